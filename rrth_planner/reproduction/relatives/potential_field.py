# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Growth guided by an artificial potential field."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.model.path import Path
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import option, Options
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import PlanResult, Tree
from rrth_planner.reproduction.relatives.graph_search import one_path


@dataclass(frozen=True, slots=True, kw_only=True)
class PotentialFieldOptions(Options):
    """RRT guided by a potential field (after Yang, as the paper cites it); constants are ours."""

    step_size: float = option(10.0, 0.01, 1000.0, 'map', 'length of every extension of the tree')
    attraction: float = option(0.5, 0.0, 100.0, '-', 'pull of the goal over that of the sample')
    repulsion: float = option(
        0.5, 0.0, 100.0, '-', 'push of a wall in contact over the pull of the sample'
    )
    influence: float = option(5.0, 1e-3, 1000.0, 'map', 'range within which a wall pushes')
    max_samples: int = option(20_000, 1, 10**7, '-', 'samples after which the growth fails')
    time_limit: float = option(600.0, 1e-3, 3600.0, 's', 'the growth fails after this time')


def search(
    problem: PlanningProblem,
    options: PotentialFieldOptions,
    rng: np.random.Generator,
    deadline: Deadline,
) -> PlanResult:
    """
    Return the first path of one tree of uniform draws, whose steps follow `force`.

    Each step has the length `step_size`, but for the last one, which joins the goal.
    """
    world, goal = problem.world, problem.q_goals[0]
    low, high = world.bounds
    walls = world.obstacles.reshape(-1, 2, len(low))
    nodes = np.empty((options.max_samples + 2, len(low)))
    parents = np.empty(len(nodes), dtype=np.int64)
    nodes[0], parents[0], size = problem.q_start, -1, 1

    def joins_goal(q: Array) -> bool:
        is_near = bool(np.linalg.norm(goal - q) <= options.step_size)
        return is_near and world.is_edge_valid(q, goal)

    stopped, drawn, is_joined = None, 0, joins_goal(problem.q_start)
    while not is_joined and drawn < options.max_samples:
        stopped = deadline.status()
        if stopped is not None:
            break
        drawn += 1
        q = rng.uniform(low, high)
        near = int(np.argmin(((nodes[:size] - q) ** 2).sum(axis=1)))
        q_near = nodes[near]
        q_new = q_near + options.step_size * unit(force(q_near, q, goal, walls, options))
        if world.is_edge_valid(q_near, q_new):
            nodes[size], parents[size] = q_new, near
            size += 1
            is_joined = joins_goal(q_new)
    path = None
    if is_joined:
        nodes[size], parents[size] = goal, size - 1
        size += 1
        path = Path(_branch(nodes, parents, size - 1))
    tree = Tree(nodes=nodes[:size], parents=parents[:size])
    return one_path(path, drawn, deadline, [tree], stopped)


def force(
    q: Array, q_sample: Array, goal: Array, walls: Array, options: PotentialFieldOptions
) -> Array:
    """
    Return the force at q, without unit, shape (dof,).

    F = u(q_sample - q) + attraction u(goal - q) + repulsion (1 - d / influence) u(q - q_wall),
    u(v) = v / |v|; q_wall is the nearest point of a wall, and its term counts only where its
    distance d is less than `influence`. The field of Khatib (1986) with forces that stay finite:
    with his, which grow without limit at a wall, no edge would lead along one.

    Parameters
    ----------
    q, q_sample, goal : ndarray, shape (dof,)
        [map units].
    walls : ndarray, shape (m, 2, dof)
        Lower and upper corner of each wall [map units].

    """
    total: Array = unit(q_sample - q) + options.attraction * unit(goal - q)
    offsets = q - np.clip(q, walls[:, 0], walls[:, 1])
    distances = np.linalg.norm(offsets, axis=1)
    if len(walls) and distances.min() < options.influence:
        nearest = int(np.argmin(distances))
        share = 1.0 - distances[nearest] / options.influence
        total += options.repulsion * share * unit(offsets[nearest])
    return total


def unit(vector: Array) -> Array:
    """Return a vector of length 1 in the same direction; zero stays zero."""
    length = np.linalg.norm(vector)
    result: Array = vector / length if length > 0.0 else vector
    return result


def _branch(nodes: Array, parents: NDArray[np.int64], node: int) -> Array:
    """Return the nodes from the root to a node of a tree, (n, dof)."""
    branch = []
    while node >= 0:
        branch.append(node)
        node = int(parents[node])
    return nodes[branch[::-1]]
