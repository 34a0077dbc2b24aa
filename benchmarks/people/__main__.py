# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Have an arm asked for targets beside recorded people in virtual time, and print tables.

Everything is a number: latencies, ages of bodies, targets. The same arguments have the same tables
on any machine, but for what they say of its speed.
"""

import argparse
from collections.abc import Sequence
import hashlib
import math
from multiprocessing import get_context
import os
from pathlib import Path
import sys
import time

from rrth_planner.rehearsal.contacts import AT_REST, FAST, SLOW
from tqdm import tqdm

from benchmarks.people.beside import LENGTH, Row, row_of, scenarios, STOPS

# Causes of lost time that are printed.
MOST_CAUSES = 12
# Of the soak, by which the ray is stated [s].
PERIOD = 240.0

HEADER = (
    '| recording | rate | time [s] | aimed within 6 s | plans | stops | ray across a part, in '
    'motion, of 240 s [s] | contacts faster than v_c: part kept its speed | part was faster | '
    'slower | at rest | times real time, a core |'
)


def line_of(row: Row) -> str:
    """Return a line of the table."""
    contacts = row.contacts
    share = 100.0 * row.n_aimed / max(row.n_requests, 1)
    cells = (
        *(row.name, f'{row.rate:g}', f'{row.seconds:.0f}'),
        f'{row.n_aimed} of {row.n_requests} ({share:.0f} %)',
        *(row.n_plans, row.n_stops, f'{row.ray * PERIOD / row.seconds:.2f}'),
        *(contacts[FAST, True], contacts[FAST, False]),
        contacts[SLOW, True] + contacts[SLOW, False],
        contacts[AT_REST, True] + contacts[AT_REST, False],
        f'{row.seconds / row.cpu:.1f}',
    )
    return f'| {" | ".join(map(str, cells))} |'


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print tables, and return 1 where a contact was too fast."""
    options = _parser().parse_args(arguments)
    recordings = (
        [str(path) for path in sorted(options.folder.glob('*.bvh'))] if options.folder else []
    )
    items = scenarios(recordings, options.hours, options.seconds, options.stop, options.seed)
    begin = time.monotonic()
    rows: dict[tuple[str, float], Row] = {}
    # Compiled code is kept, and loaded by each.
    with get_context('spawn').Pool(options.jobs) as pool:
        found = pool.imap(row_of, items)
        for row in tqdm(found, total=len(items), file=sys.stderr, disable=None):
            rows.setdefault((row.name, row.rate), Row(row.name, row.rate)).add(row)
    whole = Row('all', math.nan)
    print(f'{HEADER}\n|{" --- |" * (HEADER.count("|") - 1)}')
    for row in rows.values():
        whole.add(row)
        print(line_of(row))
    print(line_of(whole).replace('| nan |', '| – |'))
    print('\nWhat became of targets: ', end='')
    print(', '.join(f'{n} {what}' for what, n in whole.outcomes.most_common()))
    print('\n| time lost [s] | share [%] | the arm | for |\n| --- | --- | --- | --- |')
    total = sum(whole.lost.values())
    lost = sorted(whole.lost.items(), key=lambda item: -item[1])
    for (doing, cause), seconds in lost[:MOST_CAUSES]:
        print(f'| {seconds:.0f} | {100.0 * seconds / total:.1f} | {doing} | {cause or "–"} |')
    print(*whole.sentences, sep='\n')
    digest = hashlib.sha256(''.join(whole.digests).encode()).hexdigest()
    print(
        f'\n{whole.seconds / 3600.0:.2f} h in {whole.cpu / 60.0:.1f} core-minutes '
        f'({whole.seconds / whole.cpu:.1f} times real time a core), '
        f'{(time.monotonic() - begin) / 60.0:.1f} min in all; digest {digest}'
    )
    return int(bool(whole.sentences))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='python -m benchmarks.people', description=(__doc__ or '').strip().splitlines()[0]
    )
    add = parser.add_argument
    add('folder', type=Path, nargs='?', metavar='FOLDER', help='with recordings (BVH)')
    add('--hours', type=float, default=0.5, help='in virtual time [h] (%(default)s)')
    add('--seconds', type=float, default=LENGTH, help='of each run [s] (%(default)s)')
    add('--stop', choices=STOPS, default='4/40', help='stop limits (%(default)s)')
    add('--seed', type=int, default=0, help='of the first run (%(default)s)')
    add('--jobs', type=int, default=os.cpu_count(), help='processes (%(default)s)')
    return parser


if __name__ == '__main__':
    sys.exit(main())
