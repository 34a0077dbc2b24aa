# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Bars of an arm against each other: contact, distance, and the proof that two keep apart."""

import math

from numba.core.types import boolean, float64, int64, void
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import kernel, MAT, OUT_VEC, VEC
from rrth_planner.kernels.layout import (
    BAR_SIZE,
    BODY,
    FIRST_PAIR,
    FRAME,
    FRAME_SIZE,
    FRAMES,
    INNER,
    KIND,
    MAX_BARS,
    MAX_DOF,
    MAX_PAIRS,
    OUTER,
    PRISMATIC,
    REACH,
)

# Bars that come nearer than this are in contact: rounding of kinematics, with room [m].
CONTACT = 1e-9
# What is known of the motion of a pair: bounds of the second derivatives of both ends of the inner
# bar and of the outer one, seen from the link of the inner one, < 0 until they are needed, and of
# the sum of their speeds.
BOW_SIZE, SPEED = 5, 4
BOWS_ROOM = BOW_SIZE * MAX_PAIRS
# The speed of each bar, seen from each link.
SPEEDS_ROOM = MAX_BARS * (MAX_DOF + 1)
# Two bars at two instants.
SEEN_ROOM = 4 * BAR_SIZE
# Shorter lines are points [m^2].
POINT = 1e-24


@kernel(float64(OUT_VEC, int64, OUT_VEC, int64, OUT_VEC), is_inlined=True)
def segment_gap(first, i, second, j, gap):
    """
    Return the squared distance of two lines [m^2], and write the vector of it [m].

    From the first, first[i] to first[i + 4], to the second, second[j] to second[j + 4]: the
    nearest points of both, clamped in turn (Ericson 2005, section 5.1.9).
    """
    aa = ab = bb = ar = br = 0.0
    for c in range(3):
        u, v = first[i + 4 + c] - first[i + c], second[j + 4 + c] - second[j + c]
        r = first[i + c] - second[j + c]
        aa += u * u
        ab += u * v
        bb += v * v
        ar += u * r
        br += v * r
    s = t = 0.0
    if aa > POINT:
        if bb > POINT:
            denominator = aa * bb - ab * ab
            if denominator > POINT * aa * bb:
                s = min(max((ab * br - ar * bb) / denominator, 0.0), 1.0)
            t = (ab * s + br) / bb
            if t < 0.0:
                t, s = 0.0, min(max(-ar / aa, 0.0), 1.0)
            elif t > 1.0:
                t, s = 1.0, min(max((ab - ar) / aa, 0.0), 1.0)
        else:
            s = min(max(-ar / aa, 0.0), 1.0)
    elif bb > POINT:
        t = min(max(br / bb, 0.0), 1.0)
    square = 0.0
    for c in range(3):
        gap[c] = (
            second[j + c]
            + t * (second[j + 4 + c] - second[j + c])
            - first[i + c]
            - s * (first[i + 4 + c] - first[i + c])
        )
        square += gap[c] * gap[c]
    return square


@kernel(boolean(OUT_VEC, int64, int64, float64), is_inlined=True, is_inner=True)
def are_far(points, a, b, distance):
    """Return whether the middles of two bars prove them further apart than a distance [m]."""
    twice = 0.0
    for c in range(3):
        apart = points[b + c] + points[b + 4 + c] - points[a + c] - points[a + 4 + c]
        twice += apart * apart
    far = points[a + 3] + points[b + 3] + distance
    return twice > 4.0 * far * far


@kernel(boolean(OUT_VEC, int64, int64, MAT), is_inner=True)
def is_pair_in_contact(points, at, row, robot):
    """Return whether a pair of bars, row in `robot`, is in contact at points[at]: exact."""
    a = at + BAR_SIZE * int64(robot[row, INNER])
    b = at + BAR_SIZE * int64(robot[row, OUTER])
    radius = points[a + 7] + points[b + 7] + CONTACT
    if are_far(points, a, b, radius):
        return False
    # Also for NaN, which must never count as apart.
    return not segment_gap(points, a, points, b, scratch.floats(3)) > radius * radius


@kernel(int64(OUT_VEC, int64, int64, MAT))
def colliding_pair(points, at, dof, robot):
    """Return the first pair of bars in contact with the arm at points[at], or -1: exact."""
    first = int64(robot[dof + 1, FIRST_PAIR])
    for row in range(first, robot.shape[0]):
        if is_pair_in_contact(points, at, row, robot):
            return row - first
    return -1


@kernel(float64(OUT_VEC, int64, int64, MAT, float64), is_inner=True)
def nearest_pair(points, at, dof, robot, least):
    """Return the least distance of pairs of bars that must not collide, where it is less [m]."""
    gap = scratch.floats(3)
    for row in range(int64(robot[dof + 1, FIRST_PAIR]), robot.shape[0]):
        a = at + BAR_SIZE * int64(robot[row, INNER])
        b = at + BAR_SIZE * int64(robot[row, OUTER])
        apart = math.sqrt(segment_gap(points, a, points, b, gap))
        least = min(least, apart - points[a + 7] - points[b + 7])
    return least


@kernel(void(MAT, int64, VEC, VEC, OUT_VEC), is_inlined=True, is_inner=True)
def curvature_factors(robot, first, speed, curvature, factors):
    """
    Write what each joint from `first` on adds to the bound of a second derivative, by its reach.

    speed, curvature: bounds of |dq/du| and |d2q/du2| of each joint. With R_j the reach of a point
    round joint j, its second derivative, seen from the link that `first` joints move, is at most
    the sum over first <= i <= j of 2 |q_i'| |q_j'| R_j (once where i = j) plus the sum of
    |q_j''| R_j; an inner prismatic joint adds nothing (`docs/algorithms.md`, section 2).
    """
    inner = 0.0
    for j in range(first, speed.shape[0]):
        turns = 0.0 if robot[j, KIND] == PRISMATIC else speed[j]
        factors[j] = speed[j] * (turns + 2.0 * inner) + curvature[j]
        inner += turns


@kernel(void(MAT, VEC, OUT_VEC), is_inner=True)
def pair_bounds(robot, speed, bows):
    """Write what is known of the motion of each pair at first, BOW_SIZE numbers each."""
    dof = speed.shape[0]
    first = int64(robot[dof + 1, FIRST_PAIR])
    # Of each bar, seen from each link: the sum over the joints that move it.
    fastest = scratch.floats(SPEEDS_ROOM)
    for bar in range(first - dof - 2):
        row, start, end = dof + 2 + bar, 0.0, 0.0
        fastest[(dof + 1) * bar + dof] = 0.0
        for j in range(dof - 1, -1, -1):
            start += robot[row, REACH + j] * speed[j]
            end += robot[row, REACH + dof + j] * speed[j]
            fastest[(dof + 1) * bar + j] = max(start, end)
    for row in range(first, robot.shape[0]):
        n, body = BOW_SIZE * (row - first), int64(robot[row, BODY])
        inner, outer = int64(robot[row, INNER]), int64(robot[row, OUTER])
        bows[n] = -1.0
        bows[n + SPEED] = fastest[(dof + 1) * inner + body] + fastest[(dof + 1) * outer + body]


@kernel(void(OUT_VEC, int64, int64, OUT_VEC, int64), is_inlined=True, is_inner=True)
def seen_from(points, bar, frame, seen, to):
    """Write both ends of points[bar] in the frame at points[frame], < 0: as is, to seen[to]."""
    for end in range(2):
        for k in range(3):
            value = 0.0
            if frame < 0:
                value = points[bar + 4 * end + k]
            else:
                for c in range(3):
                    value += points[frame + 3 + 3 * k + c] * (
                        points[bar + 4 * end + c] - points[frame + c]
                    )
            seen[to + 4 * end + k] = value


@kernel(void(OUT_VEC, int64, OUT_VEC), is_inner=True)
def turned_to(points, frame, v):
    """Turn a vector of the base into the frame at points[frame]."""
    x, y, z = v[0], v[1], v[2]
    for k in range(3):
        row = frame + 3 + 3 * k
        v[k] = points[row] * x + points[row + 1] * y + points[row + 2] * z


@kernel(
    boolean(OUT_VEC, float64, OUT_VEC, OUT_VEC, int64, float64, float64),
    is_inlined=True,
    is_inner=True,
)
def keeps_apart(gap, length, seen, bows, n, bow, radius):
    """
    Return whether a direction, `gap` of some length, separates the hulls of two moving bars.

    seen: both bars at two instants, inner and outer at each, in the frame of the direction.
    """
    low, high = math.inf, -math.inf
    for instant in range(2):
        for end in range(2):
            at = 2 * BAR_SIZE * instant + 4 * end
            inner = outer = 0.0
            for c in range(3):
                inner += gap[c] * seen[at + c]
                outer += gap[c] * seen[at + BAR_SIZE + c]
            high = max(high, inner + length * bow * bows[n + end])
            low = min(low, outer - length * bow * bows[n + 2 + end])
    return low - high > length * radius


@kernel(
    boolean(OUT_VEC, int64, int64, int64, float64, VEC, VEC, OUT_VEC, int64, MAT),
    is_inlined=True,
    is_inner=True,
)
def is_pair_open(points, a, b, row, width, speed, curvature, bows, n, robot):
    """
    Return whether a pair of bars is not proven apart between two instants.

    points[a], points[b]: the arm at both; width: of the interval of the curve's parameter; row:
    that of the pair in `robot`; speed, curvature: bounds of |dq/du| and |d2q/du2| of each joint;
    n: where those of the pair are in `bows`. Apart are: bars that do not move to each other and
    are not in contact, those too far away from each other to meet within the interval, and those
    whose hulls at both instants, thickened by width^2 / 8 times the second derivative and seen
    from the link of the inner bar, are separated by the direction in which they are nearest at one
    of the instants (`docs/algorithms.md`, section 3).
    """
    if bows[n + SPEED] == 0.0:
        return is_pair_in_contact(points, a, row, robot)
    inner, outer = BAR_SIZE * int64(robot[row, INNER]), BAR_SIZE * int64(robot[row, OUTER])
    radius = points[a + inner + 7] + points[a + outer + 7] + CONTACT
    way = bows[n + SPEED] * width
    if are_far(points, a + inner, a + outer, radius + way):
        return False
    one, other = scratch.floats(3), scratch.floats(3)
    length_one = math.sqrt(segment_gap(points, a + inner, points, a + outer, one))
    if length_one > radius + way:
        return False
    length_other = math.sqrt(segment_gap(points, b + inner, points, b + outer, other))
    # On the way from one distance to the other they would have to lose both.
    if length_one + length_other > 2.0 * radius + way:
        return False
    dof = speed.shape[0]
    if bows[n] < 0.0:
        body, factors = int64(robot[row, BODY]), scratch.floats(MAX_DOF)
        curvature_factors(robot, body, speed, curvature, factors)
        for k in range(4):
            bar = dof + 2 + int64(robot[row, INNER if k < 2 else OUTER])
            bows[n + k] = 0.0
            for j in range(body, dof):
                bows[n + k] += robot[bar, REACH + k % 2 * dof + j] * factors[j]
    seen = scratch.floats(SEEN_ROOM)
    slot = int64(robot[row, FRAME])
    frame = int64(robot[dof + 1, FRAMES]) + FRAME_SIZE * slot if slot >= 0 else -1
    for instant in range(2):
        base = b if instant else a
        at = base + frame if slot >= 0 else -1
        seen_from(points, base + inner, at, seen, 2 * BAR_SIZE * instant)
        seen_from(points, base + outer, at, seen, 2 * BAR_SIZE * instant + BAR_SIZE)
    if slot >= 0:
        turned_to(points, a + frame, one)
        turned_to(points, b + frame, other)
    bow = 0.125 * width * width
    return not (
        keeps_apart(one, length_one, seen, bows, n, bow, radius)
        or keeps_apart(other, length_other, seen, bows, n, bow, radius)
    )
