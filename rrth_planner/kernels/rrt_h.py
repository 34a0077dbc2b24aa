# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT-H: growth to a first path, and the three steps that pull it taut (Zou et al. 2024)."""

import math

from numba.core.types import boolean, float64, int64, npy_rng, void
import numpy as np

from rrth_planner.kernels.jit import (
    EDGE_CHECK,
    kernel,
    MAT,
    OUT_CUBE,
    OUT_INT_MAT,
    OUT_INTS,
    OUT_MAT,
    VEC,
)
from rrth_planner.kernels.sampling import draw_informed, draw_uniform
from rrth_planner.kernels.tree import distance, nearest, path_length, steer

# What a gain in length must exceed to be worth another round, relative.
TAUT = 1e-5


@kernel(boolean(VEC, MAT, float64, int64, float64, npy_rng))
def is_rejected_by_club(q, club, radius, count, probability, rng):
    """Return whether the path club turns a new point away (section 4 of the paper)."""
    if club.shape[0] == 0:
        return False
    n_near = 0
    for i in range(club.shape[0]):
        if distance(q, club[i]) < radius:
            n_near += 1
    return n_near > count and rng.random() < probability


@kernel(
    int64(
        EDGE_CHECK,
        float64,
        MAT,
        MAT,
        MAT,
        float64,
        float64,
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
    resolution,
    robot,
    obstacles,
    bounds,
    step_size,
    goal_bias,
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
    Grow two trees towards each other by at most n_draws draws; return how many were made.

    tree_q (2, capacity, dof) and parents (2, capacity): the tree of the start and the tree of the
    goals, whose first sizes[1] nodes without parent are the goals themselves. Each draw extends
    one tree by a step, then the other reaches for the new node, straight or step by step (Kuffner
    and LaValle 2000). On success meeting[0], meeting[1] are the nodes of the two trees that an
    edge joins, otherwise -1. A draw that cannot shorten a path of best_cost is not made.
    """
    dof, capacity = tree_q.shape[2], tree_q.shape[1]
    q, q_new = np.empty(dof), np.empty(dof)
    meeting[0] = meeting[1] = -1
    n_goals = 0
    while n_goals < sizes[1] and parents[1, n_goals] < 0:
        n_goals += 1
    for draw in range(n_draws):
        if sizes[0] >= capacity - 1 or sizes[1] >= capacity - 1:
            return n_draws
        side = draw & 1
        goal = int64(rng.random() * n_goals)
        if rng.random() < goal_bias:
            q[:] = tree_q[1, goal] if side == 0 else tree_q[0, 0]
        elif best_cost < math.inf:
            if not draw_informed(bounds, tree_q[0, 0], tree_q[1, goal], best_cost, rng, q):
                continue
        else:
            draw_uniform(bounds, rng, q)
        near = nearest(tree_q[side], sizes[side], q)
        if distance(tree_q[side, near], q) == 0.0:
            continue
        steer(tree_q[side, near], q, step_size, q_new)
        if is_rejected_by_club(q_new, club, club_radius, club_count, club_probability, rng):
            continue
        if not is_edge_free(tree_q[side, near], q_new, resolution, robot, obstacles):
            continue
        new = sizes[side]
        tree_q[side, new] = q_new
        parents[side, new] = near
        sizes[side] += 1
        other = 1 - side
        reached = nearest(tree_q[other], sizes[other], q_new)
        is_joined = is_edge_free(tree_q[other, reached], q_new, resolution, robot, obstacles)
        while not is_joined and sizes[other] < capacity - 1:
            steer(tree_q[other, reached], q_new, step_size, q)
            if distance(q, q_new) == 0.0 or is_rejected_by_club(
                q, club, club_radius, club_count, club_probability, rng
            ):
                break
            if not is_edge_free(tree_q[other, reached], q, resolution, robot, obstacles):
                break
            tree_q[other, sizes[other]] = q
            parents[other, sizes[other]] = reached
            reached = sizes[other]
            sizes[other] += 1
            is_joined = is_edge_free(q, q_new, resolution, robot, obstacles)
        if is_joined:
            meeting[side], meeting[other] = new, reached
            return draw + 1
    return n_draws


@kernel(int64(OUT_MAT, int64, int64))
def remove_waypoint(path, n, i):
    """Remove waypoint i; return how many are left."""
    for j in range(i, n - 1):
        path[j] = path[j + 1]
    return n - 1


@kernel(void(OUT_MAT, int64))
def reverse_path(path, n):
    """Reverse the first n waypoints."""
    for i in range(n // 2):
        for k in range(path.shape[1]):
            path[i, k], path[n - 1 - i, k] = path[n - 1 - i, k], path[i, k]


@kernel(int64(EDGE_CHECK, float64, MAT, MAT, OUT_MAT, int64, float64))
def pull_forward(is_edge_free, resolution, robot, obstacles, path, n, spacing):
    """
    Do step 1 of RRT-H in place: slide P_i+1 along P_i+1 -> P_i+2 as far as P_i sees it.

    Where P_i sees all of the segment, P_i+1 goes and P_i stays for the next pair (moving on, as
    printed, leaves corners). The farthest P_T still seen is found by bisection, to `spacing`.
    Step 2 is the same on the reversed path.
    """
    dof = path.shape[1]
    q_seen, q_try = np.empty(dof), np.empty(dof)
    i = 0
    while i + 2 < n:
        if is_edge_free(path[i], path[i + 2], resolution, robot, obstacles):
            n = remove_waypoint(path, n, i + 1)
            continue
        length = distance(path[i + 1], path[i + 2])
        low, high = 0.0, 1.0
        while (high - low) * length > spacing:
            share = 0.5 * (low + high)
            for k in range(dof):
                q_try[k] = path[i + 1, k] + share * (path[i + 2, k] - path[i + 1, k])
            # The rest of the old segment stays an edge, so it is proven again on its own.
            if is_edge_free(path[i], q_try, resolution, robot, obstacles) and is_edge_free(
                q_try, path[i + 2], resolution, robot, obstacles
            ):
                low = share
                q_seen[:] = q_try
            else:
                high = share
        if low > 0.0:
            path[i + 1] = q_seen
        i += 1
    return n


@kernel(boolean(EDGE_CHECK, float64, MAT, MAT, OUT_MAT, int64, VEC, VEC))
def is_corner_free(is_edge_free, resolution, robot, obstacles, path, i, q_in, q_out):
    """Return whether waypoint i may be replaced by the chord q_in -> q_out: all three edges."""
    return (
        is_edge_free(q_in, q_out, resolution, robot, obstacles)
        and is_edge_free(path[i - 1], q_in, resolution, robot, obstacles)
        and is_edge_free(q_out, path[i + 1], resolution, robot, obstacles)
    )


@kernel(int64(EDGE_CHECK, float64, MAT, MAT, OUT_MAT, int64, float64))
def cut_corners(is_edge_free, resolution, robot, obstacles, path, n, spacing):
    """
    Do step 3 of RRT-H in place, from both sides: replace each corner by its largest free chord.

    The chord's two ends lie equally far from the corner, then the one on the longer side moves on
    alone. Bisection to half of `spacing`, the paper's k: a shorter cut is not worth a waypoint.
    """
    dof = path.shape[1]
    q_in, q_out = np.empty(dof), np.empty(dof)
    share = np.empty(2)
    lengths = np.empty(2)
    i = 1
    while i < n - 1:
        lengths[0], lengths[1] = distance(path[i - 1], path[i]), distance(path[i], path[i + 1])
        shorter = min(lengths[0], lengths[1])
        if shorter < 1e-9:
            n = remove_waypoint(path, n, i)
            continue
        # Phase 0 moves both ends, phases 1 and 2 one of them.
        share[0] = share[1] = 0.0
        for phase in range(3):
            low = 0.0 if phase == 0 else share[phase - 1]
            high, unit = 1.0, shorter if phase == 0 else lengths[phase - 1]
            at = 0.5 * (low + high) if phase == 0 else high
            while (high - low) * unit > 0.5 * spacing:
                s_in = at * shorter / lengths[0] if phase == 0 else share[0]
                s_out = at * shorter / lengths[1] if phase == 0 else share[1]
                if phase == 1:
                    s_in = at
                elif phase == 2:
                    s_out = at
                for k in range(dof):
                    q_in[k] = path[i, k] + s_in * (path[i - 1, k] - path[i, k])
                    q_out[k] = path[i, k] + s_out * (path[i + 1, k] - path[i, k])
                if is_corner_free(
                    is_edge_free, resolution, robot, obstacles, path, i, q_in, q_out
                ):
                    low = at
                    share[0], share[1] = s_in, s_out
                else:
                    high = at
                if low == high:
                    break
                at = 0.5 * (low + high)
            if phase == 0 and share[0] * lengths[0] < 0.5 * spacing:
                break
        if share[0] == 0.0 or n >= path.shape[0]:
            i += 1
            continue
        for k in range(dof):
            q_in[k] = path[i, k] + share[0] * (path[i - 1, k] - path[i, k])
            q_out[k] = path[i, k] + share[1] * (path[i + 1, k] - path[i, k])
        for j in range(n, i + 1, -1):
            path[j] = path[j - 1]
        path[i], path[i + 1] = q_in, q_out
        n += 1
        i += 2
    return n


@kernel(int64(EDGE_CHECK, float64, MAT, MAT, OUT_MAT, int64, float64, int64))
def pull_taut(is_edge_free, resolution, robot, obstacles, path, n, spacing, max_rounds):
    """
    Repeat the three steps until the path gets no shorter; return its number of waypoints.

    Every edge that enters the path has been proven by the edge check; the path never gets longer.
    """
    length = path_length(path, n)
    for _ in range(max_rounds):
        if n < 3:
            break
        n = pull_forward(is_edge_free, resolution, robot, obstacles, path, n, spacing)
        reverse_path(path, n)
        n = pull_forward(is_edge_free, resolution, robot, obstacles, path, n, spacing)
        reverse_path(path, n)
        n = cut_corners(is_edge_free, resolution, robot, obstacles, path, n, spacing)
        shorter = path_length(path, n)
        if shorter > length * (1.0 - TAUT):
            break
        length = shorter
    return n
