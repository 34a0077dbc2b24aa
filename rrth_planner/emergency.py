# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A stop along a running motion that is found within a millisecond."""

import numpy as np
from rrth_planner.kernels.quick_stop import quick_stop
from rrth_planner.kernels.stop_points import SPACING
from rrth_planner.trajectory import MotionLimits, piece_coefficients, Trajectory

# A stop is not expected to reach the controller before [s].
ON_ITS_WAY = 0.01


def emergency_stop(trajectory: Trajectory, time: float, limits: MotionLimits) -> Trajectory:
    """
    Return how an arm that is at a time within a motion comes to rest along it.

    For as long as a message may be on its way the motion goes on as it is: a controller that gets
    the stop a little late finds itself on it. From there on it is about as soon at rest as by
    `braking.brake`, which takes several milliseconds to prove what here is only looked at.

    Parameters
    ----------
    trajectory : Trajectory
    time : float
        Within it [s].
    limits : MotionLimits
        The stop exceeds them by no more than the motion does up to there, or by less than 1 %.

    Returns
    -------
    Trajectory
        From the state at that time to rest, with points no further apart than 50 ms once it
        slows down; the rest of the motion where that ends as soon.

    """
    time = min(max(time, 0.0), trajectory.duration)
    curves, dof = piece_coefficients(trajectory), trajectory.positions.shape[1]
    if time == trajectory.duration:
        still = np.zeros((1, dof))
        return Trajectory(
            times=np.zeros(1),
            positions=trajectory.positions[-1:],
            velocities=still,
            accelerations=still,
        )
    most = len(trajectory.times) + 8 + int(trajectory.duration / SPACING)
    times, states = np.empty(most), np.empty((3, most, dof))
    n = quick_stop(
        curves,
        trajectory.times,
        time,
        ON_ITS_WAY,
        limits.velocity,
        limits.acceleration,
        limits.jerk,
        times,
        states,
    )
    return Trajectory(
        times=times[:n],
        positions=states[0, :n],
        velocities=states[1, :n],
        accelerations=states[2, :n],
    )
