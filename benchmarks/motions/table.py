# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What motions are measured against: rows in, lines of the table out."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.model.status import PlanStatus
from rrth_planner.reproduction.statistics import NOTHING

from benchmarks.common.task import Row
from benchmarks.motions.rows import TOLERANCE
from benchmarks.planners.full_query import MARGIN

HEADER = ('what', 'target', 'measured', 'met')
# By how much a limit may be exceeded [-], and how far the curve may be from the path [rad].
EXCESS, DEVIATION = 0.01, 1e-4
STOPPING, OPTIMUM, TIME = 0.8, 1.03, 2e-3
Flags = NDArray[np.bool_]


def column(rows: Sequence[Row], name: str) -> Array:
    """Return the numbers of a column where there are any, shape (n,)."""
    return np.array([row[name] for row in rows if row[name] is not None], dtype=float)


def with_corners(rows: Sequence[Row]) -> list[Row]:
    """Return the planned motions whose path has a corner."""
    return [row for row in rows if row['is_solved'] and row['n_corners'] > 0]


def at_random(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of the random queries: all but those that were sought for corners."""
    return [row for row in rows if not row['is_sought']]


def is_disputed(row: Row) -> bool:
    """Return whether python-fcl, the pipeline's or ours, finds a planned motion too near."""
    if not row['is_solved']:
        return 'checks disagree' in row['sentence']
    return row['fcl_distance'] is None or row['fcl_distance'] < MARGIN - TOLERANCE


# By each violation: whether a row has it.
FAULTS: dict[str, Callable[[Row], bool]] = {
    'collides with the wearer': lambda row: bool(row['contact']),
    'over a limit by more than 1 %': lambda row: worst_ratio(row) > 1.0 + EXCESS,
    'not at rest at both ends': lambda row: row['is_at_rest'] is False,
    'not from the start to the end of its path': lambda row: row['is_at_ends'] is False,
    'times that do not increase': lambda row: row['is_increasing'] is False,
    'off the path by more than 1e-4 rad': lambda row: (row['deviation'] or 0.0) > DEVIATION,
    'python-fcl disagrees': is_disputed,
    'not certified': lambda row: row['status'] == PlanStatus.NOT_CERTIFIED.value,
}


def worst_ratio(row: Row) -> float:
    """Return the greatest magnitude of velocity, acceleration or jerk over its limit [-]."""
    names = ('velocity_ratio', 'acceleration_ratio', 'jerk_ratio')
    return max((row[name] for name in names if row[name] is not None), default=0.0)


def target_lines(rows: Sequence[Row]) -> list[list[str]]:
    """Return a line for each target, columns as in HEADER."""
    bent, usual = with_corners(rows), [row for row in at_random(rows) if row['is_solved']]
    stopping = ratio_of_means(bent, 'duration', 'duration_stopping')
    lines = [
        _count(
            rows, 'collides with the wearer', f'motions of {len(rows)} with a sample in collision'
        )
    ]
    for name in ('velocity', 'acceleration', 'jerk'):
        worst = column(rows, f'{name}_ratio').max(initial=0.0) - 1.0
        measured = f'{100 * worst:+.3g} %'
        lines.append(_line(f'{name} over its limit, worst', '<= 1 %', measured, worst <= EXCESS))
    lines += [
        _count(rows, 'not at rest at both ends', 'motions not exactly at rest at both ends'),
        _count(
            rows,
            'not from the start to the end of its path',
            'motions that miss the start or the end of the path, by any bit',
        ),
        _count(rows, 'times that do not increase', 'motions whose times do not strictly increase'),
        _line(
            'curve off the planned path, worst',
            '<= 1e-4 rad',
            _maximum(column(rows, 'deviation'), ' rad'),
            not any(map(FAULTS['off the path by more than 1e-4 rad'], rows)),
        ),
        _line(
            f'mean duration over that of stopping at corners, {len(bent)} motions with corners',
            '<= 80 %',
            f'{100 * stopping:.1f} %',
            stopping <= STOPPING,
        ),
    ]
    for what, chosen in (('with corners', bent), ('random queries', usual)):
        found = ratios(chosen, 'duration_unlimited', 'duration_toppra')
        mean = found.mean() if len(found) else np.nan
        lines.append(
            _line(
                f"duration over toppra's without a limit of jerk, mean, {what}",
                '<= 1.03',
                f'{mean:.4f}',
                mean <= OPTIMUM,
            )
        )
    times = step_time(usual)
    middle = float(np.median(times)) if len(times) else np.nan
    lines += [
        _line(
            'time to parameterise and certify, median of random queries',
            '<= 2 ms',
            _ms(middle),
            middle <= TIME,
        ),
        _count(rows, 'python-fcl disagrees', 'motions about which python-fcl disagrees'),
        _count(rows, 'not certified', 'paths whose motion could not be certified'),
    ]
    return lines


def figure_lines(rows: Sequence[Row]) -> list[list[str]]:
    """Return lines of what lies behind: what, mean, median, p90, p99, greatest."""
    usual = [row for row in at_random(rows) if row['is_solved']]
    bent = with_corners(rows)
    figures: list[tuple[str, Array, float, str]] = [
        ('points a motion', column(usual, 'n_points'), 1.0, '.4g'),
        ('points a motion with corners', column(bent, 'n_points'), 1.0, '.4g'),
        ('corners a path', column(usual, 'n_corners'), 1.0, '.3g'),
        ('duration [s]', column(usual, 'duration'), 1.0, '.3f'),
        ('duration, with corners [s]', column(bent, 'duration'), 1.0, '.3f'),
        (
            'over stopping, with corners [%]',
            ratios(bent, 'duration', 'duration_stopping'),
            100.0,
            '.1f',
        ),
        (
            "over toppra's, jerk free, with corners [-]",
            ratios(bent, 'duration_unlimited', 'duration_toppra'),
            1.0,
            '.4f',
        ),
        (
            "over toppra's, jerk limited, with corners [-]",
            ratios(bent, 'duration', 'duration_toppra'),
            1.0,
            '.4f',
        ),
        ('over its limits, jerk free [%]', column(rows, 'unlimited_ratio') - 1, 100.0, '.4f'),
        ('curve off the planned path [rad]', column(rows, 'deviation'), 1.0, '.2g'),
        ('joint beyond its range [rad]', column(rows, 'beyond_range'), 1.0, '.2g'),
        ('velocity over its limit [%]', column(rows, 'velocity_ratio') - 1, 100.0, '.4f'),
        ('acceleration over its limit [%]', column(rows, 'acceleration_ratio') - 1, 100.0, '.4f'),
        ('jerk over its limit [%]', column(rows, 'jerk_ratio') - 1, 100.0, '.4f'),
        ('parameterise and certify [ms]', step_time(usual), 1e3, '.3f'),
        ('parameterise and certify, with corners [ms]', step_time(bent), 1e3, '.3f'),
        ('of that: round the corners [ms]', column(usual, 'time_round'), 1e3, '.3f'),
        ('of that: parameterise and certify alone [ms]', column(usual, 'time_prove'), 1e3, '.3f'),
        ('second check, python-fcl [ms]', column(usual, 'time_second'), 1e3, '.3f'),
        ('whole plan [ms]', column(usual, 'time_plan'), 1e3, '.3f'),
    ]
    return [
        [what, *(f'{scale * value:{form}}' for value in _spread(values))]
        if len(values)
        else [what, *[NOTHING] * 5]
        for what, values, scale, form in figures
    ]


def _spread(values: Array) -> list[float]:
    """Return mean, median, p90, p99 and the greatest."""
    return [float(values.mean()), *np.percentile(values, [50, 90, 99, 100]).tolist()]


def step_time(rows: Sequence[Row]) -> Array:
    """Return how long it took to round the corners, time and prove each motion, (n,) [s]."""
    chosen = [row for row in rows if row['time_prove']]
    return column(chosen, 'time_round') + column(chosen, 'time_prove')


def ratios(rows: Sequence[Row], name: str, over: str) -> Array:
    """Return one column over another where both are numbers, shape (n,)."""
    pairs = [(row[name], row[over]) for row in rows if row[name] and row[over]]
    values = np.array(pairs, dtype=float).reshape(-1, 2)
    return values[:, 0] / values[:, 1]


def ratio_of_means(rows: Sequence[Row], name: str, over: str) -> float:
    """Return the mean of a column over the mean of another; NaN without rows."""
    return float(column(rows, name).mean() / column(rows, over).mean()) if rows else np.nan


def _count(rows: Sequence[Row], fault: str, what: str) -> list[str]:
    n = sum(map(FAULTS[fault], rows))
    return _line(what, '0', str(n), n == 0)


def _line(what: str, target: str, measured: str, is_met: bool) -> list[str]:
    return [what, target, measured, 'yes' if is_met else '**no**']


def _maximum(values: Array, unit: str) -> str:
    return f'{values.max():.2g}{unit}' if len(values) else NOTHING


def _ms(time: float) -> str:
    return f'{1e3 * time:.3f} ms'
