# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Targets from messages, in any known frame."""

from geometry_msgs.msg import PointStamped
import numpy as np
from rrth_planner.model.errors import MessageError, SceneError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.ros.messages.fields import nanoseconds_of, triple_of
from rrth_planner.ros.messages.frames import Lookup, pose_in_base


def goal_from_msg(
    msg: PointStamped, base_frame: str, lookup: Lookup | None = None
) -> PointingGoal:
    """
    Return the goal to point at a point, in the base frame; for frames see `pose_in_base`.

    Raises
    ------
    MessageError
        A bad point; a FrameError when its frame is the reason.

    """
    point = np.array(triple_of(msg.point, 'point'))
    stamp = nanoseconds_of(msg.header.stamp)
    T = pose_in_base(msg.header.frame_id, base_frame, lookup, stamp)
    try:
        # What overflows is infinite, which a goal rejects.
        with np.errstate(over='ignore', invalid='ignore'):
            return PointingGoal(T[:3, :3] @ point + T[:3, 3])
    except SceneError as problem:
        raise MessageError(str(problem)) from problem
