# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plan many motions from files of queries on a cluster, to one Parquet file."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import chain
import sys
import time
from typing import Any, TYPE_CHECKING

import numpy as np
from rrth_planner.cli.parsers.campaign import parser
from rrth_planner.cli.program import interrupt_on_signals, INTERRUPTED, run, say
from rrth_planner.io.extras import require
from rrth_planner.model.errors import OptionsError, RecordError, RrthError

if TYPE_CHECKING:
    from rrth_planner.cli.query_batch import QueryBatch

LIBRARIES = ('distributed', 'pyarrow', 'tqdm')
WRONG = 2
# Queries in a task: it must take far longer than the millisecond or so that dask spends on one;
# and tasks of a campaign, where it has so many queries: enough to keep many workers busy.
MOST_QUERIES, FEWEST_TASKS = 64, 256


def main(arguments: Sequence[str] | None = None) -> int:
    """Plan all queries, print how many have which status, and return the exit code."""
    options = parser().parse_args(arguments)
    return run('campaign', lambda: _campaign(options), WRONG)


def _campaign(options: argparse.Namespace) -> int:
    require('campaign', *LIBRARIES)
    from rrth_planner.cli.campaign_file import finished, plan_schema, statuses, unfinished
    from rrth_planner.cli.file_question import question_of, SEEDS, settings_of
    from rrth_planner.cli.query_batch import read_batches, RESULTS
    from rrth_planner.io.arm_file import load_arm
    from rrth_planner.io.incident import versions
    from rrth_planner.io.query_file import other_columns, query_schema
    from rrth_planner.io.settings import load_values
    from rrth_planner.io.wearer_file import load_body

    if options.output.suffix.lower() != '.parquet':
        raise OptionsError(f'--output {options.output}: expected a name that ends in .parquet')
    arm, scene = load_arm(options.arm), load_body(options.body)
    settings = settings_of(arm, options.settings, margin=options.margin, seed=options.seed)
    if not -1 <= settings.seed < SEEDS:
        raise OptionsError(f'seed: {settings.seed}, expected -1 to {SEEDS - 1} [-]')
    # What would be wrong with every query is said at once.
    question_of(arm, scene, arm.bounds.mean(axis=0), np.ones(3), settings, 0)
    values = load_values(arm.dof, options.settings) | {'margin': settings.margin}
    queries, n_queries = query_schema(options.queries, RESULTS.names)
    if not n_queries:
        raise RecordError(f'{", ".join(map(str, options.queries))}: no query, expected some')
    if others := other_columns(queries.names):
        say('campaign', f'columns that mean nothing to the planner are kept: {", ".join(others)}')
    software = {name: value for name, value in versions().items() if name != 'platform'}
    schema = plan_schema(queries, {'settings': values, 'versions': software})
    done = finished(options.output, schema)
    batches = read_batches(
        options.queries,
        max(1, min(MOST_QUERIES, n_queries // FEWEST_TASKS)),
        arm=str(options.arm or ''),
        body=str(options.body or ''),
        seed=None if settings.seed == -1 else settings.seed,
        settings=values,
    )
    rest = unfinished(options.output, batches, done)
    speed = ''
    if len(done) < n_queries:
        try:
            speed = _plan(options, rest, schema, n_queries, len(done))
        except KeyboardInterrupt:
            say('campaign', f'interrupted; the next start continues from {options.output}')
            return INTERRUPTED
    print(f'{"written":20}{options.output}, {n_queries} plans')
    for status, count in statuses(options.output).most_common():
        print(f'{status:20}{count}')
    print(f'{"this time":20}{speed or "nothing was left to be planned"}')
    return 0


def _plan(
    options: argparse.Namespace,
    batches: Iterator['QueryBatch'],
    schema: Any,
    n_queries: int,
    n_done: int,
) -> str:
    """Plan what is left, and return how fast that was, in words."""
    from rrth_planner.cli.campaign_file import append_plans
    from rrth_planner.cli.query_batch import planned, prepare
    from rrth_planner.io.cluster import cluster_client, collect, in_order, on_each_worker

    if options.scheduler is None:
        # Once for all workers, which have the same cores.
        from rrth_planner.kernels.precompile import prepare_kernels

        prepare_kernels(partial(say, 'campaign'))
    interrupt_on_signals()
    with cluster_client(options.scheduler, options.workers) as client:
        first = next(batches)
        _check_workers(on_each_worker(client, prepare, first))
        begin = time.monotonic()
        collect(
            in_order(client, planned, chain([first], batches)),
            lambda tables: append_plans(options.output, tables, schema),
            total=n_queries,
            initial=n_done,
            label='plans',
            unit='plan',
        )
        seconds, n = time.monotonic() - begin, len(client.nthreads())
    speed = (n_queries - n_done) / seconds
    return (
        f'{n_queries - n_done} plans in {seconds:.1f} s on {n} worker{"s"[: n > 1]}: '
        f'{speed:.1f} a second, {speed / max(1, n):.1f} a second and core'
    )


def _check_workers(found: Mapping[str, Mapping[str, str]]) -> None:
    """Raise RrthError unless all workers have the versions of this process."""
    from rrth_planner.io.incident import versions

    for address, theirs in found.items():
        for name, ours in versions().items():
            if name != 'platform' and theirs.get(name) != ours:
                raise RrthError(
                    f'worker {address}: {name} {theirs.get(name)}, expected {ours}, as here'
                )


if __name__ == '__main__':
    sys.exit(main())
