# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Messages and the core's types, in both directions: the only place where input is checked.

Each kind has a module of its own; their names are offered here.
"""

from rrth_planner.ros.bodies import scene_of, WearerBody
from rrth_planner.ros.frames import FrameError
from rrth_planner.ros.goals import goal_from_msg
from rrth_planner.ros.joints import (
    configuration_from_msg,
    has_joint_of,
    joint_reading,
    JointReading,
)
from rrth_planner.ros.trajectories import (
    joint_trajectory_from_msg,
    joint_trajectory_to_msg,
    pose_to_msg,
    tool_path_to_msg,
)

__all__ = [
    'FrameError',
    'JointReading',
    'WearerBody',
    'configuration_from_msg',
    'goal_from_msg',
    'has_joint_of',
    'joint_reading',
    'joint_trajectory_from_msg',
    'joint_trajectory_to_msg',
    'pose_to_msg',
    'scene_of',
    'tool_path_to_msg',
]
