# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Make bounds of reach of recorded people, lines c + w t, and say how often people leave them.

How far a part gets within a time is what its box has to grow by to hold the later one, in the
frame of the torso, from one frame to the longest time that counts: `keep_lost`, and the longest
stop. For each kind of part two lines, and one through the origin, are drawn above what all but one
of 10,000 pairs of frames of each person need, with the least mean growth up to 0.6 s. A part is
taken to be as fast as stated at least as far as people got, and legs, which were recorded of one
person, at any time. Then lines are made steeper, each kind by as much as it takes, until nobody
has left a bound in more than 1 % of his frames by lines that were made without him. Of what does
that, something with little growth is searched for, step by step.

Boxes have no errors here but one of `body_error`. Where one person was recorded, takes are left
out in place of persons.
"""

import argparse
from collections.abc import Sequence
import math
from multiprocessing import get_context
from pathlib import Path
import sys

import numpy as np
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.settings import load_settings
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.rehearsal.scenario import Tracker
from rrth_planner.wearer.skeleton import Skeleton
from tqdm import tqdm

from benchmarks.reach.making import judged, Making
from benchmarks.reach.people import FRAMES, measured, persons_of, skeleton_name, STATED, Take

RATES = (1.0, 1.5)
# Share of the frames of an unseen person in which a part may have left its bound [-].
LIMIT = 0.01
# Boxes that trackers call by another word.
SAME_AS = {'chest': 'torso'}


def longest_time() -> float:
    """Return how long a part may be unseen while the arm moves: `keep_lost`, and a stop [s]."""
    limits = load_settings(load_arm().dof).limits
    v, a, j = (np.asarray(row) for row in (limits.velocity, limits.acceleration, limits.jerk))
    # A stop at full speed; one that begins in full acceleration takes that back first.
    return Tracker().keep_lost + float((v / a + 2.0 * a / j).max())


def table_of(making: Making) -> list[str]:
    """Return how often each person left his bounds, by kinds of parts."""
    kinds = making.kinds
    header = f'| person | rate | frames | {" | ".join(kinds)} | frames with any part out |'
    lines = [header, f'|{" --- |" * (header.count("|") - 1)}']
    for person, rate in dict.fromkeys((t.person, t.rate) for t in making.takes):
        takes = [t for t in making.takes if (t.person, t.rate) == (person, rate)]
        found = [judged(making, take) for take in takes]
        cells = []
        for kind in kinds:
            n, n_stated, n_lined = (
                sum(pairs[kind][k] for pairs, _, _ in found if kind in pairs) for k in range(3)
            )
            cells.append(f'{100 * n_stated / n:.2f} / {100 * n_lined / n:.2f}' if n else '–')
        stated, lined = (100 * np.concatenate([f[k] for f in found]).mean() for k in (1, 2))
        n_frames = sum(take.n_frames for take in takes)
        row = (person, f'{rate:g}', n_frames, *cells, f'{stated:.1f} / {lined:.2f}')
        lines.append(f'| {" | ".join(map(str, row))} |')
    return lines


def default_of(making: Making) -> list[str]:
    """Return the lines of all kinds, as source; what is not recorded is what it is part of."""
    lines = making.lines
    text = ['BODY_REACH = (']
    for words, speed in STATED.body_speeds:
        # Where what wears the arm does not move in a recording, it does not move.
        unknown = lines[''] if speed > 0.0 else ((0.0, 0.0),)
        found = lines.get(words, lines.get(SAME_AS.get(words, ' '), unknown))
        text.append(f'    ({words!r}, ({", ".join(map(str, found))},)),')
    return [*text, ')']


def main(arguments: Sequence[str] | None = None) -> int:
    """Make lines, judge people, and print tables."""
    options = _parser().parse_args(arguments)
    files = sorted(options.folder.glob('*.bvh'))
    if len(files) < 2:
        print(f'{options.folder}: {len(files)} recordings, expected two or more', file=sys.stderr)
        return 2
    people = persons_of(files)
    n_steps = math.ceil((options.longest or longest_time()) * FRAMES)
    items = [
        (file, people[file], rate, n_steps, _skeleton(file, options.hands))
        for file in files
        for rate in RATES
    ]
    with get_context('spawn').Pool(options.jobs) as pool:
        found = pool.imap(measured, items)
        takes: list[Take] = list(tqdm(found, total=len(items), file=sys.stderr, disable=None))
    making = Making(takes, options.made_of, options.limit)
    for person in dict.fromkeys(people.values()):
        print(
            f'{person}: {", ".join(file.stem for file, name in people.items() if name == person)}'
        )
    print(f'\n{n_steps} times between frames, up to {n_steps / FRAMES:.3f} s\n')
    print(
        '| part | of persons | steeper by [m/s] | lines [m, m/s] | at 0.1 | 0.2 | 0.3 | 1 | 2 s '
        '[m] |'
    )
    print(f'|{" --- |" * 9}')
    for kind, lines in making.lines.items():
        words = ', '.join(f'{c:g} + {w:g} t' for c, w in lines)
        at = [f'{min(c + w * t for c, w in lines):.2f}' for t in (0.1, 0.2, 0.3, 1.0, 2.0)]
        n = len(making.people_of(kind)) if kind else '–'
        print(f'| {kind} | {n} | {making.steps.get(kind, 0.0):g} | {words} | {" | ".join(at)} |')
    print('', *default_of(making), '', *table_of(making), sep='\n')
    print(
        '\nPairs of frames at all times between them, in percent: a corner went further than its'
    )
    print(
        'stated speed / the box got out of its bound, by lines that were made without the person.'
    )
    return 0


def _skeleton(file: Path, hands: float) -> Skeleton:
    return load_skeleton(skeleton_name(file), hand_size=hands)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='python -m benchmarks.reach', description=(__doc__ or '').strip().splitlines()[0]
    )
    add = parser.add_argument
    add('folder', type=Path, metavar='FOLDER', help='with recordings (BVH)')
    add('--made-of', type=float, nargs='+', default=(1.0,), help='rates of people (%(default)s)')
    add('--limit', type=float, default=LIMIT, help='frames with a part out (%(default)s) [-]')
    add('--longest', type=float, help='time between frames (keep_lost and a stop) [s]')
    add('--hands', type=float, default=0.0, help='edge of their boxes (as in the skeleton) [m]')
    add('--jobs', type=int, default=1, help='processes (%(default)s)')
    return parser


if __name__ == '__main__':
    sys.exit(main())
