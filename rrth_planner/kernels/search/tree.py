# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Trees in joint space: nearest node, one step towards a point, the path back to the root."""

import math

from numba import types
from numba.core.types import float64, int64, void
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import (
    CHAIN,
    EDGE_CHECK,
    kernel,
    MAT,
    OUT_CUBE,
    OUT_MAT,
    OUT_VEC,
    VEC,
)
from rrth_planner.kernels.vectors import copy, distance

# Nodes that the nearest-neighbour search checks at once.
CHUNK = 256
ROOM = CHUNK + 8


@kernel(void(MAT, int64, int64, VEC, OUT_VEC), is_inner=True)
def squared_distances(nodes, first, n, q, squares):
    """Write the squared distances of n nodes, from that row on, from q."""
    # Written out for the common sizes, and nothing else in the loop, it is done on vectors.
    if q.shape[0] == 4:
        for i in range(n):
            a, b = nodes[first + i, 0] - q[0], nodes[first + i, 1] - q[1]
            c, d = nodes[first + i, 2] - q[2], nodes[first + i, 3] - q[3]
            squares[i] = a * a + b * b + c * c + d * d
    elif q.shape[0] == 2:
        for i in range(n):
            a, b = nodes[first + i, 0] - q[0], nodes[first + i, 1] - q[1]
            squares[i] = a * a + b * b
    else:
        for i in range(n):
            total = 0.0
            for k in range(q.shape[0]):
                total += (nodes[first + i, k] - q[k]) ** 2
            squares[i] = total


@kernel(int64(MAT, int64, VEC))
def nearest(nodes, size, q):
    """Return the index of the node nearest to q; brute force wins up to some 700 nodes."""
    squares = scratch.floats(ROOM)
    best, index = math.inf, 0
    for first in range(0, size, CHUNK):
        n = min(CHUNK, size - first)
        squared_distances(nodes, first, n, q, squares)
        # Eight at once find out whether there is a nearer one; seldom is there one to look for.
        for i in range(n, n + 7):
            squares[i] = math.inf
        for i in range(0, n, 8):
            a, b = min(squares[i], squares[i + 1]), min(squares[i + 2], squares[i + 3])
            c, d = min(squares[i + 4], squares[i + 5]), min(squares[i + 6], squares[i + 7])
            if min(min(a, b), min(c, d)) < best:
                for j in range(i, i + 8):
                    if squares[j] < best:
                        best, index = squares[j], first + j
    return index


@kernel(void(VEC, VEC, float64, OUT_VEC))
def steer(q_near, q_towards, step_size, q_new):
    """Write the point at most `step_size` from q_near towards q_towards."""
    length = distance(q_near, q_towards)
    share = 1.0 if length <= step_size else step_size / length
    for k in range(q_new.shape[0]):
        q_new[k] = q_towards[k] if share == 1.0 else q_near[k] + share * (q_towards[k] - q_near[k])


@kernel(float64(EDGE_CHECK, float64, CHAIN, MAT, MAT, MAT, VEC, OUT_MAT, int64, float64))
def stay(is_edge_free, resolution, chain, robot, obstacles, bounds, target, path, n, finest):
    """Leave the last waypoint where it is (`SLIDE`): the goal is a point."""
    return 0.0


@kernel(int64(OUT_CUBE, types.Array(int64, 2, 'A', readonly=True), int64, int64, OUT_MAT))
def trace_path(tree_q, parents, from_start, from_goal, path):
    """
    Write the path root - from_start - from_goal - root of two trees; return its waypoints.

    tree_q (2, capacity, dof), parents (2, capacity): a root is its own parent's -1. The two nodes
    where the trees meet may be the same point; it is then written once. 0: the path has no room.
    """
    n = 0
    i = from_start
    while i >= 0:
        n += 1
        i = parents[0, i]
    if n >= path.shape[0]:
        return 0
    i = from_start
    for row in range(n - 1, -1, -1):
        copy(tree_q[0, i], path[row])
        i = parents[0, i]
    i = from_goal
    if distance(path[n - 1], tree_q[1, i]) == 0.0:
        i = parents[1, i]
    while i >= 0:
        if n >= path.shape[0]:
            return 0
        copy(tree_q[1, i], path[n])
        n += 1
        i = parents[1, i]
    return n
