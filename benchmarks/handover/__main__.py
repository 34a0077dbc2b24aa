# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Measure, in virtual time, what controllers make of messages that replace a motion; print a table.

The messages are those of the planner's own monitor and requests; controllers and arms are models.
"""

import argparse
from dataclasses import replace
from functools import partial
from itertools import product
import os
from pathlib import Path
import sys

from rrth_planner.simulation.trajectory_controller import ControllerVersion

from benchmarks.handover.judge import EXTENSION, HANDOVER, STOP, Sum, summed
from benchmarks.handover.session import Case, joins_of_item
from benchmarks.separation.runs import each

# Handovers, extensions and stops at each lag.
JOINS, QUICK = 2000, 36
LAGS = (0.0, 0.005, 0.01, 0.02, 0.03)
RATES = (200.0, 500.0, 1000.0)
# The longest way of a message [s]; a session each, in turn.
TRANSPORTS = (0.0, 0.02, 0.05, 0.1)
VERSIONS = (ControllerVersion.V4_20, ControllerVersion.V4_42, ControllerVersion.V6_9)
PAGE = Path('docs/ros_control.md')
# The block of the page that this program writes.
TOP, END = '<!-- written by python -m benchmarks.handover --write -->\n', '<!-- written end -->\n'
HEADER = (
    '| controller | separation | lag [ms] | handovers | extensions | stops | '
    'off the message before, at most [rad] | of them > 1e-4 rad | greatest velocity [limit] | '
    'greatest acceleration [limit] | of them > 1 % over |'
)


def cases_of(lag: float, is_separated: bool) -> list[Case]:
    """Return the controllers with which a lag is tried [s]."""
    rest = zip(product(RATES, VERSIONS), (TRANSPORTS * len(RATES) * len(VERSIONS)), strict=False)
    return [
        Case(version=version, rate=rate, lag=lag, transport=transport, is_separated=is_separated)
        for (rate, version), transport in rest
    ]


def line_of(name: str, case: Case, total: Sum) -> str:
    """Return a line of the table."""
    n_handovers, n_extensions, n_stops = (
        total.counts.get(kind, 0) for kind in (HANDOVER, EXTENSION, STOP)
    )
    return (
        f'| {name} | {"on" if case.is_separated else "off"} | {1e3 * case.lag:g} | {n_handovers} '
        f'| {n_extensions} | {n_stops} | {total.apart:.1e} | {total.n_apart} | '
        f'{total.velocity:.3f} | {total.acceleration:.3f} | {total.n_fast} |'
    )


def lines(n: int, seed: int, jobs: int) -> list[str]:
    """Return the lines of the table, with n handovers, extensions and stops at each lag."""
    rows: list[tuple[str, list[Case]]] = [
        ('4.20, 4.42, 6.9', cases_of(lag, is_separated))
        for is_separated in (False, True)
        for lag in LAGS
    ]
    for is_separated in (False, True):
        some = [case for case in cases_of(0.01, is_separated) if case.version is VERSIONS[1]]
        rows += [
            (
                '4.42, `interpolate_from_desired_state: false`',
                [replace(case, is_from_desired=False) for case in some],
            ),
            (
                'blending (`allow_trajectory_replacement: true`)',
                [replace(case, version=ControllerVersion.BLENDING) for case in some],
            ),
        ]
    found = []
    for name, cases in rows:
        # Half of those of a lag are with separation.
        share = -(-n // (2 * len(cases)))
        items = [(case, seed + k) for k, case in enumerate(cases)]
        joins = each(partial(joins_of_item, share), items, jobs, name)
        line = line_of(name, cases[0], summed([join for some in joins for join in some]))
        print(line, flush=True)
        found.append(line)
    return found


def write_block(page: Path, table: list[str]) -> None:
    """Put the table in the place of the one on the page."""
    text = page.read_text(encoding='utf-8')
    before, _, rest = text.partition(TOP)
    _, end, after = rest.partition(END)
    if not end:
        raise SystemExit(f'{page}: no block, expected {TOP.strip()} and {END.strip()}')
    block = '\n'.join([HEADER, '|' + ' --- |' * (HEADER.count('|') - 1), *table]) + '\n'
    page.write_text(f'{before}{TOP}\n{block}\n{END}{after}', encoding='utf-8')


def main(args: list[str] | None = None) -> int:
    """Print the table; write it to the page if wished."""
    parser = argparse.ArgumentParser(prog='python -m benchmarks.handover', description=__doc__)
    parser.add_argument('--quick', action='store_true', help='a few of each')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--jobs', type=int, default=os.cpu_count() or 1, help='processes')
    parser.add_argument('--write', action='store_true', help=f'the block in {PAGE}')
    options = parser.parse_args(args)
    print(HEADER, '|' + ' --- |' * (HEADER.count('|') - 1), sep='\n', flush=True)
    table = lines(QUICK if options.quick else JOINS, options.seed, options.jobs)
    if options.write:
        write_block(PAGE, table)
    return 0


if __name__ == '__main__':
    sys.exit(main())
