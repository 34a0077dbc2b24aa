# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arrays and numbers as they come in, and as a frozen value may hold them."""

import math
from types import EllipsisType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rrth_planner.model.errors import RrthError, shown

Array = NDArray[np.float64]

# Lengths and coordinates [m], and joint positions [rad or m]: further out the slack of the
# certificates would no longer cover rounding.
FARTHEST = 1e4


FLOAT = np.dtype(np.float64)
# So many elements are looked at sooner one by one.
FEW_ELEMENTS = 16
# What counts as a number; true does not, though Python takes it for one.
NUMBERS = (int, float, np.integer, np.floating)

# A shape: `None` stands for any length, `...` in front for any further axes.
Shape = tuple[int | EllipsisType | None, ...]


def float_array(
    value: ArrayLike,
    shape: Shape,
    name: str,
    unit: str,
    error: type[RrthError] = RrthError,
    largest: float = math.inf,
) -> Array:
    """
    Return finite numbers as a float64 array in C order: the given array itself where it is one.

    The one way in for arrays. What numpy makes an array of real numbers of is taken: nested lists,
    whole numbers, single precision, any strides and byte order, read-only.

    Parameters
    ----------
    shape : tuple
        Expected shape.
    name, unit : str
        In the error.
    error : type
        Raised when the shape differs, or an element is not a finite real number (true, "1" and
        what a mask hides are none) or too large.
    largest : float, optional
        Greatest magnitude of an element.

    """
    array = value
    if type(array) is not np.ndarray or array.dtype != FLOAT or not _is_plain(array):
        array = _converted(value, shape, name, unit, error)
    if array.shape != shape and not _fits(array.shape, shape):
        raise error(f'{name}: shape {array.shape}, expected {_wanted(shape)} [{unit}]')
    size = _size(array)
    if not math.isfinite(size) and not np.isfinite(array).all():
        raise error(f'{name}: {shown(array.tolist())}, expected finite numbers [{unit}]')
    if size > largest and np.abs(array).max() > largest:
        raise error(
            f'{name}: {shown(array.tolist())}, expected numbers of at most {largest:g} [{unit}]'
        )
    return array


def frozen_array(
    value: ArrayLike,
    shape: Shape,
    name: str,
    unit: str,
    error: type[RrthError],
    largest: float = math.inf,
) -> Array:
    """Return a read-only copy of what `float_array` returns, for a frozen value to hold."""
    array = float_array(value, shape, name, unit, error, largest)
    # Of these it has been made anew.
    if not isinstance(value, (list, tuple)):
        array = array.copy()
    array.setflags(write=False)
    return array


def float_number(
    value: Any,
    name: str,
    unit: str,
    low: float = -math.inf,
    high: float = math.inf,
    error: type[RrthError] = RrthError,
) -> float:
    """Return a number, Python's or numpy's, from `low` to `high`; raise an error for all else."""
    number = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    is_number = isinstance(number, NUMBERS) and not isinstance(number, bool)
    if not is_number or not low <= number <= high:
        span = '' if low == -math.inf else f' from {low:g}'
        span += '' if high == math.inf else f' to {high:g}'
        raise error(f'{name}: {shown(value)}, expected a number{span} [{unit}]')
    try:
        return float(number)
    except OverflowError as problem:
        raise error(f'{name}: {shown(value)}, expected a number [{unit}]') from problem


def _is_plain(array: Array) -> bool:
    """Return whether kernels take an array as it is."""
    flags = array.flags
    return flags.c_contiguous and flags.aligned


def _size(array: Array) -> float:
    """
    Return a number that is no less than the magnitude of any element.

    It is finite where all elements are, unless it overflows.
    """
    if array.size > FEW_ELEMENTS:
        return math.sqrt(np.vdot(array, array))
    # A third of the time.
    total: float = sum(map(abs, array.ravel().tolist()))
    return total


def _converted(
    value: ArrayLike, shape: Shape, name: str, unit: str, error: type[RrthError]
) -> Array:
    try:
        if not are_numbers(value):
            raise TypeError('of another type')
        array: Array = np.asarray(value, dtype=np.float64, order='C')
    except (TypeError, ValueError, OverflowError, RuntimeError) as problem:
        raise error(
            f'{name}: {shown(value)}, expected numbers of shape {_wanted(shape)} [{unit}]'
        ) from problem
    return array if array.flags.aligned else array.copy()


def are_numbers(value: Any) -> bool:
    """Return whether an array, or nested lists of numbers, hold real numbers only."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind in 'fiu' and not np.ma.is_masked(value)
    if isinstance(value, (list, tuple)):
        return all(map(are_numbers, value))
    if isinstance(value, NUMBERS):
        return not isinstance(value, bool)
    return np.asarray(value).dtype.kind in 'fiu'


def check_dof(q: Array, dof: int, name: str) -> None:
    """Raise RrthError unless an array, shape (..., dof), has a value for each joint."""
    if q.shape[-1:] != (dof,):
        raise RrthError(f'{name}: shape {q.shape}, expected a value for each of {dof} joints')


def _fits(shape: tuple[int, ...], wanted: Shape) -> bool:
    if wanted and wanted[0] is ...:
        wanted = wanted[1:]
        shape = shape[max(0, len(shape) - len(wanted)) :]
        if shape == wanted:
            return True
    return len(shape) == len(wanted) and all(
        m is None or n == m for n, m in zip(shape, wanted, strict=True)
    )


def _wanted(shape: Shape) -> str:
    lengths = ['n' if n is None else '...' if n is ... else str(n) for n in shape]
    return f'({", ".join(lengths)})'
