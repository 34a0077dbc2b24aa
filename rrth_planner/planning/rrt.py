# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Growth to a first path: RRT with one tree or two, the basis of RRT-H."""

from collections.abc import Sequence
from importlib import import_module

import numpy as np
from numpy.typing import NDArray
from rrth_planner.kernels.search import rrt, rrt_h, tree
from rrth_planner.kernels.search.random import random_state
from rrth_planner.model.arrays import Array, check_dof
from rrth_planner.model.path import Path
from rrth_planner.model.status import PlanStatus
from rrth_planner.planning.buffers import MAX_NODES, Workspace, workspace
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import GrowthOptions, RRTHOptions, TreeOptions
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import GrownTrees, PlanResult, Tree


def search(
    problem: PlanningProblem,
    options: GrowthOptions,
    rng: np.random.Generator,
    deadline: Deadline,
    previous: Sequence[Tree] = (),
    club: Array | None = None,
    budget: int | None = None,
) -> PlanResult:
    """
    Return the first path that RRT finds, without shortcuts.

    Parameters
    ----------
    previous : sequence of Tree
        Trees of an earlier plan: growth begins with their branches that are still free.
    club : ndarray, shape (m, dof)
        Points to keep away from [rad]; the options are then RRTHOptions.
    budget : int
        Most samples; default: `max_samples`.

    """
    world, n_goals, dof = problem.world, len(problem.q_goals), len(problem.q_start)
    budget = options.max_samples if budget is None else budget
    club = np.empty((0, dof)) if club is None else club
    room = workspace(dof, room_for(n_goals, previous, budget))
    drawn, stopped, bits = 0, None, random_state(rng)
    tree_q, parents, sizes = trees = room.tree_q[0], room.parents[0], room.sizes[0]
    settings = np.array(growth_settings(options))
    plant(problem, n_goals, options, room, previous)
    while room.meeting[0] < 0 and drawn < budget and sizes[:2].max() < tree_q.shape[1] - 1:
        stopped = deadline.status()
        if stopped is not None:
            break
        # As RRT-H does, which so grows the same first path.
        n_draws = min(rrt_h.BATCH, budget - drawn)
        drawn += rrt.advance(
            world.space, settings, np.inf, club, n_draws, bits, *trees, room.meeting
        )
    n = 0
    if room.meeting[0] >= 0:
        n = tree.trace_path(tree_q, parents, *room.meeting, room.paths[rrt_h.WORK])
    moment = deadline.elapsed()
    path = Path(room.paths[rrt_h.WORK, :n]) if n else None
    return PlanResult(
        status=(stopped or PlanStatus.SAMPLE_LIMIT) if path is None else PlanStatus.SOLVED,
        path=path,
        raw_path=path,
        trees=grown_trees(room, 0, options),
        cost_history=() if path is None else (path.length,),
        sample_history=() if path is None else (drawn,),
        time_history=() if path is None else (moment,),
        n_samples=drawn,
        planning_time=deadline.elapsed(),
        is_reproducible=stopped is None,
    )


def growth_settings(options: GrowthOptions) -> list[float]:
    """Return the `settings` of a growth, entries as in `kernels.search.rrt`."""
    club = (0.0, 0.0, 0.0)
    if isinstance(options, RRTHOptions):
        club = (options.club_radius, options.club_count, options.club_probability)
    return [
        options.step_size,
        options.clearance_gain,
        options.goal_bias,
        options.is_bidirectional,
        options.near_bias,
        *club,
    ]


def room_for(n_roots: int, previous: Sequence[Tree], budget: int) -> int:
    """Return how many nodes a tree may come to have."""
    return min(2 * budget, MAX_NODES) + n_roots + sum(len(t.nodes) for t in previous) + 2


def plant(
    problem: PlanningProblem,
    n_roots: int,
    options: GrowthOptions,
    room: Workspace,
    previous: Sequence[Tree],
) -> None:
    """Begin the trees of a growth, with what is still free of the previous ones."""
    tree_q, parents, sizes = room.tree_q[0], room.parents[0], room.sizes[0]
    rrt_h.plant(problem.q_goals, problem.q_start, n_roots, tree_q, parents, sizes)
    if previous:
        reuse(problem, options, previous, tree_q, parents, sizes, room.meeting)


def reuse(
    problem: PlanningProblem,
    options: TreeOptions,
    previous: Sequence[Tree],
    tree_q: Array,
    parents: NDArray[np.int64],
    sizes: NDArray[np.int64],
    meeting: NDArray[np.int64],
) -> None:
    """Add to new trees the branches of earlier ones that are still free; join them if possible."""
    # Compiled when a plan first builds on another one.
    kernels = import_module('rrth_planner.kernels.search.tree_reuse')
    space = problem.world.space
    for side, old in enumerate(previous[: 2 if options.is_bidirectional else 1]):
        check_dof(old.nodes, len(problem.q_start), 'previous')
        sizes[side] = kernels.transplant(
            space, old.nodes, old.parents, sizes[side], tree_q[side], parents[side]
        )
    kernels.join(space, options.step_size, tree_q, sizes, meeting)


def grown_trees(room: Workspace, pair: int, options: GrowthOptions) -> GrownTrees:
    """Return the trees of one pair as they are."""
    nodes, parents, sizes = room.tree_q[pair], room.parents[pair], room.sizes[pair].tolist()
    sides = range(2 if options.is_bidirectional else 1)
    return GrownTrees([(nodes[i, : sizes[i]], parents[i, : sizes[i]]) for i in sides])
