# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The command `plot`: it draws plans, or says in one sentence why not."""

import numpy as np
import pytest

image = pytest.importorskip('matplotlib.image')

from rrth_planner.cli.plot import main  # noqa: E402
from rrth_planner.execution.recording import CommandedMotion, Recording  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.io.settings import load_settings  # noqa: E402
from rrth_planner.model.scene import Box, Scene  # noqa: E402
from rrth_planner.model.trajectory import sample, Trajectory  # noqa: E402
from rrth_planner.visualization.recording_figure import recording_figure  # noqa: E402

ARM = load_arm()
FOLDED = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])
TARGET = ['--target', '0.3', '1.4', '0.4']


def is_drawn(pixels):
    """Return whether there is a picture on both halves of some pixels."""
    return all(half.std() > 0.02 for half in np.array_split(pixels[..., :3], 2, axis=1))


def stopped_run():
    """Return a run in which the arm is stopped on its way and goes on."""
    way = Trajectory(
        times=[0.0, 2.0],
        positions=[FOLDED, FOLDED - 0.5],
        velocities=np.zeros((2, 4)),
        accelerations=np.zeros((2, 4)),
    )
    q, v, a = sample(way, [0.9])
    stop = Trajectory(
        times=[0.0, 0.3],
        positions=[q[0], q[0] - 0.05],
        velocities=[v[0], np.zeros(4)],
        accelerations=[a[0], np.zeros(4)],
    )
    times = np.linspace(0.0, 2.0, 201)
    is_stopping = times >= 0.9
    states = [sample(way, times), sample(stop, times - 0.9)]
    q, v = (np.where(is_stopping[:, None], states[1][k], states[0][k]) for k in (0, 1))
    wearer = [
        Scene((Box('torso', [0.0, y, 0.0], [0.3, 0.46, 0.6], np.eye(3)),)) for y in (0.0, 0.1)
    ]
    return Recording(
        times=times,
        positions=q,
        velocities=v,
        commanded=(CommandedMotion(0.0, way), CommandedMotion(0.9, stop)),
        bodies=((-0.5, wearer[0]), (0.88, wearer[1])),
        targets=((0.0, np.array([1.5, 0.2, 0.3])),),
        monitor_states=((0.0, 'monitoring'), (0.95, 'stopping'), (1.3, 'holding')),
    )


@pytest.mark.parametrize('kind', ['png', 'svg', 'pdf'])
def test_a_plan_is_drawn_in_the_format_of_the_ending(tmp_path, capsys, kind):
    path = tmp_path / f'plan.{kind}'
    assert main(['plan', *TARGET, '--seed', '1', '-o', str(path)]) == 0
    told = capsys.readouterr().out
    assert 'least clearance' in told
    assert str(path) in told
    if kind == 'png':
        assert is_drawn(image.imread(path))
    else:
        assert path.read_bytes().startswith({'svg': b'<?xml', 'pdf': b'%PDF'}[kind])
        assert path.stat().st_size > 20_000


def test_the_same_seed_draws_the_same_picture(tmp_path):
    paths = [tmp_path / f'{k}.png' for k in range(2)]
    for path in paths:
        assert main(['plan', *TARGET, '--seed', '7', '-o', str(path)]) == 0
    # But for the planning time, which is not in it.
    assert paths[0].read_bytes() == paths[1].read_bytes()


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ([*TARGET, '-o', 'plan.jpg'], 'expected a name that ends in .png, .svg, .pdf'),
        ([*TARGET, '-o', 'nowhere/plan.png'], 'its folder does not exist'),
        (['--target', '0', '0', '0', '-o', 'plan.png'], 'inside'),
        ([*TARGET, '--from', '0', '1', '-o', 'plan.png'], 'expected'),
        ([*TARGET, '--seed', '-2', '-o', 'plan.png'], 'expected 0 to 2147483647'),
        ([*TARGET, '--body', 'nobody.yaml', '-o', 'plan.png'], 'nobody.yaml'),
        ([*TARGET, '--arm', 'nothing.yaml', '-o', 'plan.png'], 'nothing.yaml'),
        ([*TARGET, '--settings', 'none.yaml', '-o', 'plan.png'], 'none.yaml'),
    ],
)
def test_what_is_wrong_with_a_plan_is_said_in_one_sentence(
    tmp_path, monkeypatch, capsys, arguments, words
):
    monkeypatch.chdir(tmp_path)
    assert main(['plan', *arguments]) == 1
    said = capsys.readouterr().err
    assert said.startswith('plot: ')
    assert len(said.splitlines()) == 1
    assert words in said
    assert not list(tmp_path.iterdir())


def test_a_run_is_drawn_with_its_stop_its_distance_and_the_guard():
    figure = recording_figure(stopped_run(), ARM, load_settings(4), 'run.mcap')
    figure.canvas.draw()
    assert is_drawn(np.asarray(figure.canvas.buffer_rgba()) / 255.0)
    view, position, velocity, distance, guard = figure.axes
    assert position.get_title(loc='left').startswith('run.mcap\n1 motion, 1 stop, ')
    assert position.get_ylabel() == 'position [rad]'
    assert velocity.get_ylabel() == 'velocity [rad/s]'
    assert distance.get_ylabel().endswith('[m]')
    assert guard.get_xlabel() == 'time [s]'
    names = [text.get_text() for text in guard.get_legend().get_texts()]
    assert names == ['monitoring', 'stopping', 'holding', 'update of the wearer']
    # A band where the arm was stopped, in each of the three curves; the stages of the guard.
    for axes in (position, velocity, distance):
        (band,) = axes.patches
        begin, end = band.get_extents().transformed(axes.transData.inverted()).intervalx
        assert begin == pytest.approx(0.9)
        assert end == pytest.approx(1.2)
    assert len(guard.patches) == 3
    assert 'end' in {text.get_text() for text in view.texts}


def test_the_curves_are_commanded_and_measured():
    run = stopped_run()
    figure = recording_figure(run, ARM, load_settings(4), 'run')
    position = figure.axes[1]
    seen = position.lines[1].get_xydata()
    np.testing.assert_array_equal(seen, np.column_stack([run.times, run.positions[:, 0]]))
    told = position.lines[0].get_xydata()
    expected = np.interp(told[:, 0], run.times, run.positions[:, 0])
    np.testing.assert_allclose(told[:, 1], expected, atol=1e-3)


def test_a_line_is_interrupted_where_nothing_was_recorded():
    run = stopped_run()
    rows = np.flatnonzero((run.times < 0.5) | (run.times > 1.0))
    gap = Recording(
        times=run.times[rows], positions=run.positions[rows], velocities=run.velocities[rows]
    )
    line = recording_figure(gap, ARM, load_settings(4), 'run').axes[1].lines[1].get_xydata()
    assert np.isnan(line).any(axis=1).sum() == 1


def test_a_run_of_one_instant_without_wearer_or_target_is_drawn():
    run = Recording(times=[3.0], positions=[FOLDED], velocities=[np.zeros(4)])
    figure = recording_figure(run, ARM, load_settings(4), 'run')
    figure.canvas.draw()
    assert figure.axes[1].get_title(loc='left') == 'run\n0 motions, 0 stops'
