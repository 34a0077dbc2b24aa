# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Error codes of answers: names and numbers of moveit_msgs/MoveItErrorCodes."""

from enum import IntEnum

from rrth_planner.model.errors import MessageError, one_line
from rrth_planner.model.status import PlanStatus
from rrth_planner.ros.messages.frames import FrameError


class ErrorCode(IntEnum):
    """The codes that the planner answers with, spelt as MoveIt spells them."""

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


CODE_OF_STATUS = {
    PlanStatus.SOLVED: ErrorCode.SUCCESS,
    PlanStatus.TIMEOUT: ErrorCode.TIMED_OUT,
    PlanStatus.SAMPLE_LIMIT: ErrorCode.PLANNING_FAILED,
    PlanStatus.CANCELLED: ErrorCode.PREEMPTED,
    PlanStatus.START_OUT_OF_BOUNDS: ErrorCode.START_STATE_INVALID,
    PlanStatus.START_MOVES: ErrorCode.START_STATE_INVALID,
    PlanStatus.START_IN_COLLISION: ErrorCode.START_STATE_IN_COLLISION,
    PlanStatus.GOAL_IN_COLLISION: ErrorCode.GOAL_IN_COLLISION,
    PlanStatus.GOAL_UNREACHABLE: ErrorCode.NO_IK_SOLUTION,
    PlanStatus.NOT_CERTIFIED: ErrorCode.FAILURE,
}


def code_of_rejection(problem: MessageError, otherwise: ErrorCode) -> ErrorCode:
    """Return the code of a rejected message: the one of a bad frame, or another one."""
    return ErrorCode.FRAME_TRANSFORM_FAILURE if isinstance(problem, FrameError) else otherwise


def answer(code: ErrorCode, sentence: str) -> str:
    """Return the answer of a service, in one line: `NAME (number): sentence`."""
    return one_line(f'{code.name} ({code.value}): {sentence}')
