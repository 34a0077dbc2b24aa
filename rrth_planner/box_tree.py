# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A tree of bounding boxes over the boxes, packed in groups that one vector of numbers holds."""

import itertools
import math

import numpy as np
from numpy.typing import NDArray
from rrth_planner.arrays import Array
from rrth_planner.errors import SceneError
from rrth_planner.kernels.jit import BOX_HALF, BOX_OFFSET, BOX_ROWS, LANES

Indices = NDArray[np.int64]
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def pack_boxes(rows: Array) -> tuple[Array, Indices]:
    """
    Return the groups of boxes that the kernels read, and where each box went.

    Parameters
    ----------
    rows : ndarray, shape (15, m)
        Each box's rotation into its own axes, the position of the arm's base in them and its half
        extents [m].

    Returns
    -------
    groups : ndarray, shape (n_groups, 8 * 15)
        Layout as in `kernels.jit`: a full tree of groups, each lane of an inner one the bound of
        a group below. Unused lanes can not be touched.
    lanes : ndarray, shape (m,)
        Which lane of the last level holds box i.

    """
    m = rows.shape[1]
    depth = max(1, math.ceil(math.log(max(m, 1), LANES) - 1e-9))
    first = (LANES ** (depth - 1) - 1) // (LANES - 1)
    groups = np.zeros((first + LANES ** (depth - 1), BOX_ROWS, LANES))
    groups[:, BOX_HALF:] = -np.inf
    lanes = np.empty(m, dtype=np.int64)
    _fill(groups, lanes, rows, np.arange(m), 0, depth, first)
    return groups.reshape(len(groups), BOX_ROWS * LANES), lanes


def grown_groups(groups: Array, by: float) -> Array:
    """
    Return the groups with every box grown by that much more on every side [m].

    Raises
    ------
    SceneError
        A box would vanish.

    """
    grown = groups.reshape(len(groups), BOX_ROWS, LANES).copy()
    first = (len(groups) - 1) // LANES
    half = grown[first:, BOX_HALF:]
    half += by
    if ((half <= 0.0) & np.isfinite(half)).any():
        raise SceneError(f'growth: {by}, expected no box to vanish [m]')
    # A box grows by as much along its own axes, its corners by up to the diagonal of a cube.
    grown[:first, BOX_HALF:] += max(0.0, math.sqrt(3.0) * by)
    return grown.reshape(groups.shape)


def _fill(
    groups: Array, lanes: Indices, rows: Array, boxes: Indices, g: int, depth: int, first: int
) -> None:
    """Write the boxes of a group, or the bounds of the groups below it."""
    if depth == 1:
        groups[g, :, : len(boxes)] = rows[:, boxes]
        lanes[boxes] = LANES * (g - first) + np.arange(len(boxes))
        return
    for lane, part in enumerate(_parts(rows, boxes, LANES)):
        if len(part):
            groups[g, :, lane] = _bound(rows[:, part])
            _fill(groups, lanes, rows, part, LANES * g + lane + 1, depth - 1, first)


def _parts(rows: Array, boxes: Indices, n: int) -> list[Indices]:
    """Return the boxes in n parts of nearly equal number, halved along the widest axis."""
    if n == 1:
        return [boxes]
    centers = _centers(rows[:, boxes])
    axis = int(np.argmax(np.ptp(centers, axis=0))) if len(boxes) else 0
    order = boxes[np.argsort(centers[:, axis], kind='stable')]
    middle = (len(boxes) + 1) // 2
    return _parts(rows, order[:middle], n // 2) + _parts(rows, order[middle:], n // 2)


def _centers(rows: Array) -> Array:
    """Return the centres in the arm's base frame, (m, 3)."""
    axes = rows[:BOX_OFFSET].T.reshape(-1, 3, 3)
    return -np.einsum('mij,mi->mj', axes, rows[BOX_OFFSET:BOX_HALF].T)


def _bound(rows: Array) -> Array:
    """Return the smallest bound of some boxes whose axes are those of one of them, (15,)."""
    axes = rows[:BOX_OFFSET].T.reshape(-1, 3, 3)
    half = rows[BOX_HALF:].T
    corners = _centers(rows)[:, None] + np.einsum(
        'mij,mci->mcj', axes, CORNERS[None] * half[:, None]
    )
    corners = corners.reshape(-1, 3)
    # Boxes cut from one another share their axes; the first few stand for many.
    candidates = np.concatenate([axes[:LANES], np.eye(3)[None]])
    local = np.einsum('aij,cj->aci', candidates, corners)
    low, high = local.min(axis=1), local.max(axis=1)
    best = int(np.argmin(np.prod(high - low, axis=1)))
    # Rounding of the corners, with room.
    half = 0.5 * (high[best] - low[best]) + 1e-9
    return np.concatenate([candidates[best].ravel(), -0.5 * (high[best] + low[best]), half])
