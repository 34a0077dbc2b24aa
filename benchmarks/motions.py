# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Judges the timed motions of random queries, and writes docs/motions.md with its pictures."""

import argparse
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
import sys
from typing import Any

NEEDED = ('pyarrow', 'tqdm', 'matplotlib', 'fcl', 'toppra')
MISSING = """{}: not installed, and motions cannot be judged without; install what it needs by
    ./run exec python -m pip install -r requirements/benchmark.txt"""
RESULTS = Path(__file__).parent / 'results'
# Queries round each wearer, queries in all, and those of a quick look.
EACH, QUERIES, QUICK = 10, 1000, 40


def main(arguments: Sequence[str] | None = None, find: Callable[[str], object] = find_spec) -> int:
    """Plan and judge what is asked for, then write the report and its pictures."""
    arguments = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(arguments)
    missing = [name for name in NEEDED if find(name) is None]
    if missing:
        print(MISSING.format(', '.join(missing)), file=sys.stderr)
        return 2
    from rrth_planner.errors import RrthError

    try:
        _run(options, _command(options))
    except KeyboardInterrupt:
        return 130
    except (RrthError, OSError) as problem:
        print(f'motions: {problem}', file=sys.stderr)
        return 1
    return 0


def _run(options: argparse.Namespace, command: str) -> None:
    from rrth_planner.campaign.statistics import markdown_table
    from rrth_planner.campaign.store import replace_file

    from benchmarks.motion_figures import draw_figures
    from benchmarks.motion_plan import default_limits
    from benchmarks.motion_report import report
    from benchmarks.motion_rows import read_motions, write_motions
    from benchmarks.motion_table import HEADER, target_lines

    output = options.output or Path('build/motions' if options.quick else 'docs')
    data = options.data or (output if options.quick else RESULTS) / 'motions.parquet'
    limits = default_limits()
    if not options.report_only:
        write_motions(data, _measured(QUICK if options.quick else options.queries))
    rows = read_motions(data)
    pictures = draw_figures(rows, limits, output / 'images' / 'motions')
    places = {caption: f'images/motions/{name}' for caption, name in pictures.items()}
    target, text = output / 'motions.md', report(rows, command, places)
    replace_file(target, lambda path: path.write_text(text, encoding='utf-8'))
    print(markdown_table(HEADER, target_lines(rows)))
    print(f'{target}: {len(rows)} queries in {data}')


def _measured(n_queries: int) -> list[dict[str, Any]]:
    """Return the rows of some queries, spread over as many wearers as it takes."""
    from tqdm import tqdm

    from benchmarks.clock import pinned
    from benchmarks.motion_plan import default_limits, planned_motions
    from benchmarks.motion_rows import motion_row

    # Its thread would wake up while plans are timed.
    tqdm.monitor_interval = 0
    limits = default_limits()
    rows: list[dict[str, Any]] = []
    with pinned(), tqdm(total=n_queries, unit='query', file=sys.stderr) as bar:
        for body in range(-(-n_queries // EACH)):
            motions = planned_motions(body, min(EACH, n_queries - len(rows)), limits)
            for motion in motions:
                rows.append(motion_row(motion, limits))
                bar.update()
    return rows


def _command(options: argparse.Namespace) -> str:
    """Return the command without folders, which belong to one machine."""
    parts = ['python -m benchmarks.motions']
    parts += ['--quick'] if options.quick else []
    parts += [f'--queries {options.queries}'] if options.queries != QUERIES else []
    return ' '.join(parts)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='python -m benchmarks.motions', description=__doc__)
    parser.add_argument('--quick', action='store_true', help=f'{QUICK} queries: about a minute')
    parser.add_argument(
        '--queries', type=_count, default=QUERIES, metavar='N', help=f'how many ({QUERIES})'
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
