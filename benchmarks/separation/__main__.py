# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Measure separation from a wearer who moves in lock-step, without ROS, and print tables.

Latencies are true, and time is no more than a number: the machine may be as slow as it likes. The
sections `markers` and `nodes` need ROS, and only the last one, `nodes`, an idle machine.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
from pathlib import Path
import sys

from benchmarks.separation import adversary, costs, durations, people, perception, reference
from benchmarks.separation.runs import each
from benchmarks.separation.setting import Case


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """
    How much is measured.

    Parameters
    ----------
    motions : int
        Whose commitments are judged.
    hands, faulty : int
        Parts of the wearer that leave, each trial, in `adversary`, and in `perception` and
        `markers`.
    timed : int
        Motions of each case in `durations` and `costs`.
    reaches, ended : int
        Hands that reach for the arm of real nodes, each trial, and planners that are killed or
        stand still.
    seconds : float
        Beside each recorded person [s].

    """

    motions: int = 10_000
    hands: int = 1000
    faulty: int = 300
    timed: int = 200
    reaches: int = 300
    ended: int = 100
    seconds: float = 120.0


QUICK = Extent(motions=8, hands=3, faulty=2, timed=1, reaches=2, ended=1, seconds=2.0)
COST_CASES = (Case(), Case(stop='10/400'), Case(contact_speed=0.0, stop='10/400'))


def print_head(title: str, header: str) -> None:
    """Print a heading and the head of a table."""
    print(f'\n## {title}\n\n{header}\n|{" --- |" * (header.count("|") - 1)}', flush=True)


def print_reference(options: argparse.Namespace, extent: Extent) -> None:
    """Print what the reference checker says."""
    n = min(extent.motions, reference.CHAIN)
    chains = max(1, math.ceil(extent.motions / n))
    if extent.motions < 4 * reference.CHAIN:
        # Each case has a chain.
        n, chains = max(1, extent.motions // 4), 4
    drawn = math.ceil(reference.LEAST / extent.motions)
    seeds = range(options.seed, options.seed + chains)
    found = each(reference.chain_of_motions, seeds, options.jobs, 'reference', drawn, n)
    print_head('reference: commitments judged by the reference checker', reference.HEADER)
    print('\n'.join(reference.lines_of(found)))
    print(
        f'\nOf each motion up to {drawn} commitments are drawn at random, and judged at each of '
        'their points and each millisecond.'
    )


def print_trials(
    title: str,
    trials: dict[str, adversary.Trial],
    n_hands: int,
    options: argparse.Namespace,
) -> None:
    """Print a table of trials with an adversary."""
    print_head(title, adversary.HEADER)
    n = min(n_hands, adversary.CHAIN)
    seeds = range(options.seed, options.seed + math.ceil(n_hands / n))
    for what, trial in trials.items():
        found = each(adversary.chain_of_hands, seeds, options.jobs, what, trial, n)
        print(adversary.line_of(what, trial, found), flush=True)
        for chain in found:
            for hand in chain.hands:
                if hand.word == adversary.FAST and trial.is_honest:
                    print(f'{what}: {hand}', file=sys.stderr)


def print_adversary(options: argparse.Namespace, extent: Extent) -> None:
    """Print what becomes of parts of the wearer that leave to intercept the arm."""
    title = 'adversary: parts of the wearer that leave to intercept the arm'
    print_trials(title, adversary.trials(), extent.hands, options)


def print_durations(options: argparse.Namespace, extent: Extent) -> None:
    """Print how much longer motions take."""
    print_head('durations: the wearer at rest', durations.HEADER)
    n = min(extent.timed, durations.CHAIN)
    seeds = range(options.seed, options.seed + math.ceil(extent.timed / n))
    for dead, case in durations.cases():
        chains = each(durations.chain_of_timed, seeds, options.jobs, 'durations', dead, case, n)
        print(
            durations.line_of(dead, case, [one for chain in chains for one in chain]), flush=True
        )


def print_people(options: argparse.Namespace, extent: Extent) -> None:
    """Print what was seen beside recorded people."""
    print_head('people: beside recorded people', people.HEADER)
    records: list[people.Beside] = []
    for take in people.takes(options.recordings):
        items = people.items(take)
        found = each(people.beside_person, items, options.jobs, take.name, extent.seconds)
        records += found
        for record in found:
            print(people.line_of(record), flush=True)
            for sentence in record.sentences if record.is_separate else ():
                print(f'{take.name}, {take.rate:g}: {sentence}', file=sys.stderr)
    print('\nFrames at which a part had got further than assumed since any of the last second:\n')
    print('\n'.join(people.reach_lines(records)))


def print_perception(options: argparse.Namespace, extent: Extent) -> None:
    """Print what becomes of the adversary where perception is at fault."""
    title = 'perception: the adversary, and what is wrong with what is seen'
    print_trials(title, perception.trials(), extent.faulty, options)


def print_markers(options: argparse.Namespace, extent: Extent) -> None:
    """Print what becomes of the adversary where the wearer is seen by way of messages."""
    # Needs the messages of ROS.
    from benchmarks.separation import markers

    title = 'markers: the adversary, seen by way of the messages of a tracker'
    print_trials(title, markers.trials(), extent.faulty, options)


def print_costs(options: argparse.Namespace, extent: Extent) -> None:
    """Print how long commitments take."""
    print_head('costs: time of a commitment, one thread', costs.HEADER)
    n = min(extent.timed, durations.CHAIN)
    seeds = range(options.seed, options.seed + math.ceil(extent.timed / n))
    for case in COST_CASES:
        print('\n'.join(costs.lines_of(case, each(costs.costs, seeds, 1, 'costs', case, n))))


def print_nodes(options: argparse.Namespace, extent: Extent) -> None:
    """Print what becomes of hands that reach for an arm of real nodes."""
    # Only this section needs ROS.
    from benchmarks.separation import nodes

    print_head('nodes: planner and playback over DDS, a body 120 times a second', nodes.HEADER)
    for trial, ends_planners in nodes.trials().values():
        n = extent.ended if ends_planners else extent.reaches
        print(nodes.line_of(trial, nodes.run(trial, n, options.seed)), flush=True)


SECTIONS: dict[str, Callable[[argparse.Namespace, Extent], None]] = {
    'reference': print_reference,
    'adversary': print_adversary,
    'durations': print_durations,
    'people': print_people,
    'perception': print_perception,
    'markers': print_markers,
    'costs': print_costs,
    'nodes': print_nodes,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables of some sections."""
    options = _parser().parse_args(arguments)
    base = QUICK if options.quick else Extent()
    given = {
        name: getattr(options, name)
        for name in Extent.__dataclass_fields__
        if getattr(options, name) is not None
    }
    extent = Extent(**{n: given.get(n, getattr(base, n)) for n in Extent.__dataclass_fields__})
    for name in options.only or SECTIONS:
        SECTIONS[name](options, extent)
    if options.figure is not None:
        # Only pictures need it.
        from benchmarks.separation.figures import draw

        file = str(options.recordings[0]) if options.recordings else ''
        print(f'\n{draw(options.figure, people.Take(file, 1.0), Case())}')


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='python -m benchmarks.separation',
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--only', nargs='+', choices=SECTIONS, metavar='SECTION', help='some')
    parser.add_argument('--quick', action='store_true', help='two minutes, to see that it runs')
    full = Extent()
    for name, kind, text in (
        ('motions', _count, 'whose commitments the reference checker judges'),
        ('hands', _count, 'parts of the wearer that leave, each trial'),
        ('faulty', _count, 'the same in `perception` and `markers`'),
        ('timed', _count, 'motions of each case in `durations` and `costs`'),
        ('reaches', _count, 'hands that reach for the arm of real nodes, each trial'),
        ('ended', _count, 'planners that are killed, or stand still, in mid-motion'),
        ('seconds', float, 'beside each recorded person [s]'),
    ):
        default = getattr(full, name)
        parser.add_argument(f'--{name}', type=kind, metavar='N', help=f'{text} ({default:g})')
    parser.add_argument(
        '--recordings',
        nargs='*',
        type=Path,
        default=[],
        metavar='FILE',
        help='further recorded people, in the layouts of CMU or TUM',
    )
    parser.add_argument('--figure', type=Path, metavar='FILE', help='draw motions into it')
    parser.add_argument('--jobs', type=_count, default=1, metavar='N', help='processes (1)')
    parser.add_argument('--seed', type=int, default=0, help='the first of them (0)')
    return parser


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f'{text}: expected 1 or more')
    return value


if __name__ == '__main__':
    main()
