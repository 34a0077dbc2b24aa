# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plans from files to files: what is printed, written and returned."""

import json

import numpy as np
import pytest

pytest.importorskip('fcl')

from rrth_planner.cli import plan
from rrth_planner.collision.reference_checker import first_contact
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import pointing_error
from rrth_planner.model.trajectory import positions_at, Trajectory

TARGET = ['--target', '1.5', '0.8', '0.6']
FOLDED = load_yaml(resource_path('config/playback.yaml'))['/**']['ros__parameters'][
    'initial_positions'
]


def sentence(said):
    """Return the one line that was said, but for that of a planner that had to be compiled."""
    (line,) = (line for line in said.splitlines() if 'compiling kernels' not in line)
    return line


def written(file):
    """Return the trajectory in a file of YAML."""
    points = load_yaml(file)['points']
    keys = ('time', 'positions', 'velocities', 'accelerations')
    return Trajectory(*(np.array([point[key] for point in points]) for key in keys))


def test_a_motion_is_printed_and_written(tmp_path, capsys):
    exact, table = tmp_path / 'motion.yaml', tmp_path / 'motion.csv'
    assert plan.main([*TARGET, '--seed', '5', '--output', str(exact)]) == 0
    said = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert said['seed'] == '5'
    assert said['written'] == str(exact)
    motion = written(exact)
    assert said['duration'] == f'{motion.duration:.3f} s'
    assert 'seed 5' in exact.read_text().splitlines()[0]
    arm, scene = load_arm(), load_body()
    q = positions_at(motion, np.linspace(0.0, motion.duration, 2000))
    assert q[0].tolist() == FOLDED
    assert pointing_error(arm, q[-1], np.array([1.5, 0.8, 0.6])) < 1e-6
    assert first_contact(arm, scene, q, 1.0, 0.02) is None
    again = [*TARGET, '--seed', '5', '--output', str(table), '--period', '0.05']
    assert plan.main(again) == 0
    rows = np.loadtxt(table, delimiter=',', skiprows=1)
    assert np.array_equal(rows[:, 1::3], positions_at(motion, rows[:, 0]))


def test_figures_as_json(capsys):
    start = ['--from', '0', '-0.35', '1.5', '1.5', '--margin', '0.03', '--json']
    assert plan.main([*TARGET, *start]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures['status'] == 'solved'
    assert figures['clearance_m'] >= 0.03
    assert figures['seed'] >= 0
    # Inside the torso no target can be.
    assert plan.main(['--target', '0', '0', '0', '--json']) == 1
    streams = capsys.readouterr()
    assert json.loads(streams.out)['status'] == 'goal in collision'
    assert sentence(streams.err).startswith('plan: goal in collision: ')
    assert 'torso' in streams.err


def test_the_ray_is_printed_from_where_it_begins(capsys):
    # The lamp of this arm is 0.04 m further out.
    arm = ['--arm', str(resource_path('config/examples/chest_arm.yaml'))]
    body = ['--body', str(resource_path('config/examples/seated_body.yaml'))]
    asked = [*arm, *body, '--target', '1', '0.5', '0', '--seed', '1']
    assert plan.main(asked) == 0
    said = capsys.readouterr().out
    assert '\n  ray from     0.6700 0.0000 0.1200 m along 1.0000 0.0000 0.0000\n' in said
    assert 'tool at' not in said
    assert plan.main([*asked, '--json']) == 0
    start = json.loads(capsys.readouterr().out)['start']
    np.testing.assert_allclose(start['ray_from_m'], (0.67, 0.0, 0.12), atol=1e-5)
    np.testing.assert_allclose(start['ray'], (1.0, 0.0, 0.0), atol=1e-5)


def test_a_refusal_is_a_sentence_and_leaves_no_file(tmp_path, capsys):
    file = tmp_path / 'motion.csv'
    assert plan.main(['--target', '0', '0', '0.1', '--output', str(file)]) == 1
    streams = capsys.readouterr()
    assert streams.out == ''
    assert 'torso' in streams.err
    assert not file.exists()


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--from', '1', '2'], '--from: 2 values, expected 4, one for each'),
        (['--margin', '-1'], 'margin: -1.0, expected'),
        (['--seed', '-7'], 'seed: -7, expected -1 to'),
        (['--output', 'motion.txt'], '.yaml or .csv'),
        (['--output', '/nowhere/at/all.csv'], '/nowhere/at/all.csv'),
        (['--output', 'motion.csv', '--period', '0'], 'period: 0.0, expected'),
        (['--period', '0.1'], '--period: given without --output'),
        (['--arm', 'none.yaml'], 'none.yaml'),
        (['--arm', str(resource_path('config/examples/chest_arm.urdf'))], 'read_urdf writes one'),
        (['--body', 'none.yaml'], 'none.yaml'),
        (['--settings', 'none.yaml'], 'none.yaml'),
    ],
)
def test_wrong_input_is_a_sentence(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert plan.main([*TARGET, *arguments]) == 2
    assert words in sentence(capsys.readouterr().err)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    'line',
    [
        'margin: wide',
        'ray_guard_length: [1.0]',
        'seed: 1.5',
        'max_velocity: 1.5',
        'max_jerk: [a]',
        'time_limit: soon',
        'algorithm: [rrt]',
        'step: 1',
    ],
)
def test_settings_that_are_none_are_a_sentence(tmp_path, capsys, line):
    file = tmp_path / 'mine.yaml'
    file.write_text(f'/**: {{ros__parameters: {{{line}}}}}\n')
    assert plan.main([*TARGET, '--settings', str(file)]) == 2
    said = sentence(capsys.readouterr().err)
    assert line.split(':')[0] in said or 'settings' in said


@pytest.mark.parametrize('arguments', [[], ['--target', '1', '2'], [*TARGET, '--fast']])
def test_wrong_usage_ends_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        plan.main(arguments)
    assert end.value.code == 2
    assert 'usage: plan' in capsys.readouterr().err


def test_an_interrupt_is_a_sentence(monkeypatch, capsys):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr('rrth_planner.pipeline.plan_motion.plan_motion', interrupted)
    assert plan.main(TARGET) == 130
    assert sentence(capsys.readouterr().err) == 'plan: interrupted'
