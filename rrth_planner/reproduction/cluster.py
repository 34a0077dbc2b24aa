# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Runs spread over cores or machines by dask.distributed, or done one after another.

Times of concurrent runs are noisy: tables take times from a serial pass, and results over many
seeds from the cluster.
"""

# mypy: disable-error-code="import-untyped,import-not-found,no-untyped-call"

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rrth_planner.io.cluster import collect, in_order
from rrth_planner.reproduction.row_store import append_rows, CLUSTER, finished_keys, SERIAL
from rrth_planner.reproduction.run import execute, Row, Run

# Runs in a task: tasks must take far longer than the millisecond or so that dask spends on one.
BATCH = 10


def run_campaign(
    runs: Sequence[Run],
    path: Path,
    *,
    client: Any = None,
    timed: bool = False,
    label: str = 'runs',
) -> int:
    """
    Do the runs whose rows are not in a file yet; return how many there were.

    Parameters
    ----------
    path : Path
        The Parquet file of the campaign.
    client : distributed.Client
        Where to run, see `io.cluster`; None: here, one after another.
    timed : bool
        Times matter: what was done beside other runs is done again.
    label : str
        What the progress bar calls them.

    """
    done = finished_keys(path, timed=timed)
    pending = list({run.key(): run for run in runs if run.key() not in done}.values())
    if not pending:
        return 0
    one_by_one = ([execute(run, SERIAL)] for run in pending)
    results = one_by_one if client is None else _on_cluster(pending, client)
    collect(
        results,
        lambda lots: append_rows(path, [row for rows in lots for row in rows]),
        total=len(pending),
        label=label,
        unit='run',
    )
    return len(pending)


def run_batch(runs: Sequence[Run]) -> list[Row]:
    """Return the rows of some runs; what a worker does."""
    return [execute(run, CLUSTER) for run in runs]


def _on_cluster(runs: Sequence[Run], client: Any) -> Iterator[list[Row]]:
    # Fewer runs a task when there are few, so that no worker waits for the last one.
    n_threads = max(1, sum(client.nthreads().values()))
    size = max(1, min(BATCH, len(runs) // (4 * n_threads)))
    batches = [runs[i : i + size] for i in range(0, len(runs), size)]
    return in_order(client, run_batch, batches)
