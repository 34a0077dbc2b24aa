# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT*: trees whose paths get shorter as they grow (Karaman and Frazzoli 2011)."""

import math

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import (
    kernel,
    N_GOALS,
    N_MEETINGS,
    OUT_CUBE,
    OUT_INT_CUBE,
    OUT_INT_MAT,
    OUT_INTS,
    OUT_MAT,
    OUT_VEC,
    RNG,
    SPACE,
    VEC,
)
from rrth_planner.kernels.search.random import uniform
from rrth_planner.kernels.search.sampling import draw_uniform
from rrth_planner.kernels.search.space import (
    adapted_step,
    BIAS,
    borrowed,
    is_free,
    STEP,
    TWO_TREES,
)
from rrth_planner.kernels.search.tree import nearest, squared_distances, steer
from rrth_planner.kernels.vectors import copy, distance

# Further entries of `settings`: rewire radius, and, for RRT*-Smart alone, the biasing ratio.
REWIRE, RATIO = range(4, 6)
# The trees: tree_q, links, costs, sizes, meetings, best. best (4,): cost of the best path and row
# of its meeting, then number of waypoints and cost of the shortened path, which RRT*-Smart alone
# keeps.
TREES = OUT_CUBE, OUT_INT_CUBE, OUT_MAT, OUT_INTS, OUT_INT_MAT, OUT_VEC
# What the `advance` of RRT*, Informed RRT* and RRT*-Smart have in common: space, settings,
# shortened path, rng, the trees, history.
STAR_SIGNATURE = void(SPACE, VEC, OUT_MAT, RNG, *TREES, OUT_VEC)
# Rows of the links of a tree, (3, capacity): parent, first child, next sibling.
PARENT, CHILD, SIBLING = 0, 1, 2
# A gain below this is rounding.
GAIN = 1e-12


@kernel(float64(int64, int64, float64, float64), is_inner=True)
def near_radius(size, dof, rewire_radius, step_size):
    """
    Return the radius of the neighbourhood, gamma (log n / n)^(1/dof) (algorithm 6).

    Never beyond a step: longer edges would enter by rewiring alone.
    """
    radius = rewire_radius * (math.log(size + 1.0) / (size + 1.0)) ** (1.0 / dof)
    return min(radius, step_size)


@kernel(void(OUT_INT_MAT, int64), is_inner=True)
def detach(links, node):
    """Take a node out of its parent's list of children; links (3, capacity)."""
    parent = links[PARENT, node]
    if links[CHILD, parent] == node:
        links[CHILD, parent] = links[SIBLING, node]
        return
    child = links[CHILD, parent]
    while links[SIBLING, child] != node:
        child = links[SIBLING, child]
    links[SIBLING, child] = links[SIBLING, node]


@kernel(void(OUT_INT_MAT, int64, int64))
def attach(links, node, parent):
    """Make a node the first child of a parent."""
    links[PARENT, node] = parent
    links[SIBLING, node] = links[CHILD, parent]
    links[CHILD, parent] = node


@kernel(void(OUT_INT_MAT, OUT_VEC, int64, float64), is_inner=True)
def shift_costs(links, costs, node, change):
    """Add a change to the cost of a node and of all its descendants, depth first."""
    costs[node] += change
    at = node
    while True:
        if links[CHILD, at] >= 0:
            at = links[CHILD, at]
        else:
            while at != node and links[SIBLING, at] < 0:
                at = links[PARENT, at]
            if at == node:
                return
            at = links[SIBLING, at]
        costs[at] += change


@kernel(int64(SPACE, VEC, int64, float64, OUT_MAT, OUT_INT_MAT, OUT_VEC, int64))
def add_node(space, q, near, radius, nodes, links, costs, n):
    """
    Add q to a tree of n nodes, then rewire; return 1 and how many were rewired, 0: not reached.

    nodes (capacity, dof), links (3, capacity), costs (capacity,). `near`, the nearest node, is the
    parent unless one within the radius gives a shorter path (ChooseParent); afterwards q becomes
    the parent of those to which it makes one (Rewire).
    """
    if not is_free(space, nodes[near], q):
        return 0
    neighbours, lengths = np.empty(n, np.int64), np.empty(n)
    n_near = 0
    squared_distances(nodes, 0, n, q, lengths)
    for i in range(n):
        # Written in any case, kept only if near: no branch for the processor to guess.
        squared = lengths[i]
        neighbours[n_near], lengths[n_near] = i, squared
        n_near += 1 if squared <= radius * radius else 0
    for row in range(n_near):
        lengths[row] = math.sqrt(lengths[row])
    parent, cost = near, costs[near] + distance(nodes[near], q)
    totals = np.empty(n_near)
    for row in range(n_near):
        totals[row] = costs[neighbours[row]] + lengths[row]
    while True:
        # The best first: the first free one is the parent, and no other need be checked.
        at, least = -1, cost - GAIN
        for row in range(n_near):
            if totals[row] < least:
                at, least = row, totals[row]
        if at < 0:
            break
        totals[at] = math.inf
        if is_free(space, nodes[neighbours[at]], q):
            parent, cost = neighbours[at], least
            break
    copy(q, nodes[n])
    links[CHILD, n] = -1
    costs[n] = cost
    attach(links, n, parent)
    n_rewired = 0
    for row in range(n_near):
        i, length = neighbours[row], lengths[row]
        is_shorter = i != parent and cost + length < costs[i] - GAIN
        if is_shorter and is_free(space, q, nodes[i]):
            detach(links, i)
            attach(links, i, n)
            shift_costs(links, costs, i, cost + length - costs[i])
            n_rewired += 1
    return 1 + n_rewired


@kernel(void(OUT_CUBE, OUT_MAT, OUT_INTS, OUT_INT_MAT, OUT_VEC))
def find_best(tree_q, costs, sizes, meetings, best):
    """Write the least cost over all meetings, and the row of that meeting, into best[:2]."""
    best[0], best[1] = math.inf, -1.0
    for row in range(sizes[N_MEETINGS]):
        a, b = meetings[row, 0], meetings[row, 1]
        cost = costs[0, a] + distance(tree_q[0, a], tree_q[1, b]) + costs[1, b]
        if cost < best[0]:
            best[0], best[1] = cost, row


@kernel(boolean(SPACE, VEC, int64, VEC, *TREES))
def extend(space, settings, side, q, tree_q, links, costs, sizes, meetings, best):
    """
    Extend one of the two trees towards q; return whether there is a better path now.

    tree_q (2, capacity, dof), links (2, 3, capacity), costs (2, capacity): the tree of the start
    and that of the goals. meetings (rows, 2): pairs of their nodes that a proven edge joins. With
    one tree each goal within a step of a new node is a meeting; with two, whatever node of the
    other tree within a step makes a better path. best (4,): its cost and the row of its meeting.
    """
    other, dof = 1 - side, q.shape[0]
    near = nearest(tree_q[side], sizes[side], q)
    q_near, q_new, new = tree_q[side, near], np.empty(dof), sizes[side]
    if new >= tree_q.shape[1] or distance(q_near, q) == 0.0:
        return False
    step_size, is_bidirectional = settings[STEP], settings[TWO_TREES] != 0.0
    step = adapted_step(space, settings, q_near)
    steer(q_near, q, step, q_new)
    radius = near_radius(new, dof, settings[REWIRE], step_size)
    n_changed = add_node(space, q_new, near, radius, tree_q[side], links[side], costs[side], new)
    if n_changed == 0:
        return False
    sizes[side] += 1
    n_met = sizes[N_MEETINGS]
    for i in range(sizes[other] if is_bidirectional else sizes[N_GOALS]):
        length = distance(tree_q[other, i], q_new)
        cost = costs[side, new] + length + costs[other, i]
        if length > step_size or sizes[N_MEETINGS] >= meetings.shape[0]:
            continue
        if is_bidirectional and cost >= best[0] - GAIN:
            continue
        if is_free(space, tree_q[other, i], q_new):
            meetings[sizes[N_MEETINGS], side], meetings[sizes[N_MEETINGS], other] = new, i
            sizes[N_MEETINGS] += 1
    if n_changed == 1 and sizes[N_MEETINGS] == n_met:
        return False
    before = best[0]
    find_best(tree_q, costs, sizes, meetings, best)
    return best[0] < before - GAIN


@kernel(STAR_SIGNATURE)
def advance(space, settings, shortened, rng, tree_q, links, costs, sizes, meetings, best, history):
    """
    Make n uniform draws; history (n,): cost of the best path after each.

    `shortened` is not used.
    """
    space, is_bidirectional = borrowed(space), settings[TWO_TREES] != 0.0
    q = np.empty(tree_q.shape[2])
    for draw in range(history.shape[0]):
        side = draw & 1 if is_bidirectional else 0
        if uniform(rng) < settings[BIAS]:
            goal = int64(uniform(rng) * sizes[N_GOALS])
            copy(tree_q[1, goal] if side == 0 else tree_q[0, 0], q)
        else:
            draw_uniform(space.bounds, rng, q)
        extend(space, settings, side, q, tree_q, links, costs, sizes, meetings, best)
        history[draw] = best[0]
