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

from rrth_planner.io.replaced_file import replace_file
from rrth_planner.rehearsal.contacts import AT_REST, FAST, SLOW
from rrth_planner.rehearsal.ray_time import CLASSES
from tqdm import tqdm

from benchmarks.common.sections import VIRTUAL_TIME, with_section
from benchmarks.people.beside import HANDS, LENGTH, RATES, Row, row_of, scenarios, STOPS

# Causes of lost time that are printed.
MOST_CAUSES = 12
# Of the soak, by which the ray is stated [s].
PERIOD = 240.0

HEADER = (
    '| recording | rate | hands [m] | time [s] | goals taken | aims within 6 s, goals not taken | '
    'all | plans | stops | ray across a part, in motion, of 240 s [s] | contacts faster than v_c: '
    'part kept its bound | it did not | slower | at rest | times real time, a core |'
)


def line_of(row: Row) -> str:
    """Return a line of the table."""
    contacts = row.contacts
    n_free, n_aimed = row.n_requests - row.n_taken, row.n_aimed - row.n_aimed_taken
    cells = (
        *(row.name, f'{row.rate:g}', f'{row.hands:g}' if row.hands else 'default'),
        *(f'{row.seconds:.0f}', f'{row.n_taken} ({_percent(row.n_taken, row.n_requests)})'),
        f'{n_aimed} of {n_free} ({_percent(n_aimed, n_free)})',
        f'{row.n_aimed} of {row.n_requests} ({_percent(row.n_aimed, row.n_requests)})',
        *(row.n_plans, row.n_stops, f'{_of_period(sum(row.ray.values()), row):.2f}'),
        *(contacts[FAST, True], contacts[FAST, False]),
        contacts[SLOW, True] + contacts[SLOW, False],
        contacts[AT_REST, True] + contacts[AT_REST, False],
        f'{row.seconds / row.cpu:.1f}',
    )
    return f'| {" | ".join(map(str, cells))} |'


def ray_lines(wholes: Sequence[Row]) -> list[str]:
    """Return the table of the time of the ray, by how it began."""
    header = f'| rate | hands [m] | {" | ".join(CLASSES)} | all |'
    lines = [header, f'|{" --- |" * (header.count("|") - 1)}']
    for row in wholes:
        seconds = [*(row.ray.get(word, 0.0) for word in CLASSES), sum(row.ray.values())]
        cells = ' | '.join(f'{_of_period(value, row):.2f}' for value in seconds)
        lines.append(f'| {row.rate:g} | {row.hands:g} | {cells} |')
    return lines


def tables_of(rows: Sequence[Row], wholes: Sequence[Row], whole: Row) -> list[str]:
    """Return the tables of some rows, of the sums by rate and hands, and of all."""
    total = sum(whole.lost.values())
    lost = sorted(whole.lost.items(), key=lambda item: -item[1])[:MOST_CAUSES]
    outcomes = ', '.join(f'{n} {what}' for what, n in whole.outcomes.most_common())
    digest = hashlib.sha256(''.join(whole.digests).encode()).hexdigest()
    return [
        f'{HEADER}\n|{" --- |" * (HEADER.count("|") - 1)}',
        *map(line_of, rows),
        *map(line_of, wholes),
        '\nRay across a part, arm in motion, of 240 s [s], by how it began:\n',
        *ray_lines(wholes),
        f'\nWhat became of targets: {outcomes}.\n',
        '| time lost [s] | share [%] | the arm | for |\n| --- | --- | --- | --- |',
        *(
            f'| {seconds:.0f} | {100.0 * seconds / total:.1f} | {doing} | {cause or "–"} |'
            for (doing, cause), seconds in lost
        ),
        '',
        *(f'- {sentence}' for sentence in whole.sentences),
        f'Digest: `{digest[:16]}`.',
    ]


def _percent(n: int, of: int) -> str:
    return f'{100.0 * n / max(of, 1):.1f} %'


def _of_period(seconds: float, row: Row) -> float:
    return seconds * PERIOD / row.seconds


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print tables, and return 1 where a contact was too fast."""
    options = _parser().parse_args(arguments)
    recordings = (
        [str(path) for path in sorted(options.folder.glob('*.bvh'))] if options.folder else []
    )
    n = options.seeds
    if options.hours is not None:
        each = 3600.0 * options.hours / options.seconds
        n = math.ceil(each / (len(RATES) * len(options.hands) * (1 + len(recordings))))
    items = scenarios(recordings, n, options.seconds, options.stop, options.seed, options.hands)
    begin = time.monotonic()
    rows: dict[tuple[str, float, float], Row] = {}
    # Compiled code is kept, and loaded by each.
    with get_context('spawn').Pool(options.jobs) as pool:
        found = pool.imap(row_of, items)
        for row in tqdm(found, total=len(items), file=sys.stderr, disable=None):
            key = row.name, row.rate, row.hands
            rows.setdefault(key, Row(*key)).add(row)
    whole = Row('all', math.nan, math.nan)
    wholes = {(r, h): Row('all', r, h) for r in RATES for h in options.hands}
    for row in rows.values():
        whole.add(row)
        wholes[row.rate, row.hands].add(row)
    words = f'--hands {" ".join(map("{:g}".format, options.hands))} --seconds {options.seconds:g}'
    text = '\n'.join(
        [
            f'Written by `python -m benchmarks.people FOLDER {words} --seeds {n} --stop '
            f'{options.stop} --seed {options.seed}`.\n',
            *tables_of(list(rows.values()), tuple(wholes.values()), whole),
            f'\n{whole.seconds / 3600.0:.2f} h in {whole.cpu / 60.0:.1f} core-minutes '
            f'({whole.seconds / whole.cpu:.1f} times real time a core), '
            f'{(time.monotonic() - begin) / 60.0:.1f} min in all.',
        ]
    )
    print(text)
    if options.page is not None:
        page = options.page.read_text(encoding='utf-8')
        title = f'{VIRTUAL_TIME}, stops {options.stop}'
        new = with_section(page, title, text)
        replace_file(options.page, lambda path: path.write_text(new, encoding='utf-8'))
    return int(bool(whole.sentences))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='python -m benchmarks.people', description=(__doc__ or '').strip().splitlines()[0]
    )
    add = parser.add_argument
    add('folder', type=Path, nargs='?', metavar='FOLDER', help='with recordings (BVH)')
    add('--seeds', type=int, default=1, help='runs beside each, rate and hands (%(default)s)')
    add('--hours', type=float, help='in virtual time, as many runs as that takes [h]')
    add(
        '--hands',
        type=float,
        nargs='+',
        default=HANDS,
        help='edges of their boxes, 0: as the skeleton has them (%(default)s) [m]',
    )
    add('--seconds', type=float, default=LENGTH, help='of each run [s] (%(default)s)')
    add('--stop', choices=STOPS, default='4/40', help='stop limits (%(default)s)')
    add('--page', type=Path, help='with a section of its own for the tables')
    add('--seed', type=int, default=0, help='of the first run (%(default)s)')
    add('--jobs', type=int, default=os.cpu_count(), help='processes (%(default)s)')
    return parser


if __name__ == '__main__':
    sys.exit(main())
