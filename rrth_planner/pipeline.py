# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The straight line from a scene and a target to a certified trajectory."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
import functools
import time

import numpy as np
from rrth_planner.aiming import (
    check_pointing_arm,
    FEW,
    goal_configurations,
    GoalSet,
    MANY,
    pointing_problem,
)
from rrth_planner.arm import ArmModel, tool_pose
from rrth_planner.arrays import Array
from rrth_planner.blend import Blend, round_corners
from rrth_planner.certificate import certify, least_clearance
from rrth_planner.escape import beyond, Escape, way_out
from rrth_planner.fcl_check import first_touch, touch_on_way_out
from rrth_planner.goal import PointingGoal
from rrth_planner.kernels import jit
from rrth_planner.leaving import box_depths
from rrth_planner.options import TreeOptions
from rrth_planner.path import Path
from rrth_planner.planner import plan, PlanResult
from rrth_planner.refusal import (
    depth_sentence,
    goal_refusal,
    lead_refusal,
    Refusal,
    start_refusal,
    target_refusal,
    within_limits,
)
from rrth_planner.scene import Box, Scene
from rrth_planner.status import PlanStatus
from rrth_planner.takeover import joined, Lead, lead_in, reserved, stop_first, Takeover
from rrth_planner.timing import parameterize, TooFastError
from rrth_planner.touch import Disagreement
from rrth_planner.trajectory import MotionLimits, Trajectory
from rrth_planner.world import arm_world, grown, World

# Clearance that the path is planned with on top of the margin, for its rounded corners to spend;
# in a tight place, next to none [m].
SPARES = (5e-3, 1e-5)
# Rounded corners are proven with this on top of the margin, so that the timed curve, whose proof
# has other intervals, does not fail for a hair [m].
HAIR = 2e-6
# Sizes of the first blend of an arm that moves, as shares of what is free.
FIRST_SHARES = (0.5, 0.2, 0.0)
# A wearer who holds still makes the same world from plan to plan.
_world_of = functools.lru_cache(maxsize=8)(arm_world)
_grown = functools.lru_cache(maxsize=32)(grown)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MotionPlan:
    """
    How a request ended.

    Parameters
    ----------
    status : PlanStatus
    sentence : str
        What happened, with figures and units, for the caller.
    seed : int
        Seed that was used; the same seed and inputs give the same trajectory to the bit.
    planning_time : float
        From the call to the certified trajectory [s].
    path : Path or None
        The shortened path before timing; None unless solved.
    trajectory : Trajectory or None
        From rest to rest, certified; None unless solved.
    clearance : float
        Least distance of the arm and of the guarded ray from the wearer [m], once out of the
        boxes that it was in; NaN unless solved.
    reach : float
        Distance from the tool to the target at the end [m]; NaN unless solved.
    disagreement : Disagreement or None
        The motion that the two judges disagree about, where that is why there is none.
    escape_time : float
        Until then the trajectory leads out of boxes that the arm was in [s]; 0: it was in none.
    search : PlanResult or None
        How the path was found: the first path, the trees; None unless solved.

    """

    status: PlanStatus
    sentence: str
    seed: int
    planning_time: float
    path: Path | None = None
    trajectory: Trajectory | None = None
    clearance: float = float('nan')
    reach: float = float('nan')
    disagreement: Disagreement | None = None
    escape_time: float = 0.0
    search: PlanResult | None = None


def plan_motion(
    arm: ArmModel,
    scene: Scene,
    q_start: Array,
    goal: PointingGoal,
    limits: MotionLimits,
    options: TreeOptions,
    *,
    margin: float,
    ray_guard_length: float,
    seed: int,
    should_stop: Callable[[], bool] = lambda: False,
    moving: Takeover | None = None,
    escape_depth: float = 0.05,
) -> MotionPlan:
    """
    Return a certified motion that ends with the tool pointing at the goal.

    Parameters
    ----------
    arm : ArmModel
        Passes `aiming.check_pointing_arm`.
    scene : Scene
        The wearer in the base frame.
    q_start : ndarray, shape (dof,)
        Where the arm is, at rest [rad].
    goal : PointingGoal
    limits : MotionLimits
    options : TreeOptions
        Their class is the choice of the algorithm.
    margin : float
        Clearance kept from every box [m].
    ray_guard_length : float
        How much of the pointing ray is kept clear in motion [m]; at the end, all of it.
    seed : int
        >= 0.
    should_stop : callable
        Polled while planning; True cancels.
    moving : Takeover, optional
        How the arm moves at q_start; without, it is at rest. The motion then begins with this
        state: the arm goes on straight ahead, no further than it needs to stop, and turns off; or,
        where there is no room for that, it stops along its present motion first.
    escape_depth : float
        An arm at rest that is less deep in the boxes grown by the margin first leaves them by the
        shortest way [m]; 0: it never does. The depth is by how much a box would have to be
        smaller on every side.

    """
    begin = time.perf_counter()
    q_start = within_limits(arm, q_start)
    world = _world_of(arm, scene, margin, ray_guard_length)
    lead, escape, q_from, disagreement = None, None, q_start, None
    refusal = start_refusal(arm, _grown(world, SPARES[-1]), q_start)
    if refusal is not None and refusal.status is PlanStatus.START_IN_COLLISION:
        if moving is not None:
            said = depth_sentence(world, box_depths(world, q_start), margin)
            refusal = replace(
                refusal, sentence=f'{said}, expected an arm that is at rest or clear'
            )
        else:
            out = way_out(
                world,
                q_start,
                limits,
                margin=margin,
                spares=SPARES,
                escape_depth=escape_depth,
                seed=seed,
                should_stop=should_stop,
            )
            if isinstance(out, Escape):
                refusal, escape, q_from = None, out, out.q_end
                lead = Lead(trajectory=out.trajectory, speed=0.0, q_stop=out.q_end)
            else:
                refusal = out
    if refusal is None:
        refusal = target_refusal(scene, goal, margin)
    if refusal is None and moving is not None:
        led = _lead(arm, world, moving, limits)
        if isinstance(led, Refusal):
            refusal = led
        else:
            lead, q_from = led, led.q_stop
    if refusal is None:
        found = _find_path(arm, goal, world, q_from, options, seed, should_stop, begin)
        if isinstance(found, PlanResult) and found.path is not None:
            timed = _time_path(arm, scene, goal, world, found.path, limits, margin, lead, escape)
            if should_stop():
                refusal = Refusal(PlanStatus.CANCELLED, 'the plan was cancelled')
            elif isinstance(timed, Trajectory):
                return _solved(arm, goal, world, found, timed, margin, seed, begin, escape)
            elif isinstance(timed, Disagreement):
                disagreement = timed
                refusal = Refusal(PlanStatus.NOT_CERTIFIED, timed.sentence(margin))
            else:
                refusal = timed
        else:
            assert isinstance(found, Refusal)
            refusal = found
    return MotionPlan(
        status=refusal.status,
        sentence=f'{refusal.sentence}, seed {seed}',
        seed=seed,
        planning_time=time.perf_counter() - begin,
        disagreement=disagreement,
    )


def warm_up(arm: ArmModel, options: TreeOptions) -> None:
    """
    Plan once round a small box, so that every kernel is compiled and loaded.

    Raises
    ------
    ModelError
        The arm cannot point.

    """
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
    )
    jit.mark_compiled()


def _lead(arm: ArmModel, world: World, moving: Takeover, limits: MotionLimits) -> Lead | Refusal:
    """Return what an arm in motion does first, straight on or along its present motion."""
    straight = lead_in(moving.state, limits)
    refusal = lead_refusal(arm, world, straight, limits)
    if refusal is None:
        return straight
    stop = stop_first(moving, limits)
    if stop is not None and certify(stop.trajectory, world).is_proven:
        # Rounding may have put a joint past its limit.
        return replace(stop, q_stop=np.clip(stop.q_stop, *arm.bounds))
    return refusal


def _find_path(
    arm: ArmModel,
    goal: PointingGoal,
    world: World,
    q_start: Array,
    options: TreeOptions,
    seed: int,
    should_stop: Callable[[], bool],
    begin: float,
) -> PlanResult | Refusal:
    """Return the shortest path found, with as much spare clearance as there is room for."""
    goals: GoalSet | None = None
    result: PlanResult | None = None
    n_samples, is_clocked = 0, False
    for spare in (*SPARES, 0.0):
        roomy = _grown(world, spare)
        # Without any to spare only where the start has none: an arm that was in motion.
        if not roomy.is_valid(q_start) or (spare == 0.0 and goals is not None):
            continue
        goals = goal_configurations(arm, goal, roomy, q_start, FEW)
        if len(goals.q_goals) == 0:
            goals = goal_configurations(arm, goal, roomy, q_start, MANY)
        if len(goals.q_goals) == 0:
            continue
        # Half of the time for the roomy way, so that the tight one has its chance.
        share = 0.5 if spare == SPARES[0] else 1.0
        left = max(1e-3, share * options.time_limit - (time.perf_counter() - begin))
        problem = pointing_problem(arm, goal, roomy, q_start, goals)
        rng = np.random.default_rng(seed)
        result = plan(problem, replace(options, time_limit=left), rng, should_stop)
        n_samples += result.n_samples
        is_clocked |= result.status is PlanStatus.TIMEOUT
        if result.status in (PlanStatus.SOLVED, PlanStatus.CANCELLED):
            break
    if result is None:
        # The start keeps the smallest spare, so the goals were asked for.
        assert goals is not None
        return goal_refusal(world, goals)
    if result.status is PlanStatus.SOLVED:
        return replace(result, is_reproducible=result.is_reproducible and not is_clocked)
    elapsed = time.perf_counter() - begin
    sentence = {
        PlanStatus.TIMEOUT: f'no path within the time limit of {options.time_limit:g} s',
        PlanStatus.CANCELLED: 'the plan was cancelled',
        PlanStatus.SAMPLE_LIMIT: 'the free postures that aim at the target were not reached',
    }[result.status]
    return Refusal(result.status, f'{sentence} ({n_samples} samples, {elapsed * 1e3:.0f} ms)')


def _time_path(
    arm: ArmModel,
    scene: Scene,
    goal: PointingGoal,
    world: World,
    path: Path,
    limits: MotionLimits,
    margin: float,
    lead: Lead | None,
    escape: Escape | None,
) -> Trajectory | Disagreement | Refusal:
    """Return the timed path once both judges agree that it is free, with stops if need be."""
    if lead is not None and lead.speed > 0.0:
        path = _straight_on(lead, path)
    rounded = round_corners(path, _grown(world, HAIR), limits)
    choices = [rounded]
    if lead is not None and lead.speed > 0.0 and rounded:
        # The arm must be slow enough where the first blend begins: a smaller one begins later.
        choices += [
            (replace(rounded[0], half_length=share * rounded[0].half_length), *rounded[1:])
            for share in FIRST_SHARES
        ]
    if any(blend.half_length > 0.0 for blend in rounded):
        choices.append(tuple(replace(blend, half_length=0.0) for blend in rounded))
    escape_time = 0.0 if escape is None else escape.trajectory.duration
    trajectory = first_proven(path, choices, limits, world, lead, escape_time)
    if trajectory is None:
        return Refusal(
            PlanStatus.NOT_CERTIFIED, 'the path was found but its timed motion is not proven free'
        )
    reach = _reach(arm, goal, path.waypoints[-1])
    touch = None
    if escape is not None:
        depths = box_depths(world, trajectory.positions[0]).max(axis=0)
        touch = touch_on_way_out(
            arm, scene, depths, trajectory, escape_time, margin, world.ray_length
        )
    if touch is not None:
        return Disagreement(trajectory, touch, escape_time)
    touch = first_touch(
        arm, scene, beyond(trajectory, escape_time), margin, world.ray_length, reach
    )
    if touch is not None:
        later = replace(touch, time=escape_time + touch.time)
        return Disagreement(trajectory, later, escape_time)
    return trajectory


def first_proven(
    path: Path,
    choices: Sequence[tuple[Blend, ...]],
    limits: MotionLimits,
    world: World,
    lead: Lead | None = None,
    escape_time: float = 0.0,
) -> Trajectory | None:
    """
    Return the fastest trajectory along a path that is proven free, or None.

    Parameters
    ----------
    path : Path
    choices : sequence of tuple of Blend
        Ways to take the corners.
    limits : MotionLimits
    world : World
    lead : Lead, optional
        What comes before the path, whose first edge is then followed from its speed on.
    escape_time : float
        Until then the lead is proven to lead out of the world's boxes [s].

    """
    # Where a rounded corner must be taken slowly, stopping at each can be the faster way.
    if lead is None:
        timed = [parameterize(path, blends, limits) for blends in choices]
    else:
        timed = []
        for blends in choices:
            with suppress(TooFastError):
                within = reserved(limits) if lead.speed > 0.0 else limits
                rest = parameterize(path, blends, within, lead.speed)
                timed.append(joined(lead.trajectory, rest))
    for trajectory in sorted(timed, key=lambda trajectory: trajectory.duration):
        if certify(trajectory, world, escape_time).is_proven:
            return trajectory
    return None


def _straight_on(lead: Lead, path: Path) -> Path:
    """Return the path from the end of the lead-in over where the arm would stop."""
    begin = lead.trajectory.positions[-1]
    rest = path.waypoints if path.length > 0.0 else path.waypoints[:1]
    return Path(np.concatenate([begin[None], rest]))


def _solved(
    arm: ArmModel,
    goal: PointingGoal,
    world: World,
    result: PlanResult,
    trajectory: Trajectory,
    margin: float,
    seed: int,
    begin: float,
    escape: Escape | None,
) -> MotionPlan:
    path = result.path
    assert path is not None
    # The world's boxes are the body's grown by margin and slack.
    escape_time = 0.0 if escape is None else escape.trajectory.duration
    clearance = least_clearance(trajectory, _grown(world, -margin), escape_time)
    planning_time = time.perf_counter() - begin
    note = '' if result.is_reproducible else '; the clock ended the improvement'
    if escape is not None:
        q_start = trajectory.positions[:1]
        path = Path(np.concatenate([q_start, path.waypoints]))
        note = f', {escape.sentence}{note}'
    return MotionPlan(
        status=PlanStatus.SOLVED,
        sentence=(
            f'{len(path.waypoints)} waypoints, duration {trajectory.duration:.3f} s, path length '
            f'{path.length:.4f} rad, least clearance {clearance:.4f} m, planning time '
            f'{planning_time * 1e3:.2f} ms, seed {seed}{note}'
        ),
        seed=seed,
        planning_time=planning_time,
        path=path,
        trajectory=trajectory,
        clearance=clearance,
        reach=_reach(arm, goal, path.waypoints[-1]),
        escape_time=escape_time,
        search=result,
    )


def _reach(arm: ArmModel, goal: PointingGoal, q: Array) -> float:
    """Return the distance from the tool to the target at q [m]."""
    return float(np.linalg.norm(goal.target - tool_pose(arm, q)[:3, 3]))
