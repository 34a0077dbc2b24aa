# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Probabilistic roadmaps, a reference in the plane."""

from dataclasses import dataclass
import math

import numpy as np
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import option, Options
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import PlanResult
from rrth_planner.planning.rrt_star import optimal_radius
from rrth_planner.reproduction.relatives.graph_search import join_points


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadmapOptions(Options):
    """PRM (Kavraki et al. 1996) with the radius of PRM* (Karaman and Frazzoli 2011)."""

    n_samples: int = option(2000, 2, 10**6, '-', 'draws of the roadmap, also those in walls')
    radius_factor: float = option(
        1.1, 0.01, 100.0, '-', 'radius of the neighbours over the least one of optimality'
    )


def search(
    problem: PlanningProblem, options: RoadmapOptions, rng: np.random.Generator, deadline: Deadline
) -> PlanResult:
    """
    Return the shortest path over free draws, start and goal, each joined to those around it.

    The radius is gamma (log n / n)^(1/d), with n draws in d dimensions and gamma of
    `optimal_radius`. A roadmap is made for many queries; here it has one, and edges that the
    search does not need are not checked. `n_samples` counts all draws.
    """
    n, world = options.n_samples, problem.world
    low, high = world.bounds
    draws = rng.uniform(low, high, (n, len(low)))
    points = draws[[world.is_valid(q) for q in draws]]
    gamma = options.radius_factor * optimal_radius(world.bounds)
    radius = gamma * (math.log(n) / n) ** (1.0 / len(low))
    return join_points(problem, points, radius, 2.0, deadline, n)
