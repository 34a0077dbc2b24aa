# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
How far a box gets out of where it was, in plain numpy.

The distance of a point from a box is a convex function of the point. So of all points of the
later box a corner is furthest from the earlier one: the earlier one holds the later one exactly
where it has been grown by the greatest distance of the later corners.
"""

import numpy as np
from rrth_planner.kernels.layout import ROTATION, SIZE
from rrth_planner.model.arrays import Array

# The corners of a box, in halves of its size.
SIGNS = np.indices((2, 2, 2)).reshape(3, 8) * 2.0 - 1.0


def corners_of(rows: Array) -> Array:
    """Return the corners of boxes, (n, 15) -> (3, 8, n) [m]."""
    half, axes = 0.5 * rows[:, SIZE:ROTATION], rows[:, ROTATION:].reshape(-1, 3, 3)
    out = np.einsum('nij,nj,jk->ikn', axes, half, SIGNS)
    result: Array = np.ascontiguousarray(out + rows[:, :SIZE].T[:, None])
    return result


def containment(before: Array, after: Array) -> Array:
    """Return by how much boxes have to grow to hold other ones, (n, 15) twice -> (n,) [m]."""
    return _outside(before, corners_of(after))


def ways(before: Array, after: Array) -> Array:
    """Return how far the corner that went furthest went, (n, 15) twice -> (n,) [m]."""
    result: Array = np.sqrt(
        ((corners_of(after) - corners_of(before)) ** 2).sum(axis=0).max(axis=0)
    )
    return result


def _outside(rows: Array, points: Array) -> Array:
    """Return the greatest distance of points, (3, 8, n), from a box each, (n, 15) -> (n,) [m]."""
    axes, away = rows[:, ROTATION:].reshape(-1, 3, 3), points - rows[:, :SIZE].T[:, None]
    square = np.zeros(points.shape[1:])
    for j in range(3):
        local = away[0] * axes[:, 0, j] + away[1] * axes[:, 1, j] + away[2] * axes[:, 2, j]
        square += np.maximum(np.abs(local) - 0.5 * rows[:, SIZE + j], 0.0) ** 2
    result: Array = np.sqrt(square.max(axis=0))
    return result


def reaches(rows: Array, n_steps: int) -> tuple[Array, Array]:
    """
    Return how far a box got out of where it was, and how far its corners went, by time between.

    Forwards and backwards in time, the greater: recordings are played both ways.

    Parameters
    ----------
    rows : ndarray, shape (n, 15)
        The box from frame to frame; NaN: lost.
    n_steps : int
        Frames between two that are compared, at most.

    Returns
    -------
    ndarray, ndarray, shape (n_steps, n)
        At [m - 1, k] of the frames k - m and k [m]; NaN where there is none.

    """
    n, points = len(rows), corners_of(rows)
    out, gone = (np.full((n_steps, n), np.nan, dtype=np.float32) for _ in range(2))
    for m in range(1, min(n_steps, n - 1) + 1):
        old, new = slice(None, -m), slice(m, None)
        out[m - 1, m:] = np.maximum(
            _outside(rows[old], points[..., new]), _outside(rows[new], points[..., old])
        )
        step = points[..., new] - points[..., old]
        gone[m - 1, m:] = np.sqrt((step * step).sum(axis=0).max(axis=0))
    return out, gone
