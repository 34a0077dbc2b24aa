# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The curve that joint_trajectory_controller runs by the numbers of a trajectory: plain numpy."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import Trajectory

NANOSECONDS = 1e9
# Between two samples of a curve [s].
SAMPLE_PERIOD = 2e-4
# Samples this near to a point of the trajectory are that point, but for rounding [s].
SAME = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """
    A quintic for each piece, in seconds since the begin of the piece.

    Parameters
    ----------
    times : ndarray, shape (n + 1,)
        Of the points, strictly increasing [s].
    coefficients : ndarray, shape (n, 6, dof)
        Lowest power first [rad/s^k].

    """

    times: Array
    coefficients: Array


@dataclass(frozen=True, slots=True, eq=False)
class Instants:
    """
    Places on a curve in the order of time; each point twice, as end and as begin of a piece.

    Parameters
    ----------
    pieces : ndarray of int, shape (m,)
    since : ndarray, shape (m,)
        Time since the begin of the piece [s].
    times : ndarray, shape (m,)
        [s].

    """

    pieces: NDArray[np.intp]
    since: Array
    times: Array


def whole_nanoseconds(times: Array) -> NDArray[np.int64]:
    """Return times as a message carries them, [s] -> [ns]."""
    return np.rint(np.asarray(times) * NANOSECONDS).astype(np.int64)


def curve_of(trajectory: Trajectory) -> Curve:
    """
    Return the curve of a message, as `Trajectory::interpolate_between_points` computes it.

    The times of the trajectory must strictly increase.
    """
    nanoseconds = whole_nanoseconds(trajectory.times)
    T = (np.diff(nanoseconds) / NANOSECONDS)[:, None]
    p0, p1 = trajectory.positions[:-1], trajectory.positions[1:]
    v0, v1 = trajectory.velocities[:-1], trajectory.velocities[1:]
    a0, a1 = trajectory.accelerations[:-1], trajectory.accelerations[1:]
    c = [
        p0,
        v0,
        0.5 * a0,
        (-20 * p0 + 20 * p1 - 3 * a0 * T**2 + a1 * T**2 - 12 * v0 * T - 8 * v1 * T) / (2 * T**3),
        (30 * p0 - 30 * p1 + 3 * a0 * T**2 - 2 * a1 * T**2 + 16 * v0 * T + 14 * v1 * T)
        / (2 * T**4),
        (-12 * p0 + 12 * p1 - a0 * T**2 + a1 * T**2 - 6 * v0 * T - 6 * v1 * T) / (2 * T**5),
    ]
    return Curve(nanoseconds / NANOSECONDS, np.stack(c, axis=1))


def instants(curve: Curve, period: float = SAMPLE_PERIOD) -> Instants:
    """Return a place every `period` [s], and both ends of every piece."""
    times = curve.times
    n = len(times) - 1
    grid = np.arange(times[0], times[-1], period)
    inside = np.searchsorted(times, grid, side='right') - 1
    near = np.minimum(grid - times[inside], times[np.minimum(inside + 1, n)] - grid)
    inside, grid = inside[near > SAME], grid[near > SAME]
    every = np.arange(n)
    pieces = np.concatenate([every, inside, every])
    since = np.concatenate([np.zeros(n), grid - times[inside], np.diff(times)])
    order = np.lexsort((since, pieces))
    pieces, since = pieces[order], since[order]
    return Instants(pieces, since, times[pieces] + since)


def derivative(curve: Curve, places: Instants, order: int) -> Array:
    """Return a derivative of the curve at some places, (m, dof) [rad/s^order]."""
    c = curve.coefficients
    for _ in range(order):
        c = c[:, 1:] * np.arange(1, c.shape[1])[:, None]
    value = np.zeros((len(places.pieces), c.shape[2]))
    for k in reversed(range(c.shape[1])):
        value = value * places.since[:, None] + c[places.pieces, k]
    return value


def positions_of(trajectory: Trajectory, period: float) -> Array:
    """Return where a controller takes the arm, every `period` [s] and at each point, [rad]."""
    if len(trajectory.times) == 1:
        return trajectory.positions
    curve = curve_of(trajectory)
    return derivative(curve, instants(curve, period), 0)


def greatest_jerk(curve: Curve) -> Array:
    """Return the greatest |third derivative| of each joint, exactly, shape (dof,) [rad/s^3]."""
    c3, c4, c5 = (curve.coefficients[:, k] for k in (3, 4, 5))
    T = np.broadcast_to(np.diff(curve.times)[:, None], c3.shape)
    # A parabola: greatest at an end or at its vertex.
    vertex = np.divide(-c4, 5 * c5, out=np.zeros_like(c5), where=c5 != 0.0).clip(0.0, T)
    at = [np.abs(6 * c3 + 24 * c4 * t + 60 * c5 * t**2) for t in (0.0 * T, vertex, T)]
    return np.max(at, axis=(0, 1))
