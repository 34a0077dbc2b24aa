# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion between trajectories and messages, with the checks of controllers."""

from array import array
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
import numpy as np
from rrth_planner.model.arm import ArmModel, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import MessageError, RrthError
from rrth_planner.model.rotation import quaternion_xyzw
from rrth_planner.model.stamp import NANOSECONDS, stamp_of
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.ros.messages.fields import (
    nanoseconds_of,
    numbers,
    seconds_of,
)
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

# joint_trajectory_controller rejects a last point that is faster (float epsilon) [rad/s].
REST_VELOCITY = float(np.finfo(np.float32).eps)
# More are rejected: reading them would block the node.
MOST_POINTS = 10_000
UNITS = {'positions': 'rad', 'velocities': 'rad/s', 'accelerations': 'rad/s^2'}


def joint_trajectory_to_msg(
    trajectory: Trajectory, joint_names: Sequence[str], frame: str, begin: float = 0.0
) -> JointTrajectory:
    """
    Return a trajectory as a message that starts at a time [s], or on reception (stamp 0).

    Its numbers are those of the trajectory, which was proven; times are rounded to whole
    nanoseconds.

    Raises
    ------
    MessageError
        Not at rest at the end, or two points closer than a nanosecond.

    """
    # Numbers one by one, as in what follows: of few points arrays take longer.
    velocities, accelerations = trajectory.velocities.tolist(), trajectory.accelerations.tolist()
    if any(abs(value) > REST_VELOCITY for value in velocities[-1]):
        raise MessageError(f'velocity of the last point: {velocities[-1]}, expected 0 [rad/s]')
    times = [round(t * NANOSECONDS) for t in trajectory.times.tolist()]
    check_times(times)
    msg = JointTrajectory(joint_names=list(joint_names))
    msg.header.frame_id = frame
    msg.header.stamp.sec, msg.header.stamp.nanosec = divmod(stamp_of(begin), NANOSECONDS)
    positions = trajectory.positions.tolist()
    for time, q, v, a in zip(times, positions, velocities, accelerations, strict=True):
        # Arrays are taken as they are; lists would be checked number by number.
        point = JointTrajectoryPoint(
            positions=array('d', q), velocities=array('d', v), accelerations=array('d', a)
        )
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(time, NANOSECONDS)
        msg.points.append(point)
    return msg


def joint_trajectory_from_msg(
    msg: JointTrajectory, joint_names: Sequence[str], now: float | None = None
) -> Trajectory:
    """
    Return a message's trajectory, its columns in the order of `joint_names`.

    Rejects what joint_trajectory_controller rejects, and besides numbers that are not finite,
    joints named twice, a first point that is not at time 0, and points without velocities or
    accelerations: between two points a quintic fits all three. With the time of reception [s], a
    stamped message that has already ended is rejected, too.

    Raises
    ------
    MessageError
        What was given, what was expected, the unit.

    """
    names = list(msg.joint_names)
    if sorted(names) != sorted(joint_names):
        raise MessageError(f'joint_names: {names}, expected each of {list(joint_names)} once')
    if not msg.points:
        raise MessageError('points: none, expected at least one')
    if len(msg.points) > MOST_POINTS:
        raise MessageError(f'points: {len(msg.points)}, expected at most {MOST_POINTS}')
    times = [nanoseconds_of(point.time_from_start) for point in msg.points]
    if times[0] != 0:
        raise MessageError(
            f'points[0].time_from_start: {times[0] / NANOSECONDS}, expected 0, the state at the '
            'start [s]'
        )
    check_times(times)
    if now is not None:
        check_end(msg, now)
    if any(len(point.effort) for point in msg.points):
        raise MessageError('effort: given, expected none: the arm follows positions')
    columns = [names.index(name) for name in joint_names]
    values = {field: rows_of(msg.points, field, columns) for field in UNITS}
    if (np.abs(values['velocities'][-1]) > REST_VELOCITY).any():
        raise MessageError(
            f'velocity of the last point: {values["velocities"][-1].tolist()}, expected 0 [rad/s]'
        )
    try:
        return Trajectory(times=np.array(times) / NANOSECONDS, **values)
    except RrthError as problem:
        raise MessageError(str(problem)) from problem


def tool_path_to_msg(arm: ArmModel, trajectory: Trajectory, frame: str, n_poses: int) -> Path:
    """Return the tool's poses at so many equal steps of time along a trajectory (n_poses > 1)."""
    msg = Path()
    msg.header.frame_id = frame
    positions, _, _ = sample(trajectory, np.linspace(0.0, trajectory.duration, n_poses))
    msg.poses = [pose_to_msg(T, frame) for T in tool_pose(arm, positions)]
    return msg


def pose_to_msg(T: Array, frame: str) -> PoseStamped:
    """Return a pose of a frame, shape (4, 4) [m], as a message with stamp 0 (the latest)."""
    msg = PoseStamped()
    msg.header.frame_id = frame
    p, o = msg.pose.position, msg.pose.orientation
    p.x, p.y, p.z = T[:3, 3].tolist()
    o.x, o.y, o.z, o.w = quaternion_xyzw(T[:3, :3]).tolist()
    return msg


def check_end(msg: JointTrajectory, now: float) -> None:
    """Raise MessageError where a stamped motion has ended at a time [s]."""
    stamp = seconds_of(msg.header.stamp)
    duration = nanoseconds_of(msg.points[-1].time_from_start) / NANOSECONDS
    if stamp != 0.0 and stamp + duration < now:
        raise MessageError(
            f'header.stamp: {stamp} with a duration of {duration}, expected 0 or an end after the '
            f'present time {now} [s]'
        )


def check_times(times: Sequence[int]) -> None:
    """Raise MessageError unless the times of points strictly increase [ns]."""
    for i, (before, after) in enumerate(pairwise(times)):
        if after <= before:
            raise MessageError(
                f'points[{i + 1}].time_from_start: {after / NANOSECONDS} after '
                f'{before / NANOSECONDS}, expected strictly increasing times [s]'
            )


def rows_of(
    points: Sequence[Any], field: str, columns: Sequence[int], *, may_lack: bool = False
) -> Array:
    """Return a field of all points, (n, dof), NaN where one lacks it and may; or MessageError."""
    rows = []
    for i, point in enumerate(points):
        name, row = f'points[{i}].{field}', getattr(point, field)
        if may_lack and not len(row):
            rows.append(np.full(len(columns), np.nan))
            continue
        if len(row) != len(columns):
            raise MessageError(
                f'{name}: {len(row)} values, expected {len(columns)}, one a joint [{UNITS[field]}]'
            )
        rows.append(numbers(list(row), name, UNITS[field])[list(columns)])
    return np.array(rows)
