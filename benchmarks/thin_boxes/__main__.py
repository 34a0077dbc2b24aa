# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Plan from starts that meet, near or cross boxes of 0.1 um to 5 mm, and compare the checkers.

It prints what became of the plans: both checks of a motion have to agree, and the reference
checker looks at every motion densely. It ends with 1 where one does not, and with 2 where a
library of the second checker is not installed.
"""

import argparse
from collections import Counter
from collections.abc import Sequence
import sys
import time

from rrth_planner.collision.distance_library import LIBRARIES, require_library
from rrth_planner.model.errors import ModelError

from benchmarks.separation.runs import each
from benchmarks.thin_boxes.verdict import Verdict, verdict_of

# To see that it runs.
QUICK = 1000
HEADER = '| library | plans | motions | with an escape | disagreements | faults |'


def lines_of(verdicts: Sequence[Verdict]) -> list[str]:
    """Return the table of some verdicts, a row for each library."""
    lines = [HEADER, f'|{" --- |" * (HEADER.count("|") - 1)}']
    for library in sorted({verdict.library for verdict in verdicts}):
        some = [verdict for verdict in verdicts if verdict.library == library]
        figures = (
            len(some),
            sum(verdict.status == 'SOLVED' for verdict in some),
            sum(verdict.is_escape for verdict in some),
            sum(verdict.is_disagreement for verdict in some),
            sum(bool(verdict.faults) for verdict in some),
        )
        lines.append(f'| {library} | {" | ".join(map(str, figures))} |')
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    """Plan, print the table, and every plan that is wrong with its seed."""
    options = _parser().parse_args(arguments)
    for library in LIBRARIES:
        try:
            require_library(library)
        except ModelError as problem:
            print(f'thin_boxes: {problem}', file=sys.stderr)
            return 2
    n = QUICK if options.quick else options.plans
    begin = time.perf_counter()
    seeds = range(options.seed, options.seed + n)
    verdicts = each(verdict_of, seeds, options.jobs, 'plans')
    print('\n'.join(lines_of(verdicts)))
    counts = Counter(verdict.status for verdict in verdicts)
    print(', '.join(f'{status} {count}' for status, count in counts.most_common()))
    print(f'{time.perf_counter() - begin:.0f} s')
    wrong = [verdict for verdict in verdicts if verdict.is_disagreement or verdict.faults]
    for verdict in wrong:
        found = '; '.join(verdict.faults) or verdict.sentence
        print(f'seed {verdict.seed}, {verdict.library}: {found}', file=sys.stderr)
    return 1 if wrong else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='python -m benchmarks.thin_boxes',
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--quick', action='store_true', help='to see that it runs')
    parser.add_argument('--plans', type=int, default=100_000, metavar='N', help='(100000)')
    parser.add_argument('--jobs', type=int, default=1, metavar='N', help='processes (1)')
    parser.add_argument('--seed', type=int, default=0, help='the first of them (0)')
    return parser


if __name__ == '__main__':
    sys.exit(main())
