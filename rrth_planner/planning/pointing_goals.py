# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The goal manifold of an arm: the configurations whose ray meets a target."""

from collections.abc import Callable
from dataclasses import dataclass, replace
import functools
from importlib import import_module
import math

import numpy as np
from numpy.typing import ArrayLike
from rrth_planner.collision.world import World
from rrth_planner.kernels import jit
from rrth_planner.kernels.kinematics import pan_tilt_ik
from rrth_planner.kernels.kinematics.goal_selection import find_goals
from rrth_planner.model.arm import ArmModel, forward_kinematics
from rrth_planner.model.arrays import Array, check_dof, float_array
from rrth_planner.model.errors import check_type, ModelError, RrthError, shown
from rrth_planner.model.frozen import Frozen
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.joint_range import turns_near
from rrth_planner.planning.problem import PlanningProblem

# Samples of the joints: few are enough mostly; many before all are reported as not free.
FEW_DRAWS, MANY_DRAWS = 176, 4096
# Half of the most candidates that a caller may ask for.
MOST_DRAWS = 10**7
# Shares of a turn round q_near from which joints that turn freely are drawn, too, since few of the
# draws from a whole turn are near.
SHARES = (0.5, 0.25)
# Most goals that are kept, and most configurations in collision.
MOST_GOALS, MOST_BLOCKED = 256, 512
# Goals with a continuous joint the other way round that are kept, at most.
MOST_TURNED = 64
# A joint that moves a point of the ray by less than this, in m per rad or m, does not move it.
LEAST_MOVE = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class PointingKernels:
    """
    How the goal manifold of an arm is computed.

    Parameters
    ----------
    goal_candidates : compiled function
        The seam `kernels.jit.CANDIDATES`.
    slide_goal : compiled function
        The seam `kernels.jit.SLIDE`.
    n_solved : int
        How many of the last joints `goal_candidates` solves for; the others are drawn.

    """

    goal_candidates: Callable[..., int]
    slide_goal: Callable[..., float]
    n_solved: int


CLOSED_FORM = PointingKernels(
    goal_candidates=jit.first_class(pan_tilt_ik.goal_candidates),
    slide_goal=jit.first_class(pan_tilt_ik.slide_goal),
    n_solved=2,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GoalSet(Frozen):
    """
    Goal configurations of a target, nearest first.

    Parameters
    ----------
    q_goals : ndarray, shape (n, dof)
        The free ones [rad].
    n_bent : int
        Number of the first ones that no straight free edge reaches.
    n_aiming : int
        Number of configurations that aim at the target, free or not.
    q_blocked : ndarray, shape (m, dof)
        Those in collision, up to a few hundred [rad].
    blocked_reaches : ndarray, shape (m,)
        Length of their rays out to the target [m].

    """

    q_goals: Array
    n_bent: int
    n_aiming: int
    q_blocked: Array
    blocked_reaches: Array


@functools.lru_cache(maxsize=16)
def pointing_kernels(arm: ArmModel) -> PointingKernels:
    """
    Return the goal solver of an arm: closed form if its last two joints are a pan-tilt unit.

    That is revolute joints, square to each other and to the ray, without `a` offset. With more
    than a few other joints the search along the manifold of the closed form would take too long.
    """
    tail = arm.dh[-2:]
    is_square = np.abs(np.cos(tail[:, 0])).max() < 1e-9 and np.abs(tail[:, 1]).max() < 1e-12
    is_unit = arm.dof >= 2 and not any(arm.is_prismatic[-2:]) and is_square
    is_closed = is_unit and arm.dof <= pan_tilt_ik.MAX_CLOSED_DOF
    return CLOSED_FORM if is_closed else numerical()


@functools.cache
def numerical() -> PointingKernels:
    """Return the numerical goal solver; compiled when the first arm needs it."""
    kernels = import_module('rrth_planner.kernels.kinematics.numerical_ik')
    return PointingKernels(
        goal_candidates=jit.first_class(kernels.goal_candidates),
        slide_goal=jit.first_class(kernels.slide_goal),
        n_solved=0,
    )


def check_pointing_arm(arm: ArmModel) -> None:
    """
    Raise ModelError if the joints can sweep the ray of an arm over a surface at most.

    To reach the targets beside it, the joints must move a point of the ray both ways across it.
    """
    share = (0.5 + np.arange(64)[:, None] * spreading_ratios(arm.dof)) % 1.0
    T = forward_kinematics(arm, arm.bounds[0] + share * (arm.bounds[1] - arm.bounds[0]))
    point = T[:, -1:, :3, 3] + T[:, -1:, :3, 2]
    z, origin = T[:, :-1, :3, 2], T[:, :-1, :3, 3]
    moves = np.where(np.array(arm.is_prismatic)[:, None], z, np.cross(z, point - origin))
    slopes = np.linalg.svd(moves @ T[:, -1, :3, :2], compute_uv=False)
    n_directions = int((slopes.max(axis=0) > LEAST_MOVE).sum())
    if n_directions < 2:
        raise ModelError(
            f'arm: its joints move the pointing ray sideways in {n_directions} direction(s), '
            'expected 2: the ray sweeps a surface at most, and misses all targets beside it'
        )


def target_in_mount(arm: ArmModel, goal: PointingGoal) -> Array:
    """Return the target in the arm's own base frame, shape (3,) [m]."""
    R, p = arm.T_base_mount[:3, :3], arm.T_base_mount[:3, 3]
    target: Array = np.ascontiguousarray(R.T @ (goal.target - p))
    return target


def goal_configurations(
    arm: ArmModel, goal: PointingGoal, world: World, q_near: ArrayLike, n_draws: int
) -> GoalSet:
    """
    Return the free configurations that aim at a target, nearest to q_near first.

    The list ends with the first one that a straight free edge reaches, if there is one: no path to
    a farther one is shorter. Continuous joints are at the turn that is nearest to q_near, and in
    some goals, one joint in each, at the next one the other way round.

    Parameters
    ----------
    arm : ArmModel
        Passes `check_pointing_arm`.
    q_near : array_like, shape (dof,)
        [rad].
    n_draws : int
        Half of the number of candidates, of which there are more where joints turn freely.

    Raises
    ------
    RrthError
        A q_near that is no (dof,) finite numbers, an n_draws that is no whole number from 0 to
        1e7, an argument of another type, or the world of another number of joints.

    """
    _check_types(arm, goal, world)
    q_near = float_array(q_near, (arm.dof,), 'q_near', 'rad')
    check_dof(world.bounds, arm.dof, 'world')
    if not isinstance(n_draws, (int, np.integer)) or not 0 <= n_draws <= MOST_DRAWS:
        raise RrthError(
            f'n_draws: {shown(n_draws)}, expected a whole number from 0 to {MOST_DRAWS} [-]'
        )
    bounds = turns_near(arm, world.bounds, q_near, 1.0)
    found = _goals_within(arm, goal, world, bounds, q_near, n_draws)
    if bounds is world.bounds:
        return found
    for share in SHARES:
        near = turns_near(arm, world.bounds, q_near, share)
        other = _goals_within(arm, goal, world, near, q_near, 2 * FEW_DRAWS)
        if _straight_distance(other, q_near) < _straight_distance(found, q_near):
            found = other
    return _with_other_turns(arm, world, q_near, found)


def _goals_within(
    arm: ArmModel, goal: PointingGoal, world: World, bounds: Array, q_near: Array, n_draws: int
) -> GoalSet:
    """Return what `goal_configurations` does, within bounds, (2, dof) [rad or m]."""
    kernels, dof = pointing_kernels(arm), arm.dof
    goals, blocked = np.empty((MOST_GOALS, dof)), np.empty((MOST_BLOCKED, dof))
    blocked_reaches = np.empty(MOST_BLOCKED)
    n_free, n_blocked, is_straight = find_goals(
        world.functions,
        jit.address(kernels.goal_candidates),
        world.resolution,
        world.robot,
        world.obstacles,
        bounds,
        target_in_mount(arm, goal),
        q_near,
        spreading_ratios(dof - kernels.n_solved),
        n_draws,
        goals,
        blocked,
        blocked_reaches,
    )
    n_kept = min(n_blocked, MOST_BLOCKED)
    return GoalSet(
        q_goals=goals[:n_free],
        n_bent=n_free - is_straight,
        n_aiming=n_free + n_blocked,
        q_blocked=blocked[:n_kept],
        blocked_reaches=blocked_reaches[:n_kept],
    )


def _straight_distance(goals: GoalSet, q_near: Array) -> float:
    """Return how far the goal with a straight free edge is, or infinity [rad]."""
    if goals.n_bent == len(goals.q_goals):
        return math.inf
    return float(np.linalg.norm(goals.q_goals[-1] - q_near))


def _with_other_turns(arm: ArmModel, world: World, q_near: Array, found: GoalSet) -> GoalSet:
    """Return goals and their like with one continuous joint the other way round."""
    q_goals = found.q_goals
    low, high = turns_near(arm, world.bounds, q_near, 2.0)
    turned = [q_goals]
    for k in np.flatnonzero(arm.is_continuous):
        others = q_goals.copy()
        others[:, k] -= np.copysign(math.tau, q_goals[:, k] - q_near[k])
        turned.append(others[(low[k] <= others[:, k]) & (others[:, k] <= high[k])])
    n_near, goals = len(q_goals), np.concatenate(turned)
    distances = np.linalg.norm(goals - q_near, axis=1)
    # No path to a goal beyond the one with a straight edge is shorter.
    longest = distances[n_near - 1] if found.n_bent < n_near else np.inf
    order = np.argsort(distances, kind='stable')
    further = [i for i in order[distances[order] < longest] if i >= n_near][:MOST_TURNED]
    kept = sorted([*range(n_near), *further], key=distances.__getitem__)[:MOST_GOALS]
    for n, i in enumerate(kept):
        if i >= n_near and world.is_edge_valid(q_near, goals[i]):
            return replace(found, q_goals=goals[kept[: n + 1]], n_bent=n)
    n_bent = len(kept) - (found.n_bent < n_near and kept[-1] == n_near - 1)
    return replace(found, q_goals=goals[kept], n_bent=n_bent)


def pointing_problem(
    arm: ArmModel,
    goal: PointingGoal,
    world: World,
    q_start: ArrayLike,
    goals: GoalSet | None = None,
) -> PlanningProblem:
    """
    Return the planning problem of a pointing goal.

    It has continuous joints search two turns round the start, and as many as the goals need.

    Parameters
    ----------
    world : World
        Of that arm.
    q_start : array_like, shape (dof,)
        [rad].
    goals : GoalSet, optional
        None: those that `goal_configurations` finds near q_start.

    Raises
    ------
    ModelError
        The ray of the arm sweeps no more than a surface; only where goals are to be found.
    RrthError
        A q_start that is no (dof,) finite numbers, an argument of another type; no goal that is
        free.

    """
    _check_types(arm, goal, world)
    q_start = float_array(q_start, (arm.dof,), 'q_start', 'rad')
    if goals is None:
        check_pointing_arm(arm)
        goals = goal_configurations(arm, goal, world, q_start, FEW_DRAWS)
        if len(goals.q_goals) == 0:
            goals = goal_configurations(arm, goal, world, q_start, MANY_DRAWS)
    check_type(goals, GoalSet, 'goals')
    bounds = turns_near(arm, world.bounds, q_start, 2.0)
    if bounds is not world.bounds and len(goals.q_goals) > 0:
        low, high = goals.q_goals.min(axis=0), goals.q_goals.max(axis=0)
        bounds = np.array([np.minimum(bounds[0], low), np.maximum(bounds[1], high)])
        world = replace(world, bounds=bounds)
    return PlanningProblem(
        world=world,
        q_start=q_start,
        q_goals=goals.q_goals,
        n_bent=goals.n_bent,
        slide_goal=pointing_kernels(arm).slide_goal,
        target=target_in_mount(arm, goal),
    )


def _check_types(arm: ArmModel, goal: PointingGoal, world: World) -> None:
    check_type(arm, ArmModel, 'arm')
    check_type(goal, PointingGoal, 'goal')
    check_type(world, World, 'world')


@functools.lru_cache(maxsize=32)
def spreading_ratios(n: int) -> Array:
    """Return the steps 1/phi, 1/phi^2, ... with phi^(n+1) = phi + 1 (Roberts 2018)."""
    phi = 2.0
    for _ in range(64):
        phi = (1.0 + phi) ** (1.0 / (n + 1))
    ratios: Array = phi ** -np.arange(1.0, n + 1.0)
    ratios.setflags(write=False)
    return ratios
