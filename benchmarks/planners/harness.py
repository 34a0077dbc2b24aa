# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The lines of a C++ program over the OMPL library, one JSON object a run, and published figures.

The program is not part of this project. Its lines carry `problem`, `planner`, `seed`, `solved`,
`t_first`, `c_first`, `t_max` and `c_max` (of simplifying) [s, rad or map units], for planners that
improve their path `trace`, pairs of time and cost, and at best `path`, the final waypoints.
"""

from collections.abc import Iterator
import json
from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.model.errors import RrthError

from benchmarks.common.queries import FOLDER, load_query, MAPS, QUERIES
from benchmarks.common.task import path_row, Row, Task

SOURCE = 'harness'
SIMPLIFIED = 'RRTConnect, simplified'
NAMES = {'RRTC-MS': 'RRTConnect, restarts', 'BITstar': 'BIT*', 'InformedRRTstar': 'Informed RRT*'}


def tasks(folder: Path | None) -> list[Task]:
    """Return the reading of each file of a folder; nothing without a folder."""
    if folder is None:
        return []
    files = sorted((*folder.glob('one_*.jsonl'), *folder.glob('any_*.jsonl')))
    if not files:
        raise RrthError(f'--harness {folder}: no one_*.jsonl or any_*.jsonl in it')
    return [
        Task(section='harness', name=file.name, measure=lambda file=file: read_runs(file))
        for file in files
    ]


def read_runs(file: Path) -> list[Row]:
    """
    Return the rows of the runs in a file on the seven problems, one fixed goal each.

    Raises
    ------
    RrthError
        A line that is no run.

    """
    return [_row(run) for run in _lines(file) if _is_wanted(run)]


def published() -> dict[str, Any]:
    """Return figures of another machine, quoted: `about`, `machine` and `rows`."""
    data: dict[str, Any] = json.loads((FOLDER / 'vamp_published.json').read_text(encoding='utf-8'))
    return data


def _lines(file: Path) -> Iterator[dict[str, Any]]:
    for number, line in enumerate(file.read_text(encoding='utf-8').splitlines(), 1):
        try:
            run = json.loads(line)
            _ = run['problem'], run['planner'], run['seed'], run['solved']
        except (ValueError, KeyError, TypeError) as problem:
            raise RrthError(f'{file}, line {number}: {problem!r}, expected a run') from problem
        yield run


def _is_wanted(run: dict[str, Any]) -> bool:
    is_fixed = run.get('goals', 'one') == 'one' and run.get('goalkey', 'goal') == 'goal'
    return run['problem'] in (*MAPS, *QUERIES) and is_fixed


def _row(run: dict[str, Any]) -> Row:
    query, is_solved = load_query(run['problem']), bool(run['solved'])
    first, cost = run.get('t_first'), run.get('c_first')
    history: tuple[tuple[float, float], ...] = ()
    total = None
    if 'trace' in run:
        history = tuple((time, cost) for time, cost in run['trace'] if cost is not None)
    elif is_solved:
        total = first + run['t_max']
        history = ((first, cost), (total, run['c_max']))
    path = np.array(run['path']) if is_solved and run.get('path') else None
    name = run['planner']
    return path_row(
        problem=query.name,
        planner=SIMPLIFIED if name == 'RRTConnect' else NAMES.get(name, name),
        source=SOURCE,
        seed=run['seed'],
        best_cost=query.best_cost,
        options=run.get('validator', ''),
        waypoints=path,
        is_valid=None if path is None else query.is_solved_by(path),
        time_total=total,
        time_first=first,
        cost_first=cost,
        cost_final=history[-1][1] if is_solved and history else None,
        history=history,
    )
