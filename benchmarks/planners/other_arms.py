# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whether other arms are planned for: a pointing goal for each of some targets."""

import numpy as np
from rrth_planner.collision.world import arm_world
from rrth_planner.model.arm import pointing_error
from rrth_planner.model.errors import RrthError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.planning.pointing_goals import check_pointing_arm

from benchmarks.common.numpy_checker import is_arm_path_free
from benchmarks.common.queries import wearer
from benchmarks.common.random_draws import free_configurations, random_target
from benchmarks.common.size import Extent
from benchmarks.common.task import figure_row, Row, Task
from benchmarks.planners.arms import NAMES, other_arm
from benchmarks.planners.full_query import Case, query

# How far a ray may pass by its target [m].
TOLERANCE = 1e-3


def tasks(extent: Extent) -> list[Task]:
    """Return the measurements of this section, one an arm."""
    return [
        Task(
            section='other arms',
            name=name,
            measure=lambda name=name: _pointing(name, extent.n_pointing),
        )
        for name in NAMES
    ]


def _pointing(name: str, n: int) -> list[Row]:
    arm, scene, rng = other_arm(name), wearer(), np.random.default_rng(4)
    world, reasons, n_planned = arm_world(arm, scene, 0.0, 1.0), set(), 0
    for _ in range(n):
        q_start, goal = free_configurations(rng, world, 1)[0], PointingGoal(random_target(rng))
        try:
            check_pointing_arm(arm)
            result = query(arm, Case(scene=scene, world=world, q_start=q_start, goal=goal), rng)
        except RrthError as problem:
            reasons.add(str(problem))
            continue
        if result is None or result.path is None:
            reasons.add('no free posture was found or reached')
            continue
        waypoints = result.path.waypoints
        is_aimed = pointing_error(arm, waypoints[-1], goal.target) < TOLERANCE
        n_planned += is_aimed and is_arm_path_free(arm, scene, waypoints, 1.0, 0.0)
    detail = f'{n_planned} of {n}' + ''.join(f'; {reason}' for reason in sorted(reasons))
    return [figure_row(f'pointing, {name}', n_planned / n, '', detail=detail)]
