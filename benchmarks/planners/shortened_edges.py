# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The hardest edges: those of shortened paths, which lean on the boxes."""

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.planning.edge_checks import sampled
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.problem import PlanningProblem

from benchmarks.common.clock import repeated
from benchmarks.common.queries import table_1_arm, wearer, wearer_world
from benchmarks.common.random_draws import free_configurations
from benchmarks.common.size import Extent
from benchmarks.common.task import figure_row, Row, Task
from benchmarks.planners import dense_checker, loops

# The paths are pulled taut by a check at this spacing, not by the proof, which would only let
# those edges stand that it can prove [rad].
SPACING = 1e-3
# Shorter edges are left out: they are corners that were cut, proven by their ends [rad].
SHORTEST = 1e-3
# Edges that clear the boxes by this are counted by themselves too [m].
ROOM = 1e-4
# Spacing at which it is judged whether an edge is truly free: at a coarser one, touches of some
# hundredths of a millimetre are missed [rad].
JUDGED = 1e-5


def tasks(extent: Extent) -> list[Task]:
    """Return the measurement of this section."""
    return [Task(section='taut', name='taut edges', measure=lambda: _taut(extent))]


def _taut(extent: Extent) -> list[Row]:
    world = wearer_world()
    starts, ends = _taut_edges(extent)
    flags = np.empty(len(starts), dtype=np.bool_)
    times = repeated(lambda: loops.check_edges(world, starts, ends, flags), extent.repeats)
    is_free, has_room = (
        ~dense_checker.touching_edges(
            table_1_arm(), wearer(), world.ray_length, room, (starts, ends), JUDGED
        )
        for room in (0.0, ROOM)
    )
    return [
        _share('taut edges certified', flags[is_free]),
        _share('taut edges certified, 0.1 mm clear', flags[has_room]),
        figure_row('taut edges certified that touch', float(flags[~is_free].sum()), ''),
        *(
            figure_row('taut edge', 1e6 * time / len(starts), 'us', seed=i)
            for i, time in enumerate(times)
        ),
    ]


def _share(quantity: str, flags: NDArray[np.bool_]) -> Row:
    detail = f'{int(flags.sum())} of {len(flags)} truly free edges'
    return figure_row(quantity, float(flags.mean()), '', detail=detail)


def _taut_edges(extent: Extent) -> tuple[Array, Array]:
    """Return the edges of shortened paths between configurations with a wearer in between."""
    rng, world = np.random.default_rng(5), wearer_world()
    coarse = sampled(world, SPACING)
    options = RRTHOptions(improve_time=0.0)
    pairs: list[Array] = []
    n_paths = 0
    while n_paths < extent.n_taut:
        q_start, q_goal = free_configurations(rng, world, 2)
        if coarse.is_edge_valid(q_start, q_goal):
            continue
        problem = PlanningProblem(world=coarse, q_start=q_start, q_goals=q_goal[None])
        path = plan(problem, options, rng).path
        if path is None:
            continue
        n_paths += 1
        pairs += [
            np.array([a, b])
            for a, b in zip(path.waypoints[:-1], path.waypoints[1:], strict=True)
            if np.linalg.norm(b - a) > SHORTEST
        ]
    edges = np.array(pairs)
    return np.ascontiguousarray(edges[:, 0]), np.ascontiguousarray(edges[:, 1])
