# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Runs spread over cores or machines by dask.distributed, or done one after another.

Times of concurrent runs are noisy: tables take times from a serial pass, and results over many
seeds from the cluster.
"""

# mypy: disable-error-code="import-untyped,import-not-found,no-untyped-call"

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import logging
from pathlib import Path
import sys
import tempfile
import time
from typing import Any

from rrth_planner.reproduction.row_store import append_rows, CLUSTER, finished_keys, SERIAL
from rrth_planner.reproduction.run import execute, Row, Run
from tqdm import tqdm

# Runs in a task: tasks must take far longer than the millisecond or so that dask spends on one.
BATCH = 10
# Rows are saved at least so often: what an interruption may lose [s].
SAVE_PERIOD = 20.0


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
        Where to run, see `cluster_client`; None: here, one after another.
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
    rows: list[Row] = []
    saved = time.monotonic()
    with tqdm(
        total=len(pending), desc=label, unit='run', file=sys.stderr, mininterval=1.0
    ) as progress:
        try:
            for batch in results:
                rows.extend(batch)
                progress.update(len(batch))
                if time.monotonic() - saved > SAVE_PERIOD:
                    append_rows(path, rows)
                    rows, saved = [], time.monotonic()
        finally:
            # Also when interrupted.
            if rows:
                append_rows(path, rows)
    return len(pending)


@contextmanager
def cluster_client(scheduler: str | None = None, n_workers: int | None = None) -> Iterator[Any]:
    """
    Open a client of a scheduler, or of a cluster of this machine's own cores.

    Parameters
    ----------
    scheduler : str
        As `tcp://host:8786`; None: a local cluster, one thread a process.
    n_workers : int
        Processes of the local cluster; None: as many as cores.

    """
    from distributed import Client

    with tempfile.TemporaryDirectory(prefix='rrth-campaign-') as folder:
        local = {
            'n_workers': n_workers,
            'threads_per_worker': 1,
            'processes': True,
            'dashboard_address': '127.0.0.1:0',
            'local_directory': folder,
            'silence_logs': logging.ERROR,
        }
        with Client(**local) if scheduler is None else Client(scheduler) as client:
            yield client


def run_batch(runs: Sequence[Run]) -> list[Row]:
    """Return the rows of some runs; what a worker does."""
    return [execute(run, CLUSTER) for run in runs]


def _on_cluster(runs: Sequence[Run], client: Any) -> Iterator[list[Row]]:
    from distributed import as_completed

    # Fewer runs a task when there are few, so that no worker waits for the last one.
    n_threads = max(1, sum(client.nthreads().values()))
    size = max(1, min(BATCH, len(runs) // (4 * n_threads)))
    batches = [runs[i : i + size] for i in range(0, len(runs), size)]
    # A run on another machine, or of an edited source, is not the same: never pure.
    futures = client.map(run_batch, batches, pure=False)
    for future in as_completed(futures):
        yield future.result()
        future.release()
