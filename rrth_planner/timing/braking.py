# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Braking along a running trajectory, and its certificate."""

import numpy as np
from rrth_planner.collision.certificate import Certificate, certify
from rrth_planner.collision.world import World
from rrth_planner.model.arrays import check_dof, float_number
from rrth_planner.model.errors import check_type
from rrth_planner.model.trajectory import MotionLimits, part_of, sample, Trajectory
from rrth_planner.timing.fast_stop import fast_stop

# What rounding leaves of an acceleration [rad/s^2].
ROUNDING = 1e-9


def brake(trajectory: Trajectory, time: float, limits: MotionLimits) -> Trajectory:
    """
    Return the stop along the path of a running trajectory, from its state at some time.

    It begins with position, velocity and acceleration of that time. Between its points no
    joint is further than 1e-4 rad from the path, nor more than 1 % beyond its limits, or beyond
    what the trajectory itself does up to there, where that is more; jerks only up to rounding,
    which in pieces below 0.1 ms exceeds that. Its times are whole nanoseconds from 0; before the
    start of the motion and after its end [s] the arm stands still, and it is a single point.

    Raises
    ------
    RrthError
        A time that is no number, or limits of another number of joints.

    """
    check_type(trajectory, Trajectory, 'trajectory')
    check_type(limits, MotionLimits, 'limits')
    time = float_number(time, 'time', 's')
    check_dof(trajectory.positions, len(limits.velocity), 'trajectory')
    if not 0.0 < time < trajectory.duration:
        return part_of(trajectory, time, time)
    stop = fast_stop(trajectory, time, limits, lead=0.0)
    state = sample(trajectory, np.array([time]))
    if np.abs(state[2] - stop.accelerations[:1]).max() > ROUNDING:
        # At a point of the trajectory, whose jerk jumps: by the piece that follows.
        return stop
    # Compiled code rounds the last digit of the first state differently.
    rows = zip(state, stop.states, strict=True)
    return Trajectory(stop.times, *(np.concatenate([first, row[1:]]) for first, row in rows))


def certify_braking(
    trajectory: Trajectory, time: float, world: World, limits: MotionLimits
) -> Certificate:
    """
    Return the certificate of `brake` at some time [s].

    The world is the present one, not the one that the trajectory was planned in.
    """
    return certify(brake(trajectory, time, limits), world)
