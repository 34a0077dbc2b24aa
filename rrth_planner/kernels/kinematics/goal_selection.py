# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The free goal configurations of a target, nearest first."""

import math

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import (
    as_candidates,
    as_chain,
    as_edge_check,
    CHAIN,
    CHAIN_AT,
    EDGE_CHECK,
    EDGE_CHECK_AT,
    kernel,
    MAT,
    OUT_INTS,
    OUT_MAT,
    OUT_VEC,
    READ_INTS,
    VEC,
)
from rrth_planner.kernels.kinematics.pan_tilt_ik import is_goal_free
from rrth_planner.kernels.vectors import copy, distance

# Draws for a first goal with a straight free edge, which bounds the distance of the others.
FIRST_DRAWS = 16


@kernel(void(VEC, OUT_INTS, int64, int64))
def sink(keys, heap, n, i):
    """Let entry i of a heap of n indices sink to its place; the least key is on top."""
    while True:
        least, child = i, 2 * i + 1
        for side in range(2):
            if child + side < n and keys[heap[child + side]] < keys[heap[least]]:
                least = child + side
        if least == i:
            break
        heap[i], heap[least] = heap[least], heap[i]
        i = least


@kernel(
    int64(
        EDGE_CHECK,
        CHAIN,
        float64,
        MAT,
        MAT,
        VEC,
        MAT,
        VEC,
        int64,
        boolean,
        OUT_MAT,
        OUT_VEC,
        OUT_MAT,
        OUT_VEC,
        OUT_INTS,
    )
)
def take_free(
    is_edge_free,
    chain,
    resolution,
    robot,
    obstacles,
    q_near,
    candidates,
    reaches,
    n_candidates,
    is_kept,
    goals,
    goal_reaches,
    blocked,
    blocked_reaches,
    counts,
):
    """
    Take the free ones of the candidates, nearest first; return the row of the last one.

    It ends with the first that q_near reaches by a straight free edge: no path to a farther one is
    shorter. Then counts[2] = 1. counts[0], counts[1]: how many are free, how many collide.
    """
    keys, heap = np.empty(n_candidates), np.empty(n_candidates, np.int64)
    for i in range(n_candidates):
        keys[i], heap[i] = distance(candidates[i], q_near), i
    for i in range(n_candidates // 2 - 1, -1, -1):
        sink(keys, heap, n_candidates, i)
    counts[0] = counts[1] = counts[2] = 0
    n, row = n_candidates, -1
    while n > 0 and counts[0] < goals.shape[0]:
        row = heap[0]
        n -= 1
        heap[0] = heap[n]
        sink(keys, heap, n, 0)
        q = candidates[row]
        if not is_goal_free(chain, robot, obstacles, q, reaches[row]):
            if is_kept and counts[1] < blocked.shape[0]:
                copy(q, blocked[counts[1]])
                blocked_reaches[counts[1]] = reaches[row]
            counts[1] += 1
            continue
        copy(q, goals[counts[0]])
        goal_reaches[counts[0]] = reaches[row]
        counts[0] += 1
        if is_edge_free(q_near, q, resolution, chain, robot, obstacles):
            counts[2] = 1
            break
    return row


@kernel(
    void(
        READ_INTS,
        int64,
        float64,
        MAT,
        MAT,
        MAT,
        VEC,
        VEC,
        VEC,
        int64,
        OUT_MAT,
        OUT_VEC,
        OUT_MAT,
        OUT_VEC,
        OUT_INTS,
    )
)
def find_goals(
    functions,
    candidates_at,
    resolution,
    robot,
    obstacles,
    bounds,
    target,
    q_near,
    ratios,
    n_draws,
    goals,
    goal_reaches,
    blocked,
    blocked_reaches,
    counts,
):
    """
    Write the free goal configurations, nearest to q_near first, and those in collision.

    The list ends with the first goal that a straight free edge reaches, if there is one. The
    first few draws, if they find one, bound the distance of the others. counts (3,): free ones,
    ones in collision (without such a bound: all), whether the last has a straight edge.
    """
    find_candidates = as_candidates(candidates_at)
    is_edge_free, chain = as_edge_check(functions[EDGE_CHECK_AT]), as_chain(functions[CHAIN_AT])
    dof = q_near.shape[0]
    candidates, reaches = np.empty((2 * n_draws, dof)), np.empty(2 * n_draws)
    n_first, longest = min(FIRST_DRAWS, n_draws), math.inf
    n = find_candidates(
        robot, bounds, target, q_near, ratios, 0, n_first, longest, candidates, reaches
    )
    last = take_free(
        is_edge_free,
        chain,
        resolution,
        robot,
        obstacles,
        q_near,
        candidates,
        reaches,
        n,
        False,
        goals,
        goal_reaches,
        blocked,
        blocked_reaches,
        counts,
    )
    if counts[2] == 1:
        longest = distance(candidates[last], q_near)
    n += find_candidates(
        robot,
        bounds,
        target,
        q_near,
        ratios,
        n_first,
        n_draws - n_first,
        longest,
        candidates[n:],
        reaches[n:],
    )
    take_free(
        is_edge_free,
        chain,
        resolution,
        robot,
        obstacles,
        q_near,
        candidates,
        reaches,
        n,
        True,
        goals,
        goal_reaches,
        blocked,
        blocked_reaches,
        counts,
    )
