# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A stop along a running motion that is found within a millisecond."""

import numpy as np
from rrth_planner.kernels.trajectory.fast_stop import write_fast_stop
from rrth_planner.kernels.trajectory.stop_trajectory import SPACINGS
from rrth_planner.model.trajectory import MotionLimits, piece_coefficients, Trajectory

# A stop is not expected to reach the controller before [s].
ON_ITS_WAY = 0.01


def fast_stop(
    trajectory: Trajectory, time: float, limits: MotionLimits, lead: float = ON_ITS_WAY
) -> Trajectory:
    """
    Return how an arm that is at a time within a motion comes to rest along it.

    For as long as a message may be on its way the motion goes on as it is: a controller that gets
    the stop a little late finds itself on it.

    Parameters
    ----------
    trajectory : Trajectory
    time : float
        Within it [s].
    limits : MotionLimits
        The stop exceeds them by no more than the motion does up to there, or by less than 1 %;
        a jerk is told to rounding, which in pieces below 0.1 ms is more than that.
    lead : float
        For so long the motion goes on as it is [s].

    Returns
    -------
    Trajectory
        From the state at that time to rest, no joint further than 1e-4 rad from the path, with
        points no further apart than 50 ms once it slows down; the rest of the motion where that
        ends as soon.

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
    most = len(trajectory.times) + 8 + int(trajectory.duration / SPACINGS[-1])
    times, states = np.empty(most), np.empty((3, most, dof))
    n = write_fast_stop(
        curves,
        trajectory.times,
        time,
        lead,
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
