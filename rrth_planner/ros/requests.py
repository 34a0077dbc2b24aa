# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""One request: from what was heard to an outcome with a code, whatever happens."""

from collections.abc import Callable
from dataclasses import dataclass, replace
import secrets
import time

import numpy as np
from rrth_planner.arm import reach_to
from rrth_planner.arrays import Array
from rrth_planner.certificate import certify
from rrth_planner.escape import beyond
from rrth_planner.fcl_check import first_touch, touch_on_way_out
from rrth_planner.goal import PointingGoal
from rrth_planner.incident import disagreement_incident, Incident
from rrth_planner.leaving import box_depths, leads_out
from rrth_planner.motion_plan import MotionPlan
from rrth_planner.pipeline import plan_motion
from rrth_planner.question import PlanQuestion
from rrth_planner.ros.error_codes import CODE_OF_STATUS, ErrorCode
from rrth_planner.ros.incidents import PlanError
from rrth_planner.ros.inputs import Inputs, PlanInputs, RequestError
from rrth_planner.ros.parameters import PlannerParameters
from rrth_planner.running_motion import LONGEST_LEAD, RunningMotion
from rrth_planner.scene import Scene
from rrth_planner.takeover import Takeover
from rrth_planner.touch import Disagreement
from rrth_planner.trajectory import Trajectory
from rrth_planner.world import arm_world

# A motion that starts further from the arm than this would begin with a jump [rad].
START_TOLERANCE = 1e-3


# How far ahead a motion begins that takes over from one that runs: that long its plan may take,
# and once more with more time [s].
LEADS = (0.05, LONGEST_LEAD)
# So long before it begins such a motion is told, so that the arm has it in time [s]; not where the
# present motion is unknown, since the arm has to be looked at as late as can be.
EARLY = 0.025
# So late a motion may be told of which nobody knows how the arm moved until then [s].
LATE = 0.02
# How often a motion is held against the wearer before it is told, who may never stand still.
MOST_CHECKS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """
    Where a motion of an arm that moves begins.

    Parameters
    ----------
    time : float
        [s].
    takeover : Takeover
        What the arm does then.
    running : RunningMotion or None
        The motion that it was last told to follow.

    """

    time: float
    takeover: Takeover
    running: RunningMotion | None

    @property
    def early(self) -> float:
        """How long before it begins the motion is told, if all goes well [s]."""
        return 0.0 if self.takeover.running is None else EARLY

    @property
    def latest(self) -> float:
        """When the motion can still be told [s]."""
        return self.time + (LATE if self.takeover.running is None else 0.0)


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
        """The motion to publish; None unless the request succeeded."""
        if self.plan is None or self.code is not ErrorCode.SUCCESS:
            return None
        return self.plan.trajectory


def plan_request(
    heard: Inputs,
    parameters: PlannerParameters,
    clock: Callable[[], float],
    should_stop: Callable[[], bool],
    goal: PointingGoal | None = None,
    running: RunningMotion | None = None,
    catch_up: Callable[[], bool] = lambda: True,
) -> PlanOutcome:
    """
    Return the outcome of a request that begins now.

    A motion for an arm that moves begins with the state that the arm is going to be in shortly,
    and this returns not long before.

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
    running : RunningMotion, optional
        The motion that the arm was last told to follow.
    catch_up : callable, optional
        Returns when the bodies that came are heard, and whether that is so.

    Raises
    ------
    PlanError
        Of an error that nobody expected, once it is known what was asked.

    """
    question: PlanQuestion | None = None
    try:
        for lead in LEADS:
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
            if start is None or clock() <= start.time:
                _require_news(catch_up)
                _wait_for(start, clock, should_stop)
                if should_stop():
                    raise RequestError(ErrorCode.PREEMPTED, 'the request was cancelled')
                moved = _check_news(heard, parameters, clock, inputs, plan, start)
                if moved is not None:
                    incident = disagreement_incident(question, *moved)
                    sentence = f'{incident.sentence}, seed {plan.seed}'
                    return PlanOutcome(
                        ErrorCode.FAILURE, sentence, plan, inputs, incident=incident
                    )
                if start is None or clock() <= start.latest:
                    return PlanOutcome(code, plan.sentence, plan, inputs, start, question)
        raise RequestError(
            ErrorCode.TIMED_OUT,
            f'the arm moves, and no plan was ready within {LEADS[-1]:g} s to take over from its '
            'motion',
        )
    except RequestError as problem:
        return PlanOutcome(problem.code, str(problem))
    except Exception as problem:
        if question is None:
            raise
        raise PlanError(question) from problem


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


def _wait_for(
    start: Start | None, clock: Callable[[], float], should_stop: Callable[[], bool]
) -> None:
    """Return when a motion is to be told; at once for an arm at rest."""
    # A simulated clock may stand still.
    end = time.monotonic() + 2 * LEADS[-1]
    while start is not None and time.monotonic() < end and not should_stop():
        left = start.time - start.early - clock()
        if left <= 0.0:
            return
        time.sleep(min(1e-3, max(1e-5, left)))


def _require_news(catch_up: Callable[[], bool]) -> None:
    """Wait until the bodies that came are heard, or raise RequestError."""
    if not catch_up():
        raise RequestError(
            ErrorCode.SENSOR_INFO_STALE,
            'the node is busy: the bodies that came while the motion was planned are not read yet',
        )


def _check_news(
    heard: Inputs,
    parameters: PlannerParameters,
    clock: Callable[[], float],
    inputs: PlanInputs,
    plan: MotionPlan,
    start: Start | None,
) -> tuple[Disagreement, Scene] | None:
    """Check as `_check_present` does until no other body comes meanwhile."""
    for _ in range(MOST_CHECKS):
        body = heard.body.value
        moved = _check_present(heard, parameters, clock(), inputs, plan, start)
        if moved is not None or heard.body.value is body:
            return moved
    return None


def _check_present(
    heard: Inputs,
    parameters: PlannerParameters,
    now: float,
    inputs: PlanInputs,
    plan: MotionPlan,
    start: Start | None,
) -> tuple[Disagreement, Scene] | None:
    """
    Raise RequestError where wearer or arm have moved so that the motion no longer fits.

    Return what the two judges disagree about in the present world, and its wearer; None where they
    agree.
    """
    trajectory, escape_time = plan.trajectory, plan.escape_time
    assert trajectory is not None
    present = heard.at(now, parameters, inputs.goal)
    expected = inputs.q_start
    if start is None:
        present.require_rest(now, parameters.arm)
    else:
        ahead = inputs.ahead(start.running, present.joints.taken, parameters.arm)
        expected = ahead.state.positions
    moved = float(np.abs(present.q_start - expected).max())
    if not moved <= START_TOLERANCE:
        what = 'moved by' if start is None else 'is off its course by'
        raise RequestError(
            ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
            f'the arm {what} {moved:.4f} rad while its motion was planned, expected at most '
            f'{START_TOLERANCE:g} rad',
        )
    if _is_same(present.scene, inputs.scene):
        return None
    world = arm_world(
        parameters.arm, present.scene, parameters.margin, parameters.ray_guard_length
    )
    q_end: Array = trajectory.positions[-1]
    reach = reach_to(parameters.arm, inputs.goal.target, q_end)
    if not (
        world.is_valid(q_end, reach)
        and (escape_time == 0.0 or leads_out(trajectory, world, escape_time))
        and certify(trajectory, world, escape_time).is_proven
    ):
        raise RequestError(
            ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
            'the wearer moved while the motion was planned, and it is no longer proven free of '
            'the present body',
        )
    # Both judges must agree, as they had to when it was planned.
    arm, margin = parameters.arm, parameters.margin
    touch = None
    if escape_time > 0.0:
        depths = box_depths(world, trajectory.positions[0]).max(axis=0)
        touch = touch_on_way_out(
            arm, present.scene, depths, trajectory, escape_time, margin, world.ray_length
        )
    if touch is None:
        rest = beyond(trajectory, escape_time)
        touch = first_touch(arm, present.scene, rest, margin, world.ray_length, reach)
        if touch is not None:
            touch = replace(touch, time=escape_time + touch.time)
    if touch is None:
        return None
    return Disagreement(trajectory, touch, escape_time), present.scene


def _is_same(one: Scene, other: Scene) -> bool:
    return len(one.boxes) == len(other.boxes) and all(
        a is b
        or (
            np.array_equal(a.center, b.center)
            and np.array_equal(a.size, b.size)
            and np.array_equal(a.rotation, b.rotation)
        )
        for a, b in zip(one.boxes, other.boxes, strict=True)
    )
