# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The benchmarks sum up rows as they should; what is fast is not for a test to say."""

import json
from pathlib import Path
import subprocess
import sys

import pytest

pytest.importorskip('pyarrow')
pytest.importorskip('tqdm')
pytest.importorskip('psutil')
pytest.importorskip('matplotlib')

from benchmarks import __main__ as starter
from benchmarks.common import dense_checker, numpy_checker, random_draws
from benchmarks.common.queries import load_query, MAPS, QUERIES, table_1_arm, wearer, wearer_world
from benchmarks.common.rows import read_rows, write_rows
from benchmarks.common.size import Extent, QUICK
from benchmarks.common.task import figure_row, origin, path_row
from benchmarks.planners import figures, harness, machine_speed, measures, table
from benchmarks.planners.main import main
from benchmarks.planners.report import report
from benchmarks.planners.table import peer_lines, survival_lines, TARGET_HEADER, target_lines
from benchmarks.planners.targets import TARGETS
from benchmarks.real_arms.edges import checked_pairs
import numpy as np
import psutil
from rrth_planner.collision.reference_checker import bar_distances, bar_ends_at
from rrth_planner.model.errors import RrthError
from rrth_planner.model.scene import Scene
from rrth_planner.planning.visibility_graph import shortest_path
from worlds import capsule_arm

NAMES = (*MAPS, *QUERIES)


def run_row(seed, cost, *, planner='RRT-H', source='ours', problem='lap', is_valid=True):
    """Return the row of a run that is 10 % over the best after 1 ms, at `cost` after 2 ms."""
    return path_row(
        problem=problem,
        planner=planner,
        source=source,
        seed=seed,
        best_cost=1.0,
        is_valid=is_valid,
        time_total=0.01,
        time_first=0.001,
        cost_first=1.1,
        cost_final=cost,
        history=((0.001, 1.1), (0.002, cost)),
    )


def stored(tmp_path, rows):
    """Return rows as they come out of a file."""
    common = {'section': 'plans', 'task': 'some', 'extent': '', **origin()}
    write_rows(tmp_path / 'rows.parquet', [{**row, **common} for row in rows])
    return read_rows(tmp_path / 'rows.parquet')


def line_of(rows, what, statistic, **reasons):
    """Return a line of the table by its first two cells, as a mapping."""
    lines = target_lines(rows, **reasons)
    (found,) = [line for line in lines if line[:2] == [what, statistic]]
    return dict(zip(TARGET_HEADER, found, strict=True))


def test_every_target_has_a_key_of_its_own():
    # The full query has two percentiles of time and one of the gap.
    assert len({target.key for target in TARGETS}) == len(TARGETS)


def test_the_time_within_a_factor_is_that_of_the_first_improvement_that_gets_there():
    row = run_row(0, 1.005)
    assert measures.time_within(row, 1.2) == pytest.approx(1.0)
    assert measures.time_within(row, 1.01) == pytest.approx(2.0)
    assert measures.time_within(row, 1.001) == np.inf


def test_a_percentile_that_falls_on_runs_which_did_not_get_there_is_infinite():
    values = np.array([1.0, 2.0, np.inf])
    assert measures.percentile(values, 50) == 2.0
    assert measures.percentile(values, 95) == np.inf
    assert measures.percentile(np.array([1.0, 2.0]), 50) == pytest.approx(1.5)


def test_targets_are_met_missed_or_not_measured(tmp_path):
    rows = stored(
        tmp_path,
        [
            *(run_row(seed, 1.005 if seed < 19 else 1.05) for seed in range(20)),
            *(figure_row('configuration, single', v, 'ns', seed=v) for v in (95, 100, 105)),
            figure_row('certified edges that collide', 0, ''),
        ],
    )
    near = 'runs within 1 % of the best known, lap'
    assert line_of(rows, near, 'mean')['met'] == 'yes'
    assert line_of(rows, near, 'mean')['runs that got there'] == '19 of 20'
    assert line_of(rows, 'within 1 % of the best known, lap', 'p95')['measured'] == 'not reached'
    key = 'one configuration, p50'
    missed = line_of(rows, 'one configuration', 'p50', reasons={key: 'It is what it is.'})
    assert (missed['measured'], missed['met']) == ('100 ns', '**no**')
    assert missed['why not'] == 'It is what it is.'
    assert line_of(rows, 'first path, lap', 'p50')['measured'] == 'not measured'
    assert line_of(rows, 'certified edges that collide at 0.0005 rad', 'sum')['met'] == 'yes'


def test_the_peers_of_the_same_rows_stand_beside_ours(tmp_path):
    peers = [run_row(s, 1.05, source='ompl', planner='AORRTC', is_valid=s > 0) for s in range(4)]
    rows = stored(tmp_path, [run_row(0, 1.0), *peers])
    assert 'AORRTC, ompl wheel' in line_of(rows, 'first path, lap', 'p50')['best peer, median']
    assert ['AORRTC', 'ompl wheel', '–', '3 of 4 (75.0 %)'] in survival_lines(rows)
    assert any(line[:3] == ['lap', 'RRT-H', 'ours'] for line in peer_lines(rows))
    text = report(rows, 'python -m benchmarks', 'a machine', {'A picture': 'a.png'})
    assert 'do not edit' in text
    assert '![A picture](a.png)' in text
    assert ' nan' not in text and ' inf' not in text


def test_a_picture_is_drawn_of_each_family(tmp_path):
    rows = stored(tmp_path, [run_row(seed, 1.01) for seed in range(3)])
    names = figures.draw_figures(rows, tmp_path / 'pictures')
    assert all((tmp_path / 'pictures' / name).stat().st_size > 10_000 for name in names.values())


@pytest.mark.parametrize('name', NAMES)
def test_the_problems_are_valid_and_their_best_cost_can_be(name):
    query = load_query(name)
    q_start, q_goal = query.problem.q_start, query.problem.q_goals[0]
    assert query.best_cost >= np.linalg.norm(q_goal - q_start)
    # None of them is solved by a straight line, and the reference checker finds that.
    assert not query.problem.world.is_edge_valid(q_start, q_goal)
    assert not query.is_solved_by(np.array([q_start, q_goal]))
    assert query.is_path_free(q_start[None].repeat(2, axis=0))
    assert any(row['problem'] == name for row in harness.published()['rows'])


def test_the_shortest_path_on_a_map_passes():
    from benchmarks.common.queries import load_map

    assert numpy_checker.is_map_path_free(load_map('fence'), shortest_path(load_map('fence'))[1])


def test_the_dense_check_agrees_with_the_reference_checker():
    rng, world = np.random.default_rng(1), wearer_world()
    starts = rng.uniform(*world.bounds, (60, 4))
    edges = random_draws.random_edges(rng, world, starts, rng.uniform(0.02, 0.3, 60))
    flags = dense_checker.colliding_edges(
        table_1_arm(), wearer(), world.ray_length, 0.0, edges, numpy_checker.SPACING
    )
    assert 0 < flags.sum() < len(flags)
    for is_colliding, *edge in zip(flags, *edges, strict=True):
        is_free = numpy_checker.is_arm_path_free(
            table_1_arm(), wearer(), np.array(edge), world.ray_length, 0.0
        )
        assert is_free is not bool(is_colliding)


def test_the_dense_check_of_capsules_agrees_with_the_reference_checker():
    rng, nothing, ray = np.random.default_rng(2), Scene(()), 0.4
    arm = capsule_arm(np.random.default_rng(0))
    pairs = checked_pairs(rng, arm, ray)
    bars = dense_checker.bars_in_frames(arm, ray)
    n_colliding = 0
    for q_from in rng.uniform(*arm.bounds, (40, arm.dof)):
        q_to = np.clip(q_from + 0.1 * rng.standard_normal(arm.dof), *arm.bounds)
        (flag,) = dense_checker.colliding_edges(
            arm, nothing, ray, 0.0, (q_from[None], q_to[None]), numpy_checker.SPACING, pairs
        )
        q = np.linspace(q_from, q_to, 400)
        ends = bar_ends_at(arm, q, ray)
        # The reference checker has another order: mount last, ray before.
        own = np.argsort([*np.flatnonzero(bars.bodies > 0), *np.flatnonzero(bars.bodies == 0)])
        ends = ends[:, own]
        least = min(
            (bar_distances(ends[:, i], ends[:, j]) - bars.radii[i] - bars.radii[j]).min()
            for i, j in pairs
        )
        # Where both sample the grids differ.
        if abs(least) > 1e-3:
            assert bool(flag) is bool(least < 0.0)
            n_colliding += bool(flag)
    assert 5 < n_colliding < 35


def test_boxes_are_split_into_parts_of_the_same_volume():
    volume = sum(np.prod(box.size) for box in wearer().boxes)
    parts = random_draws.split_boxes(wearer(), 2).boxes
    assert len(parts) == 64
    assert sum(np.prod(box.size) for box in parts) == pytest.approx(volume)


def test_lines_of_the_harness_become_rows_with_a_verdict(tmp_path):
    query = load_query('c_shape')
    path = [query.problem.q_start.tolist(), query.problem.q_goals[0].tolist()]
    run = {'problem': 'c_shape', 'planner': 'RRTConnect', 'seed': 1, 'solved': True}
    run |= {'t_first': 1e-4, 'c_first': 150.0, 't_max': 1e-4, 'c_max': 120.0, 'path': path}
    file = tmp_path / 'one_map.jsonl'
    file.write_text(json.dumps(run) + '\n')
    (row,) = harness.read_runs(file)
    assert (row['is_solved'], row['is_valid'], row['cost_final']) == (True, False, 120.0)
    file.write_text('{"problem": "c_shape"}\n')
    with pytest.raises(RrthError, match='expected a run'):
        harness.read_runs(file)


def test_the_pace_of_a_machine_is_that_of_the_peer_who_was_timed_elsewhere_too(tmp_path):
    known, lines = machine_speed.published_first(), []
    assert set(known) == {*MAPS, *QUERIES}
    # The peer takes twice as long here, but for one problem.
    for problem, first in known.items():
        factor = 9.0 if problem == 'lap' else 2.0
        run = {'problem': problem, 'planner': 'RRTConnect', 'seed': 1, 'solved': True}
        run |= {'t_first': factor * first * 1e-3, 'c_first': 9.0, 't_max': 0.0, 'c_max': 9.0}
        lines.append(json.dumps(run))
    (tmp_path / 'one.jsonl').write_text('\n'.join(lines))
    rows = harness.read_runs(tmp_path / 'one.jsonl')
    assert machine_speed.slowness(rows) == pytest.approx(2.0)
    assert 'takes 2.00 times as long here' in machine_speed.sentence(rows)
    assert machine_speed.slowness(rows[:2]) is None
    assert 'was not compared' in machine_speed.sentence([])

    # What does not make up for all of a miss says what is left; no excuse for a share or a length.
    target = next(t for t in TARGETS if t.what == 'one configuration')
    assert table._pace(rows, target, 1.9 * target.limit)[0].endswith('as long here.')
    assert table._pace(rows, target, 2.2 * target.limit)[0].endswith('it would be 99 ns.')
    assert not table._pace(rows, target, np.inf)
    gap = next(t for t in TARGETS if t.unit.startswith('%'))
    assert not table._pace(rows, gap, 1.5 * gap.limit)


def test_the_quick_extent_is_smaller_in_everything():
    for name in Extent.__dataclass_fields__:
        assert getattr(QUICK, name) <= getattr(Extent(), name)


def test_the_command_line_explains_itself(capsys):
    with pytest.raises(SystemExit) as end:
        main(['--help'])
    assert end.value.code == 0
    assert '--harness' in capsys.readouterr().out


def test_a_harness_folder_without_lines_is_rejected(tmp_path, capsys):
    assert main(['--only', 'harness', '--harness', str(tmp_path), '--output', str(tmp_path)]) == 1
    assert 'no one_*.jsonl' in capsys.readouterr().err


def test_a_missing_library_is_named_with_the_command_that_installs_it(capsys):
    assert starter.main(lambda name: None if name == 'psutil' else name) == 2
    error = capsys.readouterr().err
    assert error.startswith('psutil: not installed')
    assert 'pip install -r requirements/benchmark.txt' in error


# Starts a node as benchmarks do, writes its number, and waits.
STARTS_A_NODE = """
import time
from benchmarks.common.client import ros_client
from rrth_planner.ros.middleware.child_process import ChildProcess
with ros_client(), ChildProcess('rrth_planner.ros.playback_node', [], lambda line: None) as child:
    print(child.pid, flush=True)
    time.sleep(60.0)
"""


def test_a_benchmark_that_is_ended_ends_its_nodes():
    pytest.importorskip('rclpy')
    command, root = [sys.executable, '-c', STARTS_A_NODE], Path(__file__).parents[2]
    with subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE, text=True) as benchmark:
        node = psutil.Process(int(benchmark.stdout.readline()))
        benchmark.terminate()
        benchmark.wait(30.0)
    assert not node.is_running()
