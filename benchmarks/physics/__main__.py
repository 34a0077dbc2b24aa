# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Have an arm with masses, gravity, friction and servos that lag execute what is planned.

It prints the tables of docs/ros_control.md, without ROS nodes: time is no more than a number.
"""

import argparse
from collections.abc import Sequence
import math
from pathlib import Path
import sys

from benchmarks.physics import people, servos
from benchmarks.separation.people import takes
from benchmarks.separation.runs import each

SECTIONS = ('servos', 'people')
# To see that it runs.
QUICK_MOTIONS, QUICK_SECONDS = 24, 5.0


def print_head(title: str, header: str) -> None:
    """Print a heading and the head of a table."""
    print(f'\n## {title}\n\n{header}\n|{" --- |" * (header.count("|") - 1)}', flush=True)


def print_servos(options: argparse.Namespace) -> None:
    """Print what became of motions round a wearer at rest."""
    print_head('servos: motions round a wearer at rest, half of them stopped', servos.HEADER)
    n = min(servos.CHAIN, max(1, options.motions // (len(servos.LAGS) * len(servos.DELAYS))))
    seeds = range(options.seed, options.seed + math.ceil(options.motions / n))
    found = each(servos.chain_of_motions, seeds, options.jobs, 'servos', n)
    print('\n'.join(servos.lines_of(found)), flush=True)
    n_other = sum(one.n_other for one in found)
    print(f'\nMotions that the monitor stopped or gave up by itself: {n_other}.', flush=True)


def print_people(options: argparse.Namespace) -> None:
    """Print what was seen of arms beside recorded people."""
    print_head('people: beside recorded people, with separation', people.HEADER)
    for setup, case in people.CASES:
        items = [(take, setup, case) for take in takes(options.recordings)]
        found = each(people.beside_person, items, options.jobs, 'people', options.seconds)
        print(people.line_of(found), flush=True)
        for one in found:
            for sentence in people.sentences_of(one):
                print(sentence, file=sys.stderr)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables of some sections."""
    options = _parser().parse_args(arguments)
    if options.quick:
        options.motions, options.seconds = QUICK_MOTIONS, QUICK_SECONDS
    for name in options.only or SECTIONS:
        {'servos': print_servos, 'people': print_people}[name](options)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='python -m benchmarks.physics',
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--only', nargs='+', choices=SECTIONS, metavar='SECTION', help='some')
    parser.add_argument('--quick', action='store_true', help='a minute, to see that it runs')
    parser.add_argument('--motions', type=int, default=1000, metavar='N', help='(1000)')
    parser.add_argument(
        '--seconds', type=float, default=60.0, metavar='N', help='beside each person [s] (60)'
    )
    parser.add_argument(
        '--recordings',
        nargs='*',
        type=Path,
        default=[],
        metavar='FILE',
        help='further recorded people, in the layouts of CMU or TUM',
    )
    parser.add_argument('--jobs', type=int, default=1, metavar='N', help='processes (1)')
    parser.add_argument('--seed', type=int, default=0, help='the first of them (0)')
    return parser


if __name__ == '__main__':
    main()
