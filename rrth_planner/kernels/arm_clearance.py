# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How far the arm is from the boxes."""

import math

from numba.core.types import float64, void
from rrth_planner.kernels import scratch
from rrth_planner.kernels.arm_validity import ENDS_ROOM
from rrth_planner.kernels.geometry import bar_distance
from rrth_planner.kernels.jit import BOX_HALF, CHAIN, D, kernel, LANES, MAT, OUT_MAT, REACH, VEC


@kernel(void(MAT, float64, CHAIN, MAT, OUT_MAT))
def clearances(positions, ray_length, chain, boxes, distances):
    """
    Write the least signed distance of every bar (rows) from every lane of the last groups [m].

    positions (n, dof): the configurations over which the least is taken. Unused lanes: infinity.
    """
    points = scratch.floats(ENDS_ROOM)
    first = (boxes.shape[0] - 1) // LANES
    distances[:] = math.inf
    for i in range(positions.shape[0]):
        n_bars = chain(positions[i], ray_length, points, 0)
        for k in range(n_bars):
            for g in range(first, boxes.shape[0]):
                for j in range(LANES):
                    if boxes[g, 12 * LANES + j] > 0.0:
                        distance = bar_distance(points, 4 * k, boxes, g, j)
                        lane = LANES * (g - first) + j
                        distances[k, lane] = min(distances[k, lane], distance)


@kernel(float64(VEC, CHAIN, MAT, MAT))
def free_radius(q, chain, robot, boxes):
    """
    Return the radius of a ball of joint space round q that is free [rad], 0 in contact.

    A joint step of length r moves no point further than r times the norm of the greatest
    reaches (Cauchy-Schwarz), so all bars keep clear while that is less than their distance.
    """
    dof = q.shape[0]
    points = scratch.floats(ENDS_ROOM)
    n_bars = chain(q, robot[robot.shape[0] - 1, D], points, 0)
    least = math.inf
    for bar in range(n_bars):
        for g in range((boxes.shape[0] - 1) // LANES, boxes.shape[0]):
            for j in range(LANES):
                if boxes[g, LANES * BOX_HALF + j] > 0.0:
                    least = min(least, bar_distance(points, 4 * bar, boxes, g, j))
    squared = 0.0
    for k in range(dof):
        reach = 0.0
        for i in range(robot.shape[0]):
            reach = max(reach, robot[i, REACH + k], robot[i, REACH + dof + k])
        squared += reach * reach
    return max(least, 0.0) / math.sqrt(squared)
