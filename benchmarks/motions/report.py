# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The report, docs/motions.md: rows in, Markdown out."""

from collections.abc import Mapping, Sequence
from importlib.metadata import version

from rrth_planner.reproduction.statistics import markdown_table

from benchmarks.common.task import Row
from benchmarks.motions.table import (
    at_random,
    column,
    FAULTS,
    figure_lines,
    HEADER,
    ratio_of_means,
    target_lines,
    with_corners,
    worst_ratio,
)

# Motions that are listed with what they break.
LISTED = 25
FIGURE_HEADER = ('what', 'mean', 'median', 'p90', 'p99', 'greatest')
FAULT_HEADER = ('wearer', 'query', 'what', 'most over a limit', 'off the path [rad]', 'collides')
METHOD = """\
- **Queries** are drawn like those of [performance.md](performance.md), round other wearers: each
  can be answered. Planned by `pipeline.plan_motion` with default limits and options, a margin of
  2 cm and 1 m of the ray kept clear.
- **Motions with corners** are those of the random queries and of further ones, round further
  wearers, until there are enough; of the further queries those answered by a straight motion are
  left out. Violations are counted over all motions, shares and ratios "with corners"
  over these, all else over the random queries alone.
- **The curve** is what joint_trajectory_controller interpolates by the numbers of the message,
  computed as its source does, in seconds and whole nanoseconds; nothing of it comes from
  `rrth_planner.model.trajectory`. It is sampled every 0.2 ms and at both sides of every point;
  jerk is the exact maximum of the third derivative of each quintic.
- **Collision** is checked by plain numpy that shares nothing with the planner: bars of the arm
  against the boxes grown by the margin, at the end with the ray out to the target.
- **Off the planned path** is the distance of the curve, at the same instants, from the straight
  edges and the rounded corners of the path.
- **Stopping** is the same path from rest to rest, edge by edge. The target is the ratio of the two
  mean durations, of the motions that have corners. The mean of the ratios of the single motions is
  among the figures. A motion that stops although corners could be rounded does so because it is
  faster.
- **toppra** gets the same rounded path with limits of velocity and acceleration on a fine grid
  (constraints at both ends of each interval); ours is timed on it with a jerk of 1e6 rad/s^3,
  and its velocity and acceleration are checked too.
  Where a corner cannot be rounded both stop.
- **python-fcl** checks in the pipeline, and again by code of its own every 1 ms: distance of
  each bar from each box that is not clearly further away than the margin.
- **Times** are taken in the pipeline, warm, on one pinned core, without the garbage collector."""


def report(rows: Sequence[Row], command: str, pictures: Mapping[str, str]) -> str:
    """
    Return the report in Markdown.

    Parameters
    ----------
    rows : sequence of dict
        Of one run.
    command : str
        The command that wrote it.
    pictures : mapping
        By caption, where the pictures are, relative to the report.

    """
    first = rows[0]
    commit = f', commit {first["commit"]}' if first['commit'] else ''
    versions = (
        f'Python {first["python_version"]}, numpy {first["numpy_version"]}, numba '
        f'{first["numba_version"]}, toppra {version("toppra")}, '
        f'python-fcl {version("python-fcl")}{commit}'
    )
    gallery = '\n\n'.join(f'### {caption}\n\n![{caption}]({p})' for caption, p in pictures.items())
    return f"""# Timed motions

Written by `{command}`; do not edit.
{_queries_sentence(rows)} on {first['machine']} ({first['n_cores']} cores); {versions}.

## Targets

{markdown_table(HEADER, target_lines(rows))}

{_corners_sentence(rows)}

## Figures

{markdown_table(FIGURE_HEADER, figure_lines(rows))}

## What is measured, and how

{METHOD}

## Motions that violate something

{_faults(rows)}

## Pictures

{gallery}
"""


def _queries_sentence(rows: Sequence[Row]) -> str:
    usual, n_bent = at_random(rows), len(with_corners(rows))
    return f'{len(usual)} random queries and {n_bent} motions with corners, {len(rows)} in all,'


def _corners_sentence(rows: Sequence[Row]) -> str:
    bent = with_corners(rows)
    n_corners = int(column(bent, 'n_corners').sum())
    n_sharp = int(column(bent, 'n_stops').sum())
    n_with = sum(row['n_stops'] > 0 for row in bent)
    n_stopping = sum(bool(row['is_stopping']) for row in bent)
    usual = at_random(rows)
    solved = [row for row in usual if row['is_solved']]
    n_of_them = len(with_corners(usual))
    over_all = ratio_of_means(solved, 'duration', 'duration_stopping')
    return (
        f'Of {len(usual)} random queries {len(solved)} were planned, {n_of_them} of '
        f'them with corners: with them or without, the mean duration is {100 * over_all:.1f} % of '
        f'stopping at each corner. The {len(bent)} motions with corners have {n_corners}. '
        f'{n_sharp} of these, in {n_with} motions, could not be rounded; in {n_stopping} motions '
        'stopping at each corner was chosen although some could be.'
        f'{_other_ends(rows)}'
    )


def _other_ends(rows: Sequence[Row]) -> str:
    ends = [row['status'] for row in rows if not row['is_solved']]
    counts = [f'{ends.count(status)} {status}' for status in dict.fromkeys(ends)]
    return f' Not planned: {", ".join(counts)}.' if counts else ''


def _faults(rows: Sequence[Row]) -> str:
    """Return a table of the motions that break something."""
    lines = []
    for row in rows:
        broken = [name for name, is_broken in FAULTS.items() if is_broken(row)]
        if broken:
            off = '' if row['deviation'] is None else f'{row["deviation"]:.2g}'
            over = f'{100 * (worst_ratio(row) - 1):+.2f} %' if row['is_solved'] else ''
            contact = row['contact'] or ''
            lines.append(
                [str(row['body']), str(row['query']), '; '.join(broken), over, off, contact]
            )
    if not lines:
        return 'None.'
    more = f'\n\n... and {len(lines) - LISTED} more.' if len(lines) > LISTED else ''
    return markdown_table(FAULT_HEADER, lines[:LISTED]) + more
