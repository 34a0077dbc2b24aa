# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Messages to joint_trajectory_controller, accepted and rejected as it does in ROS 2 Jazzy."""

from collections.abc import Sequence

import numpy as np
from rrth_planner.model.errors import MessageError
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.ros.messages.fields import nanoseconds_of
from rrth_planner.ros.messages.trajectory import (
    check_end,
    check_times,
    MOST_POINTS,
    REST_VELOCITY,
    rows_of,
    UNITS,
)
from rrth_planner.simulation.trajectory_controller import TimedPoints
from trajectory_msgs.msg import JointTrajectory


def controller_points_from_msg(
    msg: JointTrajectory, joint_names: Sequence[str], now: float
) -> TimedPoints:
    """
    Return the points of a message that came at a time [s], columns in the order of `joint_names`.

    Rejected, as by the controller with its default parameters: other joints than all of those, no
    point, times that do not increase, positions that are missing, fields with more or fewer values
    than joints, efforts, a last point that moves, a stamp whose motion has ended. Numbers that are
    not finite and more than `MOST_POINTS` points are rejected besides.

    Raises
    ------
    MessageError
        What was given, what was expected, the unit.

    """
    names = list(msg.joint_names)
    if sorted(names) != sorted(joint_names):
        raise MessageError(f'joint_names: {names}, expected each of {list(joint_names)} once')
    if not 1 <= len(msg.points) <= MOST_POINTS:
        raise MessageError(f'points: {len(msg.points)}, expected 1 to {MOST_POINTS}')
    times = [nanoseconds_of(point.time_from_start) for point in msg.points]
    if times[0] < 0:
        raise MessageError(
            f'points[0].time_from_start: {times[0] / NANOSECONDS}, expected >= 0 [s]'
        )
    check_times(times)
    check_end(msg, now)
    if any(len(point.effort) for point in msg.points):
        raise MessageError('effort: given, expected none: the arm follows positions')
    columns = [names.index(name) for name in joint_names]
    rows = {
        field: rows_of(msg.points, field, columns, may_lack=field != 'positions')
        for field in UNITS
    }
    last = rows['velocities'][-1]
    if (np.abs(last) > REST_VELOCITY).any():
        raise MessageError(f'velocity of the last point: {last.tolist()}, expected 0 [rad/s]')
    return TimedPoints(
        times=np.array(times) / NANOSECONDS,
        positions=rows['positions'],
        velocities=rows['velocities'],
        accelerations=rows['accelerations'],
    )
