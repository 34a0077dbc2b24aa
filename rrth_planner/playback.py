# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The kinematic arm: it follows one motion exactly, brakes along its path, or stands still."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from rrth_planner.arrays import Array
from rrth_planner.trajectory import sample, Trajectory

# Delays, and durations for each, that a brake is chosen from; the shortest duration [s].
BRAKES = 16
SHORTEST_BRAKE = 0.02
# Instants of a brake at which limits are looked at: at least so many, and so close [s].
INSTANTS = 64
INSTANT_SPACING = 0.002


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Playback:
    """
    What the arm does from some time on.

    The motion is passed through at the rate `time_scale`; from `brake_time` on the rate falls
    smoothly to 0 within `brake_duration`, so the arm never leaves the path of the motion.

    Parameters
    ----------
    trajectory : Trajectory
        A single point is an arm that stands still.
    start_time : float
        When the motion begins; before, the arm stands at its first point [s].
    time_scale : float
        Seconds of the motion per second of the clock [-].
    brake_time, brake_duration : float
        [s]; no brake: infinity and 1.

    """

    trajectory: Trajectory
    start_time: float
    time_scale: float
    brake_time: float = float('inf')
    brake_duration: float = 1.0

    @property
    def end_time(self) -> float:
        """When the arm stands still for good, at the latest [s]."""
        if self.brake_time < np.inf:
            return self.brake_time + self.brake_duration
        return self.start_time + self.trajectory.duration / self.time_scale

    def phase(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """Return time within the motion [s], its rate [-] and the rate's slope [1/s]."""
        t = np.asarray(times, dtype=np.float64)
        if self.brake_time == np.inf:
            ahead = self.time_scale * (t - self.start_time)
            return ahead, np.full_like(t, self.time_scale), np.zeros_like(t)
        u = np.clip((t - self.brake_time) / self.brake_duration, 0.0, 1.0)
        rate = self.time_scale * (1.0 - u**2 * (3.0 - 2.0 * u))
        slope = -self.time_scale * 6.0 * u * (1.0 - u) / self.brake_duration
        # The integral of the rate: at full rate until the brake, then that of the cubic.
        braked = self.brake_duration * (u - u**3 + 0.5 * u**4)
        at_full_rate = np.minimum(t, self.brake_time) - self.start_time
        return self.time_scale * (at_full_rate + braked), rate, slope

    def states_at(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """
        Return the states of the arm at some times, shape (m,) [s].

        Returns
        -------
        tuple of ndarray, each of shape (m, dof)
            Positions [rad], velocities [rad/s], accelerations [rad/s^2].

        """
        phase, rate, slope = self.phase(np.atleast_1d(times))
        q, v, a = sample(self.trajectory, phase)
        rate, slope = rate[:, None], slope[:, None]
        return q, v * rate, a * rate**2 + v * slope

    def state_at(self, time: float) -> tuple[Array, Array, Array]:
        """Return positions, velocities, accelerations at one time, each of shape (dof,)."""
        q, v, a = self.states_at([time])
        return q[0], v[0], a[0]


def standing(q: ArrayLike) -> Playback:
    """Return an arm that stands still at a configuration, shape (dof,) [rad]."""
    positions = np.atleast_2d(np.asarray(q, dtype=np.float64))
    still = np.zeros_like(positions)
    point = Trajectory(
        times=np.zeros(1), positions=positions, velocities=still, accelerations=still
    )
    return Playback(trajectory=point, start_time=0.0, time_scale=1.0)


def stop(playback: Playback, max_acceleration: Array, time: float) -> Playback:
    """
    Return what the arm does when it brakes along its path from now on.

    The brake that stands still first is taken, of those that keep every acceleration within its
    limit (or within what the motion itself does, where that is more); it may begin later, where
    a joint already slows down as fast as it may. A motion that ends sooner just ends.

    Parameters
    ----------
    playback : Playback
    max_acceleration : ndarray, shape (dof,)
        [rad/s^2].
    time : float
        Now [s].

    """
    if playback.brake_time < np.inf or time >= playback.end_time:
        return playback
    if time <= playback.start_time:
        return standing(playback.trajectory.positions[0])
    remaining = playback.end_time - time
    own = playback.states_at(np.linspace(time, playback.end_time, 2048))[2]
    limits = np.maximum(max_acceleration, np.abs(own).max(axis=0))
    best = playback
    for delay in np.linspace(0.0, remaining, BRAKES, endpoint=False):
        for duration in np.geomspace(SHORTEST_BRAKE, SHORTEST_BRAKE + remaining, BRAKES):
            start, end = time + float(delay), time + float(delay + duration)
            if end >= best.end_time:
                break
            braked = replace(playback, brake_time=start, brake_duration=end - start)
            n_instants = max(INSTANTS, int(duration / INSTANT_SPACING))
            if (np.abs(braked.states_at(np.linspace(start, end, n_instants))[2]) <= limits).all():
                best = braked
                break
    return best
