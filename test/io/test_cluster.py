# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Work of a cluster: results in order, nothing lost by an interruption, sentences for its ends."""

from itertools import islice
import os
import time

import pytest

distributed = pytest.importorskip('distributed')
pytest.importorskip('tqdm')

import dask
from rrth_planner.io import cluster
from rrth_planner.io.cluster import (
    cluster_client,
    collect,
    in_order,
    on_each_worker,
    TASKS_AHEAD,
)
from rrth_planner.model.errors import RrthError


def squared(number):
    """Return a square, the sooner the greater it is."""
    time.sleep(0.005 * (number % 3 == 0))
    return number**2


def end_of_worker(_):
    """End the process."""
    os._exit(1)


def missing(_):
    """Fail as a worker without the package does."""
    raise ModuleNotFoundError("No module named 'rrth_planner'")


@pytest.fixture(scope='module', name='client')
def _client():
    """Give two workers in this process."""
    with distributed.Client(
        processes=False, n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as client:
        yield client


def test_results_come_in_order_and_few_are_handed_out_ahead(client):
    handed, n = [], 100 + 2 * TASKS_AHEAD

    def batches():
        for number in range(n):
            handed.append(number)
            yield number

    results = in_order(client, squared, batches())
    assert list(islice(results, 5)) == [0, 1, 4, 9, 16]
    assert len(handed) <= 5 + TASKS_AHEAD * 2
    assert list(results) == [number**2 for number in range(5, n)]


def test_each_worker_answers(client):
    found = on_each_worker(client, squared, 3)
    assert set(found) == set(client.nthreads())
    assert set(found.values()) == {9}
    with pytest.raises(
        RrthError, match="No module named 'rrth_planner'; expected the same version"
    ):
        on_each_worker(client, missing, 0)


def test_workers_with_several_threads_are_rejected():
    with (
        distributed.Client(
            processes=False, n_workers=1, threads_per_worker=2, dashboard_address=None
        ) as client,
        pytest.raises(RrthError, match='2 threads, expected 1: dask worker --nthreads 1'),
    ):
        on_each_worker(client, squared, 3)


def test_a_task_that_ends_its_workers_is_a_sentence():
    with (
        dask.config.set({'distributed.scheduler.allowed-failures': 0}),
        cluster_client(n_workers=1) as client,
        pytest.raises(RrthError, match='^cluster: .*; expected a scheduler and workers that run'),
    ):
        list(in_order(client, end_of_worker, [1]))


def test_no_scheduler_and_no_worker_are_sentences(monkeypatch):
    monkeypatch.setattr(cluster, 'LONGEST_IDLE', 0.3)
    with (
        dask.config.set({'distributed.comm.timeouts.connect': '1s'}),
        pytest.raises(RrthError, match='^scheduler tcp://127.0.0.1:1: .*; expected the address'),
        cluster_client('tcp://127.0.0.1:1'),
    ):
        pass
    with (
        pytest.raises(RrthError, match='^scheduler no address: .*expected the address'),
        cluster_client('no address'),
    ):
        pass
    with (
        distributed.LocalCluster(processes=False, n_workers=0, dashboard_address=None) as empty,
        pytest.raises(RrthError, match='no worker in 0.3 s, expected at least one'),
        cluster_client(empty.scheduler_address),
    ):
        pass


def test_an_interruption_saves_what_came(capsys):
    kept = []

    def results():
        yield from ([1], [2, 3], [4])
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        collect(results(), kept.append, total=9, initial=2, label='numbers', unit='number')
    assert kept == [[[1], [2, 3], [4]]]
    assert 'numbers:  67%' in capsys.readouterr().err


def test_results_are_saved_every_so_often(monkeypatch):
    monkeypatch.setattr(cluster, 'SAVE_PERIOD', -1.0)
    monkeypatch.setattr(cluster, 'SAVE_SHARE', float('inf'))
    kept = []
    collect(iter([[1], [2]]), kept.append, total=2, label='numbers', unit='number')
    assert kept == [[[1]], [[2]]]


def test_what_is_being_saved_at_an_interruption_is_not_saved_twice(monkeypatch):
    monkeypatch.setattr(cluster, 'SAVE_PERIOD', -1.0)
    kept = []

    def save(lots):
        kept.append(lots)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        collect(iter([[1], [2]]), save, total=2, label='numbers', unit='number')
    assert kept == [[[1]]]
