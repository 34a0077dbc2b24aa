# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""One request: from what was heard to an outcome with a code, whatever happens."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
import secrets

from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.io.incident import disagreement_incident, Incident
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.plan_motion import plan_motion
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.ros.interface.inputs import ArmHasMoved, Inputs, PlanInputs, RequestError
from rrth_planner.ros.interface.parameters import PlannerParameters
from rrth_planner.ros.messages.error_codes import CODE_OF_STATUS, ErrorCode
from rrth_planner.ros.requests.handover import LEADS, Start
from rrth_planner.ros.requests.incidents import PlanError
from rrth_planner.ros.requests.revalidation import require_news, Revalidation

# How often both judges are asked about a motion before it is told: the wearer may never stand
# still.
MOST_LOOKS = 3


@dataclass(frozen=True, slots=True, eq=False)
class PlanOutcome:
    """
    How a request ended: code and sentence; the rest where there was any.

    Parameters
    ----------
    code : ErrorCode
    sentence : str
    plan : MotionPlan or None
    inputs : PlanInputs or None
    start : Start or None
    question : PlanQuestion or None
        What the plan was asked.
    incident : Incident or None
        To be kept in a file, which the answer then names.

    """

    code: ErrorCode
    sentence: str
    plan: MotionPlan | None = None
    inputs: PlanInputs | None = None
    start: Start | None = None
    question: PlanQuestion | None = None
    incident: Incident | None = None

    @property
    def trajectory(self) -> Trajectory | None:
        """The motion that is told; None unless the request succeeded."""
        if self.plan is None or self.code is not ErrorCode.SUCCESS:
            return None
        return self.plan.trajectory


def plan_request(
    heard: Inputs,
    parameters: PlannerParameters,
    clock: Callable[[], float],
    should_stop: Callable[[], bool],
    goal: PointingGoal | None = None,
    running: ExecutingMotion | None = None,
    catch_up: Callable[[], bool] = lambda: True,
    tell: Callable[[PlanOutcome, Callable[[], bool]], bool] = lambda _, fits: fits(),
) -> PlanOutcome:
    """
    Return the outcome of a request that begins now, once its motion is told.

    A motion for an arm that moves begins with the state that the arm is going to be in shortly,
    and is told not long before.

    Parameters
    ----------
    heard : Inputs
        What a plan begins with is copied from here at once; at the end it is looked at again.
    parameters : PlannerParameters
    clock : callable
        Returns the present time [s].
    should_stop : callable
        Polled while planning; True cancels.
    goal : PointingGoal, optional
        Of the request; without, the last target.
    running : ExecutingMotion, optional
        The motion that the arm was last told to follow.
    catch_up : callable, optional
        Returns when the bodies that came are heard, and whether that is so.
    tell : callable, optional
        Gets an outcome with a motion, and what says whether it still fits, and returns that; tells
        the motion if so. May raise RequestError.

    Raises
    ------
    PlanError
        Of an error that nobody expected, once it is known what was asked.

    """
    question: PlanQuestion | None = None
    plan: MotionPlan | None = None
    try:
        for lead in LEADS:
            question = plan = None
            now = clock()
            inputs = heard.at(now, parameters, goal)
            if should_stop():
                raise RequestError(
                    ErrorCode.PREEMPTED, 'the request was cancelled before its turn'
                )
            start = None
            if inputs.is_moving(now) or inputs.pauses(running, now, lead):
                start = Start(
                    now + lead, inputs.ahead(running, now + lead, parameters.arm), running
                )
            question = _question(inputs, parameters, start)
            plan = plan_motion(**question.arguments, should_stop=should_stop)
            code = CODE_OF_STATUS[plan.status]
            if plan.disagreement is not None:
                incident = disagreement_incident(question, plan.disagreement)
                return PlanOutcome(code, plan.sentence, plan, inputs, incident=incident)
            if plan.trajectory is None or code is not ErrorCode.SUCCESS:
                return PlanOutcome(code, plan.sentence, plan, inputs)
            if start is not None:
                begin = clock()
                if begin > start.time:
                    continue
                require_news(catch_up)
                # That long it may take again.
                start.wait(clock, should_stop, clock() - begin)
            outcome = PlanOutcome(code, plan.sentence, plan, inputs, start, question)
            look = Revalidation(
                heard, clock, parameters, inputs, plan, start, running, should_stop
            )
            try:
                told = _told(outcome, look, tell)
            except ArmHasMoved:
                if start is not None or running is None or lead == LEADS[-1]:
                    raise
                # It seemed at rest, and has just begun the motion that it was told.
                continue
            if told is not None:
                return told
        raise RequestError(
            ErrorCode.TIMED_OUT,
            f'the arm moves, and no plan was ready and checked within {LEADS[-1]:g} s to take '
            'over from its motion',
        )
    except RequestError as problem:
        return PlanOutcome(problem.code, str(problem), plan)
    except Exception as problem:
        if question is None:
            raise
        raise PlanError(question, None if plan is None else plan.trajectory) from problem


def _told(
    outcome: PlanOutcome,
    look: Revalidation,
    tell: Callable[[PlanOutcome, Callable[[], bool]], bool],
) -> PlanOutcome | None:
    """Return the outcome once its motion is told, or why it is not; None: it is too late."""
    for n_looks in range(1, MOST_LOOKS + 1):
        if look.should_stop():
            raise RequestError(ErrorCode.PREEMPTED, 'the request was cancelled')
        if look.is_late():
            return None
        begin = look.clock()
        seen = look.take()
        if seen.disagreement is not None:
            assert outcome.question is not None
            incident = disagreement_incident(outcome.question, seen.disagreement, seen.scene)
            sentence = f'{incident.sentence}, seed {look.plan.seed}'
            return replace(outcome, code=ErrorCode.FAILURE, sentence=sentence, incident=incident)
        # Another look, and to hear what came meanwhile, takes about as long again.
        is_last = n_looks == MOST_LOOKS or look.is_late(2.0 * (look.clock() - begin))
        if tell(outcome, partial(look.still_fits, seen, is_last)):
            return outcome
    return None


def _question(
    inputs: PlanInputs, parameters: PlannerParameters, start: Start | None
) -> PlanQuestion:
    return PlanQuestion(
        arm=parameters.arm,
        scene=inputs.scene,
        q_start=inputs.q_start if start is None else start.takeover.state.positions,
        goal=inputs.goal,
        limits=parameters.limits,
        options=parameters.options,
        margin=parameters.margin,
        ray_guard_length=parameters.ray_guard_length,
        seed=secrets.randbelow(2**31) if parameters.seed < 0 else parameters.seed,
        moving=None if start is None else start.takeover,
        escape_depth=parameters.escape_depth,
    )
