# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The free goal configurations of a target, nearest first."""

import math

from numba.core.types import float64, int64, UniTuple, void
import numpy as np
from rrth_planner.kernels.jit import (
    as_candidates,
    as_chain,
    as_edge_check,
    CHAIN_AT,
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


@kernel(void(VEC, OUT_INTS, int64, int64), is_inner=True)
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
    UniTuple(int64, 3)(
        READ_INTS, int64, float64, MAT, MAT, MAT, VEC, VEC, VEC, int64, OUT_MAT, OUT_MAT, OUT_VEC
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
    blocked,
    blocked_reaches,
):
    """
    Write the free goal configurations, nearest to q_near first, and those in collision.

    The list ends with the first goal that q_near reaches by a straight free edge, if there is one:
    no path to a farther one is shorter. The first few draws, if they find one, bound the distance
    of the others. Returns how many are free, how many collide (without such a bound: of all), and
    1 if the last has a straight edge.
    """
    find_candidates = as_candidates(candidates_at)
    is_edge_free, chain = as_edge_check(functions[EDGE_CHECK_AT]), as_chain(functions[CHAIN_AT])
    candidates, reaches = np.empty((2 * n_draws, q_near.shape[0])), np.empty(2 * n_draws)
    first, n_more, longest, n_candidates = 0, min(FIRST_DRAWS, n_draws), math.inf, 0
    n_free = n_blocked = is_straight = 0
    for _ in range(2):
        more, more_reaches = candidates[n_candidates:], reaches[n_candidates:]
        n_candidates += find_candidates(
            robot, bounds, target, q_near, ratios, first, n_more, longest, more, more_reaches
        )
        first, n_more = n_more, n_draws - n_more
        keys, heap = np.empty(n_candidates), np.empty(n_candidates, np.int64)
        for i in range(n_candidates):
            keys[i], heap[i] = distance(candidates[i], q_near), i
        for i in range(n_candidates // 2 - 1, -1, -1):
            sink(keys, heap, n_candidates, i)
        n, n_free, n_blocked, is_straight = n_candidates, 0, 0, 0
        while n > 0 and n_free < goals.shape[0] and not is_straight:
            row = heap[0]
            n -= 1
            heap[0] = heap[n]
            sink(keys, heap, n, 0)
            q = candidates[row]
            if is_goal_free(chain, robot, obstacles, q, reaches[row]):
                copy(q, goals[n_free])
                n_free += 1
                if is_edge_free(q_near, q, resolution, chain, robot, obstacles):
                    is_straight, longest = 1, keys[row]
            else:
                if n_blocked < blocked.shape[0]:
                    copy(q, blocked[n_blocked])
                    blocked_reaches[n_blocked] = reaches[row]
                n_blocked += 1
    return n_free, n_blocked, is_straight
