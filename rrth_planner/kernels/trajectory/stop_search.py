# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Stops along the path ahead, the soonest of many: a grid search, then a local one.

A stop has three phases: jerk to a deceleration, constant deceleration, jerk to rest.
"""

import math

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import CUBES, kernel, MAT, OUT_MAT, OUT_VEC, READ_INTS
from rrth_planner.kernels.trajectory import lookahead
from rrth_planner.kernels.trajectory.lookahead import BEGIN, END, MOST, S, S_DDOT, S_DOT, TIME
from rrth_planner.kernels.vectors import copy

# Columns of `phases`, (3, 5): duration [s]; s, s_dot and s_ddot at the begin [-, 1/s, 1/s^2], and
# s_dddot [1/s^3].
LASTS, X, V, A, J = range(5)
# Greatest spacing of the samples of a phase at which limits are checked [s]; least number.
INSTANT, FEWEST = 0.012, 5
# The grid: decelerations and jerks as shares of their limits along the path; and the spacing of
# the delays, and of those that end at a point of the motion [s].
DECELERATIONS = (1.0, 0.9, 0.8, 0.7, 0.55, 0.4, 0.25, 0.12)
JERKS = (1.0, 0.9, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1)
DELAY, DELAY_TO_POINT = 0.025, 0.01
# The local search, twice: changes of the delay in cells, and factors of the shares: of both, of
# one of them, or of one up and the other down.
ROUNDS, CELLS_NEAR, FACTORS = 2, (4, -4, 2, -2, 1, -1), (1.15, 1.07, 1.03, 1.01)
POWERS = ((1, 1), (0, 1), (1, 0), (-1, 1), (1, -1))
# Entries of `best`: its end [s], the row that it begins with, shares of deceleration and jerk; and
# the end of the stop that was tried last.
ENDS, ROW, DECELERATION, JERK, TRIED = range(5)
# What every stop that is tried needs: all but its row and shares.
STOP_TYPES = (MAT, CUBES, READ_INTS, int64, MAT, float64, OUT_VEC, OUT_MAT, OUT_MAT)


@kernel(float64(float64, float64, float64, float64, float64, OUT_MAT))
def line_stop(s, s_dot, s_ddot, deceleration, jerk, phases):
    """Write the soonest stop from a state on a line; return its duration [s], inf for none."""
    # Where the motion already slows down faster, the stop continues at that deceleration.
    held = max(deceleration, -s_ddot)
    peak = min(math.sqrt(jerk * s_dot + 0.5 * s_ddot * s_ddot), held)
    ramp = (s_ddot + peak) / jerk
    # Not where the jerk to rest needs more than the present s_dot.
    if not (ramp >= 0.0 and peak > 0.0 and s_dot >= 0.5 * s_ddot * min(s_ddot, 0.0) / jerk):
        return math.inf
    hold = max((s_dot + (0.5 * s_ddot * s_ddot - peak * peak) / jerk) / peak, 0.0)
    last = peak / jerk
    phases[0, LASTS], phases[1, LASTS], phases[2, LASTS] = ramp, hold, last
    phases[0, X], phases[0, V], phases[0, A], phases[0, J] = s, s_dot, s_ddot, -jerk
    phases[1, X] = s + ramp * (s_dot + ramp * (0.5 * s_ddot - jerk * ramp / 6.0))
    phases[1, V] = s_dot + ramp * (s_ddot - 0.5 * jerk * ramp)
    phases[2, V] = 0.5 * peak * last
    phases[2, X] = phases[1, X] + 0.5 * hold * (phases[1, V] + phases[2, V])
    phases[1, A], phases[1, J], phases[2, A], phases[2, J] = -peak, 0.0, -peak, jerk
    return ramp + hold + last


@kernel(float64(MAT))
def stop_s(phases):
    """Return s at the end of a stop [-]."""
    t = phases[2, LASTS]
    return phases[2, X] + t * (phases[2, V] + t * (0.5 * phases[2, A] + t * phases[2, J] / 6.0))


@kernel(boolean(CUBES, int64, int64, float64, float64, float64, float64, float64), is_inner=True)
def keeps_limits_at(geometry, cell, last, share, v, a, j, reserve):
    """Return whether s_dot, s_ddot and s_dddot keep the limits at a share of a cell."""
    for k in range(geometry.shape[3]):
        t0, t1 = geometry[cell, BEGIN, 0, k], geometry[cell, END, 0, k]
        k0, k1 = geometry[cell, BEGIN, 1, k], geometry[cell, END, 1, k]
        d0, d1 = geometry[cell, BEGIN, 2, k], geometry[cell, END, 2, k]
        t, turn, twist = t0 + share * (t1 - t0), k0 + share * (k1 - k0), d0 + share * (d1 - d0)
        # Not >: NaN is not within.
        if not abs(t * v) <= reserve * geometry[last, MOST, 0, k]:
            return False
        if not abs(t * a + turn * v * v) <= reserve * geometry[last, MOST, 1, k]:
            return False
        jerk = t * j + 3.0 * turn * v * a + twist * v * v * v
        if not abs(jerk) <= reserve * geometry[last, MOST, 2, k]:
            return False
    return True


@kernel(boolean(MAT, MAT, CUBES, READ_INTS, int64, int64, float64))
def keeps_limits(phases, rows, geometry, pieces, first, n, reserve):
    """Return whether a stop from row `first` on keeps shares of the limits, sampled."""
    end = stop_s(phases)
    if not end < rows[n, S]:
        return False
    last = first
    while rows[last + 1, S] < end:
        last += 1
    cell, x, v, a = first, phases[0, X], phases[0, V], phases[0, A]
    for p in range(3):
        lasts, x0, v0 = phases[p, LASTS], phases[p, X], phases[p, V]
        a0, j = phases[p, A], phases[p, J]
        m = max(FEWEST, math.ceil(lasts / INSTANT)) if lasts > 0.0 else 0
        for i in range(m + 1):
            t = lasts * i / max(m, 1)
            x_before, v_before, a_before = x, v, a
            x = x0 + t * (v0 + t * (0.5 * a0 + t * j / 6.0))
            v, a = v0 + t * (a0 + 0.5 * t * j), a0 + t * j
            while cell < last and rows[cell + 1, S] <= x:
                cell += 1
                # At the end of a piece the derivatives jump: check both sides.
                if pieces[cell] != pieces[cell - 1]:
                    share = (rows[cell, S] - x_before) / max(x - x_before, lookahead.TINY)
                    there = (v_before + share * (v - v_before), a_before + share * (a - a_before))
                    for side in range(2):
                        if not keeps_limits_at(
                            geometry, cell - 1 + side, last, 1.0 - side, *there, j, reserve
                        ):
                            return False
            share = (x - rows[cell, S]) / (rows[cell + 1, S] - rows[cell, S])
            if not keeps_limits_at(geometry, cell, last, share, v, a, j, reserve):
                return False
    return True


@kernel(void(int64, float64, float64, *STOP_TYPES), is_inner=True)
def try_stop(
    row, deceleration, jerk, rows, geometry, pieces, n, limits, reserve, best, phases, tried
):
    """Write a stop to `best` and `phases` if it ends sooner and keeps limits."""
    a_max, j_max = math.inf, math.inf
    for k in range(limits.shape[1]):
        t = abs(geometry[row, BEGIN, 0, k]) + 1e-300
        a_max, j_max = min(a_max, limits[1, k] / t), min(j_max, limits[2, k] / t)
    a_max, j_max = a_max * deceleration, j_max * jerk
    s, s_dot, s_ddot = rows[row, S], rows[row, S_DOT], rows[row, S_DDOT]
    end = rows[row, TIME] + line_stop(s, s_dot, s_ddot, a_max, j_max, tried)
    # Stops that do not reach their decelerations are equal.
    is_twin = end == best[TRIED]
    best[TRIED] = end
    if is_twin or not end < best[ENDS]:
        return
    if keeps_limits(tried, rows, geometry, pieces, row, n, reserve):
        best[ENDS], best[ROW], best[DECELERATION], best[JERK] = end, row, deceleration, jerk
        for k in range(3):
            copy(tried[k], phases[k])


@kernel(int64(MAT, CUBES, READ_INTS, int64, int64, MAT, float64, float64, OUT_MAT), is_inner=True)
def soonest_stop(rows, geometry, pieces, first, n, limits, before, reserve, phases):
    """
    Write the soonest stop found, phases (3, 5); return the row that it begins with, or -1.

    rows, geometry, pieces: the n cells ahead, as from `look_ahead`; first: the first row that it
    may begin with; limits (3, dof); before: it has to end before this time of the unchanged motion
    [s]; reserve: share of the limits that it may use.
    """
    best, tried = np.array([before, -1.0, 0.0, 0.0, 0.0]), np.empty((3, 5))
    ahead = (rows, geometry, pieces, n, limits, reserve, best, phases, tried)
    delayed = first
    for row in range(first, n):
        if rows[row, TIME] >= best[ENDS]:
            break
        is_point = row > 0 and pieces[row] != pieces[row - 1]
        pause = rows[row, TIME] - rows[delayed, TIME]
        if row == first or pause >= (DELAY_TO_POINT if is_point else DELAY) - 1e-9:
            delayed = row
            for jerk in JERKS:
                for deceleration in DECELERATIONS:
                    try_stop(row, deceleration, jerk, *ahead)
                    # Smaller shares end later still, of the jerk too.
                    if not best[TRIED] < best[ENDS]:
                        break
                if not best[TRIED] < best[ENDS] and deceleration == DECELERATIONS[0]:
                    break
    if best[ROW] < 0.0:
        return -1
    for _ in range(ROUNDS):
        ended = best[ENDS]
        for cells in CELLS_NEAR:
            row = int(best[ROW]) + cells
            if first <= row < n:
                try_stop(row, best[DECELERATION], best[JERK], *ahead)
        for factor in FACTORS:
            for by_d, by_j in POWERS:
                deceleration = best[DECELERATION] * factor**by_d
                try_stop(int(best[ROW]), deceleration, best[JERK] * factor**by_j, *ahead)
        if best[ENDS] == ended:
            break
    return int(best[ROW])
