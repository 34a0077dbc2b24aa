# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Braking as a motion of its own, and the proof that it is safe."""

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.certificate import Certificate, certify
from rrth_planner.playback import Playback, stop
from rrth_planner.trajectory import MotionLimits, Trajectory
from rrth_planner.world import World

# Messages carry whole nanoseconds; two points closer than this are one [s].
TICK, CLOSEST = 1e-9, 1e-5


def brake(trajectory: Trajectory, time: float, limits: MotionLimits) -> Trajectory:
    """
    Return the motion from the state of a running trajectory to rest along its path.

    It begins with the very position, velocity and acceleration at that time. The quintics between
    its points stay within 1e-4 rad of the path and within 1 % of the limits, or of what the
    trajectory itself does up to there, where that is more.

    Parameters
    ----------
    trajectory : Trajectory
    time : float
        Before the start and after the end the arm stands still [s].
    limits : MotionLimits

    Returns
    -------
    Trajectory
        From time 0 on whole nanoseconds; a single point where the arm stands still.

    """
    running = Playback(trajectory=trajectory, start_time=0.0, time_scale=1.0)
    stopped = stop(running, limits, time)
    times = np.append(0.0, np.ceil(_corners(stopped, time) / TICK) * TICK)
    q, v, a = stopped.states_at(time + times)
    if len(times) == 1:
        v, a = np.zeros_like(v), np.zeros_like(a)
    v[-1] = a[-1] = 0.0
    return Trajectory(times=times, positions=q, velocities=v, accelerations=a)


def certify_braking(
    trajectory: Trajectory, time: float, world: World, limits: MotionLimits
) -> Certificate:
    """
    Return the proof that a running trajectory can brake at some time without touching the world.

    Parameters
    ----------
    trajectory : Trajectory
    time : float
        When it begins to brake [s].
    world : World
        As it is then, not as it was when the trajectory was planned.
    limits : MotionLimits
        That it brakes within.

    """
    return certify(brake(trajectory, time, limits), world)


def _corners(playback: Playback, time: float) -> Array:
    """Return when pieces of a motion that comes to rest end, from now on, (n,) [s]."""
    if len(playback.trajectory.times) == 1:
        return np.empty(0)
    knots = (playback.trajectory.times - playback.start_time) / playback.time_scale - time
    if playback.brake is None:
        corners = knots
    else:
        corners = np.union1d(playback.brake.times, playback.brake.times_of(knots))
    corners = corners[corners > CLOSEST]
    # Where two are too close, the later one stays.
    return corners[np.append(np.diff(corners) > CLOSEST, True)] if len(corners) else corners
