# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The shortest route through a graph, whose edges are checked only when they would be taken."""

from collections.abc import Callable, Iterable, Sequence, Set
from dataclasses import dataclass
import heapq

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.path import Path
from rrth_planner.model.status import PlanStatus
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import PlanResult, Tree

# Where an edge leads, its length, and which of several edges between two nodes it is.
Edge = tuple[int, float, int]


@dataclass(frozen=True, slots=True)
class Route:
    """
    What a search has found.

    Parameters
    ----------
    steps : sequence of (int, int)
        Nodes from a source to a target, each with the kind of the edge that leads to it; empty
        where there is no route.
    parents : dict
        The parent of each node that was expanded, in that order; -1 for a source.

    """

    steps: Sequence[tuple[int, int]]
    parents: dict[int, int]


def shortest_route(
    sources: Iterable[int],
    targets: Set[int],
    edges: Callable[[int], Iterable[Edge]],
    is_free: Callable[[int, int, int], bool],
    bound: Callable[[int], float],
) -> Route:
    """
    Return the shortest route by A* (Hart, Nilsson and Raphael 1968).

    Parameters
    ----------
    edges : callable
        Node -> edges that leave it.
    is_free : callable
        Node, node, kind -> may the edge be taken. Asked when the edge would extend the shortest
        route, so of few edges; the result is that of a search in the graph of all free ones.
    bound : callable
        Node -> no more than the length of any route to a target, and by no edge does it fall
        by more than the length of that edge; 0 makes this Dijkstra's algorithm.

    """
    parents: dict[int, int] = {}
    kinds: dict[int, int] = {}
    queue = [(bound(node), 0.0, node, -1, 0) for node in sources]
    heapq.heapify(queue)
    while queue:
        _, cost, node, parent, kind = heapq.heappop(queue)
        if node in parents or (parent >= 0 and not is_free(parent, node, kind)):
            continue
        parents[node], kinds[node] = parent, kind
        if node in targets:
            steps = []
            while node >= 0:
                steps.append((node, kinds[node]))
                node = parents[node]
            return Route(steps[::-1], parents)
        for other, length, kind in edges(node):
            if other not in parents:
                total = cost + length
                heapq.heappush(queue, (total + bound(other), total, other, node, kind))
    return Route((), parents)


def join_points(
    problem: PlanningProblem,
    points: Array,
    radius: float,
    order: float,
    deadline: Deadline,
    n_samples: int | None = None,
) -> PlanResult:
    """
    Return the shortest path over points that are joined by straight free edges.

    Parameters
    ----------
    points : ndarray, shape (n, dof)
        Beside the start and the goal, which need not be among them [map units].
    radius, order : float
        Two points are joined where the norm of that order of their difference is so small [map
        units].
    n_samples : int, optional
        Of the result; default: how many nodes were expanded.

    Returns
    -------
    PlanResult
        Its tree is what was expanded.

    """
    nodes = np.vstack([problem.q_start, problem.q_goals[:1], points])
    to_goal = np.linalg.norm(nodes - nodes[1], axis=1).tolist()

    def edges(node: int) -> Iterable[Edge]:
        offsets = nodes - nodes[node]
        near = np.flatnonzero(np.linalg.norm(offsets, ord=order, axis=1) <= radius)
        lengths = np.linalg.norm(offsets[near], axis=1)
        return zip(near.tolist(), lengths.tolist(), [0] * len(near), strict=True)

    def is_free(node: int, other: int, _: int) -> bool:
        return problem.world.is_edge_valid(nodes[node], nodes[other])

    route = shortest_route([0], {1}, edges, is_free, to_goal.__getitem__)
    expanded = list(route.parents)
    rank = {node: i for i, node in enumerate(expanded)} | {-1: -1}
    parents = np.array([rank[parent] for parent in route.parents.values()])
    tree = Tree(nodes=nodes[expanded], parents=parents)
    path = Path(nodes[[node for node, _ in route.steps]]) if route.steps else None
    n_samples = len(expanded) if n_samples is None else n_samples
    return one_path(path, n_samples, deadline, [tree])


def one_path(
    path: Path | None,
    n_samples: int,
    deadline: Deadline,
    trees: Sequence[Tree],
    stopped: PlanStatus | None = None,
) -> PlanResult:
    """Return the result of a search that ends with its first path, with none, or was stopped."""
    is_found = path is not None
    elapsed = deadline.elapsed()
    return PlanResult(
        status=PlanStatus.SOLVED if is_found else stopped or PlanStatus.SAMPLE_LIMIT,
        path=path,
        trees=trees,
        cost_history=() if path is None else (path.length,),
        sample_history=(n_samples,) * is_found,
        time_history=(elapsed,) * is_found,
        n_samples=n_samples,
        planning_time=elapsed,
        is_reproducible=stopped is None,
    )
