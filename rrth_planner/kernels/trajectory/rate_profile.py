# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A motion executed at a rate that changes smoothly: the same path, at no time faster."""

import math

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import CUBE, kernel, MAT, OUT_CUBE, OUT_MAT, OUT_VEC, VEC
from rrth_planner.kernels.trajectory.lookahead import derivatives_on
from rrth_planner.kernels.trajectory.quintics import fit
from rrth_planner.kernels.trajectory.stop_trajectory import (
    CLOSEST,
    CLOSEST_FIRST,
    is_within,
    TICK,
    WITHIN,
)
from rrth_planner.kernels.vectors import sort

# A rate profile: three phases of constant second derivative of the rate, then a constant rate.
# `profile` (3, 5), a row for each phase: its duration [s]; at its begin the time within the motion
# [s], the rate [-] and the rate's derivative [1/s]; the derivative of that [1/s^2].
LASTS, TAU, RATE, RATE_DOT, RATE_JERK = range(5)
# Points of the motion while its rate changes are no further apart [s].
SPACING = 0.01
# Bisections to the time at which the motion passes one of its points.
HALVINGS = 50
# A rate as low as this is none [-], and changes of the rate below that are none [1/s].
NO_RATE, NO_CHANGE = 1e-6, 1e-9
# Rates that differ by less count as the same; a rate goes no further beyond 1 than that [-].
SAME_RATE, BEYOND = 1e-3, 1e-5
# Shares of the limits that a change of the rate is tried with, one after the other.
SHARES = (0.95, 0.6, 0.35, 0.2, 0.1)


@kernel(void(MAT, float64, OUT_VEC))
def state_of(profile, time, state):
    """Write time within the motion [s], rate and its derivative, (3,), at a time of a profile."""
    p = 0
    while p < 2 and time > profile[p, LASTS]:
        time -= profile[p, LASTS]
        p += 1
    t = min(time, profile[p, LASTS])
    tau, r, a, j = profile[p, TAU], profile[p, RATE], profile[p, RATE_DOT], profile[p, RATE_JERK]
    state[0] = tau + t * (r + t * (0.5 * a + t * j / 6.0))
    state[1] = r + t * (a + 0.5 * t * j)
    state[2] = a + t * j
    if time > t:
        state[0] += (time - t) * state[1]
        state[2] = 0.0


@kernel(void(VEC, VEC, VEC, OUT_MAT), is_inner=True)
def chain_phases(state, lasts, jerks, profile):
    """Write the profile of three phases from a state, (3,) as from `state_of`."""
    tau, r, a = state[0], state[1], state[2]
    for p in range(3):
        t, j = lasts[p], jerks[p]
        profile[p, LASTS], profile[p, TAU], profile[p, RATE] = t, tau, r
        profile[p, RATE_DOT], profile[p, RATE_JERK] = a, j
        tau += t * (r + t * (0.5 * a + t * j / 6.0))
        r += t * (a + 0.5 * t * j)
        a += t * j


@kernel(void(VEC, float64, float64, float64, OUT_MAT), is_inner=True)
def rate_change(state, target, a_max, j_max, profile):
    """
    Write the profile that reaches a target rate soonest, (3, 5).

    state (3,) as from `state_of`; a_max [1/s], j_max [1/s^2]: greatest derivatives of the rate.
    The first phase leads to the greatest derivative, the last one from there to 0.
    """
    r, a = state[1], state[2]
    # The rate that is reached when the derivative fades at once decides about the direction.
    sign = 1.0 if target >= r + 0.5 * a * abs(a) / j_max else -1.0
    change, a = sign * (target - r), sign * a
    peak = math.sqrt(max(j_max * change + 0.5 * a * a, 0.0))
    # Not below the derivative now, which would only have to fade.
    peak = max(min(peak, a_max), a, 0.0)
    first, last = (peak - a) / j_max, peak / j_max
    gained = 0.5 * (a + peak) * first + 0.5 * peak * last
    hold = (change - gained) / peak if peak > NO_CHANGE else 0.0
    lasts, jerks = scratch.floats(3), scratch.floats(3)
    lasts[0], lasts[1], lasts[2] = first, max(hold, 0.0), last
    jerks[0], jerks[1], jerks[2] = sign * j_max, 0.0, -sign * j_max
    chain_phases(state, lasts, jerks, profile)


@kernel(void(MAT, float64, OUT_MAT))
def profile_after(profile, time, rest):
    """Write what is left of a profile after a time [s]."""
    state, lasts, jerks = scratch.floats(3), scratch.floats(3), scratch.floats(3)
    state_of(profile, time, state)
    before = 0.0
    for p in range(3):
        end = before + profile[p, LASTS]
        lasts[p], jerks[p] = max(0.0, end - max(time, before)), profile[p, RATE_JERK]
        before = end
    chain_phases(state, lasts, jerks, rest)


@kernel(float64(MAT, float64, float64, float64), is_inner=True)
def time_at(profile, tau, low, high):
    """Return when a profile, between two times of it, passes a time of the motion [s]."""
    state = scratch.floats(3)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        state_of(profile, middle, state)
        if state[0] < tau:
            low = middle
        else:
            high = middle
    return high


@kernel(int64(VEC, MAT, OUT_VEC), is_inner=True)
def scaled_times(times, profile, points):
    """
    Write the times of the points of a motion that follows a rate profile; return their number.

    times (n,): the points of the motion [s]. Points end phases, stand at points of the motion, and
    while the rate changes are no further apart than `SPACING`.
    """
    marks, m, end = np.empty(times.shape[0] + 4), 1, 0.0
    marks[0] = 0.0
    for p in range(3):
        end += profile[p, LASTS]
        marks[m], m = end, m + 1
    state = scratch.floats(3)
    state_of(profile, end, state)
    changed, final = state[0], state[1]
    after, last = end, times[times.shape[0] - 1]
    is_over = changed >= last
    for i in range(times.shape[0]):
        if not times[i] > profile[0, TAU]:
            continue
        if times[i] <= changed:
            marks[m] = time_at(profile, times[i], 0.0, end)
        elif final > NO_RATE:
            marks[m] = end + (times[i] - changed) / final
        else:
            break
        after, m = marks[m], m + 1
    if final <= NO_RATE and not is_over:
        after = end
    sort(marks, m)
    points[0], n, kept = 0.0, 1, 0.0
    for i in range(1, m + 1):
        mark = marks[i] if i < m else after
        if mark > after:
            continue
        is_close = mark - kept < CLOSEST or after - mark < CLOSEST
        if mark == end and after - mark >= CLOSEST and kept > 0.0 and is_close:
            # From here on the rate is constant: the point before it, not this one, is left out.
            n -= 1
            kept = points[n - 1]
        elif i < m and is_close and not (mark == end and mark - kept >= CLOSEST_FIRST):
            continue
        if mark <= kept:
            continue
        parts = max(1, math.ceil((mark - kept) / SPACING - 1e-9)) if mark <= end + TICK else 1
        for part in range(1, parts + 1):
            points[n] = math.ceil((kept + (mark - kept) * part / parts) / TICK) * TICK
            n += 1
        kept = mark
    return n


@kernel(void(CUBE, VEC, MAT, VEC, OUT_CUBE), is_inner=True)
def scaled_states(curves, times, profile, points, states):
    """Write position, velocity and acceleration at points of a profile, (3, n, dof)."""
    at, found, piece, n = scratch.floats(3), np.empty((4, curves.shape[2])), 0, points.shape[0]
    for i in range(n):
        state_of(profile, points[i], at)
        tau = min(at[0], times[curves.shape[0]])
        while piece < curves.shape[0] - 1 and times[piece + 1] <= tau:
            piece += 1
        derivatives_on(curves, times, piece, tau, found)
        is_end = i == n - 1
        for k in range(curves.shape[2]):
            states[0, i, k] = found[0, k]
            states[1, i, k] = 0.0 if is_end else found[1, k] * at[1]
            states[2, i, k] = 0.0 if is_end else found[2, k] * at[1] ** 2 + found[1, k] * at[2]


@kernel(boolean(CUBE, VEC, MAT, MAT, float64), is_inner=True)
def keeps_limits(curves, times, profile, limits, until):
    """Return whether a motion keeps limits, (3, dof), while it follows a profile until a time."""
    end = profile[0, LASTS] + profile[1, LASTS] + profile[2, LASTS]
    points = np.empty(times.shape[0] + 8 + int(end / SPACING))
    n = scaled_times(times, profile, points)
    if n == 1:
        # It stays at rest.
        return True
    m = 1
    while m < n - 1 and points[m] < until:
        m += 1
    states, pieces = np.empty((3, n, limits.shape[1])), np.empty((m, 6, limits.shape[1]))
    scaled_states(curves, times, profile, points[:n], states)
    fit(points[: m + 1], states[0], states[1], states[2], pieces)
    return is_within(points[: m + 1], pieces, -1.0, limits)


@kernel(boolean(CUBE, VEC, VEC, float64, VEC, VEC, VEC, OUT_MAT), is_short=True)
def steer(curves, times, state, target, velocity, acceleration, jerk, profile):
    """
    Write a profile that changes the rate to a target within limits; return whether one was found.

    curves (n, 6, dof), times (n + 1,): the motion; state (3,) as from `state_of`; velocity,
    acceleration, jerk (dof,): limits of the joints. The rate changes as fast as the velocity of
    the motion allows there; less, where that exceeds the limits.
    """
    limits, found, piece = np.empty((3, velocity.shape[0])), np.empty((4, velocity.shape[0])), 0
    for k in range(velocity.shape[0]):
        # A stop from this motion may exceed them by as much again.
        limits[0, k], limits[1, k] = velocity[k] / WITHIN, acceleration[k] / WITHIN**2
        limits[2, k] = jerk[k] / WITHIN**3
    while piece < curves.shape[0] - 1 and times[piece + 1] <= state[0]:
        piece += 1
    derivatives_on(curves, times, piece, state[0], found)
    a_max, j_max = math.inf, math.inf
    for k in range(velocity.shape[0]):
        v = abs(found[1, k])
        # At rest the motion has no velocity yet, but will.
        v = max(v, 0.1 * velocity[k])
        a_max, j_max = min(a_max, acceleration[k] / v), min(j_max, jerk[k] / v)
    for share in SHARES:
        # Where the derivative fades the rate goes no further than from 0 to 1.
        faded = state[1] + 0.5 * state[2] * abs(state[2]) / (share * j_max)
        if faded < -NO_RATE or faded > 1.0 + BEYOND:
            break
        # If that ends near enough to the target, the phase back to it would be too short to keep.
        aim = faded if abs(faded - target) < SAME_RATE else target
        rate_change(state, aim, share * a_max, share * j_max, profile)
        end = profile[0, LASTS] + profile[1, LASTS] + profile[2, LASTS]
        if keeps_limits(curves, times, profile, limits, end):
            return True
    return False


@kernel(int64(CUBE, VEC, MAT, OUT_VEC, OUT_CUBE), is_short=True)
def write_scaled(curves, times, profile, points, states):
    """
    Write the points of a motion that follows a rate profile to its end; return their number.

    curves (n, 6, dof), times (n + 1,): the motion; points (m,) [s] and states (3, m, dof) are
    written. A profile that ends at rate 0 ends where it comes to rest.
    """
    n = scaled_times(times, profile, points)
    scaled_states(curves, times, profile, points[:n], states)
    return n
