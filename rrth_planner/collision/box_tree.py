# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A tree of bounding boxes over the boxes, packed in groups that one vector of numbers holds."""

import math

import numpy as np
from numpy.typing import NDArray
from rrth_planner.kernels.collision.boxes import pack
from rrth_planner.kernels.layout import BOX_ALLOWED, BOX_HALF, BOX_ROWS, LANES
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import SceneError

Indices = NDArray[np.int64]


def pack_boxes(rows: Array) -> tuple[Array, Indices]:
    """
    Return the groups of boxes that the kernels read, and where each box went.

    rows (18, m): as from `boxes.rows_of` [m]. Groups (n_groups, 8 * 18): as in `kernels.layout`, a
    full tree, each lane of an inner group the bound of a group below. Lanes (m,): which lane of
    the last level holds box i.
    """
    m = rows.shape[1]
    depth = tree_depth(m)
    n_groups = (LANES**depth - 1) // (LANES - 1)
    groups, lanes = np.empty((n_groups, BOX_ROWS * LANES)), np.empty(m, dtype=np.int64)
    pack(rows, depth, groups, lanes)
    return groups, lanes


def tree_depth(n: int) -> int:
    """Return how many levels of groups n boxes need."""
    return max(1, math.ceil(math.log(max(n, 1), LANES) - 1e-9))


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
    half = grown[first:, BOX_HALF:BOX_ALLOWED]
    half += by
    if ((half <= 0.0) & np.isfinite(half)).any():
        raise SceneError(f'growth: {by}, expected a value that leaves every box a size > 0 [m]')
    # A box grows by as much along its own axes, its corners by up to the diagonal of a cube.
    grown[:first, BOX_HALF:BOX_ALLOWED] += max(0.0, math.sqrt(3.0) * by)
    return grown.reshape(groups.shape)
