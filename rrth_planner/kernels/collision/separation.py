# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Separation of a moving arm from boxes that move too: the proof, and the rate that it permits."""

import math

from numba import types
from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.collision.arm_validity import BARS_ROOM, curvature_bounds, ENDS_ROOM
from rrth_planner.kernels.collision.bar_box import bar_box_distance
from rrth_planner.kernels.collision.boxes import may_meet, rows_of
from rrth_planner.kernels.jit import (
    ARM,
    as_chain,
    BODY,
    CHAIN,
    CUBE,
    kernel,
    MAT,
    OUT_MAT,
    OUT_VEC,
    POINTS,
    READ_INTS,
    VEC,
)
from rrth_planner.kernels.layout import (
    BAR_SIZE,
    BOX_HALF,
    BOX_OFFSET,
    BOX_ROWS,
    KIND,
    MAX_DOF,
    PRISMATIC,
    REVOLUTE,
)
from rrth_planner.kernels.trajectory.lookahead import derivatives_on
from rrth_planner.kernels.trajectory.quintics import bound, fit

# Intervals that a motion is first cut into are no longer than this [s], and are halved so often
# before the proof gives up: 0.05 ms.
LONGEST_INTERVAL, HALVINGS = 0.0128, 8
# Rounding of a speed [m/s].
AT_REST = 1e-9
# Sections that a bar is cut into for the permitted rate, instants of a stop that are looked at; up
# to when that matters [s].
SECTIONS, INSTANTS, LATEST = 8, 8, 10.0
# Steps of the search for the permitted rate; the time between two places of a difference [s].
RATE_HALVINGS, DIFFERENCE_TIME = 6, 1e-4
# Smallest velocities that are divided by [rad/s].
TINY, SLOW = 1e-6, 1e-3

# Greatest velocities, accelerations and jerks of the joints.
LIMITS = types.UniTuple(VEC, 3)


@kernel(void(MAT, float64, float64, OUT_MAT), is_inner=True)
def cut(curve, begin, end, part):
    """
    Write the part of a polynomial between two shares of it, again over u from 0 to 1.

    curve, part (degree + 1, dof), lowest power first: q(begin + (end - begin) u), by Horner's
    scheme (Taylor shift).
    """
    n, dof = curve.shape
    for k in range(dof):
        for i in range(n):
            part[i, k] = curve[i, k]
        for i in range(n - 1):
            for j in range(n - 2, i - 1, -1):
                part[j, k] += begin * part[j + 1, k]
        scale = 1.0
        for i in range(n):
            part[i, k] *= scale
            scale *= end - begin


@kernel(void(OUT_VEC, int64, MAT, int64, OUT_VEC), is_inlined=True, is_inner=True)
def line_from_box(points, at, rows, box, line):
    """
    Write a line as seen from a box, its begin and its end, (6,) [m].

    From points[at] to points[at + 4]; rows (18, m) as from `boxes.rows_of`.
    """
    for r in range(3):
        first = last = rows[BOX_OFFSET + r, box]
        for c in range(3):
            cosine = rows[3 * r + c, box]
            first += cosine * points[at + c]
            last += cosine * points[at + 4 + c]
        line[r], line[3 + r] = first, last


@kernel(float64(OUT_VEC, MAT, int64), is_inlined=True, is_inner=True)
def line_gap(line, rows, box):
    """Return the distance of a line, as from `line_from_box`, along the axes of a box [m]."""
    gap = -math.inf
    for r in range(3):
        first, last, half = line[r], line[3 + r], rows[BOX_HALF + r, box]
        gap = max(gap, min(first, last) - half, -max(first, last) - half)
    return gap


@kernel(float64(OUT_VEC, float64, float64, float64, MAT, int64), is_inlined=True, is_inner=True)
def part_within(line, low, high, distance, rows, box):
    """
    Return how far a part of a line is from a box; where that is more than a distance, more [m].

    line (6,): as from `line_from_box`, of it the part between two shares. Signed: < 0 inside.
    """
    start, step, half = scratch.floats(3), scratch.floats(3), scratch.floats(3)
    gap = -math.inf
    for r in range(3):
        first, last = line[r], line[3 + r]
        begin, end = first + low * (last - first), first + high * (last - first)
        start[r], step[r], half[r] = begin, end - begin, rows[BOX_HALF + r, box]
        gap = max(gap, min(begin, end) - half[r], -max(begin, end) - half[r])
    # Mostly a face of the box shows that it is further away.
    return gap if gap > distance else bar_box_distance(start, step, half)


@kernel(float64(OUT_VEC, int64, float64, float64, float64, MAT, int64))
def within_distance(points, at, low, high, distance, rows, box):
    """Return the same of a line from points[at] to points[at + 4]."""
    line = scratch.floats(6)
    line_from_box(points, at, rows, box, line)
    return part_within(line, low, high, distance, rows, box)


@kernel(boolean(float64, float64, float64, OUT_VEC))
def fast_part(begin, end, contact, part):
    """
    Write the part of a bar that may be faster than at rest, shares of it; return if there is one.

    begin, end: bounds of the speeds of its two ends, between which the speed is no greater than
    the straight line (it is convex); contact: the speed that counts as rest.
    """
    part[0], part[1] = 0.0, 1.0
    # Also for NaN, which is never at rest.
    if begin <= contact and end <= contact:
        return False
    if begin < contact:
        part[0] = (contact - begin) / (end - begin)
    elif end < contact:
        part[1] = (contact - begin) / (end - begin)
    return True


@kernel(float64(MAT, MAT, int64, float64), is_inlined=True, is_inner=True)
def growth_of(growths, speeds, box, time):
    """
    Return by how much a box is grown at a time: the least of its lines [m].

    growths, speeds (m, n): its lines g + w t [m, m/s].
    """
    least = math.inf
    for k in range(growths.shape[1]):
        least = min(least, growths[box, k] + speeds[box, k] * time)
    return least


@kernel(float64(MAT, MAT, int64, float64), is_inlined=True, is_inner=True)
def time_until(growths, speeds, box, room):
    """
    Return until when a box is grown by no more than some room, -1: it is by more at time 0 [s].

    The least of its lines is no more than that as long as any of them is. What never grows beyond
    it is not asked about.
    """
    latest = -1.0
    for k in range(growths.shape[1]):
        if speeds[box, k] > 0.0:
            latest = max(latest, (room - growths[box, k]) / speeds[box, k])
    return latest if latest >= 0.0 else -1.0


@kernel(
    int64(MAT, float64, float64, READ_INTS, CHAIN, MAT, MAT, VEC, MAT, MAT),
    is_inner=True,
)
def blocking_box(part, width, contact, bodies, chain, robot, rows, grown, quartic, cubic):
    """
    Return which box is not proven apart from an arm in motion, bar * m + box; -1: none.

    part (6, dof): the motion in an interval of some width [s], over u from 0 to 1; contact: speed
    up to which a point of the arm counts as at rest [m/s]; bodies (n_bars,): how many joints move
    each bar, the pointing ray left out; rows (18, m): the boxes, grown (m,): by how much they are
    grown at the end of the interval, when they have grown most; quartic and cubic as for
    `quintics.bound`. With dp the way of an end of a bar and b the bound of its
    second derivative by u, it is no faster than |dp| + b / 2, and within |dp| / 2 + b / 8 of the
    mean of its two places (`docs/algorithms.md`).
    """
    dof, m, n_bars = part.shape[1], rows.shape[1], bodies.shape[0]
    q, middle, after = (
        scratch.floats(MAX_DOF),
        scratch.floats(ENDS_ROOM),
        scratch.floats(ENDS_ROOM),
    )
    moved, share, bows = scratch.floats(2), scratch.floats(2), scratch.floats(BARS_ROOM)
    top, bend = np.empty((1, dof)), np.empty((1, dof))
    for k in range(dof):
        q[k] = part[0, k]
    chain(q[:dof], 0.0, middle, 0)
    for k in range(dof):
        for i in range(1, part.shape[0]):
            q[k] += part[i, k]
    chain(q[:dof], 0.0, after, 0)
    bound(part.reshape((1, part.shape[0], dof)), quartic, cubic, top, bend)
    curvature_bounds(robot, n_bars, top[0], bend[0], bows)
    for bar in range(n_bars):
        at, turned = BAR_SIZE * bar, 0.0
        for k in range(bodies[bar]):
            turned += top[0, k] if robot[k, KIND] == REVOLUTE else 0.0
        for i in range(2):
            square = 0.0
            for c in range(3):
                x, y = middle[at + 4 * i + c], after[at + 4 * i + c]
                square += (y - x) * (y - x)
                middle[at + 4 * i + c] = 0.5 * (x + y)
            moved[i] = math.sqrt(square)
        radius, bow, other = after[at + 7], bows[2 * bar], bows[2 * bar + 1]
        # The flesh is faster than the line within it where the bar turns, and so is what slides
        # within a bar that a joint extends.
        sliding = top[0, bodies[bar] - 1] if robot[bodies[bar] - 1, KIND] == PRISMATIC else 0.0
        rest = (contact + AT_REST) * width - radius * turned - sliding
        if not fast_part(moved[0] + 0.5 * bow, moved[1] + 0.5 * other, rest, share):
            continue
        strays = 0.0
        for i in range(2):
            # Between the two ends of the part it is no greater: convex, and linear.
            s = share[i]
            way, bent = (1.0 - s) * moved[0] + s * moved[1], (1.0 - s) * bow + s * other
            strays = max(strays, 0.5 * way + 0.125 * bent)
        for box in range(m):
            if may_meet(rows, box, bar):
                continue
            needed = radius + strays + grown[box]
            # Also for NaN, which must never count as apart.
            if not (within_distance(middle, at, share[0], share[1], needed, rows, box) > needed):
                return bar * m + box
    return -1


@kernel(int64(POINTS, float64, float64, ARM, BODY, MAT, MAT, OUT_VEC), is_short=True)
def first_blocked(points, begin, contact, arm, body, quartic, cubic, found):
    """
    Return -1 where a motion is proven separate from a moving wearer, else bar * m + box.

    points: `Points` of the motion, of which only what comes after `begin` counts [s]; arm, body:
    `Arm`, `Body`. The rest as for `blocking_box`. found (2,): begin and end of the interval that
    is not proven [s]. Intervals are halved until each is proven; conservative advancement to both
    sides of their middles.
    """
    times, positions, velocities, accelerations = points
    address, robot, bodies = arm
    boxes, allowed, T_arm_base, growths, speeds = body
    chain = as_chain(address)
    n_pieces, dof = positions.shape[0] - 1, positions.shape[1]
    curves, part = np.empty((n_pieces, 6, dof)), np.empty((6, dof))
    rows, grown = np.empty((BOX_ROWS, boxes.shape[0])), np.empty(boxes.shape[0])
    fit(times, positions, velocities, accelerations, curves)
    rows_of(boxes, allowed, T_arm_base, 0.0, rows)
    for i in range(n_pieces):
        length = times[i + 1] - times[i]
        share = min(max(0.0, (begin - times[i]) / length), 1.0)
        n_parts = max(1, math.ceil((1.0 - share) * length / LONGEST_INTERVAL - 1e-9))
        smallest = (1.0 - share) / n_parts / 2.0**HALVINGS
        left = share
        step = (1.0 - share) / n_parts
        # From the first instant to the last: what is left of a halved interval comes next.
        while left < 1.0:
            right = left + step
            if right > 1.0 - 0.5 * smallest:
                right = 1.0
            cut(curves[i], left, right, part)
            t, end = times[i] + left * length, times[i] + right * length
            for box in range(boxes.shape[0]):
                grown[box] = growth_of(growths, speeds, box, end)
            blocking = blocking_box(
                part, end - t, contact, bodies, chain, robot, rows, grown, quartic, cubic
            )
            if blocking >= 0:
                if step <= smallest:
                    found[0], found[1] = t, end
                    return blocking
                step *= 0.5
                continue
            left = right
            # The next one may be wider again.
            step = min(2.0 * step, (1.0 - share) / n_parts)
    return -1


@kernel(void(float64, float64, float64, float64, OUT_VEC), is_inner=True)
def stop_state(v, a, j, t, state):
    """
    Write how far a joint gets, and its velocity, (2,), at a time of a stop.

    v: its velocity when the stop begins; a, j: limits of the stop; t: since then [s].
    """
    peak = min(a, math.sqrt(v * j))
    ramp = peak / j
    hold = max(0.0, v / peak - ramp) if peak > 0.0 else 0.0
    first = min(t, ramp)
    x, w = first * (v - j * first * first / 6.0), v - 0.5 * j * first * first
    if t > ramp:
        second = min(t - ramp, hold)
        x, w = x + second * (w - 0.5 * peak * second), w - peak * second
    if t > ramp + hold:
        third = min(t - ramp - hold, ramp)
        x += third * (w + third * (j * third / 6.0 - 0.5 * peak))
        w += third * (0.5 * j * third - peak)
    state[0], state[1] = x, max(w, 0.0)


@kernel(float64(float64, float64, float64), is_inner=True)
def stop_time(v, a, j):
    """Return how long a joint takes from a velocity to rest, within limits of the stop [s]."""
    return v / a + a / j if v * j >= a * a else 2.0 * math.sqrt(v / j)


@kernel(
    void(OUT_VEC, READ_INTS, int64, MAT, MAT, MAT, MAT, OUT_VEC),
    is_inner=True,
)
def latest_times(points, bodies, dof, robot, rows, growths, speeds, latest):
    """
    Write until when each section of the bars is out of reach of the boxes, (n_bars * SECTIONS,).

    points: the bars at a place; growths, speeds (m, n): lines of the boxes. Below 0: it is within
    a box at time 0 already.
    """
    m, line = rows.shape[1], scratch.floats(6)
    for bar in range(bodies.shape[0]):
        at, radius = BAR_SIZE * bar, points[BAR_SIZE * bar + 7]
        for section in range(SECTIONS):
            latest[SECTIONS * bar + section] = LATEST
        last = LATEST
        for box in range(m):
            if may_meet(rows, box, bar):
                continue
            line_from_box(points, at, rows, box, line)
            # Further from the whole bar it matters to no section.
            if line_gap(line, rows, box) > radius + growth_of(growths, speeds, box, last):
                continue
            last = -1.0
            for section in range(SECTIONS):
                low, high = section / SECTIONS, (section + 1) / SECTIONS
                best = latest[SECTIONS * bar + section]
                # Nearer than this it matters.
                grown = growth_of(growths, speeds, box, best)
                room = part_within(line, low, high, radius + grown, rows, box) - radius
                if room < grown:
                    best = time_until(growths, speeds, box, room)
                    latest[SECTIONS * bar + section] = best
                last = max(last, best)


@kernel(
    boolean(
        *(float64, int64, float64, float64, float64, float64, float64, MAT, MAT),
        *(float64, int64),
    ),
    is_inner=True,
)
def is_rate_safe(rate, place, v, gains, a, j, step, latest, ends, contact, n_bars):
    """
    Return whether a stop that begins at a place, at a rate, would keep clear of a moving wearer.

    v, gains, a, j: of the joint that takes longest to stop, velocity and acceleration at rate 1,
    the latter 0 where it slows down, and the limits of the stop; step: between two places [s];
    latest (n, n_bars * SECTIONS): as from `latest_times`, of the places; ends (n, 2 n_bars): the
    speeds of the bars' ends there at rate 1, with their flesh [m/s]. Of a bar the sections with a
    place faster than `contact` count. An estimate: it knows the motion at these places only.
    """
    state, begin_v = scratch.floats(2), rate * v
    # What accelerates goes on for a while.
    fades = rate * rate * gains / j
    top = begin_v + 0.5 * fades * fades * j
    lasts = stop_time(top, a, j)
    ahead = fades * 0.5 * (begin_v + top)
    n = latest.shape[0]
    for i in range(INSTANTS + 1):
        t = lasts * i / INSTANTS
        stop_state(top, a, j, t, state)
        # How far along the motion, and how fast of what it is.
        where = place + (ahead + state[0]) / max(v, TINY) / step
        share = state[1] / max(v, TINY)
        k = int64(where)
        if k >= n - 1:
            return True
        part = where - k
        for bar in range(n_bars):
            begin, end = ends[k, 2 * bar], ends[k, 2 * bar + 1]
            begin += part * (ends[k + 1, 2 * bar] - begin)
            end += part * (ends[k + 1, 2 * bar + 1] - end)
            if share * begin <= contact and share * end <= contact:
                continue
            for section in range(SECTIONS):
                faster = (section + 1) / SECTIONS if end > begin else section / SECTIONS
                if share * (begin + faster * (end - begin)) <= contact:
                    continue
                until = latest[k, SECTIONS * bar + section]
                after = latest[k + 1, SECTIONS * bar + section]
                if until + part * (after - until) < fades + t:
                    return False
    return True


@kernel(
    void(CUBE, VEC, VEC, int64, float64, LIMITS, LIMITS, float64, ARM, BODY, OUT_MAT),
    is_short=True,
)
def permitted_rates(
    curves, times, places, n_rates, reserve, limits, stop_limits, contact, arm, body, found
):
    """
    Write the greatest rates at some places of a motion from which a stop would keep clear.

    curves (n, 6, dof), times (n + 1,): the motion; places (m,): times within it, evenly spread
    [s], of which the first n_rates are asked for; reserve: how many times a rate must be safe, to
    be permitted; limits, stop_limits: greatest velocities, accelerations and jerks of the motion
    and of a stop, (dof,) each; body: `Body`, its growths those when a stop begins. The rest as for
    `first_blocked`. found (n_rates, 3): the rate, up to 1, and how fast the rate may change there:
    its first and its second derivative that the limits of the motion allow [1/s, 1/s^2]. It makes
    a motion smooth, and proves nothing.
    """
    _, acceleration, jerk = limits
    _, stop_acceleration, stop_jerk = stop_limits
    address, robot, bodies = arm
    boxes, allowed, T_arm_base, growths, speeds = body
    chain = as_chain(address)
    dof, n_bars, m = curves.shape[2], bodies.shape[0], places.shape[0]
    q, nearby, state = np.empty(dof), np.empty(dof), np.empty((4, dof))
    points, other = scratch.floats(ENDS_ROOM), scratch.floats(ENDS_ROOM)
    rows, latest = np.empty((BOX_ROWS, boxes.shape[0])), np.empty((m, n_bars * SECTIONS))
    ends, stops = np.empty((m, 2 * n_bars)), np.empty((m, 4))
    rows_of(boxes, allowed, T_arm_base, 0.0, rows)
    piece, step = 0, places[1] - places[0]
    for i in range(m):
        while piece < curves.shape[0] - 1 and times[piece + 1] <= places[i]:
            piece += 1
        derivatives_on(curves, times, piece, places[i], state)
        slowest, joint, slows, fades = 0.0, 0, math.inf, math.inf
        for k in range(dof):
            v = abs(state[1, k])
            q[k], nearby[k] = state[0, k], state[0, k] + DIFFERENCE_TIME * state[1, k]
            takes = stop_time(v, stop_acceleration[k], stop_jerk[k])
            if takes > slowest:
                slowest, joint = takes, k
            slows = min(slows, acceleration[k] / max(v, SLOW))
            fades = min(fades, jerk[k] / max(v, SLOW))
        if i < n_rates:
            found[i, 1], found[i, 2] = slows, fades
        stops[i, 0] = abs(state[1, joint])
        stops[i, 1] = max(0.0, math.copysign(state[2, joint], state[2, joint] * state[1, joint]))
        stops[i, 2], stops[i, 3] = stop_acceleration[joint], stop_jerk[joint]
        chain(q, 0.0, points, 0)
        chain(nearby, 0.0, other, 0)
        for bar in range(n_bars):
            # As for the proof: the flesh turns with the bar, and some of it slides.
            flesh, last = 0.0, bodies[bar] - 1
            for k in range(bodies[bar]):
                flesh += abs(state[1, k]) if robot[k, KIND] == REVOLUTE else 0.0
            flesh *= points[BAR_SIZE * bar + 7]
            flesh += abs(state[1, last]) if robot[last, KIND] == PRISMATIC else 0.0
            for end in range(2):
                square = 0.0
                for c in range(3):
                    p = BAR_SIZE * bar + 4 * end + c
                    square += (other[p] - points[p]) ** 2
                ends[i, 2 * bar + end] = math.sqrt(square) / DIFFERENCE_TIME + flesh
        latest_times(points, bodies, dof, robot, rows, growths, speeds, latest[i])
    for i in range(n_rates):
        v, gains, a, j = stops[i, 0], stops[i, 1], stops[i, 2], stops[i, 3]
        low, high = 0.0, 1.0
        if is_rate_safe(reserve, i, v, gains, a, j, step, latest, ends, contact, n_bars):
            low = 1.0
        else:
            for _ in range(RATE_HALVINGS):
                middle = 0.5 * (low + high)
                rate = reserve * middle
                if is_rate_safe(rate, i, v, gains, a, j, step, latest, ends, contact, n_bars):
                    low = middle
                else:
                    high = middle
        found[i, 0] = low
