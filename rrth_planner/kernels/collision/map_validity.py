# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A point among axis-aligned boxes, in a space of any dimension: exact, or at check points."""

import math

from numba.core.types import boolean, float64, int64
import numpy as np
from rrth_planner.kernels.jit import CHAIN, kernel, MAT, VEC
from rrth_planner.kernels.vectors import between, distance

# Obstacles of a map are rows lower corner, upper corner, (m, 2 dof). Contact is allowed: a wall
# begins this far inside its faces.
CONTACT = 1e-9


@kernel(boolean(VEC, VEC, MAT), is_inner=True)
def is_edge_free_in_plane(q_from, q_to, obstacles):
    """Return whether no rectangle is entered: separating axes, those of the rectangle first."""
    ax, ay, bx, by = q_from[0], q_from[1], q_to[0], q_to[1]
    dx, dy = bx - ax, by - ay
    fx, fy = abs(dx), abs(dy)
    left, right, low, high = min(ax, bx), max(ax, bx), min(ay, by), max(ay, by)
    for j in range(obstacles.shape[0]):
        x0, y0 = obstacles[j, 0] + CONTACT, obstacles[j, 1] + CONTACT
        x1, y1 = obstacles[j, 2] - CONTACT, obstacles[j, 3] - CONTACT
        # One branch of the four: most edges are beside most rectangles.
        if (left < x1) & (right > x0) & (low < y1) & (high > y0):
            # Twice the distance of the middle from the line, and twice what the corners reach to.
            offset = abs((2.0 * ax - x0 - x1) * dy - (2.0 * ay - y0 - y1) * dx)
            # An edge of length zero is a point: no line separates it.
            if offset < (x1 - x0) * fy + (y1 - y0) * fx or fx + fy == 0.0:
                return False
    return True


@kernel(boolean(VEC, VEC, float64, CHAIN, MAT, MAT))
def is_edge_free(q_from, q_to, resolution, chain, robot, obstacles):
    """
    Return whether the straight edge stays out of the inside of every box: exact.

    The shares of the edge between the two faces of each axis are intervals; the edge enters the
    box where they all overlap (Kay and Kajiya 1986). `resolution`, `chain` and `robot` are not
    used.
    """
    dof = q_from.shape[0]
    if dof == 2:
        return is_edge_free_in_plane(q_from, q_to, obstacles)
    for j in range(obstacles.shape[0]):
        # Most boxes lie to one side of both ends.
        is_beside = False
        for k in range(dof):
            is_beside |= max(q_from[k], q_to[k]) <= obstacles[j, k] + CONTACT
            is_beside |= min(q_from[k], q_to[k]) >= obstacles[j, dof + k] - CONTACT
        if is_beside:
            continue
        enter, leave = 0.0, 1.0
        for k in range(dof):
            lower, upper = obstacles[j, k] + CONTACT, obstacles[j, dof + k] - CONTACT
            step = q_to[k] - q_from[k]
            if step == 0.0:
                if q_from[k] <= lower or q_from[k] >= upper:
                    enter = math.inf
                    break
            else:
                at_lower, at_upper = (lower - q_from[k]) / step, (upper - q_from[k]) / step
                enter = max(enter, min(at_lower, at_upper))
                leave = min(leave, max(at_lower, at_upper))
                if enter >= leave:
                    break
        # A single point inside (an edge of length zero) counts too.
        if enter < leave:
            return False
    return True


@kernel(boolean(VEC, MAT), is_inner=True)
def is_point_inside(q, obstacles):
    """Return whether a point is inside any box."""
    dof = q.shape[0]
    for j in range(obstacles.shape[0]):
        is_inside = True
        for k in range(dof):
            is_inside &= obstacles[j, k] + CONTACT < q[k] < obstacles[j, dof + k] - CONTACT
        if is_inside:
            return True
    return False


@kernel(boolean(VEC, VEC, float64, CHAIN, MAT, MAT))
def is_edge_free_sampled(q_from, q_to, resolution, chain, robot, obstacles):
    """
    Return whether no check point of the edge is inside a box: the paper's test.

    The check points are spread evenly, their number by the length of the edge (section 2), no
    further apart than `resolution`. Contacts between them are missed.
    """
    n = int64(distance(q_from, q_to) / resolution) + 1
    q = np.empty(q_from.shape[0])
    for i in range(n, 0, -1):
        between(q_from, q_to, i / n, q)
        if is_point_inside(q, obstacles):
            return False
    return True


@kernel(float64(VEC, CHAIN, MAT, MAT))
def free_radius(q, chain, robot, obstacles):
    """Return the distance of q from the nearest box, 0 inside: a ball that far is free."""
    dof = q.shape[0]
    least = math.inf
    for j in range(obstacles.shape[0]):
        squared = 0.0
        for k in range(dof):
            excess = max(obstacles[j, k] - q[k], q[k] - obstacles[j, dof + k])
            if excess > 0.0:
                squared += excess * excess
        least = min(least, squared)
    return math.sqrt(least)
