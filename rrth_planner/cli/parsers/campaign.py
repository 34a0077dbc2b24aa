# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `campaign`."""

import argparse
from pathlib import Path

from rrth_planner.cli.numbers import integer, number, number_of_workers
from rrth_planner.cli.program import add_files, BODY_HELP, command_parser

DESCRIPTION = """\
Plan a motion for each row of one or more files of queries, on all cores of this machine or on a
dask cluster, and write one Parquet file with a row for each. Plans are those of `plan`: the same
query and seed have the same result, whoever plans it. Needs no ROS.
"""
EPILOG = """\
Queries are .csv or .parquet files; all of a campaign have the same columns:
  target_x target_y target_z   target of the pointing ray in the base frame [m]
  start_1 ... start_n          start configuration [rad or m] (as of `plan`)
  arm, body                    files of the arm and the wearer, from the folder of the queries
                               (--arm, --body)
  seed                         random seed (--seed; without, the number of the row, from 0)
Only the target is required; where a value is missing the default in parentheses counts. Other
columns are kept as they are.

The output has the columns of the queries, the seed that was used, digests of the files of arm and
wearer, and the figures of the plan, named as by `plan --json`; end: the joint positions there
[rad or m]. status is `solved`, the reason why there is no motion, `invalid query`, or `error`;
sentence says more. An interrupted campaign, started again, continues.

exit codes: 0  all queries are planned, with or without a motion
            2  wrong usage or input, or a cluster that ended: the error on standard error
          130  interrupted; what was planned is kept

example:    %(prog)s queries.parquet --output plans.parquet
            %(prog)s first.csv second.csv --output plans.parquet --scheduler tcp://10.0.0.1:8786
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = command_parser('campaign', DESCRIPTION, EPILOG)
    add = command.add_argument
    add('queries', type=Path, nargs='+', metavar='QUERIES', help='.csv or .parquet')
    output = 'Parquet file of the plans; an existing one is continued'
    add('--output', type=Path, required=True, metavar='FILE', help=output)
    add_files(
        command,
        arm='the arm of queries that name none (config/arm.yaml)',
        body=BODY_HELP,
        settings='parameters of the node; defaults are those of config/planner.yaml',
    )
    add('--margin', type=number('m'), metavar='M', help='clearance demanded from every box [m]')
    seed = 'random seed of queries that have none; -1: the number of the row'
    add('--seed', type=integer, metavar='N', help=seed)
    add_where = command.add_mutually_exclusive_group().add_argument
    add_where(
        '--workers',
        type=number_of_workers,
        metavar='N',
        help='processes on this machine (its cores)',
    )
    add_where('--scheduler', metavar='tcp://HOST:PORT', help='address of a dask scheduler')
    return command
