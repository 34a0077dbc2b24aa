# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The benchmarks: one command measures, stores the rows, draws, and writes docs/performance.md."""

import argparse
from collections.abc import Sequence
import os
from pathlib import Path
import platform
import sys

from rrth_planner.io.replaced_file import replace_file
from rrth_planner.model.errors import RrthError
from rrth_planner.reproduction.run import processor_name
from rrth_planner.reproduction.statistics import markdown_table

from benchmarks.common.rows import write_summary
from benchmarks.common.size import Extent, QUICK
from benchmarks.planners.figures import draw_figures
from benchmarks.planners.report import report
from benchmarks.planners.sections import measure, section_tasks, SECTIONS
from benchmarks.planners.table import TARGET_HEADER, target_lines

RESULTS = Path(__file__).parents[1] / 'results'
# Columns of the table that a terminal shows.
SHOWN = 9


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what is asked for, then write the report and its pictures."""
    arguments = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(arguments)
    output = options.output or Path('build/performance' if options.quick else 'docs')
    data = options.data or (output if options.quick else RESULTS) / 'rows.parquet'
    extent = QUICK if options.quick else Extent()
    machine = f'{processor_name()} ({os.cpu_count()} cores, {platform.system()})'
    command = ' '.join(['python -m benchmarks', *_portable(arguments)])
    again = options.only or (() if options.resume else SECTIONS)
    try:
        tasks = section_tasks(options.only or SECTIONS, extent, options.harness)
        rows = measure(tasks, data, extent, again=again)
        pictures = draw_figures(rows, output / 'images' / 'performance')
        places = {caption: f'images/performance/{name}' for caption, name in pictures.items()}
        lines = target_lines(rows)
        write_summary(data.with_name('summary.csv'), TARGET_HEADER, lines)
        target, text = output / 'performance.md', report(rows, command, machine, places)
        replace_file(target, lambda path: path.write_text(text, encoding='utf-8'))
    except KeyboardInterrupt:
        print(f'interrupted; --resume goes on from {data}', file=sys.stderr)
        return 130
    except (RrthError, OSError) as problem:
        print(f'benchmarks: {problem}', file=sys.stderr)
        return 1
    print(machine)
    print(markdown_table(TARGET_HEADER[:SHOWN], [line[:SHOWN] for line in lines]))
    print(f'{target}: {len(rows)} rows in {data}')
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='python -m benchmarks', description=__doc__)
    parser.add_argument('--quick', action='store_true', help='few runs: about a minute')
    parser.add_argument(
        '--output',
        type=Path,
        help='folder of performance.md and its pictures (docs; --quick: build/performance)',
    )
    parser.add_argument(
        '--data', type=Path, help='Parquet file of the rows (benchmarks/results/rows.parquet)'
    )
    parser.add_argument(
        '--harness',
        type=Path,
        metavar='FOLDER',
        help='lines of a C++ program over OMPL, taken on this machine: one_*.jsonl, any_*.jsonl',
    )
    parser.add_argument(
        '--only',
        nargs='+',
        choices=SECTIONS,
        metavar='SECTION',
        help=f'measure these again, keep other rows of the same sources: {", ".join(SECTIONS)}',
    )
    parser.add_argument(
        '--resume', action='store_true', help='keep all rows of the same sources, do the others'
    )
    return parser


def _portable(arguments: Sequence[str]) -> list[str]:
    """Return the arguments without folders, which belong to one machine."""
    kept, skip = [], False
    for argument in arguments:
        name = argument.partition('=')[0]
        if skip:
            skip = False
        elif name in ('--output', '--data', '--harness'):
            skip = '=' not in argument
            kept += ['--harness FOLDER'] if name == '--harness' else []
        else:
            kept.append(argument)
    return kept
