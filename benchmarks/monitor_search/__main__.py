# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Search for an order of events after which the monitor of a moving arm does wrong.

Each seed is an episode in virtual time: hands reach for the arm, and everything goes wrong that
the wire allows; then nothing does any more, and the arm has to move again. It ends with 1 where a
fault is found. With --fault a known fault is put into the monitor first, and the search ends where
it is found.
"""

import argparse
from collections.abc import Sequence
from functools import partial
import os
import sys
import time

from benchmarks.monitor_search.faults import FAULTS, found_of
from benchmarks.monitor_search.judge import Found
from benchmarks.separation.runs import each

SEEDS = 60
HEADER = '| episodes | events | commands | stops | motions begun | slow contacts | faults |'


def lines_of(episodes: Sequence[Found]) -> list[str]:
    """Return the table of some episodes, and what was wrong with its seed."""
    figures = (
        len(episodes),
        *(
            sum(getattr(found, name) for found in episodes)
            for name in ('n_events', 'n_commands', 'n_stops', 'n_begun', 'n_contacts')
        ),
        sum(len(found.faults) for found in episodes),
    )
    faults = [f'seed {found.seed}: {fault}' for found in episodes for fault in found.faults]
    rule = f'|{" --- |" * (HEADER.count("|") - 1)}'
    return [HEADER, rule, f'| {" | ".join(map(str, figures))} |', *faults]


def until_found(fault: str, seeds: Sequence[int]) -> list[Found]:
    """Return the episodes up to the first one that shows a fault."""
    episodes: list[Found] = []
    for seed in seeds:
        episodes.append(found_of(fault, seed))
        if episodes[-1].faults:
            break
    return episodes


def main(arguments: Sequence[str] | None = None) -> int:
    """Search, print the table, and all that is wrong with its seed."""
    options = _parser().parse_args(arguments)
    seeds = range(options.first, options.first + options.seeds)
    begin, cpu = time.perf_counter(), time.process_time()
    if options.fault:
        episodes = until_found(options.fault, seeds)
    else:
        episodes = each(partial(found_of, ''), seeds, options.jobs, 'episodes')
    print('\n'.join(lines_of(episodes)))
    took = f'{time.perf_counter() - begin:.0f} s'
    if options.fault or options.jobs == 1:
        took += f', {time.process_time() - cpu:.0f} s of one processor'
    print(took)
    return int(any(found.faults for found in episodes))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='python -m benchmarks.monitor_search',
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--seeds', type=int, default=SEEDS, help='how many episodes')
    parser.add_argument('--first', type=int, default=0, help='the seed of the first one')
    parser.add_argument('--jobs', type=int, default=os.cpu_count() or 1, help='processes')
    parser.add_argument('--fault', choices=list(FAULTS), default='', help='put into the monitor')
    return parser


if __name__ == '__main__':
    sys.exit(main())
