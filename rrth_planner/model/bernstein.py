# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Bounds of polynomials over an interval: a curve stays in the hull of its control points."""

from math import comb

import numpy as np
from rrth_planner.model.arrays import Array

# Most halvings; then the range counts as left: the piece is shorter than a rounding error.
DEEPEST = 40


def to_bernstein(degree: int) -> Array:
    """Return the matrix from powers to Bernstein coefficients, (degree + 1, degree + 1)."""
    return np.array(
        [
            [comb(j, i) / comb(degree, i) if i <= j else 0.0 for i in range(degree + 1)]
            for j in range(degree + 1)
        ]
    )


def first_outside(control: Array, low: Array, high: Array) -> tuple[int, float, float] | None:
    """
    Return a place where one of many polynomials over [0, 1] leaves its range, or None.

    A polynomial lies between its least and greatest Bernstein coefficient, and the first and the
    last of them are values of it (Farouki 2012): where these decide nothing, it is halved.

    Parameters
    ----------
    control : ndarray, shape (degree + 1, m)
        Bernstein coefficients of m polynomials; infinite ones and NaN are outside of any range.
    low, high : ndarray, shape (m,)
        Their ranges.

    Returns
    -------
    tuple or None
        Index of a polynomial, where in [0, 1], and its value there; of the places checked first,
        the one furthest outside.

    """
    left, right = _halving(len(control) - 1)
    which, begin, width = np.arange(control.shape[1]), np.zeros(control.shape[1]), 1.0
    for _ in range(DEEPEST):
        is_open = ~((control >= low) & (control <= high)).all(axis=0)
        if not is_open.any():
            return None
        control, which, begin = control[:, is_open], which[is_open], begin[is_open]
        low, high = low[is_open], high[is_open]
        ends = control[[0, -1]]
        excess = np.maximum(low - ends, ends - high)
        side, i = np.unravel_index(np.argmax(excess), excess.shape)
        if not excess[side, i] <= 0.0:
            return int(which[i]), float(begin[i] + side * width), float(ends[side, i])
        width *= 0.5
        control = np.concatenate([left @ control, right @ control], axis=1)
        which, low, high = np.tile(which, 2), np.tile(low, 2), np.tile(high, 2)
        begin = np.concatenate([begin, begin + width])
    return int(which[0]), float(begin[0]), float(control[0, 0])


def _halving(degree: int) -> tuple[Array, Array]:
    """Return the matrices to the coefficients over either half (de Casteljau)."""
    left = np.array(
        [
            [comb(i, j) * 0.5**i if j <= i else 0.0 for j in range(degree + 1)]
            for i in range(degree + 1)
        ]
    )
    return left, left[::-1, ::-1]
