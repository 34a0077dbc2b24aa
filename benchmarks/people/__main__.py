# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Have an arm asked for targets beside recorded people in virtual time, and print tables.

Everything is a number: latencies, ages of bodies, targets. The same arguments have the same tables
on any machine, but for what they say of its speed.
"""

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import hashlib
from itertools import count, islice
import math
from multiprocessing import get_context
import os
from pathlib import Path
import sys
import time

from rrth_planner.rehearsal.contacts import AT_REST, FAST, SLOW
from rrth_planner.rehearsal.rehearsal import Rehearsal, rehearsed
from rrth_planner.rehearsal.scenario import Proof, Recorded, Requests, Scenario, Tracker
from rrth_planner.rehearsal.session import REACHED
from tqdm import tqdm

# How fast people are played, of 1.
RATES = (1.0, 1.5)
# One run beside a person [s]; the next one beside him has other targets.
LENGTH = 300.0
# A request has so long to have the arm aim at its target [s].
IN_TIME = 6.0
# Recordings but that of the package begin with a T-pose of so long [s].
T_POSE = 0.1
# Of the soak, by which the ray is stated [s].
PERIOD = 240.0
STOPS = {'4/40': (4.0, 40.0), '10/400': (10.0, 400.0)}
# Causes of lost time that are printed.
MOST_CAUSES = 12


@dataclass(slots=True)
class Row:
    """What was seen beside a person at a rate."""

    name: str
    rate: float
    seconds: float = 0.0
    cpu: float = 0.0
    n_requests: int = 0
    n_aimed: int = 0
    n_plans: int = 0
    n_stops: int = 0
    ray: float = 0.0
    moving: float = 0.0
    contacts: Counter[tuple[str, bool]] = field(default_factory=Counter)
    lost: Counter[tuple[str, str]] = field(default_factory=Counter)
    outcomes: Counter[str] = field(default_factory=Counter)
    sentences: list[str] = field(default_factory=list)
    digests: list[str] = field(default_factory=list)

    def add(self, other: 'Row') -> None:
        """Add what was seen in another run."""
        for name in ('seconds', 'cpu', 'n_requests', 'n_aimed', 'n_plans', 'n_stops', 'ray'):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.moving += other.moving
        self.contacts += other.contacts
        self.lost += other.lost
        self.outcomes += other.outcomes
        self.sentences += other.sentences
        self.digests += other.digests


def scenarios(recordings: Sequence[str], hours: float, stop: str, seed: int) -> list[Scenario]:
    """Return runs beside all people at all rates, for so many hours, neighbours beside one."""
    people = [(file, rate) for file in ('', *recordings) for rate in RATES]
    n = math.ceil(3600.0 * hours / LENGTH)
    acceleration, jerk = STOPS[stop]
    found = []
    for k, (file, rate) in enumerate(people):
        recorded = Recorded(
            file=file,
            skeleton='tum_bvh' if 'tum' in Path(file).stem else 'cmu_bvh',
            rate=rate,
            begin=T_POSE if file else 0.0,
        )
        # The first ones have one more where it does not come out even.
        runs = n // len(people) + (k < n % len(people))
        found += [
            Scenario(
                about=Path(file).stem or 'construction work',
                seed=number,
                seconds=LENGTH,
                recorded=recorded,
                tracker=Tracker(rate=60.0),
                separation=Proof(stop_acceleration=acceleration, stop_jerk=jerk),
                requests=Requests(pause=0.1, gives_up=IN_TIME),
            )
            for number in islice(count(seed + 1000 * k), runs)
        ]
    return found


def row_of(scenario: Scenario) -> Row:
    """Rehearse, and return what was seen."""
    begin = time.process_time()
    found: Rehearsal = rehearsed(scenario)
    cpu = time.process_time() - begin
    assert scenario.recorded is not None
    over = [one for one in found.pursuits if one.outcome]
    seen = found.testimony
    return Row(
        name=scenario.about,
        rate=scenario.recorded.rate,
        seconds=scenario.seconds,
        cpu=cpu,
        n_requests=len(over),
        n_aimed=sum(one.outcome == REACHED and one.took <= IN_TIME for one in over),
        n_plans=sum(one.n_plans for one in over),
        n_stops=found.n_stops,
        ray=seen.ray_seconds,
        moving=seen.moving_seconds,
        contacts=seen.contacts,
        lost=found.lost,
        outcomes=Counter(one.outcome for one in over),
        sentences=[f'{scenario.about}, seed {scenario.seed}: {s}' for s in seen.sentences],
        digests=[found.digest],
    )


HEADER = (
    '| recording | rate | time [s] | aimed within 6 s | plans | stops | ray across a part, in '
    'motion, of 240 s [s] | contacts faster than v_c: part kept its speed | part was faster | '
    'slower | at rest | times real time, a core |'
)


def line_of(row: Row) -> str:
    """Return a line of the table."""
    contacts = row.contacts
    cells = (
        *(row.name, f'{row.rate:g}', f'{row.seconds:.0f}'),
        f'{row.n_aimed} of {row.n_requests} ({100.0 * row.n_aimed / max(row.n_requests, 1):.0f} %)',
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
    items = scenarios(recordings, options.hours, options.stop, options.seed)
    if options.seconds is not None:
        items = [replace(item, seconds=options.seconds) for item in items]
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
    for (doing, cause), seconds in whole.lost.most_common(MOST_CAUSES):
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
    add('--seconds', type=float, help='of each run, in place of 300 [s]')
    add('--stop', choices=STOPS, default='4/40', help='stop limits (%(default)s)')
    add('--seed', type=int, default=0, help='of the first run (%(default)s)')
    add('--jobs', type=int, default=os.cpu_count(), help='processes (%(default)s)')
    return parser


if __name__ == '__main__':
    sys.exit(main())
