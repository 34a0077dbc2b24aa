# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arrays that a frozen value may hold."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rrth_planner.errors import RrthError

Array = NDArray[np.float64]


def frozen_array(
    value: ArrayLike, shape: tuple[int | None, ...], name: str, unit: str, error: type[RrthError]
) -> Array:
    """
    Return a read-only float64 copy in C order, of the given shape and finite.

    Parameters
    ----------
    value : array_like
        What was given.
    shape : tuple
        Expected shape; `None` stands for any length.
    name, unit : str
        How the array is called in the sentence of the error.
    error : type
        Raised when the shape differs or an element is not a finite number.

    """
    try:
        array = np.array(value, dtype=np.float64, order='C')
    except (TypeError, ValueError) as problem:
        raise error(
            f'{name}: {value!r}, expected numbers of shape {_wanted(shape)} [{unit}]'
        ) from problem
    if array.shape != shape and not _fits(array.shape, shape):
        raise error(f'{name}: shape {array.shape}, expected {_wanted(shape)} [{unit}]')
    # A sum of squares is finite where all elements are, unless it overflows.
    if not math.isfinite(np.vdot(array, array)) and not np.isfinite(array).all():
        raise error(f'{name}: {array.tolist()}, expected finite numbers [{unit}]')
    array.setflags(write=False)
    return array


def _fits(given: tuple[int, ...], shape: tuple[int | None, ...]) -> bool:
    return len(given) == len(shape) and all(map(_is_length, given, shape))


def _is_length(given: int, wanted: int | None) -> bool:
    return wanted is None or given == wanted


def _wanted(shape: tuple[int | None, ...]) -> str:
    return '(' + ', '.join('n' if n is None else str(n) for n in shape) + ')'
