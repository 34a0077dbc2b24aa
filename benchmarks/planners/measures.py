# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The numbers behind the table, taken from rows."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from rrth_planner.model.arrays import Array

from benchmarks.common.task import Row
from benchmarks.planners import full_query, plans

# What counts as near to the best known, and as the exact shortest on a map.
NEAR, EXACT = 1.01, 1.0002
# The share of the plans after which the memory of a node must be what it stays.
SETTLED = 0.1


def time_within(row: Row, factor: float) -> float:
    """Return when the cost of a run first came within a factor of the best [ms], or infinity."""
    for time, cost in zip(row['history_time'] or (), row['history_cost'] or (), strict=True):
        if cost <= factor * row['best_cost']:
            return 1e3 * float(time)
    return np.inf


def first_time(row: Row) -> float:
    """Return when a run had its first path [ms], or infinity."""
    return np.inf if row['time_first'] is None else 1e3 * float(row['time_first'])


def total_time(row: Row) -> float:
    """Return how long a run took that brought a path [ms], or infinity."""
    return 1e3 * float(row['time_total']) if row['is_solved'] else np.inf


def gap(row: Row) -> float:
    """Return how much longer a path is than the best known [%], or infinity."""
    return 100.0 * (row['cost_final'] / row['best_cost'] - 1.0) if row['is_solved'] else np.inf


def within_near(row: Row) -> float:
    """Return when the cost of a run came within 1 % of the best known [ms], or infinity."""
    return time_within(row, NEAR)


def within_exact(row: Row) -> float:
    """Return when the cost of a run came within 0.02 % of the exact one [ms], or infinity."""
    return time_within(row, EXACT)


def is_near(row: Row) -> float:
    """Return 1 where a run came within 1 % of the best known, else 0."""
    return float(np.isfinite(time_within(row, NEAR)))


# By name: whose rows, and what is taken from each.
_OF_RUNS: Mapping[str, tuple[str, Callable[[Row], float]]] = {
    'first path': (plans.RRT, first_time),
    'near': (plans.RRT_H, within_near),
    'share near': (plans.RRT_H, is_near),
    'exact': (plans.RRT_H, within_exact),
    'query time': (full_query.PLANNER, total_time),
    'query gap': (full_query.PLANNER, gap),
}


def measured(rows: Sequence[Row], measure: str, name: str) -> Array:
    """
    Return the numbers of a measure, shape (n,): infinite where a run did not get there.

    Parameters
    ----------
    rows : sequence of dict
    measure : str
        `figure`, `growth`, `memory growth`, or one of runs: `first path`, `near`, `share near`,
        `exact`, `query time`, `query gap`.
    name : str
        The quantity of a figure, else the problem.

    """
    if measure == 'figure':
        return figures(rows, name)
    if measure == 'growth':
        few = figures(rows, 'configuration, 8 boxes')
        return figures(rows, name) / np.median(few) if len(few) else few
    if measure == 'memory growth':
        memory = figures(rows, name)
        settled = memory[int(SETTLED * len(memory)) :]
        return settled[-1:] - settled[:1]
    planner, take = _OF_RUNS[measure]
    chosen = [r for r in rows if r['planner'] == planner and r['problem'] == name]
    return np.array([take(row) for row in chosen])


def peer_median(rows: Sequence[Row], measure: str, problem: str) -> tuple[float, Row] | None:
    """Return the least median of a measure over all peers, and a row of that peer; or None."""
    take = _OF_RUNS[measure][1]
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row['source'] in ('ompl', 'harness') and row['problem'] == problem:
            groups.setdefault((row['source'], row['planner']), []).append(row)
    best: tuple[float, Row] | None = None
    for group in groups.values():
        middle = percentile(np.array([take(row) for row in group]), 50)
        if best is None or middle < best[0]:
            best = middle, group[0]
    return best


def figures(rows: Sequence[Row], quantity: str) -> Array:
    """Return the values of a quantity, in the order of their rows."""
    return np.array([r['value'] for r in rows if r['quantity'] == quantity], dtype=float)


def percentile(values: Array, share: float) -> float:
    """Return a percentile; infinite where it falls on runs that did not get there."""
    if not len(values):
        return np.nan
    # Between a finite value and an infinite one lies no number.
    is_finite = np.isfinite(values).all()
    return float(np.percentile(values, share, method='linear' if is_finite else 'higher'))
