# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""From a scene and a target to a certified trajectory."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
import functools
import time
from typing import cast

import numpy as np
from numpy.typing import ArrayLike
from rrth_planner.collision.certificate import certify, least_clearance
from rrth_planner.collision.penetration import box_depths
from rrth_planner.collision.violation import Disagreement
from rrth_planner.collision.world import grown, with_start, World, world_of
from rrth_planner.kernels import jit
from rrth_planner.model.arm import ArmModel, reach_to, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import check_type, OptionsError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.joint_range import joints_beyond
from rrth_planner.model.path import Path
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import SeparationRules
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import MotionLimits, StartState, Trajectory
from rrth_planner.pipeline.collision_escape import Escape, plan_escape
from rrth_planner.pipeline.goal_ranking import quickest_path
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.plan_path import find_path, SPARE_CLEARANCES
from rrth_planner.pipeline.rejection import (
    CANCELLED,
    depth_sentence,
    lead_rejection,
    led_in_rejection,
    led_in_sentence,
    Rejection,
    start_rejection,
    target_rejection,
    within_limits,
)
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.pipeline.time_path import time_path
from rrth_planner.planning.options import TreeOptions
from rrth_planner.planning.planner import PlanResult
from rrth_planner.planning.pointing_goals import check_pointing_arm
from rrth_planner.timing.lead_in import lead_in, LeadIn, stop_first

# A wearer at rest makes the same world from plan to plan.
_world_of = functools.lru_cache(maxsize=8)(world_of)


def plan_motion(
    arm: ArmModel,
    scene: Scene,
    q_start: ArrayLike,
    goal: PointingGoal,
    limits: MotionLimits,
    options: TreeOptions,
    *,
    margin: float,
    ray_guard_length: float,
    seed: int,
    should_stop: Callable[[], bool] = lambda: False,
    moving: StartState | None = None,
    escape_depth: float = 0.05,
    reserve: float = 0.0,
    second_checker: str = 'fcl',
    rules: SeparationRules | None = None,
    stop_limits: MotionLimits | None = None,
    body_age: float = 0.0,
) -> MotionPlan:
    """
    Return a certified motion that ends with the tool pointing at the goal.

    Parameters
    ----------
    arm : ArmModel
        Passes `pointing_goals.check_pointing_arm`.
    scene : Scene
        The wearer in the base frame.
    q_start : array_like, shape (dof,)
        Where the arm is, at rest [rad].
    options : TreeOptions
        Their class is the choice of the algorithm.
    margin : float
        Clearance kept from every box [m].
    ray_guard_length : float
        Length of the pointing ray kept clear in motion [m]; at the end, up to the target.
    seed : int
        >= 0.
    should_stop : callable
        Polled while planning; True cancels.
    moving : StartState, optional
        State of a moving arm at q_start; without, it is at rest. The motion then begins with this
        state: the arm continues straight ahead, no further than it needs to stop, and blends
        into the path; or, where there is no room for that, it stops along its present motion.
    escape_depth : float
        An arm at rest whose bars have a smaller penetration depth in the boxes grown by the
        margin escapes first [m]; 0: never. The depth is by how much a box would have to be
        smaller on every side; that of the pointing ray, which has no body, may be any.

    reserve : float
        Clearance beyond the margin that path and goal are planned with where there is room [m]: a
        wearer who moves by less invalidates nothing.
    second_checker : str
        Library behind the second collision check, one of `distance_library.LIBRARIES`.
    rules : SeparationRules, optional
        For an arm that keeps separate from a wearer who moves: of several goals it aims at the
        one where these allow it to be soonest.
    stop_limits : MotionLimits, optional
        Of stops of such an arm; without, `limits`.
    body_age : float
        Of the scene, while such a motion is executed [s].

    Raises
    ------
    OptionsError
        A number out of its range, an argument of another type, or values of another number of
        joints than the arm's.
    ModelError
        The library of the second checker is not installed.

    """
    check_type(should_stop, Callable, 'should_stop', OptionsError)
    question = PlanQuestion(
        arm=arm,
        scene=scene,
        # Checked there.
        q_start=cast(Array, q_start),
        goal=goal,
        limits=limits,
        options=options,
        margin=margin,
        ray_guard_length=ray_guard_length,
        seed=seed,
        moving=moving,
        escape_depth=escape_depth,
        reserve=reserve,
        second_checker=second_checker,
        rules=rules,
        stop_limits=stop_limits,
        body_age=body_age,
    )
    return plan_question(question, should_stop)


def plan_question(
    question: PlanQuestion, should_stop: Callable[[], bool] = lambda: False
) -> MotionPlan:
    """Return the certified motion of a question, as `plan_motion` does for its arguments."""
    begin = time.perf_counter()
    arm, scene, margin, moving = question.arm, question.scene, question.margin, question.moving
    q_start = within_limits(arm, question.q_start)
    world = _world_of(question.required, scene)
    escape, disagreement = None, None
    leads: Iterable[LeadIn | None | Rejection] = (None,)
    # A joint may begin a little beyond its limit: straight edges lead it in.
    around = with_start(world, arm, q_start)
    rejection = start_rejection(arm, grown(world, SPARE_CLEARANCES[-1]), q_start)
    is_in_box = rejection is not None and world.colliding_bars(q_start) is None
    if rejection is not None and rejection.status is PlanStatus.START_IN_COLLISION and is_in_box:
        if moving is not None:
            sentence = depth_sentence(world, box_depths(world, q_start), margin)
            rejection = replace(
                rejection, sentence=f'{sentence}, expected an arm at rest or clear of it'
            )
        else:
            out = plan_escape(question, around, q_start, SPARE_CLEARANCES, should_stop)
            if isinstance(out, Escape):
                rejection, escape = None, out
                leads = (out.lead_in(question.limits),)
            else:
                rejection = out
    if rejection is None:
        rejection = CANCELLED if should_stop() else target_rejection(scene, question.goal, margin)
    if moving is not None:
        leads = _leads(arm, around, moving, question.limits)
    for lead in leads if rejection is None else ():
        if isinstance(lead, Rejection):
            rejection = lead
            break
        q_from = q_start if lead is None else lead.q_stop
        q_first: Array = np.clip(q_from, *arm.bounds)
        is_led_in = len(joints_beyond(arm, q_from)) > 0
        if is_led_in:
            rejection = led_in_rejection(arm, grown(world, SPARE_CLEARANCES[-1]), q_from, q_first)
            if rejection is not None:
                break
        found = find_path(question, world, q_first, should_stop, begin)
        if isinstance(found, Rejection):
            rejection = found
            break
        assert found.path is not None
        paths = [found.path]
        if question.rules is not None:
            paths.insert(0, quickest_path(question, world, q_first, found.path))
        if is_led_in:
            paths = [Path(np.concatenate([q_from[None], path.waypoints])) for path in paths]
        for path in dict.fromkeys(paths):
            reach = reach_to(arm, question.goal.target, path.waypoints[-1])
            timed = time_path(question, world, path, lead, escape, reach, should_stop)
            if not isinstance(timed, Rejection):
                break
        if isinstance(timed, Trajectory):
            found = replace(found, path=path)
            return _solved(question, world, found, timed, reach, begin, escape)
        if isinstance(timed, Disagreement):
            disagreement = timed
            rejection = Rejection(PlanStatus.NOT_CERTIFIED, timed.sentence(margin))
            break
        rejection = timed
        if rejection.status is not PlanStatus.START_MOVES:
            break
    assert rejection is not None
    return MotionPlan(
        status=rejection.status,
        sentence=f'{rejection.sentence}, seed {question.seed}',
        seed=question.seed,
        planning_time=time.perf_counter() - begin,
        disagreement=disagreement,
    )


def warm_up(arm: ArmModel, options: TreeOptions, second_checker: str = 'fcl') -> None:
    """
    Plan once round a small box, so that every kernel is compiled and loaded.

    Raises
    ------
    ModelError
        The arm cannot point, or the library of the second checker is not installed.

    """
    check_type(arm, ArmModel, 'arm')
    check_pointing_arm(arm)
    q_start = arm.bounds.mean(axis=0)
    T = tool_pose(arm, q_start)
    far = T[:3, 3] + 100.0 * T[:3, 0]
    scene = Scene((Box('far', far, np.ones(3), np.eye(3)),))
    ones = np.ones(arm.dof)
    plan_motion(
        arm,
        scene,
        q_start,
        PointingGoal(T[:3, 3] + T[:3, 2] + 0.1 * T[:3, 1]),
        MotionLimits(velocity=ones, acceleration=ones, jerk=ones),
        options,
        margin=0.0,
        ray_guard_length=1.0,
        seed=0,
        second_checker=second_checker,
    )
    jit.mark_compiled()


def _leads(
    arm: ArmModel, world: World, moving: StartState, limits: MotionLimits
) -> Iterator[LeadIn | Rejection]:
    """
    Yield the lead-ins of an arm in motion: straight ahead, or a stop along its present motion.

    The limits are those of the world. Where neither is possible, yield the rejection.
    """
    straight = lead_in(moving.state, limits)
    rejection = lead_rejection(arm, world, straight, limits)
    if rejection is None:
        # Rounding may have put a joint past its limit.
        yield replace(straight, q_stop=np.clip(straight.q_stop, *world.bounds))
    stop = stop_first(moving, limits)
    if stop is not None and certify(stop.trajectory, world).is_proven:
        yield replace(stop, q_stop=np.clip(stop.q_stop, *world.bounds))
    elif rejection is not None:
        yield rejection


def _solved(
    question: PlanQuestion,
    world: World,
    result: PlanResult,
    trajectory: Trajectory,
    reach: float,
    begin: float,
    escape: Escape | None,
) -> MotionPlan:
    path = result.path
    assert path is not None
    # The world's boxes are the body's grown by margin and slack.
    escape_time = 0.0 if escape is None else escape.trajectory.duration
    clearance = least_clearance(trajectory, grown(world, -question.margin), escape_time)
    planning_time = time.perf_counter() - begin
    note = '' if result.is_reproducible else '; improvement ended by the time limit'
    if escape is not None:
        q_start = trajectory.positions[:1]
        path = Path(np.concatenate([q_start, path.waypoints]))
        note = f', {escape.sentence}{note}'
    if len(joints_beyond(question.arm, trajectory.positions[0])) > 0:
        note = f', {led_in_sentence(question.arm, trajectory.positions[0])}{note}'
    return MotionPlan(
        status=PlanStatus.SOLVED,
        sentence=(
            f'{len(path.waypoints)} waypoints, duration {trajectory.duration:.3f} s, path length '
            f'{path.length:.4f} rad, least clearance {clearance:.4f} m, planning time '
            f'{planning_time * 1e3:.2f} ms, seed {question.seed}{note}'
        ),
        seed=question.seed,
        planning_time=planning_time,
        path=path,
        trajectory=trajectory,
        clearance=clearance,
        target_distance=reach,
        escape_time=escape_time,
        search=result,
    )
