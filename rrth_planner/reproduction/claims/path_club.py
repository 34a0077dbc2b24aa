# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The claims of the paper's section 4 about the escape from local traps, and their evaluation."""

import numpy as np
from rrth_planner.reproduction.claims.plane import verdict
from rrth_planner.reproduction.experiments import (
    ATTEMPTS,
    CLUB,
    club_label,
    Extent,
    NO_CLUB,
    SCATTERED_CLUB,
    SCATTERED_PLAIN,
    TWO_WAYS,
)
from rrth_planner.reproduction.problems import exact_length
from rrth_planner.reproduction.statistics import markdown_table, number, percent, Rows

# A path this much over the shortest one goes round the better side.
BETTER = 1.05


def better_way_share(rows: Rows, name: str, attempts: int) -> float:
    """Return the share of the runs that end on the shorter way round."""
    some = rows.where(problem=TWO_WAYS, algorithm=club_label(name, attempts))
    is_better = some.aligned('cost_final') < BETTER * exact_length(TWO_WAYS)
    return float(is_better.mean()) if len(some) else np.nan


def escape_table(rows: Rows) -> str:
    """Return how often the better way round is found, with the path club and without."""
    lines = []
    for attempts in ATTEMPTS:
        cells = [str(attempts)]
        for name in (CLUB, NO_CLUB):
            some = rows.where(problem=TWO_WAYS, algorithm=club_label(name, attempts))
            share, draws = better_way_share(rows, name, attempts), some.median('draws_total')
            cells += [percent(share, 1), number(draws, 0)]
        lines.append(cells)
    header = ('`club_attempts`', 'better way, club', 'draws', 'better way, no club', 'draws')
    return markdown_table(header, lines)


def escape_claim(rows: Rows) -> str:
    """Return the sentence on the escape."""
    none, last = better_way_share(rows, CLUB, 0), better_way_share(rows, CLUB, ATTEMPTS[-1])
    plain = better_way_share(rows, NO_CLUB, ATTEMPTS[-1])
    return (
        f'That the best of several paths wins {verdict(last >= 0.99)}: {percent(last, 1)} of the '
        f'runs end on the better way with the escape, {percent(none, 1)} with a single growth, '
        f'{percent(plain, 1)} with as many growths that know nothing of a club.'
    )


def both_ways_shares(rows: Rows, name: str, n: int) -> list[float]:
    """Return the share of the first n seeds in which 1, 2, ... growths have found both ways."""
    some = rows.where(problem=TWO_WAYS, algorithm=name, below=n)
    # A row a seed, a column a growth; null where it found no path.
    ways = np.array([row['ways'] for row in some.rows], dtype=object)
    found = [np.logical_or.accumulate(ways == way, axis=1) for way in (True, False)]
    return [float(share) for share in (found[0] & found[1]).mean(axis=0)]


def ways_claim(rows: Rows, extent: Extent) -> str:
    """Return the sentence on how the club scatters growths."""
    k = 4
    club, none = (
        both_ways_shares(rows, name, extent.many)[k - 1]
        for name in (SCATTERED_CLUB, SCATTERED_PLAIN)
    )
    return (
        f'That the club makes growths explore other ways {verdict(club > none)}: {k} growths '
        f'have found both ways in {percent(club)} of {extent.many} runs with it, in '
        f'{percent(none)} without (Figure 14).'
    )
