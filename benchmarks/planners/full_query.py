# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Full queries: choose the posture, plan and shorten, for random targets and wearers."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.collision.world import arm_world, World
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.pointing_goals import (
    FEW_DRAWS,
    goal_configurations,
    MANY_DRAWS,
    pointing_problem,
)
from rrth_planner.planning.result import PlanResult

from benchmarks.common.clock import timed, uncollected
from benchmarks.common.numpy_checker import is_arm_path_free
from benchmarks.common.queries import table_1_arm
from benchmarks.common.random_draws import free_configurations, random_target, random_wearer
from benchmarks.common.size import Extent
from benchmarks.common.task import path_row, Row, Task

MARGIN, RAY = 0.02, 1.0
FOLDED = np.array([0.0, -0.35, 0.5 * np.pi, 0.5 * np.pi])
# The defaults: a query that is answered between two frames of a body tracker.
OPTIONS = RRTHOptions()
# A long run: many postures, and as many growths as fit into this time [s].
LONG = RRTHOptions(improve_time=0.05, club_attempts=10_000)
PLANNER = 'full query'


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Case:
    """A wearer, where the arm is [rad], and what it shall point at."""

    scene: Scene
    world: World
    q_start: Array
    goal: PointingGoal


def query(
    arm: ArmModel,
    case: Case,
    rng: np.random.Generator,
    options: RRTHOptions = OPTIONS,
    draws: tuple[int, ...] = (FEW_DRAWS, MANY_DRAWS),
) -> PlanResult | None:
    """Return the answer to a full query; None where no posture that aims is free."""
    for n_draws in draws:
        goals = goal_configurations(arm, case.goal, case.world, case.q_start, n_draws)
        if len(goals.q_goals):
            problem = pointing_problem(arm, case.goal, case.world, case.q_start, goals)
            return plan(problem, options, rng)
    return None


def tasks(extent: Extent) -> list[Task]:
    """Return the measurements of this section, one a wearer."""
    n_each = -(-extent.n_queries // extent.n_bodies)
    return [
        Task(
            section='full query',
            name=f'wearer {body}',
            measure=lambda body=body: _runs(body, n_each, extent.n_long),
        )
        for body in range(extent.n_bodies)
    ]


def cases(body: int, n: int) -> list[Case]:
    """Return the queries round one wearer, each of which can be answered."""
    arm, rng = table_1_arm(), np.random.default_rng([body, 3])
    world = None
    # A wearer whose posture leaves the arm no room is none to plan for.
    while world is None or np.mean([world.is_valid(q) for q in _draws(rng, world)]) < 0.2:
        scene = random_wearer(rng)
        world = arm_world(arm, scene, MARGIN, RAY)
    q_start = FOLDED if world.is_valid(FOLDED) else free_configurations(rng, world, 1)[0]
    found: list[Case] = []
    while len(found) < n:
        goal = PointingGoal(random_target(rng))
        if len(goal_configurations(arm, goal, world, q_start, MANY_DRAWS).q_goals):
            found.append(Case(scene=scene, world=world, q_start=q_start, goal=goal))
        # Every other query begins somewhere else.
        q_start = free_configurations(rng, world, 1)[0] if len(found) % 2 else q_start
    return found


def _draws(rng: np.random.Generator, world: World) -> Array:
    return rng.uniform(*world.bounds, (100, world.bounds.shape[1]))


def _runs(body: int, n: int, n_long: int) -> list[Row]:
    arm, rows = table_1_arm(), []
    chosen = cases(body, n)
    for case in chosen:
        query(arm, case, np.random.default_rng(0))
    # One after the other: checking a path in between would leave no warm cache.
    with uncollected():
        timings = [
            timed(lambda case=case, rng=rng: query(arm, case, rng))
            for case, rng in [
                (case, np.random.default_rng(body * n + k)) for k, case in enumerate(chosen)
            ]
        ]
    for k, (case, (time_total, result)) in enumerate(zip(chosen, timings, strict=True)):
        seed = body * n + k
        path = None if result is None else result.path
        rows.append(
            path_row(
                problem='random target',
                planner=PLANNER,
                source='ours',
                seed=seed,
                best_cost=_best_cost(arm, case, n_long, path.length if path else np.inf),
                waypoints=None if path is None else path.waypoints,
                is_valid=None
                if path is None
                else is_arm_path_free(arm, case.scene, path.waypoints, RAY, MARGIN),
                time_total=time_total,
                cost_final=None if path is None else path.length,
            )
        )
    return rows


def _best_cost(arm: ArmModel, case: Case, n_long: int, least: float) -> float:
    """Return the least cost of the long runs and of what is known [rad]."""
    for seed in range(n_long):
        result = query(arm, case, np.random.default_rng([seed, 11]), LONG, (MANY_DRAWS,))
        if result is not None and result.path is not None:
            least = min(least, result.path.length)
    return least
