# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Goals of the action control_msgs/action/PointHead: a target, and a pace."""

from typing import Any

from geometry_msgs.msg import Vector3
import numpy as np
from rrth_planner.io.urdf.export import TOOL
from rrth_planner.model.errors import MessageError, OptionsError, SceneError
from rrth_planner.model.goal import PacedGoal, PointingGoal
from rrth_planner.ros.messages.fields import seconds_of, triple_of

# An axis is along z where its direction deviates by no more than this [-].
SAME_AXIS = 1e-6


def paced_goal(request: Any, goal: PointingGoal, slowest: float) -> PacedGoal:
    """
    Return the goal of a request, `PointHead.Goal`, whose target is known in the base frame.

    slowest: least velocity that may be asked for [rad/s].

    Raises
    ------
    MessageError
        An axis that is not the pointing ray, a frame that is not the tool's, or a velocity or a
        duration out of its range.

    """
    if request.pointing_frame not in ('', TOOL):
        raise MessageError(
            f'pointing_frame: "{request.pointing_frame}", expected "{TOOL}" or an empty frame, '
            'since the pointing ray leaves the tool'
        )
    _require_ray(request.pointing_axis)
    velocity, duration = request.max_velocity, seconds_of(request.min_duration)
    if velocity != 0.0 and not slowest <= velocity:
        raise MessageError(
            f'max_velocity: {velocity:g}, expected at least {slowest:g}, or 0 for that of the '
            'planner [rad/s]'
        )
    try:
        return PacedGoal(goal.target, velocity or np.inf, duration)
    except (OptionsError, SceneError) as problem:
        raise MessageError(str(problem)) from problem


def _require_ray(axis: Vector3) -> None:
    """Raise MessageError where an axis, in the frame of the tool, is not the pointing ray."""
    x, y, z = axis.x, axis.y, axis.z
    if (x, y, z) == (0.0, 0.0, 0.0):
        return
    v = np.array(triple_of(axis, 'pointing_axis'))
    # Such that no square overflows.
    v = v / np.abs(v).max()
    if not (v[2] > 0.0 and np.hypot(v[0], v[1]) <= SAME_AXIS * v[2]):
        raise MessageError(
            f'pointing_axis: ({x:g}, {y:g}, {z:g}), expected (0, 0, 1), the z axis of the tool, '
            'or zeros'
        )
