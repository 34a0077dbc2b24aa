# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A quick search for a stop along a motion, for when there is no time for the soonest one."""

import math

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import CUBE, kernel, MAT, OUT_MAT, OUT_VEC, VEC

# A stop passes the motion at a rate that falls from 1 to 0: it bends down to a constant slope,
# goes on at that, and bends up to rest. What is tried, as shares of what the limits leave at the
# speed of the motion when it begins, and how long it waits before [s].
SLOPES, BENDS, DELAYS = 14, 6, 5
SHRINK_SLOPE, SHRINK_BEND, DELAY = 0.8, 0.6, 0.05
# Instants of each of the three phases at which limits are looked at, and the share of them that
# may be used: the motion itself may be at a limit when it begins to stop.
INSTANTS, RESERVE = 14, 1.003
SLOWEST = 1e-6


@kernel(float64(float64, float64, float64))
def stop_duration(slope, down, up):
    """Return how long a stop takes [s]; slope [1/s], bends of both ramps [1/s^2]."""
    return 0.5 * slope / down + 1.0 / slope + 0.5 * slope / up


@kernel(void(float64, float64, float64, float64, OUT_VEC))
def rate_at(time, slope, down, up, rate):
    """
    Write way, rate, and its first two derivatives, (4,), at a time since the stop began.

    slope [1/s] is the greatest, down and up [1/s^2] are the bends of the two ramps;
    slope^2 (1 / down + 1 / up) <= 2.
    """
    first, last = slope / down, slope / up
    hold = stop_duration(slope, down, up) - first - last
    if time < first:
        rate[0], rate[1] = time - down * time**3 / 6.0, 1.0 - 0.5 * down * time * time
        rate[2], rate[3] = -down * time, -down
        return
    way, level = first - down * first**3 / 6.0, 1.0 - 0.5 * slope * first
    t = min(time - first, hold)
    way += level * t - 0.5 * slope * t * t
    if time < first + hold:
        rate[0], rate[1], rate[2], rate[3] = way, level - slope * t, -slope, 0.0
        return
    # As the way that is left: the mirror image of a ramp.
    left = max(0.0, first + hold + last - time)
    rate[0], rate[1] = way + up * (last**3 - left**3) / 6.0, 0.5 * up * left * left
    rate[2], rate[3] = -up * left, up


@kernel(void(CUBE, VEC, float64, OUT_MAT))
def derivatives_at(curves, times, time, states):
    """Write position, velocity, acceleration and jerk of a motion at a time, (4, dof)."""
    n, dof = curves.shape[0], curves.shape[2]
    i = 0
    while i < n - 1 and times[i + 1] < time:
        i += 1
    width = times[i + 1] - times[i]
    u = min(max((time - times[i]) / width, 0.0), 1.0)
    for k in range(dof):
        c0, c1, c2 = curves[i, 0, k], curves[i, 1, k], curves[i, 2, k]
        c3, c4, c5 = curves[i, 3, k], curves[i, 4, k], curves[i, 5, k]
        states[0, k] = ((((c5 * u + c4) * u + c3) * u + c2) * u + c1) * u + c0
        states[1, k] = ((((5 * c5 * u + 4 * c4) * u + 3 * c3) * u + 2 * c2) * u + c1) / width
        states[2, k] = (((20 * c5 * u + 12 * c4) * u + 6 * c3) * u + 2 * c2) / width**2
        states[3, k] = ((60 * c5 * u + 24 * c4) * u + 6 * c3) / width**3


@kernel(boolean(CUBE, VEC, float64, float64, float64, float64, MAT, OUT_MAT))
def keeps_limits(curves, times, begin, slope, down, up, limits, states):
    """Return whether a stop from a time on keeps velocity, acceleration and jerk, (3, dof)."""
    rate = np.empty(4)
    first, last = slope / down, slope / up
    hold = stop_duration(slope, down, up) - first - last
    for i in range(3 * INSTANTS):
        # Each phase by itself: its ends, between which the jerk jumps, and between.
        phase, share = i // INSTANTS, (0.001 + 0.998 * (i % INSTANTS) / (INSTANTS - 1))
        if phase == 0:
            time = share * first
        elif phase == 1:
            time = first + share * hold
        else:
            time = first + hold + share * last
        rate_at(time, slope, down, up, rate)
        derivatives_at(curves, times, begin + rate[0], states)
        r, dr, ddr = rate[1], rate[2], rate[3]
        for k in range(limits.shape[1]):
            v, a, j = states[1, k], states[2, k], states[3, k]
            if abs(a * r * r + v * dr) > limits[1, k]:
                return False
            if abs(j * r**3 + 3.0 * a * r * dr + v * ddr) > limits[2, k]:
                return False
    return True


@kernel(int64(CUBE, VEC, float64, MAT, OUT_VEC))
def quick_stop(curves, times, time, limits, found):
    """
    Write delay, slope and bends of the soonest stop of those that are tried; return whether any.

    Parameters
    ----------
    curves : array, shape (n, 6, dof)
        Pieces of the motion, as from `trajectory.piece_coefficients`.
    times : array, shape (n + 1,)
        [s].
    time : float
        Of the motion, when the stop is asked for [s].
    limits : array, shape (3, dof)
        Velocity, acceleration, jerk.
    found : array, shape (4,)
        Written [s, 1/s, 1/s^2, 1/s^2].

    """
    dof = curves.shape[2]
    states, allowed = np.empty((4, dof)), np.empty((3, dof))
    for row in range(3):
        for k in range(dof):
            allowed[row, k] = RESERVE * limits[row, k]
    # Sooner than its own end is what is asked for.
    best, end = times[times.shape[0] - 1] - time, times[times.shape[0] - 1]
    n_found = 0
    for d in range(DELAYS):
        begin = time + d * DELAY
        if begin >= end or d * DELAY >= best:
            break
        derivatives_at(curves, times, begin, states)
        grip, snap = math.inf, math.inf
        for k in range(dof):
            v = abs(states[1, k])
            if v > SLOWEST:
                grip, snap = min(grip, limits[1, k] / v), min(snap, limits[2, k] / v)
        if grip == math.inf:
            break
        down = snap
        for _ in range(BENDS):
            up = snap
            for _ in range(BENDS):
                slope = min(grip, math.sqrt(2.0 / (1.0 / down + 1.0 / up)))
                for _ in range(SLOPES):
                    duration = d * DELAY + stop_duration(slope, down, up)
                    if duration >= best:
                        break
                    if keeps_limits(curves, times, begin, slope, down, up, allowed, states):
                        best, n_found = duration, n_found + 1
                        found[0], found[1], found[2], found[3] = d * DELAY, slope, down, up
                    slope *= SHRINK_SLOPE
                up *= SHRINK_BEND
            down *= SHRINK_BEND
    return n_found
