# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Clearance of the arm from the boxes."""

import math

from numba.core.types import float64, int64, void
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.collision.arm_validity import ENDS_ROOM
from rrth_planner.kernels.collision.bar_bar import nearest_pair
from rrth_planner.kernels.collision.bar_box import checked_lanes, nearer
from rrth_planner.kernels.jit import CHAIN, CUBE, kernel, MAT, OUT_MAT, OUT_VEC, VEC
from rrth_planner.kernels.layout import BAR_SIZE, BOX_HALF, D, LANES, REACH
from rrth_planner.kernels.trajectory.quintics import state_at


@kernel(void(MAT, float64, CHAIN, MAT, MAT, OUT_MAT))
def clearances(positions, ray_length, chain, robot, boxes, distances):
    """
    Write the least signed distance of every bar (rows) from every lane of the last groups [m].

    positions (n, dof): the configurations over which the least is taken. Unused lanes, and boxes
    that a bar may meet: infinity.
    """
    points = scratch.floats(ENDS_ROOM)
    first = (boxes.shape[0] - 1) // LANES
    distances[:] = math.inf
    for i in range(positions.shape[0]):
        n_bars = chain(positions[i], ray_length, points, 0)
        for k in range(n_bars):
            for g in range(first, boxes.shape[0]):
                for j in range(LANES):
                    lane = LANES * (g - first) + j
                    if checked_lanes(boxes, g, k, 1 << j) == 0:
                        continue
                    distances[k, lane] = nearer(
                        points, BAR_SIZE * k, boxes, g, j, distances[k, lane]
                    )


@kernel(float64(OUT_VEC, int64, MAT, float64))
def nearest(points, n_bars, boxes, least):
    """Return the least distance of the bars of an arm from the boxes, where it is less [m]."""
    for k in range(n_bars):
        for g in range((boxes.shape[0] - 1) // LANES, boxes.shape[0]):
            for j in range(LANES):
                is_box = boxes[g, LANES * BOX_HALF + j] > 0.0
                if is_box and checked_lanes(boxes, g, k, 1 << j) != 0:
                    least = nearer(points, BAR_SIZE * k, boxes, g, j, least)
    return least


@kernel(float64(CUBE, VEC, float64, int64, CHAIN, MAT, MAT))
def least_along(curves, times, begin, n, chain, robot, boxes):
    """
    Return the least signed distance of a motion from the boxes, at n >= 2 instants [m].

    curves (m, 6, dof), times (m + 1,): as for `state_at`. The instants are evenly spread, from
    `begin` [s] to the end, both of them included. Without boxes: infinity.
    """
    points = scratch.floats(ENDS_ROOM)
    q, v = np.empty(curves.shape[2]), np.empty(curves.shape[2])
    last = times[curves.shape[0]]
    least = math.inf
    for i in range(n):
        state_at(curves, times, begin + (last - begin) * (i / (n - 1)), q, v)
        n_bars = chain(q, robot[curves.shape[2], D], points, 0)
        least = nearest(points, n_bars, boxes, least)
    return least


@kernel(float64(VEC, CHAIN, MAT, MAT))
def free_radius(q, chain, robot, boxes):
    """
    Return the radius of a ball of joint space round q that is free [rad], 0 in contact.

    A joint step of length r moves no point further than r times the norm of the greatest
    reaches (Cauchy-Schwarz), so all bars keep clear while that is less than their distance from
    boxes and, seen from the inner one of two bars, from each other.
    """
    dof = q.shape[0]
    points = scratch.floats(ENDS_ROOM)
    n_bars = chain(q, robot[dof, D], points, 0)
    least = nearest(points, n_bars, boxes, math.inf)
    least = nearest_pair(points, 0, dof, robot, least)
    squared = 0.0
    for k in range(dof):
        reach = 0.0
        for bar in range(dof + 2, dof + 2 + n_bars):
            reach = max(reach, robot[bar, REACH + k], robot[bar, REACH + dof + k])
        squared += reach * reach
    return max(least, 0.0) / math.sqrt(squared)
