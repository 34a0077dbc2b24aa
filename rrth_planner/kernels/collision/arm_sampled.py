# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Sampled checks of an arm's edge, for comparison: configurations, or points, at a spacing."""

from numba.core.types import boolean, float64, int64
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.collision.arm_validity import (
    ENDS_ROOM,
    is_configuration_free,
    is_edge_free,
)
from rrth_planner.kernels.jit import CHAIN, kernel, MAT, VEC
from rrth_planner.kernels.layout import BAR_SIZE, BOX_HALF, BOX_OFFSET, D, LANES
from rrth_planner.kernels.vectors import between, distance

# Check points of the paper: 10 on the first metre of the ray (section 6.2); as many on each bar.
POINTS_PER_BAR = 10
# Resolution of the continuous check that is tried first, in spacings: it has to be cheaper than
# checking each configuration.
SHORT_PROOF = 8.0


@kernel(boolean(VEC, VEC, float64, CHAIN, MAT, MAT))
def is_edge_free_sampled(q_from, q_to, resolution, chain, robot, boxes):
    """
    Return whether each configuration is free, exactly, at a spacing of `resolution` [rad].

    A coarse continuous check of the whole edge is tried first; where it is undecided, they are
    checked one by one, and contacts between them are missed.
    """
    if is_edge_free(q_from, q_to, SHORT_PROOF * resolution, chain, robot, boxes):
        return True
    n = int64(distance(q_from, q_to) / resolution) + 1
    q = np.empty(q_from.shape[0])
    ray_length = robot[q.shape[0], D]
    for i in range(n, 0, -1):
        between(q_from, q_to, i / n, q)
        if not is_configuration_free(q, ray_length, chain, robot, boxes):
            return False
    return True


@kernel(boolean(VEC, CHAIN, MAT, MAT), is_inner=True)
def is_configuration_free_at_points(q, chain, robot, boxes):
    """
    Return whether no check point of the arm at q is inside a cuboid (the paper's eqs. 1 and 2).

    Read sensibly: a check point collides where it is on the inner side of all six faces. Taken
    literally, the sum over the faces would ask every free point to be outside all six at once.
    """
    points = scratch.floats(ENDS_ROOM)
    n_bars = chain(q, robot[q.shape[0], D], points, 0)
    first = (boxes.shape[0] - 1) // LANES
    for bar in range(n_bars):
        for i in range(1, POINTS_PER_BAR + 1):
            share = i / POINTS_PER_BAR
            for g in range(first, boxes.shape[0]):
                for j in range(LANES):
                    n_inner = 0
                    for r in range(3):
                        value = boxes[g, LANES * (BOX_OFFSET + r) + j]
                        half = boxes[g, LANES * (BOX_HALF + r) + j]
                        for c in range(3):
                            start, end = points[BAR_SIZE * bar + c], points[BAR_SIZE * bar + 4 + c]
                            cosine = boxes[g, LANES * (3 * r + c) + j]
                            value += cosine * (start + share * (end - start))
                        n_inner += int64(value < half) + int64(-value < half)
                    if n_inner == 6:
                        return False
    return True


@kernel(boolean(VEC, VEC, float64, CHAIN, MAT, MAT))
def is_edge_free_at_points(q_from, q_to, resolution, chain, robot, boxes):
    """Return whether the check points are outside at configurations `resolution` [rad] apart."""
    n = int64(distance(q_from, q_to) / resolution) + 1
    q = np.empty(q_from.shape[0])
    for i in range(n, 0, -1):
        between(q_from, q_to, i / n, q)
        if not is_configuration_free_at_points(q, chain, robot, boxes):
            return False
    return True
