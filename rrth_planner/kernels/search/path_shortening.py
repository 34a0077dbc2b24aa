# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Path shortening, coarse at first and fine later, with goals that slide along the manifold."""

from numba.core.types import float64, int64
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import (
    CHAIN,
    CONTACTS,
    EDGE_CHECK,
    kernel,
    MAT,
    OUT_MAT,
    SHORTEN,
    SLIDE,
    VEC,
)
from rrth_planner.kernels.search.shortcut import ENOUGH, MOVES
from rrth_planner.kernels.vectors import path_length

# Entries of the settings of `shorten`: those of `shortcut`, and, for the steps as printed, the
# spacings of the points P_T and P_C.
N_HOW = 5
# Least relative gain of a round of shortcuts while paths are only compared.
LOOSE = 1e-2
# Finest step of a goal along its manifold [rad].
FINEST_SLIDE = 2e-3
# Most slides of a goal, and most with the elastic band; least relative gain of a slide for another
# one.
MAX_SLIDES, MAX_BAND_SLIDES, SLID = 30, 1, 1e-3


@kernel(
    int64(
        EDGE_CHECK,
        CONTACTS,
        SHORTEN,
        SLIDE,
        CHAIN,
        float64,
        MAT,
        MAT,
        MAT,
        VEC,
        VEC,
        OUT_MAT,
        int64,
    )
)
def shorten_coarsely(
    is_edge_free,
    find,
    shorten,
    slide_goal,
    chain,
    resolution,
    robot,
    obstacles,
    bounds,
    target,
    how,
    path,
    n,
):
    """
    Alternate shortcuts and slides of the goal until little is gained; return n.

    Coarse where the elastic band follows later: enough to compare paths by length.
    """
    coarse = scratch.floats(N_HOW)
    for i in range(N_HOW):
        coarse[i] = how[i]
    if how[MOVES] > 0.0:
        coarse[MOVES], coarse[ENOUGH] = 0.0, LOOSE
    for _ in range(MAX_SLIDES):
        n = shorten(
            is_edge_free, find, resolution, chain, robot, obstacles, bounds, path, n, coarse
        )
        gain = slide_goal(
            is_edge_free,
            resolution,
            chain,
            robot,
            obstacles,
            bounds,
            target,
            path,
            n,
            FINEST_SLIDE,
        )
        if gain < SLID * path_length(path, n):
            break
    return n


@kernel(
    int64(
        EDGE_CHECK,
        CONTACTS,
        SHORTEN,
        SLIDE,
        CHAIN,
        float64,
        MAT,
        MAT,
        MAT,
        VEC,
        VEC,
        OUT_MAT,
        int64,
    )
)
def shorten_finely(
    is_edge_free,
    find,
    shorten,
    slide_goal,
    chain,
    resolution,
    robot,
    obstacles,
    bounds,
    target,
    how,
    path,
    n,
):
    """Apply the elastic band to a path from `shorten_coarsely`, and slide its goal; return n."""
    if how[MOVES] == 0.0:
        return n
    for _ in range(MAX_BAND_SLIDES):
        n = shorten(is_edge_free, find, resolution, chain, robot, obstacles, bounds, path, n, how)
        gain = slide_goal(
            is_edge_free,
            resolution,
            chain,
            robot,
            obstacles,
            bounds,
            target,
            path,
            n,
            FINEST_SLIDE,
        )
        if gain < SLID * path_length(path, n):
            return n
    return shorten(is_edge_free, find, resolution, chain, robot, obstacles, bounds, path, n, how)
