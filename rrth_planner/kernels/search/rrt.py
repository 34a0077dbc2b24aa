# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT: growth to a first path, with one tree or two, with or without a path club."""

import math

from numba.core.types import boolean, float64, int64
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import (
    kernel,
    MAT,
    N_GOALS,
    OUT_CUBE,
    OUT_INT_MAT,
    OUT_INTS,
    RNG,
    SPACE,
    VEC,
)
from rrth_planner.kernels.search.random import uniform
from rrth_planner.kernels.search.sampling import draw_informed, draw_near, draw_uniform
from rrth_planner.kernels.search.space import (
    adapted_step,
    BIAS,
    borrowed,
    is_free,
    STEP,
    TWO_TREES,
)
from rrth_planner.kernels.search.tree import nearest, steer
from rrth_planner.kernels.vectors import copy, distance

# Further entries of `settings`.
NEAR, CLUB_RADIUS, CLUB_COUNT, CLUB_PROBABILITY = range(4, 8)
# With so many nodes the share of draws near the ends has fallen to a half.
FEW_NODES = 64


@kernel(boolean(VEC, MAT, VEC, RNG))
def is_rejected_by_club(q, club, settings, rng):
    """Return whether the path club turns a new point away (Zou et al. 2024, section 4)."""
    n_near = 0
    for i in range(club.shape[0]):
        if distance(q, club[i]) < settings[CLUB_RADIUS]:
            n_near += 1
    return n_near > settings[CLUB_COUNT] and uniform(rng) < settings[CLUB_PROBABILITY]


@kernel(int64(SPACE, VEC, float64, MAT, int64, RNG, OUT_CUBE, OUT_INT_MAT, OUT_INTS, OUT_INTS))
def advance(space, settings, best_cost, club, n_draws, rng, tree_q, parents, sizes, meeting):
    """
    Make at most n_draws draws until start and goal are joined; return how many were made.

    tree_q (2, capacity, dof), parents (2, capacity), sizes (4,): the tree of the start and that of
    the goals, which begins with the goals themselves. One tree: it grows from the start, a step
    towards each draw, and joins a goal within a step (LaValle 1998). Two: they take turns, and the
    other one reaches for each new node, at once or step by step (Kuffner and LaValle 2000). On
    success `meeting` holds the two nodes that an edge joins, otherwise -1. Draws that cannot
    shorten a path of best_cost are not made. settings[NEAR]: chance that a draw is near an end,
    where a tree that grows from there fails more often; it falls as the trees grow.
    """
    space = borrowed(space)
    bounds, is_bidirectional = space.bounds, settings[TWO_TREES] != 0.0
    dof, capacity = tree_q.shape[2], tree_q.shape[1]
    q, q_new = np.empty(dof), np.empty(dof)
    meeting[0] = meeting[1] = -1
    n_goals = sizes[N_GOALS]
    # Draws near the start and near the goals, and how many of them led to a new node.
    n_tried, n_grown = scratch.floats(2), scratch.floats(2)
    n_tried[0] = n_tried[1] = 1.0
    n_grown[0] = n_grown[1] = 0.0
    for draw in range(n_draws):
        if sizes[0] >= capacity - 1 or sizes[1] >= capacity - 1:
            return n_draws
        side = draw & 1
        goal = int64(uniform(rng) * n_goals)
        q_goal = tree_q[1, goal]
        n_nodes = sizes[0] + sizes[1] - n_goals
        is_near = uniform(rng) * (FEW_NODES + n_nodes) < settings[NEAR] * FEW_NODES
        if uniform(rng) < settings[BIAS]:
            copy(q_goal if side == 0 or not is_bidirectional else tree_q[0, 0], q)
        elif is_near:
            hard_0 = 1.0 - n_grown[0] / n_tried[0]
            hard_1 = 1.0 - n_grown[1] / n_tried[1]
            side = 0 if uniform(rng) * (hard_0 + hard_1) < hard_0 else 1
            n_tried[side] += 1.0
            near, far = (tree_q[0, 0], q_goal) if side == 0 else (q_goal, tree_q[0, 0])
            if not draw_near(near, far, best_cost, bounds, rng, q):
                continue
        elif best_cost < math.inf:
            if not draw_informed(bounds, tree_q[0, 0], q_goal, best_cost, rng, q):
                continue
        else:
            draw_uniform(bounds, rng, q)
        end, side = side, side if is_bidirectional else 0
        other = 1 - side
        nearby = nearest(tree_q[side], sizes[side], q)
        q_near = tree_q[side, nearby]
        if distance(q_near, q) == 0.0:
            continue
        step = adapted_step(space, settings, q_near)
        steer(q_near, q, step, q_new)
        if is_rejected_by_club(q_new, club, settings, rng):
            continue
        if not is_free(space, q_near, q_new):
            continue
        n_grown[end] += is_near
        new = sizes[side]
        copy(q_new, tree_q[side, new])
        parents[side, new] = nearby
        sizes[side] += 1
        reached = nearest(tree_q[other], sizes[other], q_new)
        gap = distance(tree_q[other, reached], q_new)
        is_close = is_bidirectional or gap <= settings[STEP]
        is_joined = is_close and is_free(space, tree_q[other, reached], q_new)
        while is_bidirectional and not is_joined and sizes[other] < capacity - 1:
            q_near = tree_q[other, reached]
            step = adapted_step(space, settings, q_near)
            # The rest of the extension is known to be blocked.
            if distance(q_near, q_new) <= step:
                break
            steer(q_near, q_new, step, q)
            if is_rejected_by_club(q, club, settings, rng):
                break
            if not is_free(space, q_near, q):
                break
            copy(q, tree_q[other, sizes[other]])
            parents[other, sizes[other]] = reached
            reached = sizes[other]
            sizes[other] += 1
            is_joined = is_free(space, q, q_new)
        if is_joined:
            meeting[side], meeting[other] = new, reached
            return draw + 1
    return n_draws
