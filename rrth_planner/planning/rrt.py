# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Growth to a first path: RRT with one tree or two, the basis of RRT-H."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from rrth_planner.kernels.search import rrt, rrt_h, tree
from rrth_planner.kernels.search.random import random_state
from rrth_planner.model.arrays import Array, check_dof
from rrth_planner.model.path import Path
from rrth_planner.model.status import PlanStatus
from rrth_planner.planning.buffers import MAX_NODES, Workspace, workspace
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import GrowthOptions, RRTHOptions
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import GrownTrees, PlanResult, Tree


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Growth:
    """
    Result of one growth.

    Parameters
    ----------
    waypoints : ndarray or None
        The first path, shape (n, dof) [rad].
    n_samples : int
        Number of samples.
    stopped : PlanStatus or None
        Why growth was stopped early, if it was.
    time : float
        When it ended, since the plan began [s].
    trees : sequence of Tree

    """

    waypoints: Array | None
    n_samples: int
    stopped: PlanStatus | None
    time: float
    trees: Sequence[Tree]


def search(
    problem: PlanningProblem,
    options: GrowthOptions,
    rng: np.random.Generator,
    deadline: Deadline,
    previous: Sequence[Tree],
) -> PlanResult:
    """Return the first path that RRT finds, without shortcuts."""
    grown = grow(problem, problem.q_goals, options, rng, deadline, previous=previous)
    if grown.waypoints is None:
        return PlanResult(
            status=grown.stopped or PlanStatus.SAMPLE_LIMIT,
            path=None,
            trees=grown.trees,
            n_samples=grown.n_samples,
            planning_time=deadline.elapsed(),
            is_reproducible=grown.stopped is None,
        )
    path = Path(grown.waypoints)
    return PlanResult(
        status=PlanStatus.SOLVED,
        path=path,
        raw_path=path,
        trees=grown.trees,
        cost_history=(path.length,),
        sample_history=(grown.n_samples,),
        time_history=(grown.time,),
        n_samples=grown.n_samples,
        planning_time=deadline.elapsed(),
    )


def grow(
    problem: PlanningProblem,
    roots: Array,
    options: GrowthOptions,
    rng: np.random.Generator,
    deadline: Deadline,
    *,
    previous: Sequence[Tree] = (),
    club: Array | None = None,
    best_cost: float = np.inf,
    budget: int | None = None,
) -> Growth:
    """
    Return a first path from the start to one of the roots, if the budget suffices.

    Parameters
    ----------
    problem : PlanningProblem
    roots : ndarray, shape (n, dof)
        Goals to aim for [rad].
    options : GrowthOptions
    rng : numpy.random.Generator
    deadline : Deadline
    previous : sequence of Tree
        Trees of an earlier plan: growth begins with their branches that are still free.
    club : ndarray, shape (m, dof)
        Points to keep away from [rad]; the options are then RRTHOptions.
    best_cost : float
        Only samples that can lead to a shorter path are drawn [rad].
    budget : int
        Most samples; default: `max_samples`.

    """
    world, dof = problem.world, len(problem.q_start)
    budget = options.max_samples if budget is None else budget
    club = np.empty((0, dof)) if club is None else club
    radius, count, probability = (
        (options.club_radius, options.club_count, options.club_probability)
        if isinstance(options, RRTHOptions)
        else (0.0, 0, 0.0)
    )
    room = workspace(dof, room_for(options, len(roots), previous, budget))
    drawn, stopped, bits = 0, None, random_state(rng)
    tree_q, parents, sizes = room.tree_q[0], room.parents[0], room.sizes[0]
    plant(problem, roots, options, room, previous)
    while room.meeting[0] < 0 and drawn < budget and sizes[:2].max() < tree_q.shape[1] - 1:
        stopped = deadline.status()
        if stopped is not None:
            break
        drawn += rrt.advance(
            world.functions,
            world.resolution,
            world.robot,
            world.obstacles,
            world.bounds,
            options.step_size,
            options.clearance_gain,
            options.goal_bias,
            options.near_bias,
            options.is_bidirectional,
            best_cost,
            club,
            radius,
            count,
            probability,
            # As RRT-H does, which so grows the same first path.
            min(rrt_h.BATCH, budget - drawn),
            bits,
            tree_q,
            parents,
            sizes,
            room.meeting,
        )
    waypoints = None
    if room.meeting[0] >= 0:
        path = room.paths[rrt_h.WORK]
        n = tree.trace_path(tree_q, parents, room.meeting[0], room.meeting[1], path)
        waypoints = path[:n].copy() if n else None
    return Growth(
        waypoints=waypoints,
        n_samples=drawn,
        stopped=stopped,
        time=deadline.elapsed(),
        trees=grown_trees(room, 0, options),
    )


def room_for(options: GrowthOptions, n_roots: int, previous: Sequence[Tree], budget: int) -> int:
    """Return how many nodes a tree may come to have."""
    return min(2 * budget, MAX_NODES) + n_roots + sum(len(t.nodes) for t in previous) + 2


def plant(
    problem: PlanningProblem,
    roots: Array,
    options: GrowthOptions,
    room: Workspace,
    previous: Sequence[Tree],
) -> None:
    """Begin the trees of a growth, with what is still free of the previous ones."""
    world, tree_q, parents, sizes = problem.world, room.tree_q[0], room.parents[0], room.sizes[0]
    rrt_h.plant(roots, problem.q_start, len(roots), tree_q, parents, sizes)
    if not previous:
        return
    # Compiled when a plan first builds on another one.
    reuse = import_module('rrth_planner.kernels.search.tree_reuse')
    seam = (world.edge_check, world.resolution, world.chain, world.robot, world.obstacles)
    for side, old in enumerate(previous[: 2 if options.is_bidirectional else 1]):
        check_dof(old.nodes, len(problem.q_start), 'previous')
        sizes[side] = reuse.transplant(
            *seam, old.nodes, old.parents, sizes[side], tree_q[side], parents[side]
        )
    reuse.join(*seam, options.step_size, tree_q, sizes, room.meeting)


def grown_trees(room: Workspace, pair: int, options: GrowthOptions) -> GrownTrees:
    """Return the trees of one pair as they are."""
    nodes, parents, sizes = room.tree_q[pair], room.parents[pair], room.sizes[pair].tolist()
    sides = range(2 if options.is_bidirectional else 1)
    return GrownTrees([(nodes[i, : sizes[i]], parents[i, : sizes[i]]) for i in sides])
