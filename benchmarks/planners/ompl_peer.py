# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The peer `ompl` from the package index, with a compiled check of its edges.

Its calls back into Python cost about a microsecond an edge; the looking at configurations in
between is compiled. It runs in a process of its own, pinned to the same core: whatever it writes
or breaks stays there.
"""

from concurrent.futures import ProcessPoolExecutor
from functools import cache
import importlib.util
import multiprocessing
import os
import time
from typing import Any

import numpy as np

from benchmarks.common.clock import uncollected
from benchmarks.common.queries import load_query, MAPS, QUERIES, Query
from benchmarks.common.size import Extent
from benchmarks.common.task import path_row, Row, Task
from benchmarks.planners.loops import peer_check

CONNECT, SIMPLIFIED, RESTARTS = 'RRTConnect', 'RRTConnect, simplified', 'RRTConnect, restarts'
ANYTIME = {'AORRTC': 'AORRTC', 'BIT*': 'BITstar', 'Informed RRT*': 'InformedRRTstar'}
# Longest extension on the arm, found best of a few; on maps the planner's own [rad].
ARM_RANGE = 0.5
# Runs of a one-solution planner for each run of one that improves its path, which take longer.
N_CONNECT = 5
TIME_LIMIT = 5.0


def tasks(extent: Extent) -> list[Task]:
    """Return the measurements of this section."""
    return [
        Task(
            section='peers',
            name=f'{planner}, {name}',
            measure=lambda name=name, planner=planner: _elsewhere(name, planner, extent),
        )
        for name in (*MAPS, *QUERIES)
        for planner in (CONNECT, RESTARTS, *ANYTIME)
    ]


def is_possible() -> bool:
    """Return whether the peer is there."""
    return importlib.util.find_spec('ompl') is not None


def _elsewhere(name: str, planner: str, extent: Extent) -> list[Row]:
    rows: list[Row] = _process().submit(_runs, name, planner, extent).result()
    return rows


@cache
def _process() -> ProcessPoolExecutor:
    context = multiprocessing.get_context('spawn')
    return ProcessPoolExecutor(1, mp_context=context, initializer=_silence)


def _silence() -> None:
    # At its end the wheel lists what its bindings leak.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)


def _runs(name: str, planner: str, extent: Extent) -> list[Row]:
    query = load_query(name)
    check = _check(name)
    if planner == CONNECT:
        _connect(query, check, 0)
        n_runs = N_CONNECT * extent.peer_seeds
        return [row for seed in range(n_runs) for row in _connect(query, check, seed)]
    improve = _restart if planner == RESTARTS else _improve
    return [
        improve(query, check, planner, seed, extent.peer_time) for seed in range(extent.peer_seeds)
    ]


@cache
def _check(name: str) -> Any:
    query = load_query(name)
    return peer_check(query.problem.world, query.is_map)


def _setup(query: Query, check: Any, planner: str) -> Any:
    from ompl import base, geometric, util

    util.setLogLevel(util.LogLevel.LOG_NONE)
    (low, high), dof = query.problem.world.bounds, len(query.problem.q_start)
    space, bounds = base.RealVectorStateSpace(dof), base.RealVectorBounds(dof)
    for k in range(dof):
        bounds.setLow(k, float(low[k]))
        bounds.setHigh(k, float(high[k]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()

    class Validator(base.MotionValidator):
        """Checks an edge at once."""

        if query.is_map:

            def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:  # noqa: N802
                """Return whether an edge is free."""
                return check(a[0], a[1], b[0], b[1])
        else:

            def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:  # noqa: N802
                """Return whether an edge is free at a spacing."""
                return check(a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3])

    def is_valid(state: Any) -> bool:
        q = [state[k] for k in range(dof)]
        return check(*q, *q)

    setup.setStateValidityChecker(is_valid)
    information.setMotionValidator(Validator(information))
    start, goal = space.allocState(), space.allocState()
    for k in range(dof):
        start[k], goal[k] = float(query.problem.q_start[k]), float(query.problem.q_goals[0, k])
    setup.setStartAndGoalStates(start, goal)
    chosen = getattr(geometric, planner)(information)
    if not query.is_map and planner in ('RRTConnect', 'AORRTC'):
        chosen.setRange(ARM_RANGE)
    setup.setPlanner(chosen)
    setup.setup()
    return setup


def _path(setup: Any, query: Query) -> Any:
    dof = len(query.problem.q_start)
    states = setup.getSolutionPath().getStates()
    return np.array([[state[k] for k in range(dof)] for state in states])


def _row(query: Query, planner: str, seed: int, **columns: Any) -> Row:
    waypoints = columns.get('waypoints')
    is_valid = None if waypoints is None else query.is_solved_by(waypoints)
    return path_row(
        problem=query.name,
        planner=planner,
        source='ompl',
        seed=seed,
        best_cost=query.best_cost,
        is_valid=is_valid,
        **columns,
    )


def _connect(query: Query, check: Any, seed: int) -> list[Row]:
    """Return the rows of one run of RRTConnect: its first path, and that path simplified."""
    setup = _setup(query, check, 'RRTConnect')
    with uncollected():
        begin = time.perf_counter()
        setup.solve(TIME_LIMIT)
        first = time.perf_counter() - begin
        if not setup.haveExactSolutionPath():
            return [_row(query, name, seed, time_total=first) for name in (CONNECT, SIMPLIFIED)]
        raw, cost = _path(setup, query), setup.getSolutionPath().length()
        begin = time.perf_counter()
        setup.simplifySolution()
        total = first + time.perf_counter() - begin
    known = {'time_first': first, 'cost_first': cost}
    final = setup.getSolutionPath().length()
    return [
        _row(query, CONNECT, seed, waypoints=raw, time_total=first, cost_final=cost, **known),
        _row(
            query,
            SIMPLIFIED,
            seed,
            waypoints=_path(setup, query),
            time_total=total,
            cost_final=final,
            history=((first, cost), (total, final)),
            **known,
        ),
    ]


def _restart(query: Query, check: Any, planner: str, seed: int, limit: float) -> Row:
    """Return the row of RRTConnect, simplified, again and again: the best is kept."""
    setup, history, best = _setup(query, check, 'RRTConnect'), [], None
    with uncollected():
        begin = time.perf_counter()
        while time.perf_counter() - begin < limit:
            setup.clear()
            setup.solve(limit - (time.perf_counter() - begin))
            if not setup.haveExactSolutionPath():
                continue
            for simplify in (None, setup.simplifySolution):
                if simplify is not None:
                    simplify()
                cost = setup.getSolutionPath().length()
                if not history or cost < history[-1][1]:
                    history.append((time.perf_counter() - begin, cost))
                    best = _path(setup, query)
        total = time.perf_counter() - begin
    return _improved(query, planner, seed, total, history, best)


def _improve(query: Query, check: Any, planner: str, seed: int, limit: float) -> Row:
    """Return the row of a planner that improves its path as long as it may."""
    from ompl import base

    setup, history = _setup(query, check, ANYTIME[planner]), []
    chosen, begin = setup.getPlanner(), 0.0

    def is_over() -> bool:
        cost, elapsed = chosen.bestCost().value(), time.perf_counter() - begin
        if np.isfinite(cost) and (not history or cost < history[-1][1]):
            history.append((elapsed, cost))
        return elapsed > limit

    with uncollected():
        begin = time.perf_counter()
        setup.solve(base.PlannerTerminationCondition(is_over))
        total = time.perf_counter() - begin
    best = _path(setup, query) if setup.haveExactSolutionPath() else None
    return _improved(query, planner, seed, total, history, best)


def _improved(query: Query, planner: str, seed: int, total: float, history: Any, best: Any) -> Row:
    if best is None:
        return _row(query, planner, seed, time_total=total)
    return _row(
        query,
        planner,
        seed,
        waypoints=best,
        time_total=total,
        time_first=history[0][0],
        cost_first=history[0][1],
        cost_final=history[-1][1],
        history=tuple(history),
    )
