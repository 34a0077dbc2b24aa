# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The kinematic arm: it follows one motion exactly, brakes along its path, or stands still."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import MotionLimits, sample, Trajectory
from rrth_planner.timing.proven_stop import soonest_stop
from rrth_planner.timing.running import first_rest, Running
from rrth_planner.timing.time_law import RateProfile


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Playback:
    """
    What the arm does from some time on.

    The motion is passed through at the rate `time_scale`; from `brake_time` on that is multiplied
    by the rate of the brake, which falls to 0: so the arm never leaves the path of the motion.

    Parameters
    ----------
    trajectory : Trajectory
        A single point is an arm that stands still.
    start_time : float
        When the motion begins [s].
    before : Playback or None
        What the arm does until then; None: it stands at the first point.
    time_scale : float
        Seconds of the motion per second of the clock [-].
    brake_time : float
        [s]; infinite: no brake.
    brake : RateProfile or None

    """

    trajectory: Trajectory
    start_time: float
    time_scale: float
    before: 'Playback | None' = None
    brake_time: float = float('inf')
    brake: RateProfile | None = None

    @property
    def end_time(self) -> float:
        """When the arm stands still for good, at the latest [s]."""
        if self.brake is not None:
            return self.brake_time + self.brake.duration
        return self.start_time + self.trajectory.duration / self.time_scale

    def phase(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """Return time within the motion [s], its rate [-] and the rate's slope [1/s]."""
        t = np.asarray(times, dtype=np.float64)
        if self.brake is None:
            ahead = self.time_scale * (t - self.start_time)
            return ahead, np.full_like(t, self.time_scale), np.zeros_like(t)
        way, rate, slope, _ = self.brake.at(t - self.brake_time)
        before = self.brake_time - self.start_time
        return self.time_scale * (before + way), self.time_scale * rate, self.time_scale * slope

    def states_at(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """
        Return the states of the arm at some times, shape (m,) [s].

        Returns
        -------
        tuple of ndarray, each of shape (m, dof)
            Positions [rad], velocities [rad/s], accelerations [rad/s^2].

        """
        t = np.atleast_1d(np.asarray(times, dtype=np.float64))
        phase, rate, slope = self.phase(t)
        q, v, a = sample(self.trajectory, phase)
        rate, slope = rate[:, None], slope[:, None]
        states = q, v * rate, a * rate**2 + v * slope
        is_early = t < self.start_time
        if self.before is not None and is_early.any():
            for values, earlier in zip(states, self.before.states_at(t[is_early]), strict=True):
                values[is_early] = earlier
        return states

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


def at_present(playback: Playback, time: float) -> Playback:
    """Return what an arm does now, without a motion that only begins after a time [s]."""
    if playback.before is None:
        return playback
    return playback.before if time < playback.start_time else replace(playback, before=None)


def stop(playback: Playback, limits: MotionLimits, time: float) -> Playback:
    """
    Return what the arm does when it brakes along its path from now on.

    Velocity, acceleration and jerk of every joint stay at every instant within the limits, or
    within what the motion itself does up to where it stops, where that is more. An arm that
    comes to rest by itself as soon does that; one that brakes already goes on.

    Parameters
    ----------
    playback : Playback
    limits : MotionLimits
    time : float
        Now [s].

    """
    playback = at_present(playback, time)
    if playback.brake is not None or time >= playback.end_time:
        return playback
    if time <= playback.start_time:
        return standing(playback.trajectory.positions[0])
    phase = playback.time_scale * (time - playback.start_time)
    running = Running(trajectory=playback.trajectory, phase=phase, scale=playback.time_scale)
    brake = soonest_stop(running, limits)
    if brake is not None:
        return replace(playback, brake_time=time, brake=brake)
    return replace(playback, trajectory=_up_to_rest(playback.trajectory, phase))


def _up_to_rest(trajectory: Trajectory, phase: float) -> Trajectory:
    """Return a motion up to where it stands still first after some time [s]."""
    end = first_rest(trajectory, phase) + 1
    if end == len(trajectory.times):
        return trajectory
    return Trajectory(
        times=trajectory.times[:end],
        positions=trajectory.positions[:end],
        velocities=trajectory.velocities[:end],
        accelerations=trajectory.accelerations[:end],
    )
