# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Judges the timed motions of random queries, and writes docs/motions.md with its pictures."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib.util import find_spec
import itertools
from multiprocessing import get_context
from pathlib import Path
import sys
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from benchmarks.motions.plan import Motion

NEEDED = ('pyarrow', 'tqdm', 'matplotlib', 'fcl', 'toppra')
MISSING = """{}: not installed, and motions cannot be judged without; install what it needs by
    ./run exec python -m pip install -r requirements/benchmark.txt"""
RESULTS = Path(__file__).parents[1] / 'results'
# Queries round each wearer, queries in all, and those of a quick look.
EACH, QUERIES, QUICK = 10, 1000, 40
# Motions with corners, those of the random queries among them, and those of a quick look.
BENT, QUICK_BENT = 1000, 20


def main(arguments: Sequence[str] | None = None, find: Callable[[str], object] = find_spec) -> int:
    """Plan and judge what is asked for, then write the report and its pictures."""
    arguments = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(arguments)
    if options.queries is None:
        options.queries = QUICK if options.quick else QUERIES
    if options.bent is None:
        options.bent = QUICK_BENT if options.quick else BENT
    missing = [name for name in NEEDED if find(name) is None]
    if missing:
        print(MISSING.format(', '.join(missing)), file=sys.stderr)
        return 2
    from rrth_planner.model.errors import RrthError

    try:
        _run(options, _command(options))
    except KeyboardInterrupt:
        return 130
    except (RrthError, OSError) as problem:
        print(f'motions: {problem}', file=sys.stderr)
        return 1
    return 0


def _run(options: argparse.Namespace, command: str) -> None:
    from rrth_planner.io.replaced_file import replace_file
    from rrth_planner.reproduction.statistics import markdown_table

    from benchmarks.motions.figures import draw_figures
    from benchmarks.motions.plan import default_limits
    from benchmarks.motions.report import report
    from benchmarks.motions.rows import read_motions, write_motions
    from benchmarks.motions.table import HEADER, target_lines

    output = options.output or Path('build/motions' if options.quick else 'docs')
    data = options.data or (output if options.quick else RESULTS) / 'motions.parquet'
    limits = default_limits()
    if not options.report_only:
        write_motions(data, _measured(options.queries, options.bent))
    rows = read_motions(data)
    pictures = draw_figures(rows, limits, output / 'images' / 'motions')
    places = {caption: f'images/motions/{name}' for caption, name in pictures.items()}
    target, text = output / 'motions.md', report(rows, command, places)
    replace_file(target, lambda path: path.write_text(text, encoding='utf-8'))
    print(markdown_table(HEADER, target_lines(rows)))
    print(f'{target}: {len(rows)} motions in {data}')


def _measured(n_queries: int, n_bent: int) -> list[dict[str, Any]]:
    """Return the rows of motions: planned on one quiet core, then judged on all of them."""
    from tqdm import tqdm

    from benchmarks.common.clock import pinned
    from benchmarks.motions.plan import default_limits
    from benchmarks.motions.rows import motion_row

    # Its thread would wake up while plans are timed.
    tqdm.monitor_interval = 0
    with pinned():
        chosen = list(tqdm(_planned(n_queries, n_bent), desc='planned', unit='', file=sys.stderr))
    judge = partial(motion_row, limits=default_limits())
    with ProcessPoolExecutor(mp_context=get_context('spawn')) as pool:
        rows = pool.map(judge, *zip(*chosen, strict=True))
        return list(tqdm(rows, 'judged', total=len(chosen), unit='', file=sys.stderr))


def _planned(n_queries: int, n_bent: int) -> Iterator[tuple['Motion', bool]]:
    """
    Yield motions, and whether each was sought for its corners, round as many wearers as it takes.

    The queries go on round later wearers until there are n_bent motions with corners; of those
    later queries the ones answered by a straight motion are left out, all others are kept.
    """
    from rrth_planner.model.status import PlanStatus

    from benchmarks.motions.plan import default_limits, planned_motions

    n_found, n_bodies = 0, -(-n_queries // EACH)
    for body in itertools.count():
        is_sought = body >= n_bodies
        if is_sought and n_found >= n_bent:
            return
        n = EACH if is_sought else min(EACH, n_queries - EACH * body)
        for motion in planned_motions(body, n, default_limits()):
            is_solved = motion.plan.status is PlanStatus.SOLVED
            n_found += is_solved and bool(motion.rounded)
            if motion.rounded or not (is_sought and is_solved):
                yield motion, is_sought


def _command(options: argparse.Namespace) -> str:
    """Return the command without folders, which belong to one machine."""
    parts = ['python -m benchmarks.motions']
    parts += ['--quick'] if options.quick else []
    usual = (QUICK, QUICK_BENT) if options.quick else (QUERIES, BENT)
    parts += [f'--queries {options.queries}'] if options.queries != usual[0] else []
    parts += [f'--bent {options.bent}'] if options.bent != usual[1] else []
    return ' '.join(parts)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='python -m benchmarks.motions', description=__doc__)
    parser.add_argument('--quick', action='store_true', help='a look at a few: about a minute')
    parser.add_argument(
        '--queries',
        type=_count,
        metavar='N',
        help=f'how many random queries ({QUERIES}; --quick: {QUICK})',
    )
    parser.add_argument(
        '--bent',
        type=_count,
        metavar='N',
        help='go on with queries round further wearers until this many motions have corners '
        f'({BENT}; --quick: {QUICK_BENT})',
    )
    parser.add_argument(
        '--output',
        type=Path,
        help='folder of motions.md and its pictures (docs; --quick: build/motions)',
    )
    parser.add_argument(
        '--data', type=Path, help='Parquet file of the rows (benchmarks/results/motions.parquet)'
    )
    parser.add_argument(
        '--report-only', action='store_true', help='write the report again from the rows there'
    )
    return parser


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f'{text}: expected at least 1')
    return value


if __name__ == '__main__':
    sys.exit(main())
