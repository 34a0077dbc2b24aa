# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The speed profile of a path with corner blends, cell by cell."""

import math

from numba.core.types import float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import kernel, MAT, OUT_MAT, OUT_VEC, VEC

# Rows of the limits of the joints, (3, dof).
VELOCITY, ACCELERATION, JERK = 0, 1, 2
# Columns of `places`: begin and end of a cell as shares of its segment, the segment's length, and
# its row.
BEGIN, END, WIDTH, SEGMENT = 0, 1, 2, 3
# Columns of `cells`: length, and the greatest speed, acceleration and jerk along the path.
LENGTH, V_MAX, A_MAX, J_MAX = 0, 1, 2, 3
# Share of the limit of jerk for the curvature of the path at constant speed, and share of the
# remainder for acceleration within a blend.
CURVATURE_SHARE, A_MAX_SHARE = 1.0, 0.5
# No phase of constant jerk need be shorter: closer points only enlarge a message [s].
SHORTEST_RAMP = 5e-4
HALVINGS = 50
MOST_PHASES = 7
# Share of a cell that a change of speed leaves unused, as a reserve for rounding.
SPARED = 1e-9
# Least share of acceleration and jerk that allows a change of speed.
LEAST_SHARE = 0.02
# Directions that differ by no more are equal.
ROUNDING = 1e-9


@kernel(float64(float64, float64, float64))
def ramp_time(change, a_max, j_max):
    """Return the duration of a change of speed, from and to constant speed [s]."""
    if change <= a_max * a_max / j_max:
        return 2.0 * math.sqrt(change / j_max)
    return change / a_max + a_max / j_max


@kernel(float64(float64, float64, float64, float64, float64))
def reachable_speed(speed, length, v_max, a_max, j_max):
    """Return the greatest speed up to `v_max` that a cell is long enough to change to."""
    low, high = speed, max(speed, v_max)
    if 0.5 * (speed + high) * ramp_time(high - speed, a_max, j_max) <= length:
        return high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if 0.5 * (speed + middle) * ramp_time(middle - speed, a_max, j_max) <= length:
            low = middle
        else:
            high = middle
    return low


@kernel(float64(float64, float64, float64, float64, float64, float64), is_inner=True)
def peak_speed(v_from, v_to, length, v_max, a_max, j_max):
    """Return the greatest speed up to `v_max` within a cell, between the speeds at its ends."""
    low, high = max(v_from, v_to), max(v_from, v_to, v_max)
    peak = high
    for _ in range(HALVINGS):
        up, down = ramp_time(peak - v_from, a_max, j_max), ramp_time(peak - v_to, a_max, j_max)
        if 0.5 * ((v_from + peak) * up + (v_to + peak) * down) <= length:
            low = peak
            if peak == high:
                break
        else:
            high = peak
        peak = 0.5 * (low + high)
    return low


@kernel(int64(float64, float64, float64, float64, OUT_MAT, int64), is_inner=True)
def ramp(v_from, v_to, a_max, j_max, phases, n):
    """Write the phases of constant jerk of a change of speed as rows n, ...; return the next."""
    change, sign = abs(v_to - v_from), 1.0 if v_to > v_from else -1.0
    if change == 0.0:
        return n
    first, held = math.sqrt(change / j_max), 0.0
    if change > a_max * a_max / j_max:
        first, held = a_max / j_max, change / a_max - a_max / j_max
    phases[n, 0], phases[n, 1] = first, sign * j_max
    phases[n + 1, 0], phases[n + 1, 1] = held, 0.0
    phases[n + 2, 0], phases[n + 2, 1] = first, -sign * j_max
    return n + 3


@kernel(int64(float64, float64, VEC, OUT_MAT))
def cell_phases(v_from, v_to, cell, phases):
    """
    Write the time-optimal profile of a cell within its limits; return the number of phases.

    phases (7, 2): duration [s] and jerk along the path. Up to the greatest possible
    speed, constant, and down again: from constant speed to constant speed that is the fastest
    profile (Berscheid and Kroeger 2021, where it is a case of many).
    """
    length, v_max, a_max, j_max = cell[LENGTH], cell[V_MAX], cell[A_MAX], cell[J_MAX]
    if a_max == 0.0:
        phases[0, 0] = length / v_from if v_from > 0.0 else math.inf
        phases[0, 1] = 0.0
        return 1
    peak = peak_speed(v_from, v_to, length, v_max, a_max, j_max)
    up, down = ramp_time(peak - v_from, a_max, j_max), ramp_time(peak - v_to, a_max, j_max)
    ramps = 0.5 * ((v_from + peak) * up + (v_to + peak) * down)
    n = ramp(v_from, peak, a_max, j_max, phases, 0)
    phases[n, 0] = max(0.0, length - ramps) / peak if peak > 0.0 else math.inf
    phases[n, 1] = 0.0
    return ramp(peak, v_to, a_max, j_max, phases, n + 1)


@kernel(void(MAT, MAT, int64, VEC, OUT_MAT), is_inner=True)
def bound_derivatives(directions, turns, row, place, q_s):
    """
    Write bounds of the derivatives of the path by its length within a cell, (3, dof).

    place (4,): of the cell, in a segment of this row. The direction turns from u to u + turn by
    the smooth step w(x) = 3 x^2 - 2 x^3, which is monotone.
    """
    begin, end, width = place[BEGIN], place[END], place[WIDTH]
    w_begin, w_end = begin * begin * (3 - 2 * begin), end * end * (3 - 2 * end)
    w_dot = max(6 * begin * (1 - begin), 6 * end * (1 - end))
    if begin < 0.5 < end:
        w_dot = 1.5
    w_ddot = max(abs(6 - 12 * begin), abs(6 - 12 * end))
    for k in range(directions.shape[1]):
        u, turn = directions[row, k], turns[row, k]
        q_s[0, k] = max(abs(u + turn * w_begin), abs(u + turn * w_end))
        q_s[1, k] = abs(turn) * w_dot / width
        q_s[2, k] = abs(turn) * w_ddot / (width * width)


@kernel(float64(MAT, MAT), is_inner=True)
def constant_speed(q_s, limits):
    """Return the greatest constant speed through a cell that holds all limits [rad/s]."""
    speed = math.inf
    for k in range(q_s.shape[1]):
        if q_s[0, k] > 0.0:
            speed = min(speed, limits[VELOCITY, k] / q_s[0, k])
        if q_s[1, k] > 0.0:
            speed = min(speed, math.sqrt(limits[ACCELERATION, k] / q_s[1, k]))
        if q_s[2, k] > 0.0:
            speed = min(speed, (CURVATURE_SHARE * limits[JERK, k] / q_s[2, k]) ** (1.0 / 3.0))
    return speed


@kernel(float64(MAT, MAT, float64, float64, float64), is_inner=True)
def slowed_square(q_s, limits, length, square, cap):
    """
    Return the greatest squared speed from which a cell allows to slow down to another one.

    The acceleration a = (x_from - x_to) / (2 length) is constant and, with the curvature term at
    the greater speed, within the limits: |q'| a + |q''| x_from <= A for each joint (Pham 2014,
    equation 3, for all of the cell at once).
    """
    most = cap
    for k in range(q_s.shape[1]):
        tangent = q_s[0, k] / (2.0 * length)
        weight = q_s[1, k] + tangent
        if weight > 0.0:
            most = min(most, (limits[ACCELERATION, k] + tangent * square) / weight)
    return most


@kernel(void(MAT, MAT, float64, OUT_VEC), is_inner=True)
def path_limits(q_s, limits, speed, cell):
    """Write a_max and j_max along the path, as a cell allows them up to a speed."""
    a_max, j_max = math.inf, math.inf
    for k in range(q_s.shape[1]):
        left = limits[JERK, k] - q_s[2, k] * speed**3
        if q_s[0, k] > 0.0:
            most = limits[ACCELERATION, k] - q_s[1, k] * speed * speed
            a_max = min(a_max, most / q_s[0, k])
        if q_s[1, k] * speed > 0.0:
            a_max = min(a_max, A_MAX_SHARE * left / (3.0 * q_s[1, k] * speed))
    straight_a_max, straight_j_max = math.inf, math.inf
    for k in range(q_s.shape[1]):
        left = limits[JERK, k] - q_s[2, k] * speed**3 - 3.0 * q_s[1, k] * speed * a_max
        if q_s[0, k] > 0.0:
            j_max = min(j_max, left / q_s[0, k])
            straight_a_max = min(straight_a_max, limits[ACCELERATION, k] / q_s[0, k])
            straight_j_max = min(straight_j_max, limits[JERK, k] / q_s[0, k])
    # A remainder of the size of rounding: such a cell is passed at constant speed.
    has_room = a_max > LEAST_SHARE * straight_a_max and j_max > LEAST_SHARE * straight_j_max
    cell[A_MAX] = a_max if has_room else 0.0
    cell[J_MAX] = min(j_max, a_max / SHORTEST_RAMP) if has_room else 0.0


@kernel(float64(float64, float64, VEC), is_inner=True)
def ramped(speed, other, cell):
    """Return the greatest speed up to `speed` that a cell can change to, or from, `other`."""
    if speed <= other or cell[A_MAX] == 0.0:
        return min(speed, other)
    length = (1.0 - SPARED) * cell[LENGTH]
    return reachable_speed(other, length, speed, cell[A_MAX], cell[J_MAX])


@kernel(float64(MAT, MAT, MAT, MAT, float64, OUT_MAT, OUT_VEC), is_inner=True)
def cell_speeds(directions, turns, places, limits, v_start, cells, speeds):
    """
    Write the limits of each cell and the speed at each knot between cells; return the duration.

    The greatest speeds from which constant accelerations lead on, backwards and forwards, as in
    time-optimal path parameterization by reachability (Pham and Pham 2018), with bounds over whole
    cells in place of points; then the same with ramps of limited jerk, from and to constant speed
    at the knots. The duration is infinite where the arm cannot slow down in time from `v_start`.

    directions, turns (m, dof): the direction at the begin of each segment, and the change of
    direction to its end; places (n, 4): of each cell; limits (3, dof): velocity, acceleration,
    jerk; v_start: speed at the first knot [rad/s]. cells (n, 4) are written in rad, and speeds
    (n + 1,) [rad/s].
    """
    n, dof = places.shape[0], directions.shape[1]
    q_s, squares = np.empty((3, dof)), np.empty(n + 1)
    squares[:] = math.inf
    squares[0], squares[n] = v_start * v_start, 0.0
    for i in range(n):
        row = int(places[i, SEGMENT])
        bound_derivatives(directions, turns, row, places[i], q_s)
        cells[i, LENGTH] = (places[i, END] - places[i, BEGIN]) * places[i, WIDTH]
        cells[i, V_MAX] = constant_speed(q_s, limits)
        if i == 0:
            # The present speed is given.
            cells[i, V_MAX] = max(cells[i, V_MAX], v_start)
        square = cells[i, V_MAX] * cells[i, V_MAX]
        squares[i] = min(squares[i], square)
        for k in range(dof):
            # A corner without a blend.
            if row > 0 and places[i, BEGIN] == 0.0:
                jump = directions[row, k] - directions[row - 1, k] - turns[row - 1, k]
                if abs(jump) > ROUNDING:
                    squares[i] = 0.0
        squares[i + 1] = min(squares[i + 1], square)
    for i in range(n - 1, -1, -1):
        bound_derivatives(directions, turns, int(places[i, SEGMENT]), places[i], q_s)
        squares[i] = slowed_square(q_s, limits, cells[i, LENGTH], squares[i + 1], squares[i])
    for i in range(n):
        bound_derivatives(directions, turns, int(places[i, SEGMENT]), places[i], q_s)
        squares[i + 1] = slowed_square(q_s, limits, cells[i, LENGTH], squares[i], squares[i + 1])
        bend = 0.0
        for k in range(dof):
            bend = max(bend, q_s[1, k])
        # Within a blend no faster than at its knots, for which the acceleration was bounded.
        if bend > 0.0:
            cells[i, V_MAX] = math.sqrt(max(squares[i], squares[i + 1]))
        path_limits(q_s, limits, cells[i, V_MAX], cells[i])
        speeds[i] = math.sqrt(squares[i])
    speeds[n] = 0.0
    for i in range(n - 1, -1, -1):
        speeds[i] = ramped(speeds[i], speeds[i + 1], cells[i])
    if speeds[0] < v_start:
        return math.inf
    speeds[0] = v_start
    duration = 0.0
    phases = np.empty((MOST_PHASES, 2))
    for i in range(n):
        speeds[i + 1] = ramped(speeds[i + 1], speeds[i], cells[i])
        for row in range(cell_phases(speeds[i], speeds[i + 1], cells[i], phases)):
            duration += phases[row, 0]
    return duration


@kernel(int64(MAT, VEC, OUT_MAT), is_inner=True)
def knots(cells, speeds, rows):
    """
    Write the ends of all phases of constant jerk; return their number.

    rows (7 n, 5): time [s], cell, s within it, s_dot and s_ddot.
    """
    phases = np.empty((MOST_PHASES, 2))
    n, now = 0, 0.0
    for i in range(cells.shape[0]):
        s, v, a = 0.0, speeds[i], 0.0
        for row in range(cell_phases(speeds[i], speeds[i + 1], cells[i], phases)):
            t, j = phases[row, 0], phases[row, 1]
            if t > 0.0:
                now += t
                s += t * (v + t * (0.5 * a + t * j / 6.0))
                v += t * (a + 0.5 * t * j)
                a += t * j
                rows[n, 0], rows[n, 1], rows[n, 2], rows[n, 3], rows[n, 4] = now, i, s, v, a
                n += 1
        # Exact, without the rounding of the sums.
        rows[n - 1, 2], rows[n - 1, 3], rows[n - 1, 4] = cells[i, LENGTH], speeds[i + 1], 0.0
    return n
