# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Rows in, lines of tables out."""

from collections.abc import Mapping, Sequence

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.reproduction.statistics import NOTHING

from benchmarks.common.queries import MAPS, QUERIES
from benchmarks.common.task import Row
from benchmarks.planners.harness import published
from benchmarks.planners.machine_speed import slowness
from benchmarks.planners.measures import (
    gap,
    measured,
    peer_median,
    percentile,
    time_within,
    total_time,
)
from benchmarks.planners.targets import Target, TARGETS, WHY_NOT

SOURCES: Mapping[str, str] = {'ours': 'ours', 'ompl': 'ompl wheel', 'harness': 'OMPL, C++'}
TARGET_HEADER = (
    *(
        'what',
        'statistic',
        'target',
        'measured',
        'met',
        'p10',
        'median',
        'p90',
        'runs that got there',
    ),
    *('best peer, median', 'why not'),
)
PEER_HEADER = (
    *('problem', 'planner', 'whose', 'runs with a path', 'first path [ms]', 'time in all [ms]'),
    *('over the best known [%]', 'to within 5 % [ms]', 'to within 1 % [ms]', 'paths that hold'),
)
# Units of what a slower machine takes longer for.
TIMES = ('ns', 'us', 'ms', 's')
SURVIVAL_HEADER = ('planner', 'whose', 'maps', 'arm')
_PROBLEMS = (*MAPS, *QUERIES)


def target_lines(rows: Sequence[Row], reasons: Mapping[str, str] = WHY_NOT) -> list[list[str]]:
    """Return a line for each target, columns as in TARGET_HEADER."""
    return [_target_line(rows, target, reasons) for target in TARGETS]


def _target_line(rows: Sequence[Row], target: Target, reasons: Mapping[str, str]) -> list[str]:
    values = measured(rows, target.measure, target.name)
    sign, unit = '>=' if target.is_floor else '<=', f' {target.unit}' if target.unit else ''
    line = [target.what, target.statistic, f'{sign} {_number(target.limit)}{unit}']
    if not len(values):
        return [*line, 'not measured', *[NOTHING] * 5, _peer(rows, target), '']
    value = statistic(values, target.statistic)
    is_met, is_share = target.is_met_by(value), target.measure == 'share near'
    why = [] if is_met else [*_details(rows, target), *_pace(rows, target, value)]
    has_spread = len(values) > 1 and not is_share
    spread = [_number(percentile(values, share)) for share in (10, 50, 90)]
    n_there = int(values.sum() if is_share else np.isfinite(values).sum())
    return [
        *line,
        _number(value) + unit if np.isfinite(value) else 'not reached',
        'yes' if is_met else '**no**',
        *(spread if has_spread else [NOTHING] * 3),
        f'{n_there} of {len(values)}' if len(values) > 1 else NOTHING,
        _peer(rows, target),
        '' if is_met else ' '.join([*why, reasons.get(target.key, '')]).strip(),
    ]


def statistic(values: Array, name: str) -> float:
    """Return a statistic by its name: `p50` and the like, `mean`, `sum` or `greatest`."""
    if name.startswith('p'):
        return percentile(values, float(name[1:]))
    return float({'mean': np.mean, 'sum': np.sum, 'greatest': np.max}[name](values))


def _details(rows: Sequence[Row], target: Target) -> list[str]:
    """Return what the rows of a single figure say about it."""
    if target.statistic != 'mean' or target.measure != 'figure':
        return []
    details = [row['detail'] for row in rows if row['quantity'] == target.name and row['detail']]
    return [f'{text}.' for text in details]


def _pace(rows: Sequence[Row], target: Target, value: float) -> list[str]:
    """Return how slow the machine is, and what is left where that is not enough of a reason."""
    slow = slowness(rows)
    if slow is None or slow <= 1.0 or target.unit not in TIMES or not np.isfinite(value):
        return []
    pace = f'The C++ peer, too, takes {slow:.2f} times as long here'
    if value <= slow * target.limit:
        return [f'{pace}.']
    return [f'{pace}; at its pace it would be {_number(value / slow)} {target.unit}.']


def _peer(rows: Sequence[Row], target: Target) -> str:
    if target.measure not in ('first path', 'near', 'exact') or target.statistic != 'p50':
        return target.peer or NOTHING
    parts = []
    best = peer_median(rows, target.measure, target.name)
    if best is not None:
        whose = f'{best[1]["planner"]}, {SOURCES[best[1]["source"]]}'
        parts.append(f'{_number(best[0])} ms ({whose})' if np.isfinite(best[0]) else 'none there')
    if target.measure == 'first path':
        known = next(r for r in published()['rows'] if r['problem'] == target.name)
        parts.append(f'{_number(known["first_ms"])} ms (VAMP, published)')
    return '; '.join(parts) or NOTHING


def peer_lines(rows: Sequence[Row]) -> list[list[str]]:
    """Return a line for each planner on each problem, columns as in PEER_HEADER."""
    lines = []
    for problem in _PROBLEMS:
        for (source, planner), group in _groups(rows).items():
            chosen = [row for row in group if row['problem'] == problem]
            if chosen:
                lines.append([problem, planner, SOURCES[source], *_peer_cells(chosen)])
        lines.append(_published_line(problem))
    return lines


def _peer_cells(group: Sequence[Row]) -> list[str]:
    solved = [row for row in group if row['is_solved']]
    judged = [row['is_valid'] for row in solved if row['is_valid'] is not None]
    first = np.array([1e3 * row['time_first'] for row in solved if row['time_first'] is not None])
    total = np.array([total_time(row) for row in solved if row['time_total'] is not None])
    return [
        f'{len(solved)} of {len(group)}',
        spread(first),
        spread(total),
        spread(np.array([gap(row) for row in solved])),
        *(_reaching(np.array([time_within(row, f) for row in group])) for f in (1.05, 1.01)),
        f'{sum(judged)} of {len(judged)}' if judged else NOTHING,
    ]


def _published_line(problem: str) -> list[str]:
    known = next(row for row in published()['rows'] if row['problem'] == problem)
    more = known['restarts']

    def reached(percent: int) -> str:
        time, share = more[f'to_{percent}_percent_ms'], more[f'share_{percent}_percent']
        return f'{NOTHING if time is None else _number(time)} ({100 * share:.0f} %)'

    return [
        problem,
        'RRTConnect, simplified; restarts',
        'VAMP, published',
        f'{known["solved"]} of {known["runs"]}',
        _number(known['first_ms']),
        _number(known['total_ms']),
        _number(100.0 * (known['cost_ratio'] - 1.0)),
        reached(5),
        reached(1),
        f'{100 * known["survives_at_0_001_rad"]:.0f} % at 0.001 rad',
    ]


def survival_lines(rows: Sequence[Row]) -> list[list[str]]:
    """Return how many paths of each planner pass the checker, columns as in SURVIVAL_HEADER."""
    lines = []
    for (source, planner), group in _groups(rows).items():
        cells = []
        for family in (MAPS, None):
            judged = [
                row['is_valid']
                for row in group
                if row['is_valid'] is not None and (row['problem'] in MAPS) is (family is MAPS)
            ]
            share = f' ({100.0 * sum(judged) / len(judged):.1f} %)' if judged else ''
            cells.append(f'{sum(judged)} of {len(judged)}{share}' if judged else NOTHING)
        lines.append([planner, SOURCES[source], *cells])
    return lines


def _groups(rows: Sequence[Row]) -> dict[tuple[str, str], list[Row]]:
    groups: dict[tuple[str, str], list[Row]] = {}
    for source in SOURCES:
        for row in rows:
            if row['quantity'] == 'path' and row['source'] == source:
                groups.setdefault((source, row['planner']), []).append(row)
    return groups


def spread(values: Array) -> str:
    """Return median, p10 and p90 for a table."""
    if not len(values):
        return NOTHING
    middle, low, high = (_number(percentile(values, share)) for share in (50, 10, 90))
    return f'{middle} ({low} to {high})'


def _reaching(times: Array) -> str:
    if not np.isfinite(times).any():
        return f'{NOTHING} (0 %)'
    return f'{_number(percentile(times, 50))} ({100.0 * np.isfinite(times).mean():.0f} %)'


def _number(value: float) -> str:
    """Return a number with three digits that count, a dash where there is none."""
    if not np.isfinite(value):
        return NOTHING
    digits = 3 if abs(value) < 1000.0 else 4
    text = f'{value:.{digits}g}'
    return f'{value:.0f}' if 'e+' in text else text
