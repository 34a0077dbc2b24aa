# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The reproduction: every figure and number of the paper, measured again by one command."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
import os
from pathlib import Path
import platform
import sys
from typing import TYPE_CHECKING

from rrth_planner.cli.parsers.reproduce import parser
from rrth_planner.cli.program import INTERRUPTED, say
from rrth_planner.io.extras import require
from rrth_planner.model.errors import OptionsError, RrthError

if TYPE_CHECKING:
    from rrth_planner.reproduction.experiments import Extent

LIBRARIES = ('distributed', 'pyarrow', 'tqdm', 'matplotlib')


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaign, then write the report and its pictures."""
    arguments = sys.argv[1:] if arguments is None else arguments
    options = parser().parse_args(arguments)
    try:
        require('campaign', *LIBRARIES)
        # Not for --help: loading the planner takes seconds, and compiling it, once, minutes.
        from rrth_planner.kernels.precompile import prepare_kernels

        prepare_kernels(partial(say, 'reproduce'))
        extent = _extent(options)
    except RrthError as problem:
        say('reproduce', str(problem))
        return 2
    from rrth_planner.io.cluster import cluster_client
    from rrth_planner.io.replaced_file import replace_file
    from rrth_planner.reproduction.cluster import run_campaign
    from rrth_planner.reproduction.experiments import spread_runs, timed_runs
    from rrth_planner.reproduction.figures.all import draw_pictures
    from rrth_planner.reproduction.report import report
    from rrth_planner.reproduction.row_store import read_rows
    from rrth_planner.reproduction.run import processor_name, source_digest
    from rrth_planner.reproduction.statistics import Rows

    output = options.output or Path('build/reproduction' if options.quick else 'docs')
    data = options.data or output / 'reproduction.parquet'
    try:
        timed, spread = timed_runs(extent), spread_runs(extent)
        run_campaign(timed, data, timed=True, label='one by one')
        if options.serial:
            run_campaign(spread, data, label='the rest')
        else:
            with cluster_client(options.scheduler) as client:
                run_campaign(spread, data, client=client, label='side by side')
        wanted = {run.key() for run in (*timed, *spread)}
        rows = Rows([row for row in read_rows(data).to_pylist() if row['key'] in wanted])
        output.mkdir(parents=True, exist_ok=True)
        pictures = draw_pictures(rows, extent, output)
        command = ' '.join(['python -m rrth_planner.cli.reproduce', *_portable(arguments)])
        machine = f'{processor_name()} ({os.cpu_count()} cores, {platform.system()})'
        text = report(rows, extent, command, machine, pictures)
        target = output / 'reproduction.md'
        replace_file(target, lambda path: path.write_text(text, encoding='utf-8'))
    except KeyboardInterrupt:
        print(f'interrupted; the next start continues from {data}', file=sys.stderr)
        return INTERRUPTED
    except (RrthError, OSError) as problem:
        say('reproduce', str(problem))
        return 1
    print(f'{target}: {len(rows)} runs of the sources {source_digest()}; rows in {data}')
    return 0


def _extent(options: argparse.Namespace) -> 'Extent':
    """Return how many runs the command line asks for, of which problems."""
    from rrth_planner.reproduction.experiments import Extent, QUICK

    for name in ('maps', 'targets'):
        known = getattr(Extent(), name)
        for given in getattr(options, name) or ():
            if given not in known:
                raise OptionsError(f'--{name} {given}, expected some of {", ".join(known)}')
    extent = QUICK if options.quick else Extent()
    if options.runs:
        few, many = min(options.runs), max(options.runs)
        extent = replace(extent, few=few, many=many, seeds=max(many, extent.seeds))
    if options.seeds:
        extent = replace(
            extent,
            seeds=max(options.seeds, extent.many),
            long=min(extent.long, options.seeds),
            arm=min(extent.arm, options.seeds),
            arm_modes=min(extent.arm_modes, options.seeds),
        )
    return replace(
        extent,
        maps=tuple(options.maps or extent.maps),
        targets=tuple(options.targets or extent.targets),
    )


def _portable(arguments: Sequence[str]) -> list[str]:
    """Return the arguments without what belongs to one machine: folders and addresses."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    for name in ('--output', '--data', '--scheduler'):
        parser.add_argument(name)
    return parser.parse_known_args(arguments)[1]


if __name__ == '__main__':
    sys.exit(main())
