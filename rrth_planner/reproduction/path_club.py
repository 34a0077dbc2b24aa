# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where growths go with the path club and without: the paper's Figures 13 and 14."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import PlanResult
from rrth_planner.planning.rrt import search

# Above this height a path goes round by the top of the map.
TOP = 85.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ScatterOptions(RRTHOptions):
    """
    RRT-H's growths alone, `club_attempts` after the first, each of `club_budget` draws at most.

    Each is kept away from the paths of those before it; with a `club_radius` of 0 they know
    nothing of each other. No shortcuts are applied.
    """


def scattered_growths(
    problem: PlanningProblem, options: ScatterOptions, seed: int
) -> list[PlanResult]:
    """Return growths after each other, each kept away from the paths of those before it."""
    rng, club = np.random.default_rng(seed), np.empty((0, len(problem.q_start)))
    growths: list[PlanResult] = []
    for _ in range(options.club_attempts + 1):
        deadline = Deadline(options.time_limit, lambda: False)
        grown = search(problem, options, rng, deadline, club=club, budget=options.club_budget)
        growths.append(grown)
        if grown.path is not None and options.club_radius > 0.0:
            club = np.concatenate([club, grown.path.waypoints[1:-1]])
    return growths


def goes_over_the_top(path: Array) -> bool:
    """Return whether a path, shape (n, 2), is of the longer homotopy class of the map."""
    return bool(path[:, 1].max() > TOP)
