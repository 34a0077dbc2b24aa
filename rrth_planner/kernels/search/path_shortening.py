# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Path shortening, coarse at first and fine later, with goals that slide along the manifold."""

from numba.core.types import boolean, int64
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import (
    as_chain,
    as_edge_check,
    CHAIN_AT,
    EDGE_CHECK_AT,
    kernel,
    OUT_MAT,
    SHORTEN,
    SLIDE,
    SPACE,
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


@kernel(int64(SPACE, SHORTEN, SLIDE, VEC, VEC, boolean, OUT_MAT, int64), is_inner=True)
def shorten_and_slide(space, shorten, slide_goal, target, how, is_fine, path, n):
    """
    Alternate shortening and slides of the goal until little is gained; return n.

    Coarse where the elastic band follows later: enough to compare paths by length. Fine: the
    elastic band too, on a path that is coarsely shortened already.
    """
    if is_fine and how[MOVES] == 0.0:
        return n
    is_edge_free = as_edge_check(space.functions[EDGE_CHECK_AT])
    chain = as_chain(space.functions[CHAIN_AT])
    robot, obstacles, bounds = space.robot, space.obstacles, space.bounds
    used = scratch.floats(N_HOW)
    for i in range(N_HOW):
        used[i] = how[i]
    if not is_fine and how[MOVES] > 0.0:
        used[MOVES], used[ENOUGH] = 0.0, LOOSE
    for _ in range(MAX_BAND_SLIDES if is_fine else MAX_SLIDES):
        n = shorten(space, path, n, used)
        gain = slide_goal(
            is_edge_free,
            space.resolution,
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
    return shorten(space, path, n, used) if is_fine else n
