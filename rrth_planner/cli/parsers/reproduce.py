# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `reproduce`."""

import argparse
from pathlib import Path

from rrth_planner.cli.numbers import number_of_runs
from rrth_planner.cli.program import command_parser

DESCRIPTION = (
    'The reproduction: every figure and number of the paper, measured again by one command.'
)


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = command_parser('reproduce', DESCRIPTION)
    add = command.add_argument
    add('--quick', action='store_true', help='few runs: a minute or two')
    output = 'folder of reproduction.md and its pictures (docs; --quick: build/reproduction)'
    add('--output', type=Path, help=output)
    data = 'Parquet file of the runs (reproduction.parquet in the output)'
    add('--data', type=Path, help=data)
    runs = 'timed runs per planner and map; the fewest and most are reported (10 100)'
    add('--runs', type=number_of_runs, nargs='+', metavar='N', help=runs)
    seeds = 'runs for each share and number of draws (1000)'
    add('--seeds', type=number_of_runs, metavar='N', help=seeds)
    add('--maps', nargs='+', metavar='NAME', help='only these maps')
    add('--targets', nargs='+', metavar='NAME', help='only these targets of the arm')
    add_where = command.add_mutually_exclusive_group().add_argument
    add_where(
        '--scheduler',
        metavar='tcp://HOST:PORT',
        help='address of a dask scheduler (default: a local cluster)',
    )
    add_where('--serial', action='store_true', help='run all in this process, one by one')
    return command
