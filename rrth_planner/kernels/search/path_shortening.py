# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Paths made shorter, quickly at first and well later, while their goal slides."""

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

# Entries of the settings of `shorten`: those of `taut`, and, for the steps as printed, the
# spacings of the points P_T and P_C.
N_HOW = 5
# What pulling must gain to go on where a path is only compared with others, relative.
LOOSE = 1e-2
# Finest step of a goal along its manifold [rad].
FINEST_SLIDE = 2e-3
# Slides of a goal, those of a path that leans; what a slide must gain to be worth another one,
# relative.
MAX_SLIDES, MAX_LEANS, SLID = 30, 1, 1e-3


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
def pull(
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
    Pull a path taut and slide its goal, in turn, until little is gained; return its size.

    Loosely where it is to lean later: enough to tell which of some paths is the shortest.
    """
    quick = scratch.floats(N_HOW)
    for i in range(N_HOW):
        quick[i] = how[i]
    if how[MOVES] > 0.0:
        quick[MOVES], quick[ENOUGH] = 0.0, LOOSE
    for _ in range(MAX_SLIDES):
        n = shorten(
            is_edge_free, find, resolution, chain, robot, obstacles, bounds, path, n, quick
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
def settle(
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
    """Let a path that is pulled lean on the boxes, its goal about where it will be; same."""
    if how[MOVES] == 0.0:
        return n
    for _ in range(MAX_LEANS):
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
