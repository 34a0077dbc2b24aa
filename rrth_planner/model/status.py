# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Results of planning, and of requests."""

from enum import Enum, IntEnum


class PlanStatus(Enum):
    """Results of planning that are not errors; each comes with a sentence."""

    SOLVED = 'solved'
    TIMEOUT = 'timeout'
    SAMPLE_LIMIT = 'sample limit'
    CANCELLED = 'cancelled'
    START_OUT_OF_BOUNDS = 'start out of bounds'
    START_MOVES = 'start moves'
    START_IN_COLLISION = 'start in collision'
    GOAL_IN_COLLISION = 'goal in collision'
    GOAL_UNREACHABLE = 'goal unreachable'
    NOT_CERTIFIED = 'not certified'


class ErrorCode(IntEnum):
    """
    The codes that the planner answers with.

    Names and numbers are those of moveit_msgs/MoveItErrorCodes.
    """

    SUCCESS = 1
    PLANNING_FAILED = -1
    MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE = -3
    UNABLE_TO_AQUIRE_SENSOR_DATA = -5
    TIMED_OUT = -6
    PREEMPTED = -7
    START_STATE_IN_COLLISION = -10
    GOAL_IN_COLLISION = -12
    INVALID_GOAL_CONSTRAINTS = -16
    FRAME_TRANSFORM_FAILURE = -21
    ROBOT_STATE_STALE = -23
    SENSOR_INFO_STALE = -24
    START_STATE_INVALID = -26
    NO_IK_SOLUTION = -31
    FAILURE = 99999
