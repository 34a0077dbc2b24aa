# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A stop along a motion as points of a trajectory, and the check of its limits and path."""

import math

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import CUBE, kernel, MAT, OUT_CUBE, OUT_VEC, READ_INTS, VEC
from rrth_planner.kernels.trajectory.lookahead import derivatives_on, S, TIME, time_after
from rrth_planner.kernels.trajectory.stop_search import A, J, LASTS, stop_s, V, X
from rrth_planner.kernels.vectors import sort

# Points of a stop are no further apart, where that keeps it on its path, and no closer [s]:
# between close points the jerk is mostly rounding, and between distant ones a jump of the jerk
# without a point is displaced.
SPACINGS, CLOSEST, CLOSEST_FIRST = (0.05, 0.0125, 0.003125), 5e-5, 1e-5
# Of a spacing: phases often last a multiple of one, and must not be cut anew by their rounding.
EVEN = 1e-6
# Samples of a piece, as shares of it, at which a stop is compared with its path; tolerance of each
# joint there [rad], so that it is nowhere further than 1e-4 rad.
SHARES, OFF_PATH = (0.25, 0.5, 0.75), 8e-5
# Messages carry whole nanoseconds [s].
TICK = 1e-9
# Bisections of a phase to find the time at which a stop passes a value of s.
HALVINGS = 45
# Samples of a piece at which limits are checked, factor of what may be missed between them, and
# allowed factor of speed: less than 1 % of its acceleration and jerk.
INSTANTS, ALLOWED, WITHIN = 17, 1.002, 1.0025
# Rounding of a jerk times the cube of the time between two points, relative to a position.
ROUNDING = 300 * 2.3e-16


@kernel(float64(MAT, float64), is_inner=True)
def passing_time(phases, s):
    """Return the time since the begin of a stop at which it passes s, before its end [s]."""
    before = 0.0
    for p in range(3):
        x, v, a, j = phases[p, X], phases[p, V], phases[p, A], phases[p, J]
        low, high = 0.0, phases[p, LASTS]
        if p == 2 or x + high * (v + high * (0.5 * a + high * j / 6.0)) >= s:
            for _ in range(HALVINGS):
                t = 0.5 * (low + high)
                if x + t * (v + t * (0.5 * a + t * j / 6.0)) < s:
                    low = t
                else:
                    high = t
            return before + high
        before += high
    return before


@kernel(int64(MAT, READ_INTS, MAT, int64, float64, OUT_VEC), is_inner=True)
def stop_times(rows, pieces, phases, begin, spacing, points):
    """Write the times of the points of a stop that begins with a row, since the first row [s]."""
    marks, m, now = np.empty(rows.shape[0] + 5), 1, rows[0, TIME]
    marks[0] = 0.0
    start, end = rows[begin, TIME] - now, stop_s(phases)
    after = start
    for p in range(3):
        marks[m], m = after, m + 1
        after += phases[p, LASTS]
    row = 1
    # Between two pieces of the motion the jerk jumps.
    while row < pieces.shape[0] and (row <= begin or rows[row, S] < end):
        if pieces[row] != pieces[row - 1]:
            if row <= begin:
                marks[m] = rows[row, TIME] - now
            else:
                marks[m] = start + passing_time(phases, rows[row, S])
            m += 1
        row += 1
    sort(marks, m)
    points[0], n, kept = 0.0, 1, 0.0
    for i in range(1, m + 1):
        mark = marks[i] if i < m else after
        is_close = mark - kept < (CLOSEST_FIRST if kept == 0.0 else CLOSEST)
        if i < m and (is_close or after - mark < CLOSEST):
            continue
        parts = 1 if mark <= start else max(1, math.ceil((mark - kept) / spacing - EVEN))
        for part in range(1, parts + 1):
            points[n] = math.ceil((kept + (mark - kept) * part / parts) / TICK) * TICK
            n += 1
        kept = mark
    return n


@kernel(void(CUBE, VEC, MAT, READ_INTS, MAT, int64, MAT, VEC, OUT_CUBE), is_inner=True)
def stop_states(curves, times, rows, pieces, phases, begin, limits, points, out):
    """Write position, velocity and acceleration at all points of a stop, (3, n, dof)."""
    n, dof = points.shape[0], curves.shape[2]
    states, cell, phase = np.empty((4, dof)), 0, 0
    start, now = rows[begin, TIME] - rows[0, TIME], rows[0, TIME]
    phase_begin = start
    # Skip a piece that ends immediately.
    while rows[cell + 1, TIME] - now < CLOSEST_FIRST:
        cell += 1
    for i in range(n):
        ratio, ratio_dot = 1.0, 0.0
        if points[i] <= start:
            time = now + points[i]
            while cell < begin and rows[cell + 1, TIME] <= time:
                cell += 1
            derivatives_on(curves, times, pieces[cell], time, states)
        else:
            while phase < 2 and points[i] >= phase_begin + phases[phase, LASTS]:
                phase_begin += phases[phase, LASTS]
                phase += 1
            t = min(points[i] - phase_begin, phases[phase, LASTS])
            v0, a0, j = phases[phase, V], phases[phase, A], phases[phase, J]
            x = phases[phase, X] + t * (v0 + t * (0.5 * a0 + t * j / 6.0))
            while cell < pieces.shape[0] - 1 and (cell < begin or rows[cell + 1, S] <= x):
                cell += 1
            begins, ends = rows[cell, TIME], rows[cell + 1, TIME]
            time = time_after(curves, times, pieces[cell], begins, ends, x - rows[cell, S], limits)
            derivatives_on(curves, times, pieces[cell], time, states)
            vv, va = 0.0, 0.0
            for k in range(dof):
                vv += (states[1, k] / limits[1, k]) ** 2
                va += states[1, k] * states[2, k] / limits[1, k] ** 2
            w = math.sqrt(vv)
            ratio = (v0 + t * (a0 + 0.5 * t * j)) / w
            ratio_dot = (a0 + t * j - va / w * ratio * ratio) / w
        if i == n - 1:
            ratio, ratio_dot = 0.0, 0.0
        for k in range(dof):
            out[0, i, k], out[1, i, k] = states[0, k], states[1, k] * ratio
            out[2, i, k] = states[2, k] * ratio * ratio + states[1, k] * ratio_dot


@kernel(boolean(VEC, CUBE, float64, MAT), is_inner=True)
def is_within(points, stop, begin, most):
    """
    Return whether the pieces of a stop that end after `begin` keep limits, (3, dof).

    As `parameterization.limit_ratio`: between two of the instants, h apart, a function f is no
    greater than there by more than h^2 / 8 max|f''|.
    """
    between = 0.125 / (INSTANTS - 1) ** 2
    for i in range(points.shape[0] - 1):
        if points[i + 1] <= begin + TICK:
            continue
        T = points[i + 1] - points[i]
        for k in range(most.shape[1]):
            c0, c1, c2 = stop[i, 0, k], stop[i, 1, k], stop[i, 2, k]
            c3, c4, c5 = stop[i, 3, k], stop[i, 4, k], stop[i, 5, k]
            # Rounding of positions in a piece so short.
            noise = ROUNDING * abs(c0)
            top = most[0, k] * ALLOWED * WITHIN * T - between * (
                6 * abs(c3) + 24 * abs(c4) + 60 * abs(c5)
            )
            a_max = most[1, k] * ALLOWED * WITHIN**2 * T**2 - between * (
                24 * abs(c4) + 120 * abs(c5)
            )
            j_max = most[2, k] * ALLOWED * WITHIN**3 * T**3 + noise - between * 120 * abs(c5)
            for instant in range(INSTANTS):
                u = instant / (INSTANTS - 1)
                if not abs((((5 * c5 * u + 4 * c4) * u + 3 * c3) * u + 2 * c2) * u + c1) <= top:
                    return False
                if not abs(((20 * c5 * u + 12 * c4) * u + 6 * c3) * u + 2 * c2) <= a_max:
                    return False
                if not abs((60 * c5 * u + 24 * c4) * u + 6 * c3) <= j_max:
                    return False
    return True


@kernel(boolean(CUBE, VEC, MAT, READ_INTS, MAT, int64, MAT, VEC, CUBE), is_inner=True)
def is_on_path(curves, times, rows, pieces, phases, begin, limits, points, stop):
    """
    Return whether a stop, in pieces (n - 1, 6, dof) between its points (n,), stays on its path.

    At each sample no joint is further from the path of the stop than `OFF_PATH`.
    """
    n_pieces, _, dof = stop.shape
    n = len(SHARES)
    asked, exact = np.empty(n * n_pieces + 1), np.empty((3, n * n_pieces + 1, dof))
    for i in range(n_pieces):
        for k in range(n):
            asked[n * i + k] = points[i] + SHARES[k] * (points[i + 1] - points[i])
    # The last time is taken as the end, where the stop is at rest.
    asked[n * n_pieces] = points[n_pieces]
    stop_states(curves, times, rows, pieces, phases, begin, limits, asked, exact)
    for m in range(n * n_pieces):
        i, u = m // n, SHARES[m % n]
        for k in range(dof):
            c0, c1, c2 = stop[i, 0, k], stop[i, 1, k], stop[i, 2, k]
            c3, c4, c5 = stop[i, 3, k], stop[i, 4, k], stop[i, 5, k]
            q = c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
            if not abs(q - exact[0, m, k]) <= OFF_PATH:
                return False
    return True
