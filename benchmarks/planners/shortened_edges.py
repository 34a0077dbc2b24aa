# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The hardest edges: those of shortcut paths, which are in contact with the boxes."""

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.planning.edge_checks import sampled
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.problem import PlanningProblem

from benchmarks.common import dense_checker
from benchmarks.common.clock import repeated
from benchmarks.common.queries import table_1_arm, wearer, wearer_world
from benchmarks.common.random_draws import free_configurations
from benchmarks.common.size import Extent
from benchmarks.common.task import figure_row, Row, Task
from benchmarks.planners import loops

# The shortcuts are checked at this spacing, not by the certificate, which would select the edges
# that it can prove [rad].
SPACING = 1e-3
# Shorter edges are left out: they are corners that were cut, proven by their ends [rad].
SHORTEST = 1e-3
# Edges that clear the boxes by this are counted by themselves too [m].
ROOM = 1e-4
# Spacing at which an edge is checked for being truly free: at a coarser one, collisions of some
# hundredths of a millimetre deep are missed [rad].
FINE = 1e-5


def tasks(extent: Extent) -> list[Task]:
    """Return the measurement of this section."""
    return [Task(section='shortcut', name='shortcut edges', measure=lambda: _shortcut(extent))]


def _shortcut(extent: Extent) -> list[Row]:
    world = wearer_world()
    starts, ends = _shortcut_edges(extent)
    flags = np.empty(len(starts), dtype=np.bool_)
    times = repeated(lambda: loops.check_edges(world, starts, ends, flags), extent.repeats)
    is_free, has_room = (
        ~dense_checker.colliding_edges(
            table_1_arm(), wearer(), world.ray_length, room, (starts, ends), FINE
        )
        for room in (0.0, ROOM)
    )
    return [
        _share('shortcut edges certified', flags[is_free]),
        _share('shortcut edges certified, 0.1 mm clear', flags[has_room]),
        figure_row('shortcut edges certified that collide', float(flags[~is_free].sum()), ''),
        *(
            figure_row('shortcut edge', 1e6 * time / len(starts), 'us', seed=i)
            for i, time in enumerate(times)
        ),
    ]


def _share(quantity: str, flags: NDArray[np.bool_]) -> Row:
    detail = f'{int(flags.sum())} of {len(flags)} truly free edges'
    return figure_row(quantity, float(flags.mean()), '', detail=detail)


def _shortcut_edges(extent: Extent) -> tuple[Array, Array]:
    """Return the edges of shortened paths between configurations with a wearer in between."""
    rng, world = np.random.default_rng(5), wearer_world()
    coarse = sampled(world, SPACING)
    options = RRTHOptions(improve_time=0.0)
    pairs: list[Array] = []
    n_paths = 0
    while n_paths < extent.n_shortcut:
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
