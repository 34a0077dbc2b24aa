# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Rows of a campaign, chosen and summed up."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array

NOTHING = '–'


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Some rows of a campaign, as `reproduction.run.execute` returns them."""

    rows: Sequence[dict[str, Any]]

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.rows)

    def where(self, *, below: int | None = None, **wanted: Any) -> 'Rows':
        """Return the rows with these values, and a seed below a limit; in the order of seeds."""
        chosen = [
            row
            for row in self.rows
            if all(row[name] == value for name, value in wanted.items())
            and (below is None or row['seed'] < below)
        ]
        return Rows(sorted(chosen, key=lambda row: (row['problem'], row['seed'])))

    def values(self, column: str) -> Array:
        """Return the numbers of a column where a path was found, shape (n,)."""
        return np.array([r[column] for r in self.rows if r[column] is not None], dtype=float)

    def aligned(self, column: str) -> Array:
        """Return the numbers of a column, infinite where there is none, shape (len(self),)."""
        return np.array([np.inf if r[column] is None else r[column] for r in self.rows])

    def median(self, column: str) -> float:
        """Return the median of a column over all rows; infinite where most found no path."""
        # A path that was not found is longer than any other.
        return float(np.median(self.aligned(column))) if len(self) else np.inf

    def share(self, column: str) -> float:
        """Return the share of the rows with a path in which a column is true."""
        return float(self.values(column).mean()) if len(self.values(column)) else np.nan

    def n_solved(self) -> int:
        """Return how many found a path."""
        return len(self.values('cost_final'))

    def found(self) -> str:
        """Return for a table how many of all found a path."""
        return f'{self.n_solved()} of {len(self)}'


def histories_on(rows: Rows, axis: str, grid: Array) -> Array:
    """
    Return the cost of the best path of each run at some draws or times [s], (m,) -> (n, m).

    Parameters
    ----------
    axis : str
        `history_draws` or `history_time`.

    Returns
    -------
    ndarray, shape (len(rows), m)
        Infinite before the first path.

    """
    result = np.full((len(rows), len(grid)), np.inf)
    for i, row in enumerate(rows.rows):
        at = np.searchsorted(np.array(row[axis], dtype=float), grid, side='right') - 1
        costs = np.array(row['history_cost'], dtype=float)
        if len(costs):
            result[i] = np.where(at >= 0, costs[np.maximum(at, 0)], np.inf)
    return result


def quartiles(values: Array) -> Array:
    """
    Return the quartiles over the first axis, (n, m) -> (3, m).

    Between a finite value and an infinite one lies no number: the lower or higher neighbour it is.
    """
    result: Array = np.percentile(values, [25, 50, 75], axis=0, method='inverted_cdf')
    return result


def number(value: float, digits: int = 2, unit: str = '') -> str:
    """Return a number for a table, a dash where there is none."""
    return f'{value:.{digits}f}{unit}' if np.isfinite(value) else NOTHING


def spread(values: Array, digits: int = 2) -> str:
    """Return median and quartiles for a table."""
    if not len(values):
        return NOTHING
    low, middle, high = np.percentile(values, [25, 50, 75])
    return f'{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})'


def percent(share: float, digits: int = 0) -> str:
    """Return a share for a table."""
    return number(100.0 * share, digits, ' %')


def share_of(flags: NDArray[np.bool_]) -> str:
    """Return how many of all are true, as a count and in per cent."""
    if not len(flags):
        return NOTHING
    return f'{int(flags.sum())} of {len(flags)}'


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [header, ['---'] * len(header), *rows]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)
