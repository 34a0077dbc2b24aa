# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT*, Informed RRT* and RRT*-Smart: paths that get shorter as the trees grow."""

from collections.abc import Sequence
import math
from typing import Any

import numpy as np
from rrth_planner.kernels.search import informed_rrt_star, rrt_star, rrt_star_smart
from rrth_planner.kernels.search.random import random_state
from rrth_planner.kernels.search.tree import trace_path
from rrth_planner.model.arrays import Array
from rrth_planner.model.path import Path
from rrth_planner.model.status import PlanStatus
from rrth_planner.planning.buffers import MAX_NODES, MAX_WAYPOINTS
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import (
    InformedRRTStarOptions,
    RRTStarOptions,
    RRTStarSmartOptions,
)
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import GrownTrees, PlanResult, Tree
from rrth_planner.planning.rrt import reuse

# Samples between two checks of the clock.
BATCH = 500
# Pairs of nodes at which the two trees meet, at most.
MAX_MEETINGS = 65536


class _Trees:
    """The buffers of the two trees, laid out for the kernels."""

    def __init__(
        self, problem: PlanningProblem, options: RRTStarOptions, previous: Sequence[Tree]
    ) -> None:
        dof, n_goals = len(problem.q_start), len(problem.q_goals)
        old = sum(len(t.nodes) for t in previous)
        capacity = min(options.max_samples, MAX_NODES) + n_goals + old + 2
        self.tree_q = np.empty((2, capacity, dof))
        self.links = np.empty((2, 3, capacity), dtype=np.int64)
        self.links[:, :, : n_goals + 1] = -1
        self.costs = np.empty((2, capacity))
        self.costs[:, : n_goals + 1] = 0.0
        self.sizes = np.array([1, n_goals, 0, n_goals], dtype=np.int64)
        self.tree_q[0, 0] = problem.q_start
        self.tree_q[1, :n_goals] = problem.q_goals
        self.meetings = np.empty((MAX_MEETINGS, 2), dtype=np.int64)
        # Cost of the best path, row of its meeting; waypoints and cost of the shortened path.
        self.best = np.array([np.inf, -1.0, 0.0, np.inf])
        self.shortened = np.empty((MAX_WAYPOINTS, dof))
        self.is_bidirectional = options.is_bidirectional
        if previous:
            self._reuse(problem, options, previous)

    def _reuse(
        self, problem: PlanningProblem, options: RRTStarOptions, previous: Sequence[Tree]
    ) -> None:
        """Begin with what is still free of earlier trees, and the path in them, if any."""
        first, parents = self.sizes[:2].tolist(), np.empty(self.costs.shape, dtype=np.int64)
        meeting = np.empty(2, dtype=np.int64)
        reuse(problem, options, previous, self.tree_q, parents, self.sizes, meeting)
        for side in range(2):
            for i in range(first[side], self.sizes[side]):
                parent = parents[side, i]
                self.links[side, rrt_star.CHILD, i] = -1
                rrt_star.attach(self.links[side], i, parent)
                step = np.linalg.norm(self.tree_q[side, i] - self.tree_q[side, parent])
                self.costs[side, i] = self.costs[side, parent] + step
        if meeting[0] >= 0:
            self.meetings[0] = meeting
            self.sizes[2] = 1
            rrt_star.find_best(self.tree_q, self.costs, self.sizes, self.meetings, self.best)

    def arrays(self) -> tuple[Any, ...]:
        """Return the arrays of the trees, in the order of `kernels.search.rrt_star.TREES`."""
        return self.tree_q, self.links, self.costs, self.sizes, self.meetings, self.best

    def path(self) -> Array | None:
        """Return the waypoints of the best path of the trees, (n, dof); None: buffer too small."""
        a, b = self.meetings[int(self.best[1])]
        path = np.empty((MAX_WAYPOINTS, self.tree_q.shape[2]))
        n = trace_path(self.tree_q, self.links[:, rrt_star.PARENT], a, b, path)
        return path[:n].copy() if n else None

    def grown(self) -> GrownTrees:
        """Return the trees."""
        sizes = self.sizes[: 2 if self.is_bidirectional else 1]
        return GrownTrees(
            (self.tree_q[side, :n], self.links[side, rrt_star.PARENT, :n])
            for side, n in enumerate(sizes)
        )


def search(
    problem: PlanningProblem,
    options: RRTStarOptions,
    rng: np.random.Generator,
    deadline: Deadline,
    previous: Sequence[Tree],
) -> PlanResult:
    """Return the best path after `max_samples` draws, or after `improve_time` since the first."""
    world = problem.world
    trees = _Trees(problem, options, previous)
    advance, ratio, is_smart = rrt_star.advance, 1, isinstance(options, RRTStarSmartOptions)
    if isinstance(options, InformedRRTStarOptions):
        advance = informed_rrt_star.advance
    elif isinstance(options, RRTStarSmartOptions):
        advance, ratio = rrt_star_smart.advance, options.biasing_ratio
    radius = options.rewire_factor * optimal_radius(world.bounds)
    settings = np.array(
        [
            options.step_size,
            options.clearance_gain,
            options.goal_bias,
            options.is_bidirectional,
            radius,
            ratio,
        ]
    )
    cost = first_time = np.inf
    history: list[tuple[float, int, float]] = []
    drawn, stopped, is_cut, bits = 0, None, False, random_state(rng)
    while drawn < options.max_samples:
        stopped = deadline.status()
        if stopped is not None:
            break
        if deadline.elapsed() - first_time > options.improve_time:
            is_cut = options.improve_time > 0.0
            break
        if trees.sizes[:2].max() >= trees.tree_q.shape[1] - 1:
            break
        before = deadline.elapsed()
        costs = np.empty(min(BATCH, options.max_samples - drawn))
        advance(world.space, settings, trees.shortened, bits, *trees.arrays(), costs)
        after = deadline.elapsed()
        # The draws of this batch after which the path was shorter than ever before.
        falls = np.flatnonzero(costs < np.append(cost, costs[:-1]))
        if len(falls):
            moments = before + (falls + 1) * ((after - before) / len(costs))
            found = costs[falls], drawn + 1 + falls, moments
            history.extend(zip(*[column.tolist() for column in found], strict=True))
            cost = float(costs[falls[-1]])
        drawn += len(costs)
        if cost < np.inf and first_time == np.inf:
            first_time = after
    best_path: Array | None = None
    if cost < np.inf and stopped is not PlanStatus.CANCELLED:
        best_path = trees.shortened[: int(trees.best[2])] if is_smart else trees.path()
    return PlanResult(
        status=(stopped or PlanStatus.SAMPLE_LIMIT) if best_path is None else PlanStatus.SOLVED,
        path=None if best_path is None else Path(best_path),
        trees=trees.grown(),
        cost_history=tuple([row[0] for row in history]),
        sample_history=tuple([row[1] for row in history]),
        time_history=tuple([row[2] for row in history]),
        n_samples=drawn,
        planning_time=deadline.elapsed(),
        is_reproducible=stopped is None and not is_cut,
    )


def optimal_radius(bounds: Array) -> float:
    """
    Return the least gamma for which RRT* is asymptotically optimal (Karaman and Frazzoli 2011).

    gamma = 2 (1 + 1/d)^(1/d) (mu / zeta_d)^(1/d), mu the volume of the bounds (at least that of
    the free space), zeta_d that of the unit ball.
    """
    d = bounds.shape[1]
    volume = float(np.prod(bounds[1] - bounds[0]))
    ball = math.pi ** (d / 2) / math.gamma(d / 2 + 1)
    return float(2 * (1 + 1 / d) ** (1 / d) * (volume / ball) ** (1 / d))
