# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the arm is clear of the boxes: at a configuration, and proven along a motion."""

import math

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels.geometry import bar_distance, bar_touches_boxes, hull_is_apart
from rrth_planner.kernels.jit import (
    D,
    kernel,
    KIND,
    MAT,
    NO_BAR,
    OUT_MAT,
    OUT_VEC,
    PRISMATIC,
    RADIUS_A,
    RADIUS_D,
    REACH,
    VEC,
)
from rrth_planner.kernels.kinematics import chain_points, count_bars

# How many configurations and intervals a proof may visit before it gives up (and proves nothing).
MAX_NODES = 512
MAX_OPEN = 4096
# Configurations beyond this are none: `sine_cosine` holds up to 1e5 [rad or m].
LARGEST = 1e4
# Intervals shorter than this [rad] are proven part by part of the bars, as long as there are no
# more open parts than these.
SPLIT, MAX_PARTS = 0.05, 64


@kernel(void(MAT, OUT_VEC))
def bar_radii(robot, radii):
    """Write the radius of each bar, in the order of `chain_points` [m]."""
    n = 0
    for i in range(robot.shape[0]):
        for column in (RADIUS_A, RADIUS_D):
            if robot[i, column] != NO_BAR:
                radii[n] = robot[i, column]
                n += 1


@kernel(boolean(MAT, int64, VEC, MAT))
def touches(points, row, radii, boxes):
    """Return whether any bar of a row of `points` touches a box: exact, the ray first."""
    for k in range(radii.shape[0] - 1, -1, -1):
        c = 3 * k
        if bar_touches_boxes(
            points[row, c],
            points[row, c + 1],
            points[row, c + 2],
            points[row, c + 3],
            points[row, c + 4],
            points[row, c + 5],
            radii[k],
            boxes,
        ):
            return True
    return False


@kernel(boolean(VEC, float64, MAT, MAT))
def is_configuration_free(q, ray_length, robot, boxes):
    """Return whether the arm at q, with a ray of the given length [m], is clear of all boxes."""
    n_bars = count_bars(robot)
    points = np.empty((1, 3 * (n_bars + 1)))
    radii = np.empty(n_bars)
    bar_radii(robot, radii)
    chain_points(robot, q, ray_length, points, 0)
    return not touches(points, 0, radii, boxes)


@kernel(void(MAT, float64, MAT, MAT, OUT_MAT))
def clearances(positions, ray_length, robot, boxes, distances):
    """
    Write the least signed distance of every bar (rows) from every box (columns) [m].

    positions (n, dof): the configurations over which the least is taken.
    """
    n_bars = count_bars(robot)
    points, radii = np.empty((1, 3 * (n_bars + 1))), np.empty(n_bars)
    bar_radii(robot, radii)
    distances[:] = math.inf
    for i in range(positions.shape[0]):
        chain_points(robot, positions[i], ray_length, points, 0)
        for k in range(n_bars):
            for j in range(boxes.shape[1]):
                distance = bar_distance(points, 0, 3 * k, boxes, j) - radii[k]
                distances[k, j] = min(distances[k, j], distance)


@kernel(void(MAT, VEC, VEC, OUT_VEC))
def curvature_bounds(robot, speed, bend, bows):
    """
    Write a bound of the second derivative of each point of `chain_points` along a motion.

    speed, bend: bounds of |dq/du| and |d2q/du2| of each joint along the motion. With R_j the reach
    of a point round joint j: sum over i <= j of 2 |q_i'| |q_j'| R_j (once where i = j) plus sum of
    |q_j''| R_j; an inner prismatic joint adds nothing (`docs/algorithms.md`, section 2).
    """
    dof = speed.shape[0]
    bows[0] = 0.0
    n = 1
    for i in range(robot.shape[0]):
        for end in range(2):
            if robot[i, RADIUS_A + end] == NO_BAR:
                continue
            total, inner = 0.0, 0.0
            for j in range(dof):
                reach = robot[i, REACH + end * dof + j]
                turns = 0.0 if robot[j, KIND] == PRISMATIC else speed[j]
                total += reach * (speed[j] * (turns + 2.0 * inner) + bend[j])
                inner += turns
            bows[n] = total
            n += 1


@kernel(void(MAT, float64, OUT_VEC))
def curve_point(curve, u, q):
    """Write the point of a polynomial curve at u (Horner); curve (degree + 1, dof), low first."""
    n = curve.shape[0]
    for k in range(q.shape[0]):
        value = curve[n - 1, k]
        for power in range(n - 2, -1, -1):
            value = value * u + curve[power, k]
        q[k] = value


@kernel(
    boolean(MAT, int64, int64, int64, int64, int64, float64, OUT_VEC, float64, OUT_MAT, MAT, int64)
)
def piece_is_apart(points, a, b, k, level, part, bow, bows, radius, piece, boxes, j):
    """
    Return whether part `part` of the 2^level equal parts of bar k is proven apart from box j.

    Between the nodes a and b of a motion; `bow` is width^2 / 8. piece (2, 6): scratch.
    """
    n_parts = 1 << level
    low, high = part / n_parts, (part + 1) / n_parts
    for c in range(3):
        p, r = points[a, 3 * k + c], points[a, 3 * k + 3 + c]
        piece[0, c], piece[0, 3 + c] = p + low * (r - p), p + high * (r - p)
        p, r = points[b, 3 * k + c], points[b, 3 * k + 3 + c]
        piece[1, c], piece[1, 3 + c] = p + low * (r - p), p + high * (r - p)
    first = bow * (bows[k] + low * (bows[k + 1] - bows[k]))
    last = bow * (bows[k] + high * (bows[k + 1] - bows[k]))
    return hull_is_apart(piece, 0, 1, 0, first, last, radius, boxes, j)


@kernel(int64(MAT, VEC, VEC, float64, MAT, MAT))
def prove_curve(curve, speed, bend, resolution, robot, boxes):
    """
    Return 1 where a motion is proven free, 0 where it touches a box, -1 where neither is known.

    curve (degree + 1, dof): q(u) for u in [0, 1]; speed, bend (dof,): bounds of its derivatives.
    An interval of u is free when the hull of each bar at its two ends, thickened by
    width^2 / 8 times the bound of the second derivative, is apart from each box. What is not apart
    is bisected, breadth first, and the halves test only the pairs of bar and box that were left
    open, on short intervals part by part, until an interval is shorter than `resolution` [rad]
    (`docs/algorithms.md`, section 3).
    """
    dof, n_boxes = curve.shape[1], boxes.shape[1]
    n_bars = count_bars(robot)
    radii, bows, q = np.empty(n_bars), np.empty(n_bars + 1), np.empty(dof)
    bar_radii(robot, radii)
    curvature_bounds(robot, speed, bend, bows)
    length = 0.0
    for k in range(dof):
        length += speed[k] * speed[k]
    length = math.sqrt(length)
    extent = 0.0
    for power in range(curve.shape[0]):
        for k in range(dof):
            extent += abs(curve[power, k])
    # Also what is no number: it must reach neither the conversion to an integer below, nor the
    # reduction of angles.
    if not (length < MAX_NODES - 2 and extent < LARGEST):
        return -1
    ray_length = robot[robot.shape[0] - 1, D]
    points, u = np.empty((MAX_NODES, 3 * (n_bars + 1))), np.empty(MAX_NODES)
    # Queue of intervals: node at either end, then the run of `pool` that holds what is open.
    queue = np.empty((2 * MAX_NODES, 4), np.int32)
    # What is open: pair of bar and box, level of subdivision of the bar, part.
    pool, is_open = np.empty((MAX_OPEN, 3), np.int32), np.empty(max(1, n_boxes), np.int8)
    piece = np.empty((2, 6))
    n_open, head, tail = 0, 0, 0
    n_nodes = int64(length) + 2
    # The far end first: it is the configuration that no earlier edge has proven.
    for i in range(n_nodes - 1, -1, -1):
        u[i] = i / (n_nodes - 1)
        curve_point(curve, u[i], q)
        chain_points(robot, q, ray_length, points, i)
        if touches(points, i, radii, boxes):
            return 0
    for i in range(n_nodes - 1):
        queue[tail, 0], queue[tail, 1], queue[tail, 2], queue[tail, 3] = i, i + 1, 0, -1
        tail += 1
    while head < tail:
        a, b = queue[head, 0], queue[head, 1]
        first, last = queue[head, 2], queue[head, 3]
        head += 1
        width = u[b] - u[a]
        bow = 0.125 * width * width
        start = n_open
        if last < 0:
            if n_open + n_bars * n_boxes > MAX_OPEN:
                return -1
            for k in range(n_bars):
                s, t = bow * bows[k], bow * bows[k + 1]
                for j in range(n_boxes):
                    is_open[j] = not hull_is_apart(points, a, b, 3 * k, s, t, radii[k], boxes, j)
                for j in range(n_boxes):
                    pool[n_open, 0], pool[n_open, 1], pool[n_open, 2] = k * n_boxes + j, 0, 0
                    n_open += is_open[j]
        else:
            # On a long interval the whole bar moves; on a short one mostly its own length keeps
            # the hull from fitting, where it turns over an edge of the box.
            splits = 2 if width * length < SPLIT and last - first < MAX_PARTS else 1
            if n_open + splits * (last - first) > MAX_OPEN:
                return -1
            for row in range(first, last):
                k, j = pool[row, 0] // n_boxes, pool[row, 0] % n_boxes
                level = pool[row, 1] + splits - 1
                for part in range(splits * pool[row, 2], splits * (pool[row, 2] + 1)):
                    if not piece_is_apart(
                        points, a, b, k, level, part, bow, bows, radii[k], piece, boxes, j
                    ):
                        pool[n_open, 0], pool[n_open, 1] = pool[row, 0], level
                        pool[n_open, 2] = part
                        n_open += 1
        if n_open == start:
            continue
        if width * length < resolution or n_nodes >= MAX_NODES or tail + 2 > queue.shape[0]:
            return -1
        u[n_nodes] = 0.5 * (u[a] + u[b])
        curve_point(curve, u[n_nodes], q)
        chain_points(robot, q, ray_length, points, n_nodes)
        if touches(points, n_nodes, radii, boxes):
            return 0
        for side in range(2):
            queue[tail, 0] = a if side == 0 else n_nodes
            queue[tail, 1] = n_nodes if side == 0 else b
            queue[tail, 2], queue[tail, 3] = start, n_open
            tail += 1
        n_nodes += 1
    return 1


@kernel(boolean(VEC, VEC, float64, MAT, MAT))
def is_edge_free(q_from, q_to, resolution, robot, boxes):
    """
    Return whether the straight joint motion q_from -> q_to is proven free along its whole length.

    The edge check of the planners (`EDGE_CHECK`). False also where the proof fails at intervals
    of `resolution` [rad].
    """
    dof = q_from.shape[0]
    line, speed, bend = np.empty((2, dof)), np.empty(dof), np.zeros(dof)
    for k in range(dof):
        line[0, k], line[1, k] = q_from[k], q_to[k] - q_from[k]
        speed[k] = abs(line[1, k])
    return prove_curve(line, speed, bend, resolution, robot, boxes) == 1
