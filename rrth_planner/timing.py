# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""From a path to a trajectory: straight edges and rounded corners, within the joints' limits."""

from collections.abc import Sequence
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

# Where the limits are looked at within a piece: the powers of u in the first and the second
# derivative there.
_U = np.linspace(0.0, 1.0, 33)[:, None]
_FIRST = np.arange(1, 6) * _U ** np.arange(5)
_SECOND = np.array([2.0, 6.0, 12.0, 20.0]) * _U ** np.arange(4)


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
    # Time, edge, and way, speed and acceleration along it; all but the edge in floats, since these
    # are many steps with few numbers.
    knots = [(0.0, 0, 0.0, 0.0, 0.0)]
    now = 0.0
    for i, straight in enumerate(straights):
        for t, s, v, a in _straight(straight, speeds[i], speeds[i + 1], bounds[i]):
            knots.append((now + t, i, s, v, a))
        now = knots[-1][0]
        if cuts[i + 1] > 0.0:
            now += 2 * cuts[i + 1] / speeds[i + 1]
            knots.append((now, i + 1, 0.0, speeds[i + 1], 0.0))
    times, edge, *along = zip(*knots, strict=True)
    begins, ahead = q[:-1] + np.array(cuts[:-1])[:, None] * directions, directions[list(edge)]
    ways, speeds_along, accelerations = (np.array(values)[:, None] * ahead for values in along)
    positions = begins[list(edge)] + ways
    positions[-1] = q[-1]
    return _within_limits(_assemble(times, positions, speeds_along, accelerations), limits)


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

    def is_reached(speed_to: float) -> bool:
        change = speed_to - speed
        if change <= acceleration**2 / jerk:
            duration = 2 * math.sqrt(change / jerk)
        else:
            duration = change / acceleration + acceleration / jerk
        return 0.5 * (speed + speed_to) * duration <= distance

    low, high = speed, max(speed, top)
    if is_reached(high):
        return high
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_reached(middle) else (low, middle)
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
    # Each of these attributes is a copy.
    for duration, p, v, a in zip(phases.t, phases.p[1:], phases.v[1:], phases.a[1:], strict=True):
        if duration > 0.0:
            now += duration
            result.append((now, p, v, a))
    result[-1] = (now, distance, v_to, 0.0)
    return result


def _assemble(
    times: Sequence[float], positions: Array, velocities: Array, accelerations: Array
) -> Trajectory:
    """
    Return the trajectory through knots at whole nanoseconds, twins merged.

    Each knot moves along its own motion to the rounded time: a knot that stayed while its time
    moved by half a nanosecond would cost a short piece 1e-9 v / T^2 of acceleration.
    """
    kept = [0]
    for i in range(1, len(times)):
        if times[i] - times[kept[-1]] < CLOSEST and len(kept) > 1:
            kept.pop()
        kept.append(i)
    exact = np.array(times)[kept]
    rounded = np.round(exact / TICK) * TICK
    q, v, a = positions[kept], velocities[kept], accelerations[kept]
    # The last knot is at rest, so it is not moved.
    shift = (rounded - exact)[:, None]
    shift[-1] = 0.0
    q += shift * v + 0.5 * shift**2 * a
    v += shift * a
    v[-1] = a[-1] = 0.0
    return Trajectory(times=rounded, positions=q, velocities=v, accelerations=a)


def _within_limits(trajectory: Trajectory, limits: MotionLimits) -> Trajectory:
    """
    Return the trajectory, slowed down as a whole where a piece exceeds a limit.

    The quintic through scaled values is the same curve run slower. Merged twins and rounding are
    all that can make this necessary.
    """
    excess = limit_ratio(trajectory, limits)
    if excess <= 1.0:
        return trajectory
    return _assemble(
        (trajectory.times * excess).tolist(),
        trajectory.positions,
        trajectory.velocities / excess,
        trajectory.accelerations / excess**2,
    )


def limit_ratio(trajectory: Trajectory, limits: MotionLimits) -> float:
    """
    Return by which factor a trajectory must be slowed to hold its limits; <= 1: it does.

    Velocity and acceleration of each piece are looked at 33 times, where they are polynomials of
    low degree.
    """
    # Powers first: all pieces and joints in one product.
    c = piece_coefficients(trajectory).transpose(1, 0, 2)
    n, dof = c.shape[1:]
    T = np.diff(trajectory.times)[:, None]
    v = np.abs(_FIRST @ c[1:].reshape(5, -1)).max(axis=0).reshape(n, dof) / T
    a = np.abs(_SECOND @ c[2:].reshape(4, -1)).max(axis=0).reshape(n, dof) / T**2
    # The last bits are rounding, no reason to slow down.
    return max(
        float((v / limits.velocity).max()) / (1 + 1e-6),
        math.sqrt(float((a / limits.acceleration).max()) / (1 + 1e-4)),
    )
