# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The soonest of many stops along the path ahead: a grid search, then a local one."""

import math

from numba.core.types import boolean, float64, int64
import numpy as np
from rrth_planner.kernels.jit import kernel, MAT, OUT_MAT, OUT_VEC, READ_INTS
from rrth_planner.kernels.trajectory.lookahead import BEGIN, CUBES, S, S_DDOT, S_DOT, TIME
from rrth_planner.kernels.trajectory.stop_profile import keeps_limits, line_stop

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


@kernel(
    boolean(
        int64,
        float64,
        float64,
        MAT,
        CUBES,
        READ_INTS,
        int64,
        MAT,
        float64,
        OUT_VEC,
        OUT_MAT,
        OUT_MAT,
    )
)
def try_stop(
    row, deceleration, jerk, rows, geometry, pieces, n, limits, reserve, best, phases, tried
):
    """Write a stop to `best` and `phases` if it ends sooner and keeps limits; return whether."""
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
        return False
    if not keeps_limits(tried, rows, geometry, pieces, row, n, reserve):
        return False
    best[ENDS], best[ROW], best[DECELERATION], best[JERK] = end, row, deceleration, jerk
    phases[:] = tried
    return True


@kernel(int64(MAT, CUBES, READ_INTS, int64, int64, MAT, float64, float64, OUT_MAT))
def soonest_stop(rows, geometry, pieces, first, n, limits, before, reserve, phases):
    """
    Write the soonest stop found; return the row that it begins with, or -1.

    Parameters
    ----------
    rows, geometry, pieces : array
        The cells ahead, as from `look_ahead`.
    first, n : int
        The first row that it may begin with; the number of cells.
    limits : array, shape (3, dof)
        Velocity, acceleration, jerk.
    before : float
        It has to end before this time of the unchanged motion [s].
    reserve : float
        Share of the limits that it may use.
    phases : array, shape (3, 5)
        Written.

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
