# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How fast a path with rounded corners may be followed, cell by cell."""

import math

from numba.core.types import float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import kernel, MAT, OUT_MAT, OUT_VEC, VEC

# Rows of the limits of the joints, (3, dof).
VELOCITY, ACCELERATION, JERK = 0, 1, 2
# Columns of `cells`: length, and the greatest speed, acceleration and jerk along the path.
LENGTH, TOP, A_MAX, J_MAX = 0, 1, 2, 3
# Share of the limit of jerk that the bend of the path may take up at constant speed, and share of
# what is left of it that acceleration within the bend may take.
BEND_SHARE, A_MAX_SHARE = 1.0, 0.5
# No phase of constant jerk need be shorter: points of a message closer than this are a burden [s].
SHORTEST_RAMP = 5e-4
HALVINGS = 50
MOST_PHASES = 7
# What a change of speed leaves of a stretch, so that rounding does not make it too long.
SPARED = 1e-9
# Share of acceleration and jerk that must be left over for a change of speed.
LEAST_SHARE = 0.02
# Directions that differ by no more are one.
ROUNDING = 1e-9


@kernel(float64(float64, float64, float64))
def ramp_time(change, a_max, j_max):
    """Return how long a change of speed takes, from and to constant speed [s]."""
    if change <= a_max * a_max / j_max:
        return 2.0 * math.sqrt(change / j_max)
    return change / a_max + a_max / j_max


@kernel(float64(float64, float64, float64, float64, float64))
def reachable_speed(speed, length, top, a_max, j_max):
    """Return the greatest speed up to `top` that a stretch leaves room to change to."""
    low, high = speed, max(speed, top)
    if 0.5 * (speed + high) * ramp_time(high - speed, a_max, j_max) <= length:
        return high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if 0.5 * (speed + middle) * ramp_time(middle - speed, a_max, j_max) <= length:
            low = middle
        else:
            high = middle
    return low


@kernel(float64(float64, float64, float64, float64, float64, float64))
def peak_speed(v_from, v_to, length, top, a_max, j_max):
    """Return the greatest speed up to `top` that a stretch between two speeds has room for."""
    low, high = max(v_from, v_to), max(v_from, v_to, top)
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


@kernel(int64(float64, float64, float64, float64, OUT_MAT, int64))
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
def stretch_phases(v_from, v_to, cell, phases):
    """
    Write how a cell is passed as fast as its limits allow; return the number of phases.

    phases (7, 2): duration [s] and jerk along the path. Up to the greatest speed that there is
    room for, on at that, and down again: from constant speed to constant speed that is the fastest
    profile (Berscheid and Kroeger 2021, where it is a case of many).
    """
    length, top, a_max, j_max = cell[LENGTH], cell[TOP], cell[A_MAX], cell[J_MAX]
    if a_max == 0.0:
        phases[0, 0] = length / v_from if v_from > 0.0 else math.inf
        phases[0, 1] = 0.0
        return 1
    peak = peak_speed(v_from, v_to, length, top, a_max, j_max)
    up, down = ramp_time(peak - v_from, a_max, j_max), ramp_time(peak - v_to, a_max, j_max)
    ramps = 0.5 * ((v_from + peak) * up + (v_to + peak) * down)
    n = ramp(v_from, peak, a_max, j_max, phases, 0)
    phases[n, 0] = max(0.0, length - ramps) / peak if peak > 0.0 else math.inf
    phases[n, 1] = 0.0
    return ramp(peak, v_to, a_max, j_max, phases, n + 1)


@kernel(void(MAT, MAT, int64, VEC, OUT_MAT))
def bound_bends(directions, turns, row, place, bends):
    """
    Write bounds of the derivatives of the path by its length within a cell, (3, dof).

    place (3,): begin and end of the cell as shares of its segment, and the segment's length. The
    direction turns from u to u + turn by the smooth step w(x) = 3 x^2 - 2 x^3, which is monotone.
    """
    begin, end, width = place[0], place[1], place[2]
    w_begin, w_end = begin * begin * (3 - 2 * begin), end * end * (3 - 2 * end)
    slope = max(6 * begin * (1 - begin), 6 * end * (1 - end))
    if begin < 0.5 < end:
        slope = 1.5
    steep = max(abs(6 - 12 * begin), abs(6 - 12 * end))
    for k in range(directions.shape[1]):
        u, turn = directions[row, k], turns[row, k]
        bends[0, k] = max(abs(u + turn * w_begin), abs(u + turn * w_end))
        bends[1, k] = abs(turn) * slope / width
        bends[2, k] = abs(turn) * steep / (width * width)


@kernel(float64(MAT, MAT))
def constant_speed(bends, limits):
    """Return the greatest constant speed through a cell that holds all limits [rad/s]."""
    speed = math.inf
    for k in range(bends.shape[1]):
        if bends[0, k] > 0.0:
            speed = min(speed, limits[VELOCITY, k] / bends[0, k])
        if bends[1, k] > 0.0:
            speed = min(speed, math.sqrt(limits[ACCELERATION, k] / bends[1, k]))
        if bends[2, k] > 0.0:
            speed = min(speed, (BEND_SHARE * limits[JERK, k] / bends[2, k]) ** (1.0 / 3.0))
    return speed


@kernel(float64(MAT, MAT, float64, float64, float64))
def slowed_square(bends, limits, length, square, cap):
    """
    Return the greatest square of the speed from which a cell leaves room to slow down to another.

    The acceleration a = (x_from - x_to) / (2 length) is constant and, with what the bend takes at
    the greater speed, within the limits: |q'| a + |q''| x_from <= A for each joint (Pham 2014,
    equation 3, for all of the cell at once).
    """
    most = cap
    for k in range(bends.shape[1]):
        pull = bends[0, k] / (2.0 * length)
        weight = bends[1, k] + pull
        if weight > 0.0:
            most = min(most, (limits[ACCELERATION, k] + pull * square) / weight)
    return most


@kernel(void(MAT, MAT, float64, OUT_VEC))
def grip_at(bends, limits, speed, cell):
    """Write the acceleration and jerk along the path that a cell allows up to a speed."""
    a_max, j_max = math.inf, math.inf
    for k in range(bends.shape[1]):
        left = limits[JERK, k] - bends[2, k] * speed**3
        if bends[0, k] > 0.0:
            a_max = min(
                a_max, (limits[ACCELERATION, k] - bends[1, k] * speed * speed) / bends[0, k]
            )
        if bends[1, k] * speed > 0.0:
            a_max = min(a_max, A_MAX_SHARE * left / (3.0 * bends[1, k] * speed))
    straight_a_max, straight_j_max = math.inf, math.inf
    for k in range(bends.shape[1]):
        left = limits[JERK, k] - bends[2, k] * speed**3 - 3.0 * bends[1, k] * speed * a_max
        if bends[0, k] > 0.0:
            j_max = min(j_max, left / bends[0, k])
            straight_a_max = min(straight_a_max, limits[ACCELERATION, k] / bends[0, k])
            straight_j_max = min(straight_j_max, limits[JERK, k] / bends[0, k])
    # Next to nothing left is rounding: such a cell is passed at constant speed.
    has_room = a_max > LEAST_SHARE * straight_a_max and j_max > LEAST_SHARE * straight_j_max
    cell[A_MAX] = a_max if has_room else 0.0
    cell[J_MAX] = min(j_max, a_max / SHORTEST_RAMP) if has_room else 0.0


@kernel(float64(float64, float64, VEC))
def ramped(speed, other, cell):
    """Return the greatest speed up to `speed` that the cell can change to, or from, the other."""
    if speed <= other or cell[A_MAX] == 0.0:
        return min(speed, other)
    length = (1.0 - SPARED) * cell[LENGTH]
    return reachable_speed(other, length, speed, cell[A_MAX], cell[J_MAX])


@kernel(float64(MAT, MAT, MAT, MAT, float64, OUT_MAT, OUT_VEC))
def cell_speeds(directions, turns, places, limits, v_start, cells, speeds):
    """
    Write what each cell allows and the speed at each knot between cells; return the duration.

    The greatest speeds from which constant accelerations lead on, backwards and forwards, as in
    time-optimal path parameterization by reachability (Pham and Pham 2018), with bounds over whole
    cells in place of points; then the same with ramps of limited jerk, from and to constant speed
    at the knots.

    Parameters
    ----------
    directions, turns : array, shape (n, dof)
        Of the segment of each cell: direction at its begin, and by what it turns until its end.
    places : array, shape (n, 3)
        As `place` of `bound_bends`.
    limits : array, shape (3, dof)
        Velocity, acceleration, jerk.
    v_start : float
        Speed at the first knot [rad/s].
    cells : array, shape (n, 4)
        Written: length [rad], and greatest speed, acceleration and jerk along the path.
    speeds : array, shape (n + 1,)
        Written [rad/s].

    Returns
    -------
    float
        [s]; infinity where the arm cannot slow down in time from `v_start`.

    """
    n, dof = directions.shape
    bends = np.empty((3, dof))
    squares = np.empty(n + 1)
    squares[0], squares[n] = v_start * v_start, 0.0
    for k in range(1, n):
        squares[k] = math.inf
    for i in range(n):
        bound_bends(directions, turns, i, places[i], bends)
        cells[i, LENGTH] = (places[i, 1] - places[i, 0]) * places[i, 2]
        cells[i, TOP] = constant_speed(bends, limits)
        if i == 0:
            # The present speed is what it is.
            cells[i, TOP] = max(cells[i, TOP], v_start)
        square = cells[i, TOP] * cells[i, TOP]
        squares[i] = min(squares[i], square)
        for k in range(dof):
            # A corner that no blend rounds.
            jump = directions[i, k] - directions[i - 1, k] - turns[i - 1, k]
            if i > 0 and places[i, 0] == 0.0 and abs(jump) > ROUNDING:
                squares[i] = 0.0
        squares[i + 1] = min(squares[i + 1], square)
    for i in range(n - 1, -1, -1):
        bound_bends(directions, turns, i, places[i], bends)
        squares[i] = slowed_square(bends, limits, cells[i, LENGTH], squares[i + 1], squares[i])
    for i in range(n):
        bound_bends(directions, turns, i, places[i], bends)
        squares[i + 1] = slowed_square(bends, limits, cells[i, LENGTH], squares[i], squares[i + 1])
        # Within a bend no faster than at its knots, where the acceleration was reckoned with.
        if bends[1].max() > 0.0:
            cells[i, TOP] = math.sqrt(max(squares[i], squares[i + 1]))
        grip_at(bends, limits, cells[i, TOP], cells[i])
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
        for row in range(stretch_phases(speeds[i], speeds[i + 1], cells[i], phases)):
            duration += phases[row, 0]
    return duration


@kernel(int64(MAT, VEC, OUT_MAT))
def knots(cells, speeds, rows):
    """
    Write the ends of all phases of constant jerk; return their number.

    rows (7 n, 5): time [s], cell, way into it, speed and acceleration along the path.
    """
    phases = np.empty((MOST_PHASES, 2))
    n, now = 0, 0.0
    for i in range(cells.shape[0]):
        s, v, a = 0.0, speeds[i], 0.0
        for row in range(stretch_phases(speeds[i], speeds[i + 1], cells[i], phases)):
            t, j = phases[row, 0], phases[row, 1]
            if t > 0.0:
                now += t
                s += t * (v + t * (0.5 * a + t * j / 6.0))
                v += t * (a + 0.5 * t * j)
                a += t * j
                rows[n, 0], rows[n, 1], rows[n, 2], rows[n, 3], rows[n, 4] = now, i, s, v, a
                n += 1
        # Without the rounding of the sums.
        rows[n - 1, 2], rows[n - 1, 3], rows[n - 1, 4] = cells[i, LENGTH], speeds[i + 1], 0.0
    return n
