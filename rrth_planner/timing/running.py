# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A motion from now on, by the clock, and what becomes of it at another rate."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import jerks_at, piece_coefficients, sample, Trajectory
from rrth_planner.timing.time_law import RateProfile


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Running:
    """
    A motion that is passed through now.

    Parameters
    ----------
    trajectory : Trajectory
    phase : float
        Where in it the arm is [s].
    scale : float
        Seconds of the motion per second of the clock [-].

    """

    trajectory: Trajectory
    phase: float
    scale: float

    @property
    def knots(self) -> Array:
        """When its points are passed, from now on, (n,) [s]."""
        return np.asarray((self.trajectory.times - self.phase) / self.scale)


def first_rest(trajectory: Trajectory, phase: float) -> int:
    """Return the first point after some time [s] at which a motion stands still."""
    is_rest = ~(trajectory.velocities.any(axis=1) | trajectory.accelerations.any(axis=1))
    after = np.flatnonzero(is_rest & (trajectory.times > phase))
    return int(after[0]) if len(after) else len(trajectory.times) - 1


def derivatives_at(running: Running, times: Array) -> Array:
    """Return velocities, accelerations and jerks by the clock, (m,) [s] -> (m, 3, dof)."""
    phases, scale = running.phase + running.scale * times, running.scale
    _, v, a = sample(running.trajectory, phases)
    j = jerks_at(running.trajectory, phases)
    return np.stack([v * scale, a * scale**2, j * scale**3], axis=1)


def derivatives_around(running: Running, times: Array) -> Array:
    """
    Return what `derivatives_at` does at three instants each, from one piece, (3, m) [s].

    The piece that the middle one is on goes on to both sides.
    """
    grid, phases = running.trajectory.times, running.phase + running.scale * times
    i = np.searchsorted(grid[1:-1], phases[1], side='right')
    width = (grid[i + 1] - grid[i])[:, None]
    u = (phases - grid[i])[..., None] / width
    c = piece_coefficients(running.trajectory)[i]
    v = (((5 * c[:, 5] * u + 4 * c[:, 4]) * u + 3 * c[:, 3]) * u + 2 * c[:, 2]) * u + c[:, 1]
    a = ((20 * c[:, 5] * u + 12 * c[:, 4]) * u + 6 * c[:, 3]) * u + 2 * c[:, 2]
    j = (60 * c[:, 5] * u + 24 * c[:, 4]) * u + 6 * c[:, 3]
    rate = running.scale / width
    return np.stack([v * rate, a * rate**2, j * rate**3], axis=-2)


def slowed(states: Array, rate: Array, slope: Array, bend: Array) -> Array:
    """
    Return velocities, accelerations and jerks, (..., 3, dof), of a motion at another rate.

    With the time in the motion s(t) these are q' s', q'' s'^2 + q' s'' and
    q''' s'^3 + 3 q'' s' s'' + q' s'''; the rate is s' [-, 1/s, 1/s^2].
    """
    r, w, u = rate[..., None], slope[..., None], bend[..., None]
    v, a, j = (states[..., k, :] for k in range(3))
    return np.stack([v * r, a * r**2 + v * w, j * r**3 + 3.0 * a * r * w + v * u], axis=-2)


def derivatives_along(running: Running, profile: RateProfile, times: Array) -> Array:
    """Return velocities, accelerations and jerks along a stop, (m,) [s] -> (m, 3, dof)."""
    way, rate, slope, bend = profile.at(times)
    return slowed(derivatives_at(running, way), rate, slope, bend)


def along_path(states: Array, weights: Array) -> tuple[Array, Array, Array]:
    """
    Return the speed along the path and its two derivatives, from (..., 3, dof).

    Joints are weighed by their accelerations, so that radians and metres can be added.
    """
    v, a, j = (states[..., k, :] / weights for k in range(3))
    # At rest the derivatives come out as 0 or immense, never as no number.
    speed = np.maximum(np.sqrt((v * v).sum(axis=-1)), 1e-150)
    slope = (v * a).sum(axis=-1) / speed
    bend = ((a * a).sum(axis=-1) + (v * j).sum(axis=-1) - slope**2) / speed
    return speed, slope, bend
