# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How a request ended."""

from dataclasses import dataclass

from rrth_planner.execution.handover import Handover
from rrth_planner.io.incident import Incident
from rrth_planner.model.status import ErrorCode
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.requests.answer import Answer, answer
from rrth_planner.requests.inputs import InputSnapshot
from rrth_planner.requests.parameters import RequestParameters


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """
    How a request ended: code, sentence and, where known, the rest.

    Parameters
    ----------
    code, sentence
        Of the answer.
    handover : Handover or None
        None: the motion begins at rest.
    parameters : RequestParameters or None
        Those of the plan.
    incident : Incident or None
        To be written to a file, which the answer names.
    response_time : float
        From the request, its turn included, to the published motion [s]; NaN without one.
    stamp : int or None
        Of the motion's message [ns]; None: none was published.
    number : int
        Of the answer; 0: it has none.

    """

    code: ErrorCode
    sentence: str
    plan: MotionPlan | None = None
    snapshot: InputSnapshot | None = None
    handover: Handover | None = None
    parameters: RequestParameters | None = None
    incident: Incident | None = None
    response_time: float = float('nan')
    stamp: int | None = None
    number: int = 0

    @property
    def text(self) -> str:
        """Code and sentence in one line, as services answer them."""
        return answer(self.code, self.sentence)

    @property
    def trajectory(self) -> Trajectory | None:
        """The motion to publish; None unless the request succeeded."""
        if self.plan is None or self.code is not ErrorCode.SUCCESS:
            return None
        return self.plan.trajectory

    @property
    def is_outdated(self) -> bool:
        """Whether wearer or arm have moved meanwhile, or the arm still moves."""
        if self.code is ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE:
            return True
        is_start = self.code in (
            ErrorCode.START_STATE_IN_COLLISION,
            ErrorCode.START_STATE_INVALID,
        )
        return is_start and self.handover is not None

    @property
    def is_in_the_way(self) -> bool:
        """Whether the wearer is in the way, who may move on."""
        return self.code in (
            ErrorCode.START_STATE_IN_COLLISION,
            ErrorCode.GOAL_IN_COLLISION,
            ErrorCode.PLANNING_FAILED,
        )

    @property
    def answer(self) -> Answer:
        """The answer, with the figures of the plan."""
        plan, trajectory = self.plan, self.trajectory
        figures: dict[str, float] = {}
        if plan is not None:
            figures |= {'seed': plan.seed, 'planning_time_ms': 1e3 * plan.planning_time}
        if plan is not None and plan.path is not None and trajectory is not None:
            figures |= {
                'waypoints': len(plan.path.waypoints),
                'response_time_ms': 1e3 * self.response_time,
                'duration': trajectory.duration,
                'path_length': plan.path.length,
                'least_clearance': plan.clearance,
            }
        return Answer(self.code, self.sentence, figures, self.number, self.stamp)
