# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT-H: grow, pull taut, and begin again round another way (Zou et al. 2024)."""

from collections.abc import Callable

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.deadline import Deadline
from rrth_planner.growth import grow, MAX_WAYPOINTS
from rrth_planner.kernels import rrt_h
from rrth_planner.options import RRTHOptions
from rrth_planner.path import Path
from rrth_planner.problem import PlanningProblem
from rrth_planner.result import PlanResult, Tree
from rrth_planner.status import PlanStatus

# Roots of the goal tree: more goals than this only slow its nearest-neighbour search.
MAX_ROOTS = 64
# Rounds of the three steps; they stop by themselves when nothing is gained.
MAX_ROUNDS = 100
# Finest step of a goal along its manifold [rad].
FINEST_SLIDE = 2e-3
# Waypoints nearer than this are one [rad].
TWIN = 1e-9


def search(
    problem: PlanningProblem,
    options: RRTHOptions,
    rng: np.random.Generator,
    deadline: Deadline,
    previous: tuple[Tree, ...],
    shorten_path: Callable[[PlanningProblem, Array, RRTHOptions], Array] | None = None,
) -> PlanResult:
    """
    Return the shortest path of some growths, each pulled taut.

    The straight edges to the goals come first, nearest goal first: a length that no path to a
    later goal can beat ends the search. Growths after the first path keep away from the path
    club, the points of all raw paths, and draw only where a shorter path can lead.
    `shorten_path` stands in for `shorten`.
    """
    pull = shorten if shorten_path is None else shorten_path
    stopped = deadline.status()
    if stopped is not None:
        return PlanResult(status=stopped, path=None, is_reproducible=False)
    best, raw, trees = _straight(problem, options), None, previous
    history = [] if best is None else [(_length(best), 0, deadline.elapsed())]
    distances = np.linalg.norm(problem.q_goals - problem.q_start, axis=1)
    club = np.empty((0, len(problem.q_start)))
    n_samples, is_reproducible = 0, True
    # The first path, unless a straight edge is one, does not count as a further attempt.
    n_growths = options.club_attempts + (best is None)
    for attempt in range(n_growths):
        cost = np.inf if best is None else _length(best)
        useful = np.flatnonzero(distances < cost * (1.0 - rrt_h.TAUT))[:MAX_ROOTS]
        if best is not None and len(useful) == 0:
            break
        if best is not None and deadline.elapsed() > options.improve_time:
            is_reproducible = options.improve_time == 0.0
            break
        grown = grow(
            problem,
            problem.q_goals[useful],
            options,
            rng,
            deadline,
            previous=previous if attempt == 0 else (),
            club=club,
            best_cost=cost,
            budget=options.max_samples if best is None else options.club_budget,
        )
        n_samples += grown.n_samples
        # The trees that know the best way are the ones worth keeping.
        trees = grown.trees if best is None else trees
        if grown.stopped is not None:
            stopped, is_reproducible = grown.stopped, False
            break
        if grown.waypoints is None:
            if best is None:
                break
            continue
        raw = Path(grown.waypoints) if raw is None else raw
        club = np.concatenate([club, grown.waypoints[1:-1]])
        path = pull(problem, grown.waypoints, options)
        if _length(path) < cost:
            best, trees = path, grown.trees
            history.append((_length(path), n_samples, deadline.elapsed()))
    is_solved = best is not None and stopped is not PlanStatus.CANCELLED
    return PlanResult(
        status=PlanStatus.SOLVED if is_solved else (stopped or PlanStatus.SAMPLE_LIMIT),
        path=Path(without_twins(best)) if is_solved and best is not None else None,
        raw_path=raw,
        trees=trees,
        cost_history=tuple(entry[0] for entry in history),
        sample_history=tuple(entry[1] for entry in history),
        time_history=tuple(entry[2] for entry in history),
        n_samples=n_samples,
        planning_time=deadline.elapsed(),
        is_reproducible=is_reproducible,
    )


def _straight(problem: PlanningProblem, options: RRTHOptions) -> Array | None:
    """Return the straight edge to the nearest goal that has a free one, its goal slid on."""
    for goal in problem.q_goals:
        if problem.world.is_edge_valid(problem.q_start, goal):
            return shorten(problem, np.array([problem.q_start, goal]), options)
    return None


def shorten(problem: PlanningProblem, waypoints: Array, options: RRTHOptions) -> Array:
    """
    Return a taut path that ends on the goal manifold, never longer than the given one.

    Parameters
    ----------
    problem : PlanningProblem
    waypoints : ndarray, shape (n, dof)
        A path of the problem [rad].
    options : RRTHOptions

    """
    world = problem.world
    path = np.empty((max(MAX_WAYPOINTS, 2 * len(waypoints)), waypoints.shape[1]))
    n = len(waypoints)
    path[:n] = waypoints
    arguments = (world.edge_check, world.resolution, world.chain, world.robot, world.obstacles)
    spacing = options.corner_spacing
    n = rrt_h.pull_taut(*arguments, path, n, spacing, MAX_ROUNDS)
    for _ in range(MAX_ROUNDS):
        gain = problem.slide_goal(path, n, FINEST_SLIDE)
        if gain < rrt_h.TAUT:
            break
        n = rrt_h.pull_taut(*arguments, path, n, spacing, MAX_ROUNDS)
    return path[:n].copy()


def without_twins(waypoints: Array) -> Array:
    """Return the waypoints without those that stand on the one before; always both ends."""
    steps = np.abs(np.diff(waypoints, axis=0)).max(axis=1)
    if steps.min() > TWIN:
        return waypoints
    # A later twin of the last waypoint goes too, the last one stays.
    is_kept = np.concatenate([[True], steps > TWIN])
    is_kept[1:-1] &= np.abs(waypoints[1:-1] - waypoints[-1]).max(axis=1) > TWIN
    is_kept[-1] = True
    return waypoints[is_kept]


def _length(waypoints: Array) -> float:
    return float(np.linalg.norm(np.diff(waypoints, axis=0), axis=1).sum())
