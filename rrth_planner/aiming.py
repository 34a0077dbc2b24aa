# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The goal manifold of an arm: the configurations whose ray meets a target."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.arm import ArmModel
from rrth_planner.arrays import Array
from rrth_planner.errors import ModelError
from rrth_planner.goal import PointingGoal
from rrth_planner.kernels import jit, pointing
from rrth_planner.problem import PlanningProblem
from rrth_planner.world import World

# Draws of the free joints: a few give good postures at once; many, before none is said to be free.
FEW, MANY = 128, 4096
SLIDE_GOAL = jit.first_class(pointing.slide_goal)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GoalSet:
    """
    Configurations that aim at a target, nearest first.

    Parameters
    ----------
    q_goals : ndarray, shape (n, dof)
        The free ones [rad].
    n_aiming : int
        How many aim at all, free or not.
    q_blocked : ndarray, shape (m, dof)
        The others, up to a few hundred [rad].
    blocked_reaches : ndarray, shape (m,)
        Length of their rays out to the target [m].

    """

    q_goals: Array
    n_aiming: int
    q_blocked: Array
    blocked_reaches: Array


def check_pointing_arm(arm: ArmModel) -> None:
    """
    Raise ModelError unless the goal manifold of an arm is known in closed form.

    The last two joints must be revolute, square to each other and to the ray, without `a` offset.
    """
    tail = arm.dh[-2:]
    is_square = np.abs(np.cos(tail[:, 0])).max() < 1e-9 and np.abs(tail[:, 1]).max() < 1e-12
    if arm.dof < 2 or any(arm.is_prismatic[-2:]) or not is_square:
        raise ModelError(
            'arm: the last two joints are no pan and tilt unit, expected two revolute joints with '
            'alpha = +-pi/2 [rad] and a = 0 [m] in the rows of the last joint and of the tool'
        )


def target_in_mount(arm: ArmModel, goal: PointingGoal) -> Array:
    """Return the target in the arm's own base frame, shape (3,) [m]."""
    R, p = arm.T_base_mount[:3, :3], arm.T_base_mount[:3, 3]
    target: Array = np.ascontiguousarray(R.T @ (goal.target - p))
    return target


def goal_configurations(
    arm: ArmModel, goal: PointingGoal, world: World, q_near: Array, n_draws: int
) -> GoalSet:
    """
    Return the free configurations that aim at a target, nearest to q_near first.

    Parameters
    ----------
    arm : ArmModel
        Passes `check_pointing_arm`.
    goal : PointingGoal
    world : World
    q_near : ndarray, shape (dof,)
        [rad].
    n_draws : int
        How many values of the joints before the last two are tried, both branches each.

    """
    candidates, reaches = np.empty((2 * n_draws, arm.dof)), np.empty(2 * n_draws)
    n = pointing.goal_candidates(
        world.robot,
        world.bounds,
        target_in_mount(arm, goal),
        q_near,
        _spreading_ratios(arm.dof - 2),
        n_draws,
        candidates,
        reaches,
    )
    order = np.argsort(np.linalg.norm(candidates[:n] - q_near, axis=1), kind='stable')
    candidates, reaches = candidates[order], reaches[order]
    flags = np.empty(n, dtype=np.int8)
    pointing.find_free_goals(world.chain, world.robot, world.obstacles, candidates, reaches, flags)
    is_free = flags.astype(bool)
    return GoalSet(
        q_goals=candidates[is_free],
        n_aiming=n,
        q_blocked=candidates[~is_free][:512],
        blocked_reaches=reaches[~is_free][:512],
    )


def pointing_problem(
    arm: ArmModel, goal: PointingGoal, world: World, q_start: Array, goals: GoalSet
) -> PlanningProblem:
    """Return the planning problem of a pointing goal."""
    return PlanningProblem(
        world=world,
        q_start=q_start,
        q_goals=goals.q_goals,
        slide_goal=SLIDE_GOAL,
        target=target_in_mount(arm, goal),
    )


def _spreading_ratios(n: int) -> Array:
    """Return the steps 1/phi, 1/phi^2, ... with phi^(n+1) = phi + 1 (Roberts 2018)."""
    phi = 2.0
    for _ in range(64):
        phi = (1.0 + phi) ** (1.0 / (n + 1))
    return phi ** -np.arange(1.0, n + 1.0)
