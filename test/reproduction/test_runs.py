# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Campaigns: each run once, nothing lost by an interruption, the same rows however they come."""

from dataclasses import replace

import numpy as np
import pytest

pa = pytest.importorskip('pyarrow')
pytest.importorskip('tqdm')
pytest.importorskip('distributed')

import pyarrow.parquet as pq
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.cluster import cluster_client
from rrth_planner.io.map_file import load_map
from rrth_planner.model.errors import RrthError
from rrth_planner.planning.visibility_graph import shortest_path
from rrth_planner.reproduction import cluster
from rrth_planner.reproduction.claims.arm import is_the_papers
from rrth_planner.reproduction.claims.path_club import both_ways_shares
from rrth_planner.reproduction.cluster import run_campaign
from rrth_planner.reproduction.experiments import (
    ALGORITHMS,
    PRINTED,
    RRT,
    RRT_H,
    RRT_STAR,
    SCATTERED,
    SCATTERED_CLUB,
    SMART,
    TWO_WAYS,
)
from rrth_planner.reproduction.problems import load_problem
from rrth_planner.reproduction.row_store import append_rows, finished_keys, read_rows
from rrth_planner.reproduction.run import execute, Run
from rrth_planner.reproduction.statistics import histories_on, Rows

# Columns that differ from run to run whatever the seed.
CLOCK = ('time_first', 'time_total', 'history_time', 'timing')


def runs(n=3, names=(RRT, RRT_H)):
    """Return n runs of some planners on the C."""
    return [
        Run(problem='c_shape', algorithm=name, options=ALGORITHMS[name], seed=seed)
        for name in names
        for seed in range(n)
    ]


def without_clock(table):
    """Return the rows of a table in the order of their keys, without what the clock says."""
    rows = sorted(table.to_pylist(), key=lambda row: row['key'])
    return [{name: row[name] for name in row if name not in CLOCK} for row in rows]


def test_a_row_tells_what_was_asked_and_what_came_out():
    exact = shortest_path(load_map('c_shape'))[0]
    rrt, rrt_h, star = (execute(run, 'serial') for run in runs(1, (RRT, RRT_H, RRT_STAR)))
    assert rrt['cost_first'] == rrt['cost_final'] == rrt_h['cost_first']
    assert rrt['draws_total'] == rrt_h['draws_first']
    assert exact - 1e-6 <= rrt_h['cost_final'] < 1.001 * exact
    assert star['draws_first'] < star['draws_total'] == 2000
    assert star['history_cost'] == sorted(star['history_cost'], reverse=True)
    assert star['history_cost'][-1] == pytest.approx(star['cost_final'])
    assert all(row['is_valid'] for row in (rrt, rrt_h, star))
    assert all(row['python_version'] and row['numba_version'] for row in (rrt, rrt_h, star))


def test_the_first_cost_of_smart_is_of_its_path_as_it_shortened_it():
    star, smart = (execute(run, 'serial') for run in runs(1, (RRT_STAR, SMART)))
    # The same growth up to the first path.
    assert smart['draws_first'] == star['draws_first']
    assert smart['cost_first'] < 0.97 * star['cost_first']


def test_growths_after_each_other_leave_a_row_of_the_ways_that_they_took():
    rows = Rows(
        [
            execute(Run(problem=TWO_WAYS, algorithm=name, options=options, seed=seed), 'cluster')
            for name, options in SCATTERED.items()
            for seed in range(25)
        ]
    )
    assert all(len(row['ways']) == 8 and row['is_valid'] for row in rows.rows)
    assert all(row['cost_final'] <= row['cost_first'] for row in rows.rows)
    club, plain = (both_ways_shares(rows, name, 25) for name in SCATTERED)
    for shares in (club, plain):
        assert len(shares) == 8
        assert shares[0] == 0.0
        assert shares == sorted(shares)
    # Without the club a growth hardly ever takes the worse way.
    assert club[3] > 0.7
    assert plain[3] < 0.4


def test_growths_after_each_other_are_rows_that_are_made_once(tmp_path):
    path = tmp_path / 'rows.parquet'
    asked = [
        Run(problem=TWO_WAYS, algorithm=name, options=options, seed=seed)
        for name, options in SCATTERED.items()
        for seed in range(2)
    ]
    assert run_campaign(asked, path) == 4
    assert run_campaign(asked, path) == 0
    kept = Rows(read_rows(path).to_pylist())
    assert [row['ways'] for row in kept.where(algorithm=SCATTERED_CLUB).rows] == [
        execute(run, 'serial')['ways'] for run in asked[:2]
    ]


def test_the_arm_is_that_of_table_1_and_no_other_passes_for_it():
    arm = load_arm()
    assert is_the_papers(arm)
    # What the ray's d is, the table leaves open.
    for i in range(arm.dh.size - 1):
        dh = arm.dh.copy()
        dh.flat[i] += 1e-3
        assert not is_the_papers(replace(arm, dh=dh))
    assert not is_the_papers(replace(arm, bounds=0.99 * arm.bounds))


def test_the_judge_of_a_map_finds_what_the_printed_steps_break():
    row = execute(runs(1, (PRINTED,))[0], 'serial')
    assert row['is_valid'] is False


def test_the_judge_of_the_arm_rejects_a_motion_through_the_wearer():
    named = load_problem('arm/front')
    q_start, q_goal = named.problem.q_start, named.problem.q_goals[0]
    assert named.is_path_valid(np.array([q_start, q_start]))
    assert not named.is_path_valid(np.array([q_start, q_goal]))


@pytest.mark.parametrize(
    ('name', 'collision'),
    [('arm/nowhere', 'certified'), ('no_map', 'certified'), ('c_shape', 'guessed:1')],
)
def test_an_unknown_problem_or_mode_is_rejected(name, collision):
    with pytest.raises(RrthError, match='expected'):
        load_problem(name, collision)


def test_what_is_asked_for_again_is_not_done_again(tmp_path):
    path = tmp_path / 'rows.parquet'
    assert run_campaign(runs(2), path) == 4
    before = path.read_bytes()
    assert run_campaign(runs(2), path) == 0
    assert path.read_bytes() == before
    assert run_campaign(runs(3), path) == 2
    assert len(read_rows(path)) == 6


def test_every_part_of_a_run_counts_for_whether_it_is_another_one():
    run = runs(1)[0]
    others = [
        replace(run, seed=1),
        replace(run, problem='spiral'),
        replace(run, algorithm='mine'),
        replace(run, collision='sampled:1.0'),
        replace(run, options=replace(run.options, step_size=9.0)),
        replace(run, options=ALGORITHMS[RRT_H]),
    ]
    assert len({other.key() for other in [run, *others]}) == 7
    assert runs(1)[0].key() == run.key()


def test_an_interruption_loses_no_row_that_was_made(tmp_path, monkeypatch):
    path = tmp_path / 'rows.parquet'
    made = []

    def interrupted(run, timing):
        if len(made) == 3:
            raise KeyboardInterrupt
        made.append(run.key())
        return execute(run, timing)

    monkeypatch.setattr(cluster, 'execute', interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_campaign(runs(3), path)
    assert finished_keys(path) == set(made)
    monkeypatch.undo()
    assert run_campaign(runs(3), path) == 3
    assert len(read_rows(path)) == 6


def test_a_row_that_is_there_already_counts_once(tmp_path):
    path = tmp_path / 'rows.parquet'
    rows = [execute(run, 'serial') for run in runs(1)]
    pq.write_table(pa.Table.from_pylist(rows[:1], schema=read_rows(path).schema), path)
    append_rows(path, rows)
    assert len(read_rows(path)) == 2
    assert run_campaign(runs(1), path) == 0
    assert len(pq.read_table(path)) == 2


def test_a_write_that_fails_leaves_the_rows_as_they_were(tmp_path, monkeypatch):
    path = tmp_path / 'rows.parquet'
    run_campaign(runs(1), path)
    before = path.read_bytes()

    def full(table, target, **_):
        target.write_bytes(before[:100])
        raise OSError('no space left')

    monkeypatch.setattr(pq, 'write_table', full)
    with pytest.raises(OSError, match='no space left'):
        run_campaign(runs(2), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_of_something_else_is_rejected_and_kept(tmp_path):
    path = tmp_path / 'rows.parquet'
    path.write_bytes(b'my letters')
    with pytest.raises(RrthError, match='expected the rows of a campaign'):
        run_campaign(runs(1), path)
    assert path.read_bytes() == b'my letters'


def test_pandas_and_polars_read_the_file(tmp_path):
    path = tmp_path / 'rows.parquet'
    run_campaign(runs(2), path)
    pandas = pytest.importorskip('pandas')
    frame = pandas.read_parquet(path)
    assert frame.groupby('algorithm')['cost_final'].median().loc[RRT_H] < 114.0
    polars = pytest.importorskip('polars')
    assert polars.read_parquet(path).shape == frame.shape


def test_the_cost_of_a_run_falls_from_nothing_to_its_last(tmp_path):
    path = tmp_path / 'rows.parquet'
    run_campaign(runs(2, (RRT_STAR,)), path)
    table = read_rows(path)
    costs = histories_on(Rows(table.to_pylist()), 'history_draws', np.array([0.0, 2000.0]))
    assert np.isinf(costs[:, 0]).all()
    np.testing.assert_allclose(costs[:, 1], table['cost_final'].to_numpy())


def test_a_cluster_brings_the_rows_of_a_serial_campaign(tmp_path):
    asked = runs(4, (RRT, RRT_H, RRT_STAR))
    serial, spread = tmp_path / 'serial.parquet', tmp_path / 'spread.parquet'
    run_campaign(asked, serial)
    with cluster_client(n_workers=2) as client:
        assert len(client.nthreads()) == 2
        assert run_campaign(asked, spread, client=client) == len(asked)
        assert run_campaign(asked, spread, client=client) == 0
        # The same by address, as a cluster of other machines is named.
        with cluster_client(client.scheduler.address) as other:
            assert run_campaign(runs(5), spread, client=other) == 2
    keys = {run.key() for run in asked}
    rows = without_clock(read_rows(spread))
    assert [row for row in rows if row['key'] in keys] == without_clock(read_rows(serial))
    # Where times matter, what was done beside other runs is done again, and then counts.
    assert run_campaign(asked[:2], spread, timed=True) == 2
    assert run_campaign(asked[:2], spread, timed=True) == 0
    assert without_clock(read_rows(spread)) == rows
