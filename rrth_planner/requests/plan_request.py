# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""One request: from the latest inputs to an outcome with a code, even after an error."""

from collections.abc import Awaitable, Callable
from dataclasses import replace
import math

import numpy as np
from rrth_planner.execution.command import ahead
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.expected_wearer import joined
from rrth_planner.execution.handover import Handover, LATE, LEADS
from rrth_planner.io.incident import disagreement_incident
from rrth_planner.model.arrays import Array, FARTHEST
from rrth_planner.model.errors import RequestError, RrthError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.status import ErrorCode, PlanStatus
from rrth_planner.model.trajectory import MotionState, sample
from rrth_planner.pipeline.host import Host
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.requests.answer import CODE_OF_STATUS
from rrth_planner.requests.incidents import PlanError
from rrth_planner.requests.inputs import ArmHasMoved, Inputs, InputSnapshot
from rrth_planner.requests.outcome import Outcome
from rrth_planner.requests.pace import (
    is_too_short,
    limits_of,
    MOST_SLOWER,
    require_long_enough,
    slower,
)
from rrth_planner.requests.parameters import RequestParameters
from rrth_planner.requests.revalidation import Revalidation

# A request that waits for its handover looks so often whether it was cancelled [s].
LONGEST_SLEEP = 0.05


async def plan_request(
    host: Host,
    inputs: Inputs,
    parameters: RequestParameters,
    should_stop: Callable[[], bool],
    publish: Callable[[Outcome, Revalidation], Awaitable[Outcome | None]],
    goal: PointingGoal | None = None,
    hold: Callable[[float], ExecutingMotion | None] = lambda until: None,
) -> Outcome:
    """
    Return the outcome of a request that begins now, once its motion is published.

    Where the arm moves, the motion begins with its predicted state at the handover, and is
    published shortly before.

    Parameters
    ----------
    host : Host
        Where it runs.
    inputs : Inputs
        Copied at the beginning; checked again before the motion is published.
    should_stop : callable
        Polled while planning, by any thread; True cancels.
    publish : callable
        Awaited; takes an outcome with a motion, and its revalidation; publishes the motion, and
        returns the outcome, or None where it is too late. May raise RequestError.
    goal : PointingGoal, optional
        Of the request; without, the last target.
    hold : callable, optional
        Returns what the arm is commanded, which does not change until a time [s]; None: that is
        not known.

    Raises
    ------
    PlanError
        On an unexpected error, once the question is known.

    """
    question: PlanQuestion | None = None
    plan: MotionPlan | None = None
    try:
        delay = parameters.execution.controller_delay
        for lead in LEADS:
            question = plan = None
            require_not_cancelled(should_stop, 'the request was cancelled before its turn')
            now = host.now()
            then = now + lead + ahead(delay)
            running = hold(then + LATE)
            snapshot = inputs.at(now, parameters, goal)
            handover, q_start = None, snapshot.q_start
            if snapshot.joints.is_moving(now) or snapshot.is_about_to_move(
                running, now, then - now, delay
            ):
                handover = _handover(snapshot, running, then, lead, parameters)
                q_start = handover.start_state.state.positions
            else:
                hold(math.inf)
                if running is not None:
                    # The controller holds what it was given last, from which the arm may sag.
                    q_start = running.trajectory.positions[-1]
            seed = host.new_seed() if parameters.seed < 0 else parameters.seed
            age = inputs.body_age(now)
            question = _question(snapshot, parameters, handover, q_start, age, seed)
            question, plan = await _plan_round(
                inputs.expected_scene(), question, host, should_stop
            )
            for _ in range(MOST_SLOWER):
                if not is_too_short(plan, snapshot.goal):
                    break
                question = slower(question, plan, snapshot.goal)
                plan = await host.plan(question, should_stop)
            require_long_enough(plan, snapshot.goal)
            code = CODE_OF_STATUS[plan.status]
            if plan.disagreement is not None:
                incident = disagreement_incident(question, plan.disagreement)
                return Outcome(code, plan.sentence, plan, snapshot, incident=incident)
            outcome = Outcome(code, plan.sentence, plan, snapshot, handover, parameters)
            if plan.trajectory is None or code is not ErrorCode.SUCCESS:
                return outcome
            gap = float(np.abs(plan.trajectory.positions[0] - question.q_start).max())
            if not gap <= parameters.start_tolerance:
                raise RrthError(
                    f'the planned motion begins {gap:.4f} rad (or m) from the start that '
                    f'was asked for, expected at most {parameters.start_tolerance:g}'
                )
            if handover is not None:
                if host.now() > handover.time:
                    continue
                await _wait_for(handover, host, should_stop)
            revalidation = Revalidation(
                inputs, host, parameters, snapshot, plan, handover, running
            )
            try:
                require_not_cancelled(should_stop)
                found = await revalidation.disagreement()
                if found is not None:
                    incident = disagreement_incident(question, *found)
                    sentence = f'{incident.sentence}, seed {plan.seed}'
                    failed = replace(outcome, code=ErrorCode.FAILURE, sentence=sentence)
                    return replace(failed, incident=incident)
                published = await publish(outcome, revalidation)
                if published is not None:
                    return published
            except ArmHasMoved:
                if handover is not None or running is None or lead == LEADS[-1]:
                    raise
                # It seemed at rest, and has just begun its commanded motion.
        raise RequestError(
            ErrorCode.TIMED_OUT,
            f'the arm moves, and no handover was planned and checked within {LEADS[-1]:g} s',
        )
    except RequestError as problem:
        return Outcome(problem.code, str(problem), plan)
    except Exception as problem:
        if question is None:
            raise
        raise PlanError(question, None if plan is None else plan.trajectory) from problem
    finally:
        hold(-math.inf)


def require_not_cancelled(
    should_stop: Callable[[], bool], sentence: str = 'the request was cancelled'
) -> None:
    """Raise RequestError where a request was cancelled."""
    if should_stop():
        raise RequestError(ErrorCode.PREEMPTED, sentence)


async def _plan_round(
    expected: Scene, question: PlanQuestion, host: Host, should_stop: Callable[[], bool]
) -> tuple[PlanQuestion, MotionPlan]:
    """
    Return a plan, with its question: round where moving parts will be soon, if there is a way.

    Else round the wearer as he is; whether that motion may begin is seen before it is published.
    """
    both = joined(question.scene, expected)
    if both is not question.scene:
        wider = replace(question, scene=both)
        plan = await host.plan(wider, should_stop)
        if plan.status is PlanStatus.SOLVED and plan.escape_time == 0.0:
            return wider, plan
    return question, await host.plan(question, should_stop)


async def _wait_for(handover: Handover, host: Host, should_stop: Callable[[], bool]) -> None:
    """Return when the motion is to be published, or as soon as it is cancelled."""
    # A simulated clock may stand still.
    end = host.steady() + 2 * LEADS[-1]
    while host.steady() < end and not should_stop():
        left = handover.time - handover.publish_ahead - host.now()
        if left <= 0.0:
            return
        await host.sleep(min(LONGEST_SLEEP, left))


def _handover(
    snapshot: InputSnapshot,
    running: ExecutingMotion | None,
    time: float,
    lead: float,
    parameters: RequestParameters,
) -> Handover:
    """Return the handover from a moving arm at about a time [s]."""
    delay = parameters.execution.controller_delay
    start = snapshot.start_state_at(running, time, parameters.required.arm, delay)
    is_commanded = snapshot.is_commanded(running, delay) and start.running is not None
    if is_commanded and running is not None and start.time < running.trajectory.duration:
        # Numbers of seconds since 1970 are 0.24 us apart: the state is that of such a one.
        time = running.start_time + start.time
        since = time - running.start_time
        q, v, a = (row[0] for row in sample(running.trajectory, [since]))
        state = MotionState(positions=q, velocities=v, accelerations=a)
        start = replace(start, state=state, time=since)
    return Handover(time, lead, start, running, delay, is_commanded)


def _question(
    snapshot: InputSnapshot,
    parameters: RequestParameters,
    handover: Handover | None,
    q_start: Array,
    body_age: float,
    seed: int,
) -> PlanQuestion:
    required, separation = parameters.required, parameters.execution.separation
    return PlanQuestion(
        arm=required.arm,
        scene=snapshot.scene,
        q_start=q_start,
        # Its pace is in the limits.
        goal=PointingGoal(snapshot.goal.target),
        limits=limits_of(parameters.limits, snapshot.goal),
        options=parameters.options,
        margin=required.margin,
        ray_guard_length=required.ray_guard_length,
        seed=seed,
        moving=None if handover is None else handover.start_state,
        escape_depth=parameters.escape_depth,
        reserve=parameters.reserve,
        second_checker=required.library,
        rules=None if separation is None else separation.rules,
        stop_limits=parameters.stop_limits,
        body_age=min(max(body_age, 0.0), FARTHEST),
    )
