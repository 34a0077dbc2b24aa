# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A stop along a running motion that is found within a millisecond."""

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.kernels.stops import quick_stop, rate_at, stop_duration
from rrth_planner.timing import limit_ratio
from rrth_planner.trajectory import MotionLimits, piece_coefficients, sample, Trajectory

# A stop is not expected to reach the controller before [s].
ON_ITS_WAY = 0.01
# Points of the stop are no further apart, and no closer [s].
SPACING, CLOSEST = 0.025, 1e-4
TICK, HALVINGS = 1e-9, 36
# By which factor a stop may be too fast: less than 1 % of its acceleration and jerk.
WITHIN = 1.0025


def emergency_stop(trajectory: Trajectory, time: float, limits: MotionLimits) -> Trajectory:
    """
    Return how an arm that is at a time within a motion comes to rest along it.

    For as long as a message may be on its way the motion goes on as it is: a controller that gets
    the stop a little late finds itself on it. `braking.brake` finds sooner stops, but takes
    several milliseconds, in which a fast arm gets as far as it loses here.

    Parameters
    ----------
    trajectory : Trajectory
    time : float
        Within it [s].
    limits : MotionLimits
        The stop exceeds them by no more than the motion does, and by less than 1 %.

    Returns
    -------
    Trajectory
        From the state at that time to rest, with points no further apart than 25 ms; the rest of
        the motion where that ends as soon.

    """
    time = min(max(time, 0.0), trajectory.duration)
    table = np.stack([limits.velocity, limits.acceleration, limits.jerk])
    curves, found = piece_coefficients(trajectory), np.zeros(4)
    later = time + ON_ITS_WAY
    knots = trajectory.times - time
    if len(curves) and quick_stop(curves, trajectory.times, later, table, found):
        delay, *shape = found.tolist()
        begin, duration = ON_ITS_WAY + delay, stop_duration(*shape)
        slope, down, up = shape
        grid = np.concatenate(
            [
                knots[(knots > 0.0) & (knots < begin)],
                begin + np.array([0.0, slope / down, duration - slope / up]),
                begin + np.linspace(0.0, duration, 2 + int(duration / SPACING)),
                # Where the motion passes from one piece to the next its jerk jumps.
                begin + _times_of(knots[knots > begin] - begin, shape, duration),
            ]
        )
        times = _apart(grid, begin + duration)
        ways, rates, slopes = _profile(times - begin, shape)
        q, v, a = sample(trajectory, time + np.where(times < begin, times, begin + ways))
        stop = Trajectory(
            times=times,
            positions=q,
            velocities=_at_rest(v * rates[:, None]),
            accelerations=_at_rest(a * rates[:, None] ** 2 + v * slopes[:, None]),
        )
        if limit_ratio(stop, limits) <= WITHIN:
            return stop
    times = _apart(knots[knots > 0.0], trajectory.duration - time)
    q, v, a = sample(trajectory, time + times)
    return Trajectory(times=times, positions=q, velocities=_at_rest(v), accelerations=_at_rest(a))


def _profile(times: Array, shape: list[float]) -> tuple[Array, Array, Array]:
    """Return way, rate and slope of the rate at times since the stop began, each (n,)."""
    rows = np.empty((len(times), 4))
    for row, t in zip(rows, times.tolist(), strict=True):
        if t <= 0.0:
            row[:] = t, 1.0, 0.0, 0.0
        else:
            rate_at(t, *shape, row)
    return rows[:, 0], rows[:, 1], rows[:, 2]


def _times_of(ways: Array, shape: list[float], duration: float) -> Array:
    """Return when a stop has passed so much of its motion, of those that it gets to [s]."""
    low, high = np.zeros(len(ways)), np.full(len(ways), duration)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        is_past = _profile(middle, shape)[0] > ways
        low, high = np.where(is_past, low, middle), np.where(is_past, middle, high)
    return low[low < duration - CLOSEST]


def _apart(grid: Array, end: float) -> Array:
    """Return 0, the times between that are not too close to others, and the end, in whole ns."""
    kept = [0.0]
    for t in np.sort(grid).tolist():
        if t - kept[-1] > CLOSEST and end - t > CLOSEST:
            kept.append(t)
    if end > CLOSEST:
        kept.append(end)
    times = np.array(kept)
    return np.ceil(times / TICK) * TICK


def _at_rest(values: Array) -> Array:
    """Return derivatives whose last row is exactly zero."""
    values[-1] = 0.0
    return values
