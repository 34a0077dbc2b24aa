# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The kinematic arm: it executes a motion exactly, stops along its path, or stands still."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import MotionLimits, sample, Trajectory


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Playback:
    """
    The motion of the arm from some time on, executed at the rate `time_scale`.

    Parameters
    ----------
    trajectory : Trajectory
        A single point is an arm that stands still.
    start_time : float
        When the motion begins [s].
    before : Playback or None
        The motion until then; None: it stands at the first point.
    time_scale : float
        Seconds of the motion per second of the clock [-].
    is_stopping : bool
        Whether the motion is a stop.

    """

    trajectory: Trajectory
    start_time: float
    time_scale: float
    before: 'Playback | None' = None
    is_stopping: bool = False

    @property
    def end_time(self) -> float:
        """When the motion has ended [s]."""
        return self.start_time + self.trajectory.duration / self.time_scale

    def state_at(self, time: float) -> tuple[Array, Array, Array]:
        """Return positions, velocities, accelerations [rad, rad/s, rad/s^2], each (dof,)."""
        if self.before is not None and time < self.start_time:
            return self.before.state_at(time)
        rate = self.time_scale
        q, v, a = sample(self.trajectory, [rate * (time - self.start_time)])
        return q[0], v[0] * rate, a[0] * rate**2


def standing(q: ArrayLike) -> Playback:
    """Return an arm that stands still at a configuration, shape (dof,) [rad]."""
    positions = np.atleast_2d(np.asarray(q, dtype=np.float64))
    still = np.zeros_like(positions)
    point = Trajectory(
        times=np.zeros(1), positions=positions, velocities=still, accelerations=still
    )
    return Playback(trajectory=point, start_time=0.0, time_scale=1.0)


def at_present(playback: Playback, time: float) -> Playback:
    """Return the present motion of an arm, without one that begins after a time [s]."""
    if playback.before is None:
        return playback
    return playback.before if time < playback.start_time else replace(playback, before=None)


def stop(playback: Playback, limits: MotionLimits, time: float) -> Playback:
    """
    Return the motion of an arm that stops along its path from now on.

    The stop is `fast_stop.fast_stop`, with the same limits. An arm that comes to rest by itself as
    soon does that; one that is stopping already continues.

    Parameters
    ----------
    limits : MotionLimits
        Of the arm, by the clock.
    time : float
        Now [s].

    """
    playback = at_present(playback, time)
    if playback.is_stopping or time >= playback.end_time:
        return playback
    if time <= playback.start_time:
        return standing(playback.trajectory.positions[0])
    # Kernels take a while to load, and only a stop needs them.
    from rrth_planner.timing.fast_stop import fast_stop

    scale = playback.time_scale
    in_motion = MotionLimits(
        velocity=limits.velocity / scale,
        acceleration=limits.acceleration / scale**2,
        jerk=limits.jerk / scale**3,
    )
    phase = scale * (time - playback.start_time)
    # Without the compiler numpy would warn in kernels.
    with np.errstate(all='ignore'):
        stopping = fast_stop(playback.trajectory, phase, in_motion, lead=0.0)
    return replace(playback, trajectory=stopping, start_time=time, is_stopping=True)
