# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A* on a lattice of points of which each has eight neighbours, a reference in the plane."""

from dataclasses import dataclass
import math

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import option, Options
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import PlanResult
from rrth_planner.reproduction.relatives.graph_search import join_points

# Least ratio of the two that holds everywhere: length along the eight directions over distance.
OCTILE_RATIO = 1.0 / math.cos(math.pi / 8)
# Rounding of distances between neighbours, as a share.
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class LatticeOptions(Options):
    """A* (Hart, Nilsson and Raphael 1968) on an 8-connected lattice through the start."""

    spacing: float = option(1.0, 0.1, 1000.0, 'map', 'distance between neighbouring points')


def search(
    problem: PlanningProblem, options: LatticeOptions, rng: np.random.Generator, deadline: Deadline
) -> PlanResult:
    """
    Return the shortest path along the lattice, its edges checked as the planners check theirs.

    The goal is joined to the points around it. Without walls the path is at most `OCTILE_RATIO`
    times as long as the shortest one, however fine the lattice, but for the last edge; `rng` is
    not used. `n_samples` counts the expanded nodes.
    """
    points = lattice(problem.q_start, problem.world.bounds, options.spacing)
    return join_points(problem, points, (1.0 + ROUNDING) * options.spacing, math.inf, deadline)


def lattice(q_start: Array, bounds: Array, spacing: float) -> Array:
    """Return the points of a lattice through q_start within the bounds, (n, 2) [map units]."""
    low, high = (bounds - q_start) / spacing
    axes = [
        q + spacing * np.arange(math.ceil(a - ROUNDING), math.floor(b + ROUNDING) + 1)
        for q, a, b in zip(q_start, low, high, strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing='ij'), axis=-1).reshape(-1, len(q_start))
    return points[(points != q_start).any(axis=1)]
