# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Stops along the way ahead: a jerk down to a deceleration, that held, and a jerk back to rest."""

import math

from numba.core.types import boolean, float64, int64
from rrth_planner.kernels.jit import kernel, MAT, OUT_MAT, READ_INTS
from rrth_planner.kernels.trajectory.lookahead import BEGIN, CUBES, END, MOST, TINY, WAY

# Columns of `phases`, (3, 5): how long each lasts [s]; way, speed, slope of the speed at its
# begin [-, 1/s, 1/s^2], and the slope's slope [1/s^3].
LASTS, X, V, A, J = range(5)
# No two instants of a phase at which limits are looked at are further apart, of some at least [s].
INSTANT, FEWEST = 0.012, 5


@kernel(float64(float64, float64, float64, float64, float64, OUT_MAT))
def line_stop(way, speed, slope, deceleration, jerk, phases):
    """Write the soonest stop from a state on a line; return how long it takes, maybe inf [s]."""
    # Where the motion already slows down faster, the stop goes on from there.
    held = max(deceleration, -slope)
    peak = min(math.sqrt(jerk * speed + 0.5 * slope * slope), held)
    ramp = (slope + peak) / jerk
    # Not where the jerk back to rest takes more speed than there is.
    if not (ramp >= 0.0 and peak > 0.0 and speed >= 0.5 * slope * min(slope, 0.0) / jerk):
        return math.inf
    hold = max((speed + (0.5 * slope * slope - peak * peak) / jerk) / peak, 0.0)
    last = peak / jerk
    phases[0, LASTS], phases[1, LASTS], phases[2, LASTS] = ramp, hold, last
    phases[0, X], phases[0, V], phases[0, A], phases[0, J] = way, speed, slope, -jerk
    phases[1, X] = way + ramp * (speed + ramp * (0.5 * slope - jerk * ramp / 6.0))
    phases[1, V] = speed + ramp * (slope - 0.5 * jerk * ramp)
    phases[2, V] = 0.5 * peak * last
    phases[2, X] = phases[1, X] + 0.5 * hold * (phases[1, V] + phases[2, V])
    phases[1, A], phases[1, J], phases[2, A], phases[2, J] = -peak, 0.0, -peak, jerk
    return ramp + hold + last


@kernel(float64(MAT))
def stop_way(phases):
    """Return the way at the end of a stop [-]."""
    t = phases[2, LASTS]
    return phases[2, X] + t * (phases[2, V] + t * (0.5 * phases[2, A] + t * phases[2, J] / 6.0))


@kernel(boolean(CUBES, int64, int64, float64, float64, float64, float64, float64))
def keeps(geometry, cell, last, share, v, a, j, reserve):
    """Return whether a speed, its slope and bend keep the limits at a share of a cell."""
    for k in range(geometry.shape[3]):
        t0, t1 = geometry[cell, BEGIN, 0, k], geometry[cell, END, 0, k]
        k0, k1 = geometry[cell, BEGIN, 1, k], geometry[cell, END, 1, k]
        d0, d1 = geometry[cell, BEGIN, 2, k], geometry[cell, END, 2, k]
        t, turn, twist = t0 + share * (t1 - t0), k0 + share * (k1 - k0), d0 + share * (d1 - d0)
        # Not >: what is no number is not within.
        if not abs(t * v) <= reserve * geometry[last, MOST, 0, k]:
            return False
        if not abs(t * a + turn * v * v) <= reserve * geometry[last, MOST, 1, k]:
            return False
        jerk = t * j + 3.0 * turn * v * a + twist * v * v * v
        if not abs(jerk) <= reserve * geometry[last, MOST, 2, k]:
            return False
    return True


@kernel(boolean(MAT, MAT, CUBES, READ_INTS, int64, int64, float64))
def seems_to_hold(phases, rows, geometry, pieces, first, n, reserve):
    """Return whether a stop from row `first` on keeps shares of the limits at some instants."""
    end = stop_way(phases)
    if not end < rows[n, WAY]:
        return False
    last = first
    while rows[last + 1, WAY] < end:
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
            while cell < last and rows[cell + 1, WAY] <= x:
                cell += 1
                # Where a piece of the motion ends what it asks for jumps: both sides.
                if pieces[cell] != pieces[cell - 1]:
                    share = (rows[cell, WAY] - x_before) / max(x - x_before, TINY)
                    v_there = v_before + share * (v - v_before)
                    a_there = a_before + share * (a - a_before)
                    for side in range(2):
                        if not keeps(
                            geometry,
                            cell - 1 + side,
                            last,
                            1.0 - side,
                            v_there,
                            a_there,
                            j,
                            reserve,
                        ):
                            return False
            share = (x - rows[cell, WAY]) / (rows[cell + 1, WAY] - rows[cell, WAY])
            if not keeps(geometry, cell, last, share, v, a, j, reserve):
                return False
    return True
