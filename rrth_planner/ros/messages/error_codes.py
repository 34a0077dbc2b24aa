# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Error codes of answers: names and numbers of moveit_msgs/MoveItErrorCodes."""

from rrth_planner.model.errors import MessageError
from rrth_planner.model.status import ErrorCode
from rrth_planner.ros.messages.frames import FrameError

# When each is answered, and what the sentence behind it names.
MEANINGS = {
    ErrorCode.SUCCESS: 'the trajectory has been published',
    ErrorCode.PLANNING_FAILED: 'no free goal configuration was reached within `max_samples`',
    ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE: 'the wearer or the arm moved into '
    'every motion that was planned until `time_limit`',
    ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA: 'no body, target or joints yet: says which topic',
    ErrorCode.TIMED_OUT: 'no path within `time_limit`',
    ErrorCode.PREEMPTED: 'cancelled, or 64 requests wait for their answers already',
    ErrorCode.START_STATE_IN_COLLISION: 'a bar of the arm is `escape_depth` or deeper in a box, '
    'or no escape of bars and ray is proven: which part of the arm, which box, how deep; or '
    '`RAY_BLOCKED`: a part stays in the pointing ray of an arm at rest',
    ErrorCode.GOAL_IN_COLLISION: 'the target is inside a box, or all goal configurations that '
    'were tried violate the margin: which part of the arm, which box, how deep',
    ErrorCode.INVALID_GOAL_CONSTRAINTS: 'the target of a request is not valid',
    ErrorCode.FRAME_TRANSFORM_FAILURE: 'a message in a frame that is not known',
    ErrorCode.ROBOT_STATE_STALE: 'the joints are older than `joint_timeout` (counted from the '
    'stamp), or the last of them were rejected',
    ErrorCode.SENSOR_INFO_STALE: 'the body is older than `body_timeout` (counted from the stamp), '
    'the last one was rejected, a part of it is lost, or the node is too busy to read the '
    'bodies that came',
    ErrorCode.START_STATE_INVALID: 'a joint is outside its limits, by more than 0.05 rad or 5 mm '
    'or without a free way in, or the arm moves and has no room to stop straight ahead',
    ErrorCode.NO_IK_SOLUTION: 'no configuration within the joint limits aims at the target',
    ErrorCode.FAILURE: 'the motion could not be certified, the two checkers disagree, the '
    'planning process hangs (at most 5 s after `time_limit`), or an unexpected error '
    'occurred: the answer names the file of the incident, by which to replay it, and the log has '
    'the details',
}


def code_of_rejection(problem: MessageError, otherwise: ErrorCode) -> ErrorCode:
    """Return the code of a rejected message: the one of a bad frame, or another one."""
    return ErrorCode.FRAME_TRANSFORM_FAILURE if isinstance(problem, FrameError) else otherwise
