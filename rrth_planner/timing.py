# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""From a path to a trajectory: straight edges and rounded corners, within the joints' limits."""

import math

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.blend import Blend
from rrth_planner.errors import RrthError
from rrth_planner.path import Path
from rrth_planner.trajectory import MotionLimits, piece_coefficients, Trajectory
from ruckig import InputParameter, Result, Ruckig, Trajectory as Profile

# A motion shorter than this is none: the arm holds still for HOLD seconds.
STILL, HOLD = 1e-9, 0.1
# Messages carry whole nanoseconds; two points closer than this are one [s].
TICK, CLOSEST = 1e-9, 1e-5

# A point of a trajectory: time since the piece began [s], position, velocity, acceleration.
Knot = tuple[float, Array, Array, Array]


def parameterize(path: Path, blends: tuple[Blend, ...], limits: MotionLimits) -> Trajectory:
    """
    Return the trajectory that follows a path with rounded corners from rest to rest.

    Straight stretches get the fastest profile of constant jerk phases (ruckig, Berscheid and
    Kroeger 2021) and blends a constant speed, so every piece between two points is a polynomial
    of at most fourth degree: the quintic that a controller interpolates is the curve itself.

    Parameters
    ----------
    path : Path
    blends : tuple of Blend
        One for each inner waypoint; `half_length` 0 means to stop there.
    limits : MotionLimits

    Returns
    -------
    Trajectory
        At rest at both ends; its times are whole nanoseconds.

    """
    q = path.waypoints
    if path.length < STILL:
        still = np.zeros((2, q.shape[1]))
        return Trajectory(
            times=np.array([0.0, HOLD]), positions=q[[0, 0]], velocities=still, accelerations=still
        )
    cuts = [0.0, *(blend.half_length for blend in blends), 0.0]
    edges = np.diff(q, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    directions = edges / lengths[:, None]
    straights = [length - cuts[i] - cuts[i + 1] for i, length in enumerate(lengths)]
    bounds = [_along(direction, limits) for direction in directions]
    speeds = _corner_speeds(straights, bounds, blends, limits)
    zero = np.zeros(q.shape[1])
    knots: list[Knot] = [(0.0, q[0], zero, zero)]
    now = 0.0
    for i, direction in enumerate(directions):
        begin = q[i] + cuts[i] * direction
        for t, s, v, a in _straight(straights[i], speeds[i], speeds[i + 1], bounds[i]):
            knots.append((now + t, begin + s * direction, v * direction, a * direction))
        now = knots[-1][0]
        if i + 1 < len(directions) and cuts[i + 1] > 0.0:
            now += 2 * cuts[i + 1] / speeds[i + 1]
            leave = q[i + 1] + cuts[i + 1] * directions[i + 1]
            knots.append((now, leave, speeds[i + 1] * directions[i + 1], zero))
    knots[-1] = (now, q[-1], zero, zero)
    return _within_limits(_assemble(knots), limits)


def _along(direction: Array, limits: MotionLimits) -> tuple[float, float, float]:
    """Return the limits of the speed along a direction, and of its two derivatives."""
    share = np.abs(direction) + 1e-300
    return (
        float((limits.velocity / share).min()),
        float((limits.acceleration / share).min()),
        float((limits.jerk / share).min()),
    )


def _corner_speeds(
    straights: list[float],
    bounds: list[tuple[float, float, float]],
    blends: tuple[Blend, ...],
    limits: MotionLimits,
) -> list[float]:
    """Return the speed at each waypoint that the straights between them can reach [rad/s]."""
    speeds = [0.0, *(blend.top_speed(limits) for blend in blends), 0.0]
    n = len(straights)
    for i in range(1, n):
        speeds[i] = min(speeds[i], bounds[i - 1][0], bounds[i][0])
    for i in range(n - 1):
        speeds[i + 1] = min(speeds[i + 1], _reachable(speeds[i], straights[i], bounds[i]))
    for i in range(n - 1, 0, -1):
        speeds[i] = min(speeds[i], _reachable(speeds[i + 1], straights[i], bounds[i]))
    return speeds


def _reachable(speed: float, distance: float, bounds: tuple[float, float, float]) -> float:
    """Return the greatest speed that a stretch allows to reach, from and to constant speed."""
    top, acceleration, jerk = bounds
    low, high = speed, max(speed, top)
    for _ in range(50):
        middle = 0.5 * (low + high)
        change = middle - speed
        if change <= acceleration**2 / jerk:
            duration = 2 * math.sqrt(change / jerk)
        else:
            duration = change / acceleration + acceleration / jerk
        if 0.5 * (speed + middle) * duration <= distance:
            low = middle
        else:
            high = middle
    return low


def _straight(
    distance: float, v_from: float, v_to: float, bounds: tuple[float, float, float]
) -> list[tuple[float, float, float, float]]:
    """Return time, way, speed and acceleration at the ends of the phases of a stretch."""
    request = InputParameter(1)
    request.current_position, request.target_position = [0.0], [distance]
    request.current_velocity, request.target_velocity = [v_from], [v_to]
    request.current_acceleration, request.target_acceleration = [0.0], [0.0]
    request.max_velocity = [bounds[0] * (1 + 1e-9)]
    request.max_acceleration = [bounds[1]]
    request.max_jerk = [bounds[2]]
    profile = Profile(1)
    if Ruckig(1).calculate(request, profile) not in (Result.Working, Result.Finished):
        raise RrthError(
            f'straight of {distance:.3g} rad from {v_from:.3g} to {v_to:.3g} rad/s: '
            'expected a profile within the limits'
        )
    phases = profile.profiles[0][0]
    result = []
    now = 0.0
    for i, duration in enumerate(phases.t):
        if duration > 0.0:
            now += duration
            result.append((now, phases.p[i + 1], phases.v[i + 1], phases.a[i + 1]))
    result[-1] = (now, distance, v_to, 0.0)
    return result


def _assemble(knots: list[Knot]) -> Trajectory:
    """
    Return the trajectory through knots at whole nanoseconds, twins merged.

    Each knot moves along its own motion to the rounded time: a knot that stayed while its time
    moved by half a nanosecond would cost a short piece 1e-9 v / T^2 of acceleration.
    """
    kept = [knots[0]]
    for knot in knots[1:]:
        if knot[0] - kept[-1][0] < CLOSEST and len(kept) > 1:
            kept.pop()
        kept.append(knot)
    times = np.array([round(knot[0] / TICK) * TICK for knot in kept])
    positions, velocities, accelerations = (
        np.array([knot[column] for knot in kept]) for column in (1, 2, 3)
    )
    # The last knot is at rest, so it is not moved.
    shift = (times - np.array([knot[0] for knot in kept]))[:, None]
    positions += shift * velocities + 0.5 * shift**2 * accelerations
    velocities += shift * accelerations
    positions[-1], velocities[-1], accelerations[-1] = kept[-1][1], 0.0, 0.0
    return Trajectory(
        times=times, positions=positions, velocities=velocities, accelerations=accelerations
    )


def _within_limits(trajectory: Trajectory, limits: MotionLimits) -> Trajectory:
    """
    Return the trajectory, slowed down as a whole where a piece exceeds a limit.

    The quintic through scaled values is the same curve run slower. Merged twins and rounding are
    all that can make this necessary.
    """
    excess = limit_ratio(trajectory, limits)
    if excess <= 1.0:
        return trajectory
    knots = zip(
        trajectory.times * excess,
        trajectory.positions,
        trajectory.velocities / excess,
        trajectory.accelerations / excess**2,
        strict=True,
    )
    return _assemble(list(knots))


def limit_ratio(trajectory: Trajectory, limits: MotionLimits) -> float:
    """
    Return by which factor a trajectory must be slowed to hold its limits; <= 1: it does.

    Velocity and acceleration of each piece are looked at 33 times, where they are polynomials of
    low degree.
    """
    c = piece_coefficients(trajectory)
    T = np.diff(trajectory.times)[:, None, None]
    u = np.linspace(0.0, 1.0, 33)[None, :, None]
    c = c[:, :, None, :]
    v = c[:, 1] + u * (2 * c[:, 2] + u * (3 * c[:, 3] + u * (4 * c[:, 4] + u * 5 * c[:, 5])))
    a = 2 * c[:, 2] + u * (6 * c[:, 3] + u * (12 * c[:, 4] + u * 20 * c[:, 5]))
    # The last bits are rounding, no reason to slow down.
    return float(
        max(
            (np.abs(v / T) / limits.velocity).max() / (1 + 1e-6),
            np.sqrt((np.abs(a / T**2) / limits.acceleration).max() / (1 + 1e-4)),
        )
    )
