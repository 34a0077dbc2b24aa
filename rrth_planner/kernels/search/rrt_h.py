# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT-H: grow, shortcut, and repeat while avoiding earlier paths (Zou et al. 2024)."""

import math

from numba import types
from numba.core.types import float64, int64, void
from rrth_planner.kernels.clock import now
from rrth_planner.kernels.jit import (
    as_shorten,
    as_slide,
    kernel,
    MAT,
    N_GOALS,
    OUT_CUBE,
    OUT_CUBES,
    OUT_INT_CUBE,
    OUT_INT_MAT,
    OUT_INTS,
    OUT_MAT,
    RNG,
    SPACE,
    VEC,
)
from rrth_planner.kernels.search.path_shortening import shorten_and_slide
from rrth_planner.kernels.search.rrt import advance as grow
from rrth_planner.kernels.search.shortcut import LEAST_GAIN
from rrth_planner.kernels.search.space import borrowed, is_free
from rrth_planner.kernels.search.tree import trace_path
from rrth_planner.kernels.vectors import copy, distance, path_length

# Further entries of `settings` after those of `rrt`: by when improvement ends [s], by when
# `advance` returns [s], first of those of `shorten`.
MAX_SAMPLES, CLUB_BUDGET, ATTEMPTS, IMPROVE_UNTIL, UNTIL, HOW = range(8, 14)
# Entries of `state`: growths begun, whether one is active, draws of it and in all, waypoints
# of the best and of the first raw path, points of the club, rows of the history, in which of the
# two pairs of trees growth goes on, which one led to the best path, why the search ended, whether
# the best path is still to be shortened finely.
BEGUN, GROWING, DRAWN, SAMPLES, N_BEST, N_RAW, N_CLUB, N_HISTORY, PAIR, BEST_PAIR, END = range(11)
TO_SHORTEN, STATE_SIZE = 11, 12
# Values of state[END]: not yet, all growths done, no path found, no time left to improve.
RUNNING, DONE, FAILED, CLOCK = range(4)
# Rows of `paths`.
WORK, BEST, RAW = range(3)
# Columns of `history`: cost of the best path [rad], draws until then, time [s].
COST, DRAWS, TIME = range(3)
# Roots of the goal tree: more goals than this only slow its nearest-neighbour search.
MAX_ROOTS = 64
# Draws between two checks of the clock.
BATCH = 100
# Draws of later growths may lead to paths this much longer than the best one: shortening follows.
WIDER = 1.3
# The paths of so many first growths are shortened coarsely; then the shortest one finely, which
# takes as long as several growths. Later paths are shortened finely at once, if they are no longer
# than this times the best one.
N_COARSE, PROMISING = 4, 1.2
# What grows: tree_q, parents and sizes of two pairs of trees, meeting, club.
GROWTH = types.Tuple((OUT_CUBES, OUT_INT_CUBE, OUT_INT_MAT, OUT_INTS, OUT_MAT))
# Waypoints closer than this are merged [rad].
TWIN = 1e-9


@kernel(void(OUT_CUBE, int64, int64, OUT_INTS, OUT_MAT))
def keep_best(paths, n, pair, state, history):
    """Store the working path as the best one, without duplicate waypoints, and its time."""
    m = 0
    for i in range(n):
        # The last waypoint stays, its duplicates are dropped.
        is_twin = i < n - 1 and distance(paths[WORK, i], paths[WORK, n - 1]) < TWIN and i > 0
        is_twin |= m > 0 and i < n - 1 and distance(paths[WORK, i], paths[BEST, m - 1]) < TWIN
        if is_twin:
            continue
        copy(paths[WORK, i], paths[BEST, m])
        m += 1
    state[N_BEST], state[BEST_PAIR] = m, pair
    # The last row is that of the best path, even if the buffer is full.
    row = min(state[N_HISTORY], history.shape[0] - 1)
    history[row, COST] = path_length(paths[BEST], m)
    history[row, DRAWS], history[row, TIME] = state[SAMPLES], now()
    state[N_HISTORY] = row + 1


@kernel(int64(MAT, VEC, float64), is_inner=True)
def count_useful(goals, q_start, cost):
    """Return how many of the goals, nearest first, a path shorter than that can lead to."""
    n = 0
    while n < min(goals.shape[0], MAX_ROOTS):
        if distance(goals[n], q_start) >= cost * (1.0 - LEAST_GAIN):
            break
        n += 1
    return n


@kernel(void(SPACE, int64, int64, VEC, VEC, MAT, VEC, int64, OUT_CUBE, OUT_INTS, OUT_MAT))
def go_straight(
    space, shorten_at, slide_at, target, q_start, goals, settings, n_bent, paths, state, history
):
    """
    Store the straight edge to the nearest goal that has a free one as the best path.

    goals (n, dof): nearest to the start first, so no path to a later one can be shorter; the
    first n_bent are known to have no free edge. state[END]: whether no other path can be shorter.
    """
    space = borrowed(space)
    for i in range(n_bent, goals.shape[0]):
        if is_free(space, q_start, goals[i]):
            copy(q_start, paths[WORK, 0])
            copy(goals[i], paths[WORK, 1])
            shorten, slide_goal = as_shorten(shorten_at), as_slide(slide_at)
            n = shorten_and_slide(
                space, shorten, slide_goal, target, settings[HOW:], False, paths[WORK], 2
            )
            keep_best(paths, n, 0, state, history)
            if count_useful(goals, q_start, history[state[N_HISTORY] - 1, COST]) == 0:
                state[END] = DONE
            break


@kernel(void(MAT, VEC, int64, OUT_CUBE, OUT_INT_MAT, OUT_INTS))
def plant(goals, q_start, n_goals, tree_q, parents, sizes):
    """Begin the tree of the start, and that of the first n_goals goals."""
    sizes[0], sizes[1], sizes[N_GOALS] = 1, n_goals, n_goals
    copy(q_start, tree_q[0, 0])
    parents[0, 0] = -1
    for i in range(n_goals):
        copy(goals[i], tree_q[1, i])
        parents[1, i] = -1


@kernel(void(OUT_CUBE, int64, OUT_MAT, OUT_INTS), is_inner=True)
def store_raw(paths, n, club, state):
    """Add the inner points of a raw path to the path club, and keep the first raw path."""
    if state[N_RAW] == 0:
        for i in range(n):
            copy(paths[WORK, i], paths[RAW, i])
        state[N_RAW] = n
    for i in range(1, n - 1):
        if state[N_CLUB] < club.shape[0]:
            copy(paths[WORK, i], club[state[N_CLUB]])
            state[N_CLUB] += 1


@kernel(void(SPACE, int64, int64, VEC, VEC, MAT, VEC, RNG, GROWTH, OUT_CUBE, OUT_INTS, OUT_MAT))
def advance(
    space,
    shorten_at,
    slide_at,
    target,
    q_start,
    goals,
    settings,
    rng,
    growth,
    paths,
    state,
    history,
):
    """
    Grow and shorten paths until state[END] says why it ended, or until settings[UNTIL].

    Growths after the first path avoid the path club, the points of all raw paths, and draw only
    where a shorter path is possible. Of the first paths only the shortest is shortened finely.
    tree_q (2, 2, capacity, dof): the growing pair of trees, and the pair of the best path.
    """
    space = borrowed(space)
    shorten, slide_goal, how = as_shorten(shorten_at), as_slide(slide_at), settings[HOW:]
    tree_q, parents, sizes, meeting, club = growth
    while state[END] == RUNNING:
        cost = math.inf
        if state[N_BEST] > 0:
            cost = history[state[N_HISTORY] - 1, COST]
        pair, n, is_new = state[PAIR], 0, True
        if state[GROWING] == 0:
            # The first path, unless a straight edge is one, does not count as an attempt.
            if state[BEGUN] > 0 and state[N_BEST] == 0:
                state[END] = FAILED
                break
            n_useful = count_useful(goals, q_start, cost)
            if n_useful == 0 or state[BEGUN] >= settings[ATTEMPTS]:
                state[END] = DONE
            elif state[N_BEST] > 0 and now() > settings[IMPROVE_UNTIL]:
                state[END] = CLOCK
            if state[TO_SHORTEN] == 1 and (state[END] != RUNNING or state[BEGUN] >= N_COARSE):
                n, pair, is_new = state[N_BEST], state[BEST_PAIR], False
                for i in range(n):
                    copy(paths[BEST, i], paths[WORK, i])
            elif state[END] != RUNNING:
                break
            else:
                plant(goals, q_start, n_useful, tree_q[pair], parents[pair], sizes[pair])
                state[GROWING], state[DRAWN], meeting[0] = 1, 0, -1
                state[BEGUN] += 1
        if is_new:
            budget = int64(settings[MAX_SAMPLES if state[N_BEST] == 0 else CLUB_BUDGET])
            if meeting[0] < 0:
                n_drawn = grow(
                    space,
                    settings,
                    WIDER * cost,
                    club[: state[N_CLUB]],
                    min(BATCH, budget - state[DRAWN]),
                    rng,
                    tree_q[pair],
                    parents[pair],
                    sizes[pair],
                    meeting,
                )
                state[DRAWN] += n_drawn
                state[SAMPLES] += n_drawn
            n_nodes = max(sizes[pair, 0], sizes[pair, 1])
            if meeting[0] >= 0:
                state[GROWING] = 0
                n = trace_path(tree_q[pair], parents[pair], meeting[0], meeting[1], paths[WORK])
                store_raw(paths, n, club, state)
            if n > 0:
                n = shorten_and_slide(
                    space, shorten, slide_goal, target, how, False, paths[WORK], n
                )
            elif state[DRAWN] >= budget or n_nodes >= tree_q.shape[2] - 1:
                state[GROWING] = 0
        is_coarse = is_new and state[BEGUN] <= N_COARSE
        if n > 0 and not is_coarse and path_length(paths[WORK], n) <= PROMISING * cost:
            n = shorten_and_slide(space, shorten, slide_goal, target, how, True, paths[WORK], n)
        if not is_new:
            state[TO_SHORTEN] = 0
        if n > 0 and path_length(paths[WORK], n) < cost:
            keep_best(paths, n, pair, state, history)
            state[PAIR], state[TO_SHORTEN] = 1 - pair, int64(is_coarse)
        if now() > settings[UNTIL]:
            break
