# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The planner: growth, shortening and further attempts, under a clock and a cancel flag."""

from collections.abc import Callable
from dataclasses import dataclass
import time

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.kernels import rrt, rrt_h, tree
from rrth_planner.options import RRTHOptions
from rrth_planner.path import Path
from rrth_planner.problem import PlanningProblem
from rrth_planner.status import PlanStatus

CAPACITY = 8192
MAX_WAYPOINTS = 512
# Draws between two looks at the clock.
BATCH = 100
# Roots of the goal tree: more goals than this only slow its nearest-neighbour search.
MAX_ROOTS = 64
# Rounds of the three steps; they stop by themselves when nothing is gained.
MAX_ROUNDS = 30
# Finest step of a goal along its manifold [rad].
FINEST_SLIDE = 2e-3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanResult:
    """
    How planning ended.

    Parameters
    ----------
    status : PlanStatus
        SOLVED, TIMEOUT, SAMPLE_LIMIT or CANCELLED.
    path : Path or None
        The best path; None unless solved.
    cost_history : tuple of float
        Length of the best path after each attempt that shortened it [rad].
    n_samples : int
        Draws in all.
    is_reproducible : bool
        False where the clock ended the improvement: the seed alone does not fix the path then.

    """

    status: PlanStatus
    path: Path | None
    cost_history: tuple[float, ...]
    n_samples: int
    is_reproducible: bool


class _Deadline:
    """The clock and the cancel flag of one plan."""

    def __init__(self, options: RRTHOptions, should_stop: Callable[[], bool]) -> None:
        self.should_stop = should_stop
        self.start = time.monotonic()
        self.time_limit = options.time_limit

    def elapsed(self) -> float:
        """Return the time since the plan began [s]."""
        return time.monotonic() - self.start

    def status(self) -> PlanStatus | None:
        """Return why planning must end now, or None."""
        if self.should_stop():
            return PlanStatus.CANCELLED
        return PlanStatus.TIMEOUT if self.elapsed() > self.time_limit else None


def plan(
    problem: PlanningProblem,
    options: RRTHOptions,
    rng: np.random.Generator,
    should_stop: Callable[[], bool] = lambda: False,
) -> PlanResult:
    """
    Return the shortest path found to any of the goals by RRT-H (Zou et al. 2024).

    The straight edges to the goals come first, nearest goal first: a length that no path to a
    later goal can beat ends the search. Then trees grow to a first path, which the paper's three
    steps pull taut; further attempts start with the points of all found paths in a path club.

    Parameters
    ----------
    problem : PlanningProblem
    options : RRTHOptions
    rng : numpy.random.Generator
        The only source of chance.
    should_stop : callable
        Polled between batches; True cancels.

    """
    deadline = _Deadline(options, should_stop)
    world, goals = problem.world, problem.q_goals
    distances = np.linalg.norm(goals - problem.q_start, axis=1)
    best: Array | None = None
    costs: list[float] = []
    for goal in goals:
        if world.is_edge_valid(problem.q_start, goal):
            best = _shorten(problem, np.array([problem.q_start, goal]), options)
            costs.append(_length(best))
            break
    club = np.empty((0, len(problem.q_start)))
    n_samples, is_reproducible = 0, True
    for attempt in range(options.club_attempts + 1):
        cost = costs[-1] if costs else np.inf
        useful = np.flatnonzero(distances < cost * (1.0 - rrt_h.TAUT))[:MAX_ROOTS]
        if best is not None and (len(useful) == 0 or attempt == options.club_attempts):
            break
        if best is not None and deadline.elapsed() > options.improve_time:
            is_reproducible = options.improve_time == 0.0
            break
        budget = options.max_samples if best is None else options.club_budget
        raw, drawn, stopped = _grow(
            problem, goals[useful], options, cost, club, budget, rng, deadline
        )
        n_samples += drawn
        if stopped is not None:
            if best is None or stopped is PlanStatus.CANCELLED:
                return PlanResult(
                    status=stopped,
                    path=None,
                    cost_history=tuple(costs),
                    n_samples=n_samples,
                    is_reproducible=False,
                )
            is_reproducible = False
            break
        if raw is None:
            if best is None:
                break
            continue
        club = np.concatenate([club, raw[1:-1]])
        path = _shorten(problem, raw, options)
        if _length(path) < cost:
            best = path
            costs.append(_length(path))
    return PlanResult(
        status=PlanStatus.SAMPLE_LIMIT if best is None else PlanStatus.SOLVED,
        path=None if best is None else Path(_without_twins(best)),
        cost_history=tuple(costs),
        n_samples=n_samples,
        is_reproducible=is_reproducible,
    )


def _grow(
    problem: PlanningProblem,
    roots: Array,
    options: RRTHOptions,
    best_cost: float,
    club: Array,
    budget: int,
    rng: np.random.Generator,
    deadline: _Deadline,
) -> tuple[Array | None, int, PlanStatus | None]:
    """Return a first path or None, the draws it took, and why growth had to stop, if it had."""
    world, dof = problem.world, len(problem.q_start)
    tree_q = np.empty((2, CAPACITY, dof))
    parents = np.full((2, CAPACITY), -1, dtype=np.int64)
    sizes = np.array([1, len(roots), 0, len(roots)], dtype=np.int64)
    tree_q[0, 0] = problem.q_start
    tree_q[1, : len(roots)] = roots
    meeting = np.full(2, -1, dtype=np.int64)
    drawn = 0
    while drawn < budget:
        stopped = deadline.status()
        if stopped is not None:
            return None, drawn, stopped
        drawn += rrt.advance(
            world.edge_check,
            world.free_radius,
            world.resolution,
            world.robot,
            world.obstacles,
            world.bounds,
            options.step_size,
            0.0,
            options.goal_bias,
            True,
            best_cost,
            club,
            options.club_radius,
            options.club_count,
            options.club_probability,
            min(BATCH, budget - drawn),
            rng,
            tree_q,
            parents,
            sizes,
            meeting,
        )
        if meeting[0] >= 0:
            path = np.empty((MAX_WAYPOINTS, dof))
            n = tree.trace_path(tree_q, parents, meeting[0], meeting[1], path)
            return (path[:n].copy() if n else None), drawn, None
        if sizes[:2].max() >= CAPACITY - 1:
            break
    return None, drawn, None


def _shorten(problem: PlanningProblem, waypoints: Array, options: RRTHOptions) -> Array:
    """Return a taut path that ends on the goal manifold, never longer than the given one."""
    world = problem.world
    path = np.empty((MAX_WAYPOINTS, waypoints.shape[1]))
    n = len(waypoints)
    path[:n] = waypoints
    spacing = options.corner_spacing
    arguments = (world.edge_check, world.resolution, world.robot, world.obstacles)
    n = rrt_h.pull_taut(*arguments, path, n, spacing, MAX_ROUNDS)
    for _ in range(MAX_ROUNDS):
        gain = problem.slide_goal(path, n, FINEST_SLIDE)
        if gain < rrt_h.TAUT:
            break
        n = rrt_h.pull_taut(*arguments, path, n, spacing, MAX_ROUNDS)
    return path[:n].copy()


def _without_twins(waypoints: Array) -> Array:
    """Return the waypoints without those that stand on the one before; always both ends."""
    kept = [waypoints[0]]
    for q in waypoints[1:-1]:
        if np.linalg.norm(q - kept[-1]) > 1e-9 and np.linalg.norm(q - waypoints[-1]) > 1e-9:
            kept.append(q)
    return np.array([*kept, waypoints[-1]])


def _length(waypoints: Array) -> float:
    return float(np.linalg.norm(np.diff(waypoints, axis=0), axis=1).sum())
