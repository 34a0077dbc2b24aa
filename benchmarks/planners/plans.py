# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Our planners on the seven problems: the first path, and how its cost falls."""

from dataclasses import asdict
import json

import numpy as np
from rrth_planner.planning.options import RRTOptions, TreeOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.result import PlanResult

from benchmarks.common.clock import timed, uncollected
from benchmarks.common.queries import load_query, MAP_STEP, MAPS, QUERIES, Query, rrt_h_options
from benchmarks.common.size import Extent
from benchmarks.common.task import path_row, Row, Task

RRT, RRT_H = 'RRT', 'RRT-H'
# Runs that load what they need and do not count.
N_WARM = 3


def tasks(extent: Extent) -> list[Task]:
    """Return the measurements of this section."""
    return [
        Task(
            section='plans',
            name=f'{planner}, {name}',
            measure=lambda name=name, planner=planner: _runs(name, planner, extent),
        )
        for name in (*MAPS, *QUERIES)
        for planner in (RRT, RRT_H)
    ]


def _runs(name: str, planner: str, extent: Extent) -> list[Row]:
    query = load_query(name)
    options = _options(query, planner, extent.improve_time)
    for seed in range(N_WARM):
        plan(query.problem, options, np.random.default_rng(seed))
    # One after the other: checking a path in between would leave no warm cache.
    with uncollected():
        timings = [
            timed(lambda rng=rng: plan(query.problem, options, rng))
            for rng in [np.random.default_rng(seed) for seed in range(extent.seeds)]
        ]
    return [_row(query, planner, options, seed, *timing) for seed, timing in enumerate(timings)]


def _options(query: Query, planner: str, improve_time: float) -> TreeOptions:
    if planner == RRT_H:
        return rrt_h_options(query, improve_time)
    return RRTOptions(step_size=MAP_STEP, near_bias=0.0) if query.is_map else RRTOptions()


def _row(
    query: Query,
    planner: str,
    options: TreeOptions,
    seed: int,
    time_total: float,
    result: PlanResult,
) -> Row:
    path, history = result.path, list(zip(result.time_history, result.cost_history, strict=True))
    return path_row(
        problem=query.name,
        planner=planner,
        source='ours',
        seed=seed,
        best_cost=query.best_cost,
        options=json.dumps(asdict(options)),
        waypoints=None if path is None else path.waypoints,
        is_valid=None if path is None else query.is_solved_by(path.waypoints),
        time_total=time_total,
        time_first=history[0][0] if history else None,
        cost_first=None if result.raw_path is None else result.raw_path.length,
        cost_final=None if path is None else path.length,
        history=tuple(history),
    )
