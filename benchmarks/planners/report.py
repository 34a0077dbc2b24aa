# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The report, docs/performance.md: rows in, Markdown out."""

from collections.abc import Mapping, Sequence

from rrth_planner.reproduction.statistics import markdown_table

from benchmarks.common.task import Row
from benchmarks.planners import machine_speed
from benchmarks.planners.harness import published
from benchmarks.planners.measures import figures
from benchmarks.planners.table import (
    PEER_HEADER,
    peer_lines,
    SURVIVAL_HEADER,
    survival_lines,
    TARGET_HEADER,
    target_lines,
)

METHOD = """\
- Timed parts run one after another, warm, on one pinned core, without the garbage collector;
  node and client share all cores.
- **Configurations and edges** are looped over in compiled code: configurations uniform within the
  limits, edges from free configurations into random directions; each number is a mean over
  thousands. A batch is a free edge, of which every configuration 0.02 rad apart is
  checked; where a short proof holds for the whole edge it covers all of them.
- **Shortcut edges** are those of paths between random configurations that RRT-H shortened with a
  check every 0.001 rad in place of the certificate, so that it did not select them; truly free
  is what the reference checker passes at 0.0005 rad. Of those that clear the boxes by 0.1 mm
  {room} are certified.
- **First path** is that of two trees (RRT, certified edges) before shortening. **Within 1 %** and
  **0.02 %**: when the cost of RRT-H, improving for {budget} ms, first came there; the exact
  shortest on maps is that of the visibility graph.
- **Full query**: nearest free goal configurations, path, shortening, by the default options and a
  margin of 2 cm; the packing of the boxes, once a body message, is not counted. A long run
  tries 4096 draws of goal configurations at once and several times 50 ms of growths.
- **The node** is called over its service by a client in another process; body, target and joints
  are published and acknowledged before. Memory is its resident set.
- **ompl wheel**: the package from the index, its edges checked by one compiled callback an edge:
  exact on the maps, at configurations 0.02 rad apart on the arm. "Restarts" repeats RRTConnect and
  simplification and keeps the best path.
- **Reference checker**: every path of every planner, its ends included, in plain numpy that shares
  nothing with a planner: exact clipping on the maps, a sample every 0.0005 rad on the arm. The
  certified edges are checked by compiled code just as densely, some by the reference checker."""


def report(rows: Sequence[Row], command: str, machine: str, pictures: Mapping[str, str]) -> str:
    """
    Return the report in Markdown.

    Parameters
    ----------
    rows : sequence of dict
        Of one run of the benchmarks.
    command : str
        The command that wrote it.
    machine : str
        On what.
    pictures : mapping
        By caption, where the pictures are, relative to the report.

    """
    first, known = rows[0], published()
    commit = f', commit {first["commit"]}' if first['commit'] else ''
    peer = f', ompl {first["ompl_version"]}' if first['ompl_version'] else ''
    versions = (
        f'Python {first["python_version"]}, numpy {first["numpy_version"]}, numba '
        f'{first["numba_version"]}{peer}, sources {first["source_digest"]}{commit}'
    )
    gallery = '\n\n'.join(f'### {caption}\n\n![{caption}]({p})' for caption, p in pictures.items())
    missing = '' if _has(rows, 'harness') else ' No lines of the C++ program were given.'
    return f"""# Performance

Written by `{command}`; do not edit.
{len(rows)} rows on {machine}; {versions}.

## Targets

{markdown_table(TARGET_HEADER, target_lines(rows))}

{machine_speed.sentence(rows)}

## What is measured, and how

{METHOD.format(room=_shortcut_room(rows), budget=_budget(rows))}

## Peers

Medians, with p10 and p90 in brackets; in the columns "to within" the share of runs that got
there. "OMPL, C++" are lines of a C++ program over the OMPL library, given with
`--harness`.{missing}
"VAMP, published" is quoted: {known['about']} It ran on {known['machine']}.

{markdown_table(PEER_HEADER, peer_lines(rows))}

## Paths that pass the reference checker

{markdown_table(SURVIVAL_HEADER, survival_lines(rows))}

{_edges_sentence(rows)}

## Pictures

Median and the band from p10 to p90; what is below 0.01 % is drawn there.

{gallery}
"""


def _has(rows: Sequence[Row], source: str) -> bool:
    return any(row['source'] == source for row in rows)


def _shortcut_room(rows: Sequence[Row]) -> str:
    shares = figures(rows, 'shortcut edges certified, 0.1 mm clear')
    return f'{100.0 * shares[0]:.2f} %' if len(shares) else '(not measured)'


def _budget(rows: Sequence[Row]) -> str:
    times = [r['time_total'] for r in rows if r['planner'] == 'RRT-H' and r['time_total']]
    return f'{1e3 * max(times):.0f}' if times else '(not measured)'


def _edges_sentence(rows: Sequence[Row]) -> str:
    counts = {
        name: int(figures(rows, f'certified edges{name}').sum())
        for name in (
            '',
            ' that collide',
            ' sampled',
            ' that collide by the reference checker',
        )
    }
    if not counts['']:
        return 'Random certified edges were not checked.'
    return (
        f'Of {counts[""]} random certified edges {counts[" that collide"]} collide at 0.0005 rad; '
        f'of {counts[" sampled"]} of them the reference checker finds '
        f'{counts[" that collide by the reference checker"]}.'
    )
