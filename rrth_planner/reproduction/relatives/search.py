# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A path by any planner of the comparison: those of the package, and the relatives."""

from collections.abc import Callable
from typing import cast

import numpy as np
from rrth_planner.kernels.kinematics.generated_fk import NO_CHAIN
from rrth_planner.model.errors import SceneError
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import Options, TreeOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import PlanResult
from rrth_planner.reproduction.relatives import dubins_path, lattice, potential_field, roadmap

_SEARCH: dict[type[Options], Callable[..., PlanResult]] = {
    potential_field.PotentialFieldOptions: potential_field.search,
    dubins_path.DubinsOptions: dubins_path.search,
    lattice.LatticeOptions: lattice.search,
    roadmap.RoadmapOptions: roadmap.search,
}


def find_path(problem: PlanningProblem, options: Options, rng: np.random.Generator) -> PlanResult:
    """
    Return the path that a planner finds; the class of the options is the choice of the planner.

    Raises
    ------
    OptionsError
        Options of an unknown planner.
    SceneError
        A relative is asked for a path of an arm, or on a map that is not in the plane.

    """
    search = _SEARCH.get(type(options))
    if search is None:
        # Which rejects what it does not know.
        return plan(problem, cast(TreeOptions, options), rng)
    n = len(problem.q_start)
    if problem.world.chain is not NO_CHAIN or n != 2:
        kind = 'map' if problem.world.chain is NO_CHAIN else 'arm'
        raise SceneError(
            f'problem: {kind} of {n} dimensions for {type(options).__name__}, expected a map of 2'
        )
    time_limit = getattr(options, 'time_limit', np.inf)
    return search(problem, options, rng, Deadline(time_limit, lambda: False))
