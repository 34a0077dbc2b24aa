# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Work spread over the cores of one machine, or of many, by dask.distributed, and its results."""

# mypy: disable-error-code="import-untyped,import-not-found,no-untyped-call"

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
import logging
import sys
import tempfile
import time
from typing import Any

from distributed import Client, TimeoutError as TooLate
from distributed.client import FutureCancelledError
from distributed.scheduler import KilledWorker
from rrth_planner.model.errors import RrthError
from tqdm import tqdm

# Tasks of each worker that are handed out: enough that none waits while one of them takes long,
# and few enough that what is handed out stays small.
TASKS_AHEAD = 16
# So long a scheduler may be without workers [s].
LONGEST_IDLE = 30.0
# Results are saved at least so often [s], what an interruption may lose, unless that takes longer
# than this share of the time.
SAVE_PERIOD, SAVE_SHARE = 20.0, 0.05


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

    Raises
    ------
    RrthError
        There is no such scheduler, or it has no workers.

    """
    with tempfile.TemporaryDirectory(prefix='rrth-campaign-') as folder:
        local = {
            'n_workers': n_workers,
            'threads_per_worker': 1,
            'processes': True,
            'dashboard_address': '127.0.0.1:0',
            'local_directory': folder,
            'silence_logs': logging.ERROR,
        }
        with Client(**local) if scheduler is None else _client_of(scheduler) as client:
            yield client


def _client_of(scheduler: str) -> Any:
    """Return a client of a scheduler that has workers, or raise RrthError."""
    try:
        client = Client(scheduler)
    except (OSError, ValueError) as problem:
        raise RrthError(
            f'scheduler {scheduler}: {problem}; expected the address of a running dask scheduler, '
            'tcp://HOST:PORT'
        ) from problem
    try:
        client.wait_for_workers(1, timeout=LONGEST_IDLE)
    except TooLate as problem:
        client.close()
        raise RrthError(
            f'scheduler {scheduler}: no worker in {LONGEST_IDLE:g} s, expected at least one'
        ) from problem
    return client


def in_order(client: Any, function: Callable[[Any], Any], batches: Iterable[Any]) -> Iterator[Any]:
    """
    Yield a function's result of each batch in their order; the workers compute some ahead.

    Raise RrthError where the cluster ends, or a batch ends one worker after another.
    """
    ahead = TASKS_AHEAD * max(1, sum(client.nthreads().values()))
    futures: deque[Any] = deque()
    for batch in batches:
        # A run on another machine, or of an edited source, is not the same: never pure.
        futures.append(client.submit(function, batch, pure=False))
        if len(futures) >= ahead:
            yield _result(futures.popleft())
    while futures:
        yield _result(futures.popleft())


def on_each_worker(client: Any, function: Callable[[Any], Any], argument: Any) -> dict[str, Any]:
    """
    Return a function's result on each worker, by its address.

    Raise RrthError where one has not this package, or has several threads, of which planning, as
    most of Python, makes no use.
    """
    for address, n_threads in client.nthreads().items():
        if n_threads != 1:
            raise RrthError(
                f'worker {address}: {n_threads} threads, expected 1: dask worker --nthreads 1 '
                '--nworkers N'
            )
    futures = {
        address: client.submit(function, argument, workers=[address], pure=False)
        for address in client.nthreads()
    }
    try:
        return {address: _result(future) for address, future in futures.items()}
    except (ImportError, AttributeError) as problem:
        raise RrthError(
            f'workers: {problem}; expected the same version of this package there'
        ) from problem


def collect(
    results: Iterable[Any],
    save: Callable[[list[Any]], None],
    *,
    total: int,
    label: str,
    unit: str,
    initial: int = 0,
) -> None:
    """
    Save results as they come, every so often and at the end; a bar shows how far they are.

    Parameters
    ----------
    results : iterable of sized
        The length of each counts for the bar.
    save : callable
        Gets a list of those that came since.
    total, initial : int
        How many there will be, and were before.

    """
    lots: list[Any] = []
    saved, period = time.monotonic(), SAVE_PERIOD
    bar = tqdm(
        total=total, initial=initial, desc=label, unit=unit, file=sys.stderr, mininterval=1.0
    )
    with bar as progress:
        try:
            for result in results:
                lots.append(result)
                progress.update(len(result))
                begin = time.monotonic()
                if begin - saved > period:
                    # Interrupted as it is saved, a lot shall not be saved twice.
                    lot, lots = lots, []
                    save(lot)
                    saved = time.monotonic()
                    period = max(SAVE_PERIOD, (saved - begin) / SAVE_SHARE)
        finally:
            # Also when interrupted.
            if lots:
                save(lots)


def _result(future: Any) -> Any:
    try:
        return future.result()
    except (KilledWorker, FutureCancelledError) as problem:
        raise RrthError(
            f'cluster: {problem}; expected a scheduler and workers that run to the end'
        ) from problem
