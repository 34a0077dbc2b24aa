# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Collision checks of the arm: at a configuration, and continuous along a motion."""

import math

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.collision.bar_bar import (
    BOW_SIZE,
    BOWS_ROOM,
    colliding_pair,
    curvature_factors,
    is_pair_in_contact,
    is_pair_open,
    pair_bounds,
)
from rrth_planner.kernels.collision.bar_box import checked_lanes, contact_lanes, open_lanes
from rrth_planner.kernels.jit import as_chain, CHAIN, kernel, MAT, OUT_POOL, OUT_VEC, VEC
from rrth_planner.kernels.layout import (
    BAR_SIZE,
    D,
    FIRST_PAIR,
    FRAME_SIZE,
    LANES,
    MAX_BARS,
    MAX_DOF,
    MAX_FRAMES,
    REACH,
    STRIDE,
)
from rrth_planner.kernels.vectors import is_within

# Room for the numbers that `chain` writes of a configuration.
ENDS_ROOM = BAR_SIZE * MAX_BARS + FRAME_SIZE * MAX_FRAMES
# Bounds of both ends of each bar.
BARS_ROOM = 2 * MAX_BARS
# Most configurations of a continuous check, and room for the numbers of their points.
MAX_NODES, POINTS_ROOM = 512, 65536
# Most open entries of a continuous check: a bar, a group of boxes and which of them are open to
# one of so many equal parts of the bar; or, below 0, a pair of bars.
MAX_OPEN, ENTRY = 2048, 5
QUEUE_ROOM, POOL_ROOM = 8 * MAX_NODES, ENTRY * MAX_OPEN
# Groups of boxes waiting to be checked: LANES per level of their tree.
MAX_GROUPS = 64
# Largest joint position: `sine_cosine` is valid up to 1e5 [rad or m].
LARGEST = 1e4
# Intervals shorter than this [rad] are proven part by part of the bars, as long as there are no
# more open parts than these.
SPLIT, MAX_PARTS = 0.05, 64
# A motion is first cut into intervals no longer than this [rad].
FIRST_INTERVAL = 1.0


@kernel(int64(OUT_VEC, int64, int64, MAT), is_inlined=True, is_inner=True)
def group_contact(points, at, n_bars, boxes):
    """Return 0 where no bar of the arm at points[at] is in contact with one group of boxes."""
    found = 0
    for k in range(n_bars - 1, -1, -1):
        hit = contact_lanes(points, at + BAR_SIZE * k, boxes, 0)
        if hit != 0:
            found += checked_lanes(boxes, 0, k, hit)
            if found != 0:
                break
    return found


@kernel(boolean(OUT_VEC, int64, int64, MAT), is_inner=True)
def is_in_contact(points, at, n_bars, boxes):
    """Return whether any bar of the arm at points[at] is in contact with a box: exact."""
    if boxes.shape[0] == 1:
        return group_contact(points, at, n_bars, boxes) != 0
    waiting = scratch.ints(MAX_GROUPS)
    n_waiting, waiting[0] = 1, 0
    while n_waiting > 0:
        n_waiting -= 1
        g = int64(waiting[n_waiting])
        hit = 0
        is_leaf = LANES * g + 1 >= boxes.shape[0]
        for k in range(n_bars - 1, -1, -1):
            hit |= contact_lanes(points, at + BAR_SIZE * k, boxes, g)
            if is_leaf and hit != 0:
                if checked_lanes(boxes, g, k, hit) != 0:
                    return True
                hit = 0
        for j in range(LANES):
            if (hit >> j) & 1:
                waiting[n_waiting] = LANES * g + j + 1
                n_waiting += 1
    return False


@kernel(boolean(VEC, float64, CHAIN, MAT, MAT))
def is_configuration_free(q, ray_length, chain, robot, boxes):
    """Return whether the arm at q, with a ray that long [m], is clear of all boxes and itself."""
    points = scratch.floats(ENDS_ROOM)
    n_bars = chain(q, ray_length, points, 0)
    # Written out, where there is one group: a call costs as much as a bar.
    if boxes.shape[0] == 1:
        if group_contact(points, 0, n_bars, boxes) != 0:
            return False
    elif is_in_contact(points, 0, n_bars, boxes):
        return False
    # Further rows: of bars of the mount, and of pairs.
    dof = q.shape[0]
    if robot.shape[0] > dof + 2 + n_bars:
        return colliding_pair(points, 0, dof, robot) < 0
    return True


@kernel(float64(VEC, VEC, VEC, int64, float64, int64, MAT, MAT, MAT), is_short=True, is_exact=True)
def first_free(q, way, shares, n_halvings, ray_length, address, robot, boxes, bounds):
    """
    Return the first share of a way at which the arm is free, NaN: at none within its bounds.

    q, way (dof,) [rad]; shares (m,): tried one after the other, as far apart as the first is from
    0; between the last that is not free and that which is, by halving. The rest as for
    `is_configuration_free`; address: of the chain.
    """
    chain, there = as_chain(address), scratch.floats(MAX_DOF)
    place = there[: q.shape[0]]
    for far in shares:
        for k in range(q.shape[0]):
            place[k] = q[k] + far * way[k]
        if not is_within(place, bounds):
            return math.nan
        if not is_configuration_free(place, ray_length, chain, robot, boxes):
            continue
        near = far - shares[0]
        for _ in range(n_halvings):
            middle = 0.5 * (near + far)
            for k in range(q.shape[0]):
                place[k] = q[k] + middle * way[k]
            is_inside = is_within(place, bounds)
            if is_inside and is_configuration_free(place, ray_length, chain, robot, boxes):
                far = middle
            else:
                near = middle
        return far
    return math.nan


@kernel(void(MAT, int64, VEC, VEC, OUT_VEC))
def curvature_bounds(robot, n_bars, speed, curvature, bows):
    """Write the bounds of second derivatives of both ends of each bar, seen from the base."""
    dof, factors = speed.shape[0], scratch.floats(MAX_DOF)
    curvature_factors(robot, 0, speed, curvature, factors)
    for k in range(n_bars):
        start, end, row = 0.0, 0.0, dof + 2 + k
        for j in range(dof):
            start += robot[row, REACH + j] * factors[j]
            end += robot[row, REACH + dof + j] * factors[j]
        bows[2 * k], bows[2 * k + 1] = start, end


@kernel(void(MAT, float64, OUT_VEC), is_inner=True)
def curve_point(curve, u, q):
    """Write the point of a polynomial curve at u (Horner); curve (degree + 1, dof), low first."""
    n = curve.shape[0]
    for k in range(curve.shape[1]):
        value = curve[n - 1, k]
        for power in range(n - 2, -1, -1):
            value = value * u + curve[power, k]
        q[k] = value


@kernel(void(OUT_VEC, int64, int64, int64, int64, OUT_VEC), is_inner=True)
def cut_bar(points, a, b, n_parts, part, piece):
    """Write one of the equal parts of a bar at two instants, laid out as points."""
    low, high = part / n_parts, (part + 1) / n_parts
    for i, at in enumerate((a, b)):
        for c in range(3):
            p, r = points[at + c], points[at + 4 + c]
            piece[8 * i + c], piece[8 * i + 4 + c] = p + low * (r - p), p + high * (r - p)
    piece[7] = piece[15] = points[a + 7]


@kernel(
    int64(OUT_VEC, int64, int64, float64, OUT_VEC, int64, MAT, OUT_POOL, int64),
    is_inlined=True,
    is_inner=True,
)
def open_bar(points, a, b, bow, bows, k, boxes, pool, n_open):
    """
    Append to the pool the groups of boxes that are open to bar k; return its new length.

    points[a], points[b]: the arm at two instants; bow: width^2 / 8. -1: the pool has no room.
    """
    first, last = bow * bows[2 * k], bow * bows[2 * k + 1]
    waiting = scratch.ints(MAX_GROUPS)
    n_waiting, waiting[0] = 1, 0
    while n_waiting > 0:
        n_waiting -= 1
        g = int64(waiting[n_waiting])
        lanes = open_lanes(points, a + BAR_SIZE * k, b + BAR_SIZE * k, first, last, boxes, g)
        if lanes == 0:
            continue
        if LANES * g + 1 < boxes.shape[0]:
            for j in range(LANES):
                if (lanes >> j) & 1:
                    waiting[n_waiting] = LANES * g + j + 1
                    n_waiting += 1
            continue
        lanes = checked_lanes(boxes, g, k, lanes)
        if lanes == 0:
            continue
        if n_open >= MAX_OPEN:
            return -1
        at = ENTRY * n_open
        pool[at], pool[at + 1], pool[at + 2], pool[at + 3], pool[at + 4] = k, g, lanes, 1, 0
        n_open += 1
    return n_open


@kernel(
    int64(OUT_VEC, int64, int64, float64, OUT_VEC, int64, boolean, MAT, OUT_POOL, int64),
    is_inner=True,
)
def open_again(points, a, b, bow, bows, row, is_split, boxes, pool, n_open):
    """
    Append to the pool the open part of its entry `row`; return its new length.

    points[a], points[b]: the arm at two nearer instants; bow: width^2 / 8. The bar, or its part,
    is halved if asked for: on a short interval it is mostly the bar's own length that keeps the
    hull from fitting, where the bar turns over an edge of the box. -1: the pool has no room.
    """
    piece = scratch.floats(16)
    at = ENTRY * row
    k, g, lanes = int64(pool[at]), int64(pool[at + 1]), int64(pool[at + 2])
    n_parts, part = int64(pool[at + 3]), int64(pool[at + 4])
    splits = 2 if is_split else 1
    n_parts *= splits
    for i in range(splits * part, splits * (part + 1)):
        cut_bar(points, a + BAR_SIZE * k, b + BAR_SIZE * k, n_parts, i, piece)
        rise = bows[2 * k + 1] - bows[2 * k]
        first = bow * (bows[2 * k] + i / n_parts * rise)
        last = bow * (bows[2 * k] + (i + 1) / n_parts * rise)
        left = lanes & open_lanes(piece, 0, 8, first, last, boxes, g)
        if left == 0:
            continue
        if n_open >= MAX_OPEN:
            return -1
        at = ENTRY * n_open
        pool[at], pool[at + 1], pool[at + 2], pool[at + 3], pool[at + 4] = k, g, left, n_parts, i
        n_open += 1
    return n_open


@kernel(
    int64(OUT_VEC, int64, int64, int64, int64, float64, VEC, VEC, OUT_VEC, MAT, OUT_POOL, int64),
    is_inner=True,
)
def open_pairs(points, a, b, first, last, width, speed, curvature, bows, robot, pool, n_open):
    """
    Append to the pool those of some pairs that are open; return its new length.

    The pairs: those in the pool from entry `first` to `last`; last < 0: all. points[a], points[b]:
    the arm at two instants, that far apart in the curve's parameter. -1: the pool has no room.
    """
    first_pair = int64(robot[speed.shape[0] + 1, FIRST_PAIR])
    is_every = last < 0
    if is_every:
        first, last = 0, robot.shape[0] - first_pair
    for k in range(first, last):
        p = k if is_every else -1 - int64(pool[ENTRY * k])
        if p < 0 or not is_pair_open(
            points, a, b, first_pair + p, width, speed, curvature, bows, BOW_SIZE * p, robot
        ):
            continue
        if n_open >= MAX_OPEN:
            return -1
        pool[ENTRY * n_open] = -1 - p
        n_open += 1
    return n_open


@kernel(boolean(OUT_VEC, int64, int64, MAT, OUT_POOL, int64, int64), is_inner=True)
def is_open_pair_in_contact(points, at, dof, robot, pool, first, last):
    """Return whether any pair in the pool from entry `first` to `last` is in contact: exact."""
    for k in range(first, last):
        p = -1 - int64(pool[ENTRY * k])
        if p >= 0 and is_pair_in_contact(points, at, int64(robot[dof + 1, FIRST_PAIR]) + p, robot):
            return True
    return False


@kernel(int64(MAT, VEC, VEC, float64, CHAIN, MAT, MAT))
def prove_curve(curve, speed, curvature, resolution, chain, robot, boxes):
    """
    Return 1 where a motion is proven free, 0 where it collides, -1 where it is undecided.

    curve (degree + 1, dof): q(u) for u in [0, 1]; speed, curvature (dof,): derivative bounds.
    An interval of u is free when the hull of each bar at its two ends, thickened by
    width^2 / 8 times the bound of the second derivative, is apart from each box, and the hulls of
    two bars that must not collide are apart. Otherwise it is bisected, breadth first, and the
    halves test only what is still open, bars on short intervals part by part, until an interval is
    shorter than `resolution` [rad] (`docs/algorithms.md`, section 3). The ends of an interval
    belong to it: at them only pairs that are open need to be looked at.
    """
    length = extent = 0.0
    for k in range(curve.shape[1]):
        length += speed[k] * speed[k]
        for power in range(curve.shape[0]):
            extent += abs(curve[power, k])
    length = math.sqrt(length)
    # Also for NaN, which must reach neither the conversion to an integer below, nor the reduction
    # of angles.
    if not (length < 0.5 * FIRST_INTERVAL * MAX_NODES and extent < LARGEST):
        return -1
    points, u = scratch.floats(POINTS_ROOM), scratch.floats(MAX_NODES)
    q, bows, pair_bows = (
        scratch.floats(MAX_DOF),
        scratch.floats(BARS_ROOM),
        scratch.floats(BOWS_ROOM),
    )
    dof = curve.shape[1]
    # Queue of intervals: nodes at both ends, then the range of `pool` with the open entries.
    queue, pool = scratch.ints(QUEUE_ROOM), scratch.ints(POOL_ROOM)
    ray_length, stride = robot[dof, D], int64(robot[dof + 1, STRIDE])
    n_pairs = robot.shape[0] - int64(robot[dof + 1, FIRST_PAIR])
    # The far end first: earlier edges have mostly proven the start.
    u[0] = 1.0
    curve_point(curve, 1.0, q)
    n_bars = chain(q, ray_length, points, 0)
    if is_in_contact(points, 0, n_bars, boxes):
        return 0
    max_nodes = min(MAX_NODES, POINTS_ROOM // stride)
    n_pieces = int64(length / FIRST_INTERVAL) + 1
    if n_pieces >= max_nodes:
        return -1
    head, tail, n_open, n_nodes = 0, 0, 0, n_pieces + 1
    for i in range(n_pieces, 0, -1):
        u[i] = (i - 1) / n_pieces
        curve_point(curve, u[i], q)
        chain(q, ray_length, points, i * stride)
        # The start is checked below: mostly it is known to be free.
        if i > 1 and is_in_contact(points, i * stride, n_bars, boxes):
            return 0
        queue[tail], queue[tail + 1] = i, i + 1 if i < n_pieces else 0
        queue[tail + 2], queue[tail + 3] = 0, -1
        tail += 4
    curvature_bounds(robot, n_bars, speed, curvature, bows)
    if n_pairs > 0:
        pair_bounds(robot, speed, pair_bows)
    while head < tail:
        a, b = int64(queue[head]), int64(queue[head + 1])
        first, last = int64(queue[head + 2]), int64(queue[head + 3])
        head += 4
        width = u[b] - u[a]
        bow = 0.125 * width * width
        start = n_open
        if last < 0:
            for k in range(n_bars):
                n_open = open_bar(
                    points, a * stride, b * stride, bow, bows, k, boxes, pool, n_open
                )
                if n_open < 0:
                    return -1
        is_split = width * length < SPLIT and last - first < MAX_PARTS
        for row in range(first, last):
            if pool[ENTRY * row] >= 0:
                n_open = open_again(
                    points, a * stride, b * stride, bow, bows, row, is_split, boxes, pool, n_open
                )
                if n_open < 0:
                    return -1
        if n_pairs > 0:
            n_open = open_pairs(
                points,
                a * stride,
                b * stride,
                first,
                last,
                width,
                speed,
                curvature,
                pair_bows,
                robot,
                pool,
                n_open,
            )
            if n_open < 0:
                return -1
        if n_open == start:
            continue
        if last < 0:
            if n_pairs > 0 and (
                is_open_pair_in_contact(points, b * stride, dof, robot, pool, start, n_open)
                or a == 1
                and is_open_pair_in_contact(points, stride, dof, robot, pool, start, n_open)
            ):
                return 0
            if a == 1 and is_in_contact(points, stride, n_bars, boxes):
                return 0
        if width * length < resolution or n_nodes >= max_nodes or tail > QUEUE_ROOM - 8:
            return -1
        u[n_nodes] = 0.5 * (u[a] + u[b])
        curve_point(curve, u[n_nodes], q)
        chain(q, ray_length, points, n_nodes * stride)
        middle = n_nodes * stride
        if is_in_contact(points, middle, n_bars, boxes) or (
            n_pairs > 0
            and is_open_pair_in_contact(points, middle, dof, robot, pool, start, n_open)
        ):
            return 0
        queue[tail], queue[tail + 1], queue[tail + 2], queue[tail + 3] = a, n_nodes, start, n_open
        tail += 4
        queue[tail], queue[tail + 1], queue[tail + 2], queue[tail + 3] = n_nodes, b, start, n_open
        tail += 4
        n_nodes += 1
    return 1


@kernel(boolean(VEC, VEC, float64, CHAIN, MAT, MAT))
def is_edge_free(q_from, q_to, resolution, chain, robot, boxes):
    """
    Return whether the straight joint motion q_from -> q_to is proven free along its whole length.

    The edge check of the planners (`EDGE_CHECK`). False also where it is undecided at
    intervals of `resolution` [rad].
    """
    dof = q_from.shape[0]
    line, speed, curvature = np.empty((2, dof)), np.empty(dof), np.zeros(dof)
    for k in range(dof):
        line[0, k], line[1, k] = q_from[k], q_to[k] - q_from[k]
        speed[k] = abs(line[1, k])
    return prove_curve(line, speed, curvature, resolution, chain, robot, boxes) == 1
