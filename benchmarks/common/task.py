# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""One measurement of the benchmarks, and the flat rows that it leaves."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
import os
from typing import Any

from rrth_planner.reproduction.run import provenance

Row = dict[str, Any]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Task:
    """
    What is measured at once.

    Parameters
    ----------
    section, name : str
        What it belongs to, and what it is called there.
    measure : callable
        Returns its rows, made by `figure_row` or `path_row`.
    is_pinned : bool
        Whether it runs on one core only.

    """

    section: str
    name: str
    measure: Callable[[], list[Row]]
    is_pinned: bool = True


def figure_row(
    quantity: str, value: float, unit: str, *, problem: str = '', seed: int = 0, detail: str = ''
) -> Row:
    """Return the row of one number; infinite where it was asked for and there is none."""
    return {
        'quantity': quantity,
        'value': float(value),
        'unit': unit,
        'problem': problem,
        'planner': '',
        'seed': seed,
        'detail': detail,
    }


def path_row(
    *,
    problem: str,
    planner: str,
    source: str,
    seed: int,
    best_cost: float,
    options: str = '',
    waypoints: Any = None,
    is_valid: bool | None = None,
    time_total: float | None = None,
    time_first: float | None = None,
    cost_first: float | None = None,
    cost_final: float | None = None,
    history: tuple[tuple[float, float], ...] = (),
) -> Row:
    """
    Return the row of one run of a planner; times in seconds, lengths in rad or map units.

    Parameters
    ----------
    problem, planner : str
    source : str
        Whose planner: `ours`, `ompl` (the wheel) or `harness` (the C++ program).
    seed : int
    best_cost : float
        Shortest path known.
    options : str
    waypoints : ndarray, shape (n, dof)
        The final path; None where there is none, or none was kept.
    is_valid : bool
        By the judge; None where there was nothing to judge.
    time_total, time_first : float
        Of the run, and until its first path.
    cost_first, cost_final : float
    history : tuple of (float, float)
        Time of each improvement, and the cost of the best path from then on.

    """
    return {
        'quantity': 'path',
        'problem': problem,
        'planner': planner,
        'source': source,
        'seed': seed,
        'options': options,
        'best_cost': best_cost,
        'is_solved': cost_final is not None,
        'is_valid': is_valid,
        'time_total': time_total,
        'time_first': time_first,
        'cost_first': cost_first,
        'cost_final': cost_final,
        'history_time': [time for time, _ in history],
        'history_cost': [cost for _, cost in history],
        'waypoints': None if waypoints is None else [list(map(float, q)) for q in waypoints],
    }


@cache
def origin() -> Row:
    """Return what every row of this run has in common: versions, machine, sources."""
    return {
        **provenance(),
        'ompl_version': _version('ompl'),
        'n_cores': os.cpu_count(),
    }


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
