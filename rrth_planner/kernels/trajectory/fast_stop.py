# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The fail-safe stop along a motion: a fast search, without a certificate."""

import math

from numba.core.types import float64, int64
import numpy as np
from rrth_planner.kernels.jit import CUBE, kernel, MAT, OUT_CUBE, OUT_VEC, VEC
from rrth_planner.kernels.trajectory.lookahead import derivatives_on, look_ahead, MOST, S, TIME
from rrth_planner.kernels.trajectory.quintics import fit
from rrth_planner.kernels.trajectory.stop_search import soonest_stop, stop_s
from rrth_planner.kernels.trajectory.stop_trajectory import (
    CLOSEST,
    CLOSEST_FIRST,
    is_on_path,
    is_within,
    SPACINGS,
    stop_states,
    stop_times,
    TICK,
)
from rrth_planner.kernels.vectors import copy

# First window of the search, in durations of a stop on a line; its growth; greatest length of a
# cell [s], and greatest number of cells, which has priority.
FIRST_WINDOW, WINDOW_GROWTH, LONGEST_CELL, MOST_CELLS = 3.0, 4.0, 0.01, 256
# Shares of the limits that are tried: at first a little more than 1, since the motion may itself
# be at a limit when the stop begins; less where the points of the stop exceed the limits.
RESERVES = (1.003, 0.985, 0.95, 0.85)
# A motion that rests so shortly before a stop may begin ends there: within this time it would have
# moved on by 1e-7 rad at 40 rad/s^3, and by 3e-6 rad where the message comes a cycle late [s].
AT_REST = 2.5e-3


@kernel(int64(CUBE, VEC, float64, int64, OUT_VEC, OUT_CUBE), is_inner=True)
def remaining_motion(curves, times, now, last, points, states):
    """Write the points of a motion from now to one at which it is at rest; return their number."""
    state, n, dof, kept = np.empty((4, curves.shape[2])), 0, curves.shape[2], now
    for i in range(last + 1):
        if i < last and times[i + 1] - now < CLOSEST_FIRST:
            continue
        # Skip points too close to be represented in whole nanoseconds.
        is_close = times[i] - kept < CLOSEST_FIRST or times[last] - times[i] < CLOSEST_FIRST
        if n > 0 and i < last and is_close:
            continue
        kept = times[i]
        # The first point is now.
        points[n] = 0.0 if n == 0 else math.ceil((times[i] - now) / TICK) * TICK
        time = times[i] if i == last else now + points[n]
        derivatives_on(curves, times, min(i, last - 1), time, state)
        for order in range(3):
            for k in range(dof):
                states[order, n, k] = 0.0 if i == last and order > 0 else state[order, k]
        n += 1
    return n


@kernel(int64(CUBE, VEC, float64))
def first_rest(curves, times, now):
    """Return the first point of a motion after some time [s] at which it is at rest."""
    n = curves.shape[0]
    for i in range(1, n):
        fastest = 0.0
        for k in range(curves.shape[2]):
            fastest = max(fastest, abs(curves[i, 1, k]), abs(curves[i, 2, k]))
        if times[i] > now and fastest == 0.0:
            return i
    return n


@kernel(float64(VEC, float64), is_inner=True)
def avoid_points(times, begin):
    """Return the next time that is a point of a motion, or not close to any [s]."""
    for i in range(times.shape[0]):
        if abs(times[i] - begin) < CLOSEST:
            begin = times[i] if times[i] >= begin else times[i] + CLOSEST
    return begin


@kernel(float64(CUBE, VEC, float64, MAT))
def first_window(curves, times, time, limits):
    """Return the first window of the search for a stop, as if the arm moved on a line [s]."""
    state, window, piece = np.empty((4, curves.shape[2])), 0.0, 0
    while times[piece + 1] < time:
        piece += 1
    derivatives_on(curves, times, piece, time, state)
    for k in range(curves.shape[2]):
        ramp = (limits[1, k] + abs(state[2, k])) / limits[2, k]
        window = max(window, FIRST_WINDOW * (abs(state[1, k]) / limits[1, k] + ramp))
    return window


@kernel(int64(VEC, float64, float64), is_inner=True)
def points_between(times, begin, end):
    """Return how many points of a motion lie between two times [s]."""
    n = 0
    for i in range(times.shape[0]):
        if begin < times[i] < end:
            n += 1
    return n


@kernel(int64(CUBE, VEC, float64, float64, VEC, VEC, VEC, OUT_VEC, OUT_CUBE), is_short=True)
def write_fast_stop(curves, times, now, lead, velocity, acceleration, jerk, points, states):
    """
    Write the points of the soonest stop found; return their number.

    curves (n, 6, dof): pieces of the motion, as from `trajectory.piece_coefficients`; times
    (n + 1,) [s]; now, lead: time of the request within the motion, and time for which it continues
    unchanged [s]; velocity, acceleration, jerk (dof,): limits. points (m,) [s] and states
    (3, m, dof), positions, velocities, accelerations, are written.
    """
    dof, phases = curves.shape[2], np.empty((3, 5))
    limits = np.empty((3, dof))
    copy(velocity, limits[0])
    copy(acceleration, limits[1])
    copy(jerk, limits[2])
    # A motion that went on long before the stop may begin is not stopped by its rest.
    rest = first_rest(curves, times, now + max(lead - AT_REST, 0.0))
    end, begin = times[rest], avoid_points(times, now + lead)
    window = 0.0
    while begin + window < end:
        window = (
            WINDOW_GROWTH * window if window > 0.0 else first_window(curves, times, begin, limits)
        )
        until = min(begin + window, end)
        step = max(LONGEST_CELL, (until - now) / MOST_CELLS)
        # A piece of the motion may end with a shorter cell, and so may the lead.
        most = int((until - now) / step) + points_between(times, now, until) + 3
        rows, pieces = np.empty((most + 1, 4)), np.empty(most, np.int64)
        geometry = np.empty((most, 3, 3, dof))
        n = look_ahead(curves, times, now, begin, until, step, limits, rows, pieces, geometry)
        rows, pieces, first = rows[: n + 1], pieces[:n], 0
        while rows[first, TIME] < begin:
            first += 1
        for reserve in RESERVES:
            row = soonest_stop(rows, geometry, pieces, first, n, limits, end, reserve, phases)
            if row < 0:
                break
            last, reached = row, stop_s(phases)
            while rows[last + 1, S] < reached:
                last += 1
            for spacing in SPACINGS:
                m = stop_times(rows, pieces, phases, row, spacing, points)
                at = points[:m]
                stop_states(curves, times, rows, pieces, phases, row, limits, at, states)
                stop = np.empty((m - 1, 6, dof))
                fit(at, states[0], states[1], states[2], stop)
                if not is_within(at, stop, rows[row, TIME] - now, geometry[last, MOST]):
                    break
                if is_on_path(curves, times, rows, pieces, phases, row, limits, at, stop):
                    return m
    return remaining_motion(curves, times, now, rest, points, states)
