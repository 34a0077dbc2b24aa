# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The fail-safe stop along a running motion, computed within a millisecond."""

import numpy as np
from rrth_planner.kernels.trajectory.fast_stop import write_fast_stop
from rrth_planner.kernels.trajectory.stop_trajectory import SPACINGS
from rrth_planner.model.curves import curves_of, motion_through
from rrth_planner.model.trajectory import MotionLimits, Trajectory

# Assumed latency of the stop message to the controller [s].
LATENCY = 0.01


def fast_stop(
    trajectory: Trajectory, time: float, limits: MotionLimits, lead: float = LATENCY
) -> Trajectory:
    """
    Return the fail-safe stop along a motion, from a time within it.

    During `lead` [s], the latency of the message, the motion continues unchanged, so that a
    controller that receives the stop a little late is still on it.

    It leads from the state at that time [s] to rest, no joint further than 1e-4 rad from the path,
    with points no further apart than 50 ms once it slows down; it is the remaining motion where
    that ends as soon. It exceeds the limits by no more than the motion does up to there, or by
    less than 1 %; jerks only up to rounding, which in pieces below 0.1 ms exceeds that.
    """
    time = min(max(time, 0.0), trajectory.duration)
    curves, dof = curves_of(trajectory), trajectory.positions.shape[1]
    if time == trajectory.duration:
        still = np.zeros((1, dof))
        return Trajectory(np.zeros(1), trajectory.positions[-1:], still, still)
    most = len(trajectory.times) + 8 + int(trajectory.duration / SPACINGS[-1])
    times, states = np.empty(most), np.empty((3, most, dof))
    n = write_fast_stop(curves, trajectory.times, time, lead, *limits.rows, times, states)
    return motion_through(times[:n].copy(), states[:, :n].copy())
