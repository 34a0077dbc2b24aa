# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT: growth to a first path, with one tree or two, with or without a path club."""

import math

from numba.core.types import boolean, float64, int64, npy_rng
import numpy as np
from rrth_planner.kernels.jit import (
    CHAIN,
    EDGE_CHECK,
    FREE_RADIUS,
    kernel,
    MAT,
    N_GOALS,
    OUT_CUBE,
    OUT_INT_MAT,
    OUT_INTS,
    VEC,
)
from rrth_planner.kernels.sampling import draw_informed, draw_uniform
from rrth_planner.kernels.tree import adapted_step, distance, nearest, steer


@kernel(boolean(VEC, MAT, float64, int64, float64, npy_rng))
def is_rejected_by_club(q, club, radius, count, probability, rng):
    """Return whether the path club turns a new point away (Zou et al. 2024, section 4)."""
    n_near = 0
    for i in range(club.shape[0]):
        if distance(q, club[i]) < radius:
            n_near += 1
    return n_near > count and rng.random() < probability


@kernel(
    int64(
        EDGE_CHECK,
        FREE_RADIUS,
        float64,
        CHAIN,
        MAT,
        MAT,
        MAT,
        float64,
        float64,
        float64,
        boolean,
        float64,
        MAT,
        float64,
        int64,
        float64,
        int64,
        npy_rng,
        OUT_CUBE,
        OUT_INT_MAT,
        OUT_INTS,
        OUT_INTS,
    )
)
def advance(
    is_edge_free,
    free_radius,
    resolution,
    chain,
    robot,
    obstacles,
    bounds,
    step_size,
    clearance_gain,
    goal_bias,
    is_bidirectional,
    best_cost,
    club,
    club_radius,
    club_count,
    club_probability,
    n_draws,
    rng,
    tree_q,
    parents,
    sizes,
    meeting,
):
    """
    Make at most n_draws draws until start and goal are joined; return how many were made.

    tree_q (2, capacity, dof), parents (2, capacity), sizes (4,): the tree of the start and that of
    the goals, which begins with the goals themselves. One tree: it grows from the start, a step
    towards each draw, and joins a goal within a step (LaValle 1998). Two: they take turns, and the
    other one reaches for each new node, at once or step by step (Kuffner and LaValle 2000). On
    success `meeting` holds the two nodes that an edge joins, otherwise -1. Draws that cannot
    shorten a path of best_cost are not made.
    """
    dof, capacity = tree_q.shape[2], tree_q.shape[1]
    q, q_new = np.empty(dof), np.empty(dof)
    meeting[0] = meeting[1] = -1
    n_goals = sizes[N_GOALS]
    for draw in range(n_draws):
        if sizes[0] >= capacity - 1 or sizes[1] >= capacity - 1:
            return n_draws
        side = draw & 1 if is_bidirectional else 0
        other = 1 - side
        goal = int64(rng.random() * n_goals)
        if rng.random() < goal_bias:
            q[:] = tree_q[1, goal] if side == 0 else tree_q[0, 0]
        elif best_cost < math.inf:
            if not draw_informed(bounds, tree_q[0, 0], tree_q[1, goal], best_cost, rng, q):
                continue
        else:
            draw_uniform(bounds, rng, q)
        near = nearest(tree_q[side], sizes[side], q)
        q_near = tree_q[side, near]
        if distance(q_near, q) == 0.0:
            continue
        step = adapted_step(
            free_radius, chain, robot, obstacles, q_near, step_size, clearance_gain
        )
        steer(q_near, q, step, q_new)
        if is_rejected_by_club(q_new, club, club_radius, club_count, club_probability, rng):
            continue
        if not is_edge_free(q_near, q_new, resolution, chain, robot, obstacles):
            continue
        new = sizes[side]
        tree_q[side, new] = q_new
        parents[side, new] = near
        sizes[side] += 1
        reached = nearest(tree_q[other], sizes[other], q_new)
        is_close = is_bidirectional or distance(tree_q[other, reached], q_new) <= step_size
        is_joined = is_close and is_edge_free(
            tree_q[other, reached], q_new, resolution, chain, robot, obstacles
        )
        while is_bidirectional and not is_joined and sizes[other] < capacity - 1:
            q_near = tree_q[other, reached]
            step = adapted_step(
                free_radius, chain, robot, obstacles, q_near, step_size, clearance_gain
            )
            steer(q_near, q_new, step, q)
            if distance(q, q_new) == 0.0 or is_rejected_by_club(
                q, club, club_radius, club_count, club_probability, rng
            ):
                break
            if not is_edge_free(q_near, q, resolution, chain, robot, obstacles):
                break
            tree_q[other, sizes[other]] = q
            parents[other, sizes[other]] = reached
            reached = sizes[other]
            sizes[other] += 1
            is_joined = is_edge_free(q, q_new, resolution, chain, robot, obstacles)
        if is_joined:
            meeting[side], meeting[other] = new, reached
            return draw + 1
    return n_draws
