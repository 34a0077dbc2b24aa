# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Incidents are replayed: what is reproduced, what is not, and the results of the checkers."""

from dataclasses import replace
import os
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest
from rrth_planner.collision.violation import Violation
from rrth_planner.collision.world import arm_world
from rrth_planner.execution.executing_motion import predict_start_state
from rrth_planner.io.incident import disagreement_incident, error_incident, IncidentKind
from rrth_planner.io.incident_file import write_incident
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.options import RRTHOptions
from worlds import FOLDED, limits, MARGIN, RAY, table_1_arm, wearer

pipeline = pytest.importorskip('rrth_planner.pipeline.plan_motion', exc_type=ImportError)
from rrth_planner.cli import replay
from rrth_planner.collision import checker_comparison, trajectory_validation

ROOT = Path(__file__).parents[2]
TOUCH = Violation(0.25, 0.0123, 'ray', 'head')
QUESTION = PlanQuestion(
    arm=table_1_arm(),
    scene=wearer(),
    q_start=FOLDED,
    goal=PointingGoal([1.5, 0.1, 0.3]),
    limits=limits(),
    options=RRTHOptions(time_limit=1000.0, improve_time=1000.0),
    margin=MARGIN,
    ray_guard_length=RAY,
    seed=5,
)


@pytest.fixture(name='_compiled', scope='module', autouse=True)
def _compile():
    """Have all kernels compiled: a command says so where they are not."""
    pipeline.warm_up(QUESTION.arm, QUESTION.options)


def disagree(monkeypatch):
    """Have python-fcl find a violation in every motion."""
    monkeypatch.setattr(trajectory_validation, 'first_violation', lambda *_: TOUCH)


def disagreement(monkeypatch, question=QUESTION):
    """Return the record of a plan that python-fcl, patched, had something against."""
    with monkeypatch.context() as patch:
        disagree(patch)
        plan = pipeline.plan_question(question)
    assert plan.status is PlanStatus.NOT_CERTIFIED
    assert plan.trajectory is None
    when = plan.disagreement.escape_time + TOUCH.time
    assert plan.sentence.startswith(
        f'the two collision checks disagree: ray is 0.0123 m from box "head" at {when:.3f} s, '
        'expected at least 0.02 m, seed '
    )
    return disagreement_incident(question, plan.disagreement)


def play(path):
    """Run the command in a process of its own; return exit code, output and errors."""
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get('PYTHONPATH', '')]))
    found = subprocess.run(
        [sys.executable, '-m', 'rrth_planner.cli.replay', str(path)],
        env={**os.environ, 'PYTHONPATH': paths},
        capture_output=True,
        text=True,
        timeout=300.0,
        check=False,
    )
    return found.returncode, found.stdout, found.stderr


def test_checks_that_agree_now_are_no_reproduction(monkeypatch, tmp_path):
    code, out, err = play(write_incident(disagreement(monkeypatch), tmp_path))
    assert (code, err) == (1, '')
    assert 'recorded: disagreement, ' in out
    assert 'motion identical to the bit: yes' in out
    assert out.splitlines()[-1] == (
        'not reproduced: the collision checks now agree that the recorded motion is free'
    )


def test_a_disagreement_that_happens_again_is_reproduced(monkeypatch, capsys):
    incident = disagreement(monkeypatch)
    disagree(monkeypatch)
    assert replay.replay(incident) == 0
    out = capsys.readouterr().out
    assert 'second checker, fcl: ray at 0.0123000 m from "head" at 0.2500 s' in out
    assert out.splitlines()[-1].startswith('reproduced: ')


def test_another_motion_is_no_reproduction(monkeypatch, capsys):
    incident = disagreement(monkeypatch)
    moved = incident.trajectory.positions.copy()
    moved[-1, 0] = np.nextafter(moved[-1, 0], 1.0)
    given = incident.trajectory
    other = Trajectory(
        times=given.times,
        positions=moved,
        velocities=given.velocities,
        accelerations=given.accelerations,
    )
    disagree(monkeypatch)
    assert replay.replay(replace(incident, trajectory=other)) == 1
    out = capsys.readouterr().out
    assert 'motion identical to the bit: no' in out
    assert 'planning again gives another motion' in out.splitlines()[-1]


def test_a_motion_of_an_arm_that_moves_is_planned_again_to_the_bit(monkeypatch, capsys, tmp_path):
    running = pipeline.plan_question(QUESTION).trajectory
    moving = predict_start_state(running.positions[0], running.velocities[0], None, 0.0)
    state = replace(moving.state, velocities=np.array([0.2, 0.0, 0.1, 0.0]))
    moving = replace(moving, state=state, running=running, time=0.0)
    question = replace(QUESTION, moving=moving, seed=6)
    path = write_incident(disagreement(monkeypatch, question), tmp_path)
    disagree(monkeypatch)
    assert replay.main([str(path)]) == 0
    assert ' moving; ' in capsys.readouterr().out


def test_a_motion_is_checked_against_the_recorded_wearer(monkeypatch, capsys):
    incident = disagreement(monkeypatch)
    # All of the wearer's surroundings.
    wall = Box('wall', np.zeros(3), np.full(3, 5.0), np.eye(3))
    assert replay.replay(replace(incident, present=Scene((wall,)))) == 1
    out = capsys.readouterr().out
    assert '8 boxes, 1 when checked' in out
    assert 'certificate: not proven' in out
    assert out.splitlines()[-1].endswith('the recorded motion is not proven free')


def test_a_motion_with_an_escape_is_checked_as_one(monkeypatch, capsys):
    rng, world = np.random.default_rng(4), arm_world(table_1_arm(), wearer(), MARGIN, RAY)
    for _ in range(100):
        question = replace(QUESTION, q_start=rng.uniform(*world.bounds))
        if world.is_valid(question.q_start):
            continue
        plan = pipeline.plan_question(question)
        if plan.escape_time > 0.0:
            break
    incident = disagreement(monkeypatch, question)
    assert incident.escape_time == plan.escape_time
    assert incident.violation.time == plan.escape_time + TOUCH.time
    assert replay.replay(incident) == 1
    out = capsys.readouterr().out
    assert 'certificate: proven free' in out
    assert out.splitlines()[-1].endswith('the recorded motion is free')
    disagree(monkeypatch)
    assert replay.replay(incident) == 0


def test_all_checkers_agree_on_every_piece(monkeypatch):
    trajectory = disagreement(monkeypatch).trajectory
    arguments = (QUESTION.required, wearer(), QUESTION.goal, trajectory)
    comparison = checker_comparison.compare_checkers(*arguments)
    assert comparison.is_proven
    assert comparison.violation is None
    assert not comparison.is_disagreement
    assert len(comparison.pieces) == len(trajectory.times)
    for i, piece in enumerate(comparison.pieces[:-1]):
        assert (piece.begin, piece.end) == tuple(trajectory.times[i : i + 2])
    for piece in comparison.pieces:
        assert piece.certificate == 'proven'
        assert piece.begin <= piece.second.time <= piece.end + 1e-12
        # They sample nearly the same instants.
        assert piece.second.distance == pytest.approx(piece.reference, abs=1e-4)
    assert comparison.clearance >= MARGIN


def test_a_motion_without_pieces_and_a_wearer_without_boxes_are_compared():
    still = Trajectory(
        times=np.zeros(1),
        positions=FOLDED[None],
        velocities=np.zeros((1, 4)),
        accelerations=np.zeros((1, 4)),
    )
    comparison = checker_comparison.compare_checkers(
        QUESTION.required, Scene(()), QUESTION.goal, still
    )
    assert comparison.is_proven
    assert comparison.clearance == np.inf
    assert len(comparison.pieces) == 1


def fail(*_, **__):
    raise ZeroDivisionError('of a test')


def test_an_error_is_reproduced_by_an_error_of_the_same_kind(monkeypatch, capsys, tmp_path):
    incident = error_incident(QUESTION, ZeroDivisionError('of a test'), 'Traceback ...', None)
    assert incident.kind is IncidentKind.ERROR
    path = write_incident(incident, tmp_path)
    assert replay.main([str(path)]) == 1
    assert (
        'not reproduced: recorded was ZeroDivisionError, now: solved: ' in capsys.readouterr().out
    )
    monkeypatch.setattr('rrth_planner.pipeline.plan_motion.plan_question', fail)
    assert replay.main([str(path)]) == 0
    assert 'reproduced: ZeroDivisionError, as recorded' in capsys.readouterr().out


def test_an_error_after_the_plan_says_so(capsys):
    trajectory = pipeline.plan_question(QUESTION).trajectory
    incident = error_incident(QUESTION, OSError('no publisher'), 'Traceback ...', trajectory)
    assert replay.replay(incident) == 1
    out = capsys.readouterr().out
    assert 'motion identical to the bit: yes' in out
    assert 'not reproduced: the OSError occurred after the motion had been planned' in out


def test_versions_that_differ_are_named(monkeypatch, capsys):
    incident = disagreement(monkeypatch)
    versions = {**incident.versions, 'numpy': '0.1', 'moon': 'full'}
    replay.replay(replace(incident, versions=versions))
    out = capsys.readouterr().out
    assert f'numpy: 0.1 then, {np.__version__} now' in out
    assert 'moon: full then, none now' in out
    assert 'numba: ' not in out


@pytest.mark.parametrize(
    ('content', 'sentence'),
    [
        (None, 'No such file'),
        ('a: [', 'expected a readable YAML file'),
        ('', 'incident: None, expected a mapping'),
        ('format: 9', 'format: 9, expected 6'),
        ('\x00', 'expected a readable YAML file'),
        ('[' * 900, 'or 20 in one another; expected a readable YAML file'),
    ],
)
def test_a_bad_file_is_rejected_in_one_sentence(capsys, tmp_path, content, sentence):
    path = tmp_path / 'incident.yaml'
    if content is not None:
        path.write_text(content)
    assert replay.main([str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert len(err.splitlines()) == 1
    assert err.startswith(f'replay: file {path}: ')
    assert sentence in err


def test_the_help_teaches(capsys):
    with pytest.raises(SystemExit) as end:
        replay.main(['--help'])
    assert end.value.code == 0
    out = capsys.readouterr().out
    for word in ('FILE', 'exit codes:', 'needs no ROS', 'replay ~/.ros'):
        assert word in out


BLOCKED = """
import sys
for name in ('rclpy', 'ament_index_python', 'tf2_ros', 'matplotlib'):
    sys.modules[name] = None
from rrth_planner.cli.replay import main
sys.exit(main(['/no/such/file']))
"""


def test_it_needs_no_ros():
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get('PYTHONPATH', '')]))
    found = subprocess.run(
        [sys.executable, '-c', BLOCKED],
        env={**os.environ, 'PYTHONPATH': paths},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (found.returncode, found.stdout) == (2, '')
    assert found.stderr.startswith('replay: file /no/such/file: ')
