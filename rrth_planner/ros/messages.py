# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Messages and the core's types, in both directions: the only place where input is checked.

Bodies and trajectories have modules of their own; their names are offered here too.
"""

from collections.abc import Sequence

from geometry_msgs.msg import PointStamped
from rrth_planner.arrays import Array, frozen_array
from rrth_planner.errors import MessageError, SceneError
from rrth_planner.goal import PointingGoal
from rrth_planner.ros.bodies import scene_of, WearerBody
from rrth_planner.ros.fields import position_of
from rrth_planner.ros.frames import FrameError, Lookup, pose_in_base
from rrth_planner.ros.trajectories import (
    joint_trajectory_from_msg,
    joint_trajectory_to_msg,
    pose_to_msg,
    tool_path_to_msg,
)
from sensor_msgs.msg import JointState

__all__ = [
    'FrameError',
    'WearerBody',
    'configuration_from_msg',
    'goal_from_msg',
    'has_joint_of',
    'joint_trajectory_from_msg',
    'joint_trajectory_to_msg',
    'pose_to_msg',
    'scene_of',
    'tool_path_to_msg',
]


def goal_from_msg(
    msg: PointStamped, base_frame: str, lookup: Lookup | None = None
) -> PointingGoal:
    """
    Return the goal to point at a point.

    Parameters
    ----------
    msg : PointStamped
    base_frame : str
        Frame of the goal; an empty frame of the message is taken as it.
    lookup : callable, optional
        frame -> its pose in the base frame, shape (4, 4) [m]; without, no other is known.

    Raises
    ------
    MessageError
        A bad point; a FrameError when its frame is the reason.

    """
    point = position_of(msg.point, 'point')
    T = pose_in_base(msg.header.frame_id, base_frame, lookup)
    try:
        return PointingGoal(T[:3, :3] @ point + T[:3, 3])
    except SceneError as problem:
        raise MessageError(str(problem)) from problem


def has_joint_of(msg: JointState, joint_names: Sequence[str]) -> bool:
    """Return whether a message speaks of any of these joints."""
    return not set(joint_names).isdisjoint(msg.name)


def configuration_from_msg(msg: JointState, joint_names: Sequence[str]) -> Array:
    """
    Return the positions of these joints, by name, shape (dof,) [rad]; others are ignored.

    Raises
    ------
    MessageError
        A joint that is missing or there twice, a position that is missing or not finite.

    """
    names = list(msg.name)
    missing = [name for name in joint_names if name not in names]
    if missing:
        raise MessageError(f'name: no {missing} in {names}, expected all of {list(joint_names)}')
    twice = [name for name in joint_names if names.count(name) > 1]
    if twice:
        raise MessageError(f'name: {twice} twice in {names}, expected each joint once')
    if len(msg.position) != len(names):
        raise MessageError(
            f'position: {len(msg.position)} values for {len(names)} names, expected one a name '
            '[rad]'
        )
    q = [msg.position[names.index(name)] for name in joint_names]
    return frozen_array(q, (len(q),), f'position of {list(joint_names)}', 'rad', MessageError)
