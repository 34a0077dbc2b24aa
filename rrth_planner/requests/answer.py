# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Answers to requests, with the codes of moveit_msgs/MoveItErrorCodes."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from rrth_planner.model.errors import one_line
from rrth_planner.model.status import ErrorCode, PlanStatus

# To plan again in a moment changes nothing: neither wearer nor inputs are the reason.
FINAL = frozenset(
    {
        ErrorCode.FAILURE,
        ErrorCode.PREEMPTED,
        ErrorCode.NO_IK_SOLUTION,
        ErrorCode.INVALID_GOAL_CONSTRAINTS,
    }
)

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


@dataclass(frozen=True, slots=True)
class Answer:
    """
    An answer of the planner.

    Parameters
    ----------
    figures : mapping
        Of the motion, as far as known: `waypoints`, `duration` [s], `path_length` [rad],
        `least_clearance` [m], `planning_time_ms`, `response_time_ms` and `seed`.
    number : int
        Of the answer, from 1 on; 0: it has none.
    stamp : int or None
        That of the motion's message [ns]; None: no motion was published, or its stamp is not
        known.

    """

    code: ErrorCode
    sentence: str
    figures: Mapping[str, float] = field(default_factory=dict)
    number: int = 0
    stamp: int | None = None

    @property
    def text(self) -> str:
        """Code and sentence in one line, as services answer them."""
        return answer(self.code, self.sentence)


def answer(code: ErrorCode, sentence: str) -> str:
    """Return the answer of a service, in one line: `NAME (number): sentence`."""
    return one_line(f'{code.name} ({code.value}): {sentence}')
