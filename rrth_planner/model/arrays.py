# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arrays that a frozen value may hold."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rrth_planner.model.errors import RrthError, shown

Array = NDArray[np.float64]

# Lengths and coordinates [m], and joint positions [rad or m]: further out the slack of the
# certificates would no longer cover rounding.
FARTHEST = 1e4


def frozen_array(
    value: ArrayLike,
    shape: tuple[int | None, ...],
    name: str,
    unit: str,
    error: type[RrthError],
    largest: float = math.inf,
) -> Array:
    """
    Return a read-only float64 copy in C order, of the given shape and finite.

    Parameters
    ----------
    shape : tuple
        Expected shape; `None` stands for any length.
    name, unit : str
        In the error.
    error : type
        Raised when the shape differs, or an element is not a finite number (true and "1" are
        none) or too large.
    largest : float, optional
        Greatest magnitude of an element.

    """
    try:
        array = np.array(value, dtype=np.float64, order='C')
        if not are_numbers(value):
            raise TypeError('of another type')
    except (TypeError, ValueError, OverflowError) as problem:
        raise error(
            f'{name}: {shown(value)}, expected numbers of shape {_wanted(shape)} [{unit}]'
        ) from problem
    is_fit = len(array.shape) == len(shape)
    for n, wanted in zip(array.shape, shape, strict=False):
        is_fit = is_fit and wanted in (None, n)
    if not is_fit:
        raise error(f'{name}: shape {array.shape}, expected {_wanted(shape)} [{unit}]')
    # No element is greater than its root; it is finite where all are, unless it overflows.
    square = float(np.vdot(array, array))
    if not math.isfinite(square) and not np.isfinite(array).all():
        raise error(f'{name}: {shown(array.tolist())}, expected finite numbers [{unit}]')
    if math.sqrt(square) > largest and np.abs(array).max() > largest:
        raise error(
            f'{name}: {shown(array.tolist())}, expected numbers of at most {largest:g} [{unit}]'
        )
    array.setflags(write=False)
    return array


def are_numbers(value: Any) -> bool:
    """Return whether an array, or nested lists of numbers, hold numbers only."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind in 'fiu'
    if isinstance(value, list | tuple):
        return all(map(are_numbers, value))
    if isinstance(value, int | float):
        return not isinstance(value, bool)
    return np.asarray(value).dtype.kind in 'fiu'


def check_dof(q: Array, dof: int, name: str) -> None:
    """Raise RrthError unless an array, shape (..., dof), has a value for each joint."""
    if q.shape[-1:] != (dof,):
        raise RrthError(f'{name}: shape {q.shape}, expected a value for each of {dof} joints')


def _wanted(shape: tuple[int | None, ...]) -> str:
    return '(' + ', '.join('n' if n is None else str(n) for n in shape) + ')'
