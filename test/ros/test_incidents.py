# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What never should happen, through the node: answered, kept in a file, never published."""

import os
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticStatus  # noqa: E402
from monitored import know  # noqa: E402
from rcl_interfaces.msg import Log  # noqa: E402
from rrth_planner.cli import replay  # noqa: E402
from rrth_planner.collision import trajectory_validation  # noqa: E402
from rrth_planner.collision.violation import Violation  # noqa: E402
from rrth_planner.execution.watch import Stop  # noqa: E402
from rrth_planner.io.incident import IncidentKind  # noqa: E402
from rrth_planner.io.incident_file import read_incident  # noqa: E402
from rrth_planner.model.errors import MessageError  # noqa: E402
from rrth_planner.model.status import (
    ErrorCode,  # noqa: E402
    PlanStatus,  # noqa: E402
)
from rrth_planner.planning.options import RRTStarOptions  # noqa: E402
from rrth_planner.requests import incidents, plan_request  # noqa: E402
from rrth_planner.requests.answer import CODE_OF_STATUS  # noqa: E402
from rrth_planner.requests.outcome import Outcome  # noqa: E402
from rrth_planner.ros.interface import reporter  # noqa: E402
from rrth_planner.ros.interface.inputs import Inputs  # noqa: E402
from rrth_planner.ros.messages.body import scene_of, WearerBody  # noqa: E402
from rrth_planner.timing.fast_stop import fast_stop  # noqa: E402
import samples  # noqa: E402
from stranger import _start, inputs_of, say_all  # noqa: E402, F401

pytestmark = pytest.mark.usefixtures('ros_context')
ROOT = Path(__file__).parent.parent.parent
VIOLATION = Violation(0.25, 0.0123, 'pointing ray', 'head')
UNEXPECTED = 'FAILURE (99999): planning failed unexpectedly: '
SENTENCE = (
    'FAILURE (99999): the two collision checks disagree: pointing ray is 0.0123 m from box "head" '
    'at 0.250 s, expected at least 0.02 m'
)


LEVELS = {10: 'debug', 20: 'info', 30: 'warning', 40: 'error'}


def replayed(file, capsys):
    """Replay a file; return the exit code and what is printed."""
    capsys.readouterr()
    code = replay.main([str(file)])
    out, err = capsys.readouterr()
    assert err == ''
    return code, out


def replayed_elsewhere(file, _):
    """Do so in a process of its own."""
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get('PYTHONPATH', '')]))
    found = subprocess.run(
        [sys.executable, '-m', 'rrth_planner.cli.replay', str(file)],
        env={**os.environ, 'PYTHONPATH': paths},
        capture_output=True,
        text=True,
        timeout=300.0,
        check=False,
    )
    assert found.stderr == ''
    return found.returncode, found.stdout


def level(stranger):
    return stranger.received['/diagnostics'][-1].status[0].level


def nothing_published(stranger):
    topics = ('joint_trajectory', 'rrth_planner/tool_path', 'rrth_planner/markers')
    return not any(stranger.received[topic] for topic in topics)


@pytest.mark.parametrize(
    ('velocity', 'replayed'),
    [(None, replayed), ([0.3, 0.0, 0.0, -0.2], replayed_elsewhere)],
    ids=['at rest', 'moving'],
)
def test_a_disagreement_is_answered_and_kept_to_be_replayed(
    start, monkeypatch, tmp_path, capsys, velocity, replayed
):
    planner, stranger = start(
        incident_folder=str(tmp_path), seed=5, margin=0.02, algorithm='rrt_star', max_samples=500
    )
    say_all(planner, stranger, joint_states=samples.joints(velocity=velocity))
    with monkeypatch.context() as patch:
        patch.setattr(trajectory_validation, 'first_violation', lambda *_: VIOLATION)
        message = stranger.answer().message
    (file,) = tmp_path.glob('incident-*')
    assert message == f'{SENTENCE}, seed 5; to replay it: ./run exec replay {file}; answer 1'
    stranger.wait_until(lambda: stranger.value('last incident') == str(file))
    assert stranger.value('incidents') == '1'
    assert stranger.value('last code') == 'FAILURE (99999)'
    assert level(stranger) == DiagnosticStatus.ERROR
    assert nothing_published(stranger)

    incident = read_incident(file)
    question = incident.question
    assert incident.kind is IncidentKind.DISAGREEMENT
    assert incident.violation == VIOLATION
    assert incident.present is None
    assert (question.seed, question.margin, question.ray_guard_length) == (5, 0.02, 1.0)
    assert question.options == RRTStarOptions(max_samples=500)
    assert [box.name for box in question.scene.boxes] == ['torso/0', 'head/0']
    np.testing.assert_array_equal(question.goal.target, [1.5, 0.1, 0.3])
    np.testing.assert_array_equal(incident.trajectory.positions[0], question.q_start)
    if velocity is None:
        assert question.moving is None
        np.testing.assert_array_equal(question.q_start, samples.FOLDED)
    else:
        np.testing.assert_array_equal(question.moving.state.velocities, velocity)
        np.testing.assert_array_equal(incident.trajectory.velocities[0], velocity)

    # Without the patch they agree, and the node lives on.
    code, out = replayed(file, capsys)
    assert code == 1
    assert 'motion identical to the bit: yes' in out
    assert out.splitlines()[-1] == (
        'not reproduced: the collision checks now agree that the recorded motion is free'
    )
    stranger.publishers['joint_states'].publish(samples.joints())
    stranger.wait_until(lambda: not inputs_of(planner).joints.value.velocities.any())
    assert stranger.answer().success
    assert len(list(tmp_path.glob('incident-*'))) == 1


def test_a_stop_that_violates_for_the_second_checker_is_kept_to_be_replayed(
    start, monkeypatch, tmp_path, capsys
):
    planner, stranger = start(incident_folder=str(tmp_path), seed=5)
    say_all(planner, stranger)
    assert stranger.answer().success
    monitor, parameters = planner._monitor, planner._reporter.parameters
    stop = fast_stop(monitor.watch.running.trajectory, 0.3, parameters.limits)
    scene, goal = scene_of(inputs_of(planner).body.value), inputs_of(planner).target.value

    def check(violation):
        """Have a stop checked by a checker that finds this."""
        asked, violation_seen = [], planner._planner.violation_seen

        def ask(*arguments):
            found = violation_seen(*arguments)
            asked.append(found)
            return found

        with monkeypatch.context() as patch:
            patch.setattr(trajectory_validation, 'first_violation', lambda *_: violation)
            patch.setattr(planner._planner, 'violation_seen', ask)
            found = Stop(stop, goal, parameters, scene, False, monitor.watch.n_motions)
            # In the thread that also decides.
            planner.executor.create_task(know, monitor, stops=(found,))
            stranger.wait_until(lambda: asked)

    # What agrees leaves nothing behind.
    check(None)
    check(VIOLATION)
    stranger.wait_until(lambda: list(tmp_path.glob('incident-*')))
    (file,) = tmp_path.glob('incident-*')
    stranger.wait_until(lambda: stranger.value('last incident') == str(file))
    assert stranger.value('incidents') == '1'
    incident = read_incident(file)
    assert incident.violation == VIOLATION
    np.testing.assert_array_equal(incident.trajectory.positions, stop.positions)
    assert replayed(file, capsys)[0] == 1


def test_a_folder_that_cannot_be_written_does_not_break_the_answer(start, monkeypatch, tmp_path):
    file = tmp_path / 'file'
    file.write_text('')
    planner, stranger = start(incident_folder=str(file / 'folder'), seed=5)
    say_all(planner, stranger)
    with monkeypatch.context() as patch:
        patch.setattr(trajectory_validation, 'first_violation', lambda *_: VIOLATION)
        message = stranger.answer().message
    assert message.startswith(
        f'{SENTENCE}, seed 5; no file was written to replay it: NotADirectoryError: '
    )
    assert nothing_published(stranger)
    stranger.wait_until(lambda: stranger.value('incidents') == '1')
    assert stranger.value('last incident') == ''
    assert stranger.answer().success


def test_files_are_kept_among_the_logs_by_default(start, monkeypatch, tmp_path):
    planner, stranger = start()
    say_all(planner, stranger)
    with monkeypatch.context() as patch:
        patch.setenv('ROS_LOG_DIR', str(tmp_path))
        patch.setattr(trajectory_validation, 'first_violation', lambda *_: VIOLATION)
        message = stranger.answer().message
    (file,) = (tmp_path / 'rrth_planner').glob('incident-*')
    assert message.endswith(f'{file}; answer 1')


def test_an_error_that_cannot_be_recorded_is_answered(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)

    def fail(*_):
        raise OSError('nothing works')

    with monkeypatch.context() as patch:
        patch.setattr(planner._queue._publishers, 'publish_motion', fail)
        patch.setattr(incidents, 'error_incident', fail)
        message = stranger.answer().message
    assert message == f'{UNEXPECTED}OSError: nothing works; answer 1'
    assert stranger.answer().success


def test_an_error_after_the_plan_is_kept_with_the_motion(start, monkeypatch, tmp_path, capsys):
    planner, stranger = start(incident_folder=str(tmp_path), seed=5)
    say_all(planner, stranger)

    def fail(*_):
        raise OSError('no publisher')

    with monkeypatch.context() as patch:
        patch.setattr(planner._queue._publishers, 'publish_motion', fail)
        message = stranger.answer().message
    (file,) = tmp_path.glob('incident-*')
    assert message == (
        'FAILURE (99999): planning failed unexpectedly: OSError: no publisher; to replay it: '
        f'./run exec replay {file}; answer 1'
    )
    incident = read_incident(file)
    assert (incident.kind, incident.error) == (IncidentKind.ERROR, 'OSError')
    assert "raise OSError('no publisher')" in incident.traceback
    assert incident.trajectory is not None
    code, out = replayed(file, capsys)
    assert code == 1
    assert out.splitlines()[-1] == (
        'not reproduced: the OSError occurred after the motion had been planned'
    )
    assert stranger.answer().success


def test_an_error_before_anything_was_asked_leaves_no_file(start, monkeypatch, tmp_path):
    planner, stranger = start(incident_folder=str(tmp_path))
    say_all(planner, stranger)

    def fail(*_):
        raise ValueError('of a test')

    with monkeypatch.context() as patch:
        patch.setattr(plan_request, '_question', fail)
        message = stranger.answer().message
    assert message == f'{UNEXPECTED}ValueError: of a test; answer 1'
    assert not list(tmp_path.glob('incident-*'))
    assert stranger.answer().success


def test_each_request_is_logged_once_with_figures_or_with_its_code(start, monkeypatch, tmp_path):
    planner, stranger = start(seed=3, incident_folder=str(tmp_path))
    stranger.subscribe('/rosout', Log, 100)
    name = planner.get_logger().name
    say_all(planner, stranger)
    stranger.wait_until(lambda: planner.count_subscribers('/rosout') > 0)
    answers = [stranger.answer() for _ in range(2)]
    with monkeypatch.context() as patch:
        patch.setattr(trajectory_validation, 'first_violation', lambda *_: VIOLATION)
        answers.append(stranger.answer())
    stranger.say('target', samples.target(0.0, 0.0, 0.0))
    stranger.wait_until(lambda: not inputs_of(planner).target.value.target.any())
    answers.append(stranger.answer())

    def lines():
        return [
            msg for msg in stranger.received['/rosout'] if msg.name == name and '): ' in msg.msg
        ]

    stranger.wait_until(lambda: len(lines()) == len(answers))
    assert [msg.msg for msg in lines()] == [answer.message for answer in answers]
    assert [LEVELS[msg.level] for msg in lines()] == ['info', 'info', 'error', 'warning']
    for word in ('waypoints', 'duration', 'path length', 'clearance', 'planning time', 'seed 3'):
        assert word in lines()[0].msg
    assert lines()[-1].msg.startswith('GOAL_IN_COLLISION (-12): the target (0.000, 0.000, 0.000)')


def test_diagnostics_say_everything(start):
    planner, stranger = start(seed=3)
    say_all(planner, stranger)
    assert stranger.answer().success
    stranger.wait_until(lambda: stranger.value('last code') == 'SUCCESS (1)')
    for name in (
        *('planning time [ms]', 'request to trajectory [ms]', 'duration [s]', 'path length [rad]'),
        *('least clearance [m]', 'seed', 'boxes', 'requests', 'solved', 'incidents'),
        *(
            f'{kind} {name}{unit}'
            for name in ('body', 'target', 'joints')
            for kind, unit in (
                *(('age of', ' [s]'), ('good messages,', '')),
                ('rejected messages,', ''),
            )
        ),
    ):
        assert float(stranger.value(name)) >= 0.0, name
    for name in ('last sentence', 'last incident', 'monitor', 'last stop', 'last rejection, body'):
        assert isinstance(stranger.value(name), str)


def test_the_summary_of_diagnostics_is_what_is_worst(start):
    planner, _ = start(body_timeout=1.0)
    inputs = Inputs('body', 'target', 'joints')

    def summary(now=10.0, code=None, sentence=''):
        last = None if code is None else Outcome(code, sentence)
        return reporter.summary(now, inputs, planner._reporter.parameters, last)

    def reject():
        raise MessageError('no point')

    assert summary() == (DiagnosticStatus.WARN, 'waiting for body, target, joints')
    for topic in inputs.all.values():
        topic.accept(lambda topic=topic: topic.value, 10.0)
    assert summary() == (DiagnosticStatus.OK, 'ready')
    assert summary(code=ErrorCode.SUCCESS, sentence='so') == (DiagnosticStatus.OK, 'so')
    late = {'code': ErrorCode.TIMED_OUT, 'sentence': 'no path'}
    assert summary(**late) == (DiagnosticStatus.WARN, 'TIMED_OUT (-6): no path')
    inputs.target.accept(reject, 10.0)
    assert summary(**late) == (DiagnosticStatus.WARN, 'target rejected: no point')
    assert summary(11.5, **late) == (DiagnosticStatus.STALE, 'body is 1.500 s old')
    broken = (DiagnosticStatus.ERROR, 'FAILURE (99999): it broke')
    assert summary(11.5, ErrorCode.FAILURE, 'it broke') == broken


def test_only_so_many_lost_parts_are_remembered_as_named(start, monkeypatch):
    monkeypatch.setattr(reporter, 'MOST_NAMED', 3)
    planner, _ = start()
    source = inputs_of(planner).body
    for k in range(20):
        hat = samples.box('hat', k)
        hat.lifetime.nanosec = 1
        source.value = WearerBody().apply(samples.array(hat), 0.0, 'torso')
        planner._reporter._warn_of_lost(1.0)
        named = planner._reporter._named
        assert ('hat', k) in named
        assert len(named) <= 5


def test_every_end_of_a_plan_has_a_code_of_its_own_kind():
    assert set(CODE_OF_STATUS) == set(PlanStatus)
    assert {code for code in ErrorCode if code not in CODE_OF_STATUS.values()} == {
        # What a request ends with before or after it is planned.
        ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
        ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA,
        ErrorCode.INVALID_GOAL_CONSTRAINTS,
        ErrorCode.FRAME_TRANSFORM_FAILURE,
        ErrorCode.ROBOT_STATE_STALE,
        ErrorCode.SENSOR_INFO_STALE,
    }


def test_what_is_in_the_way_is_named_with_the_part_of_the_arm(start):
    planner, stranger = start()
    pack = samples.box('pack', center=(-0.3, -0.1, 0.3), text='back pack')
    say_all(planner, stranger, body_boxes=samples.array(pack))
    message = stranger.answer().message
    assert message.startswith('START_STATE_IN_COLLISION (-10): link ')
    assert ' m inside box "back pack"' in message


def test_configurations_that_all_violate_are_reported_with_part_and_box(start):
    planner, stranger = start()
    body = samples.wearer()
    # A wall between the arm and the target, larger than the arm can point past.
    body.markers.append(samples.box('wall', 7, (1.0, 0.0, 0.0), (0.1, 20.0, 20.0)))
    say_all(planner, stranger, body_boxes=body)
    message = stranger.answer().message
    assert message.startswith('GOAL_IN_COLLISION (-12): all ')
    assert 'pointing ray and box "wall' in message


@pytest.mark.parametrize('replayed', [replayed, replayed_elsewhere])
def test_the_last_events_of_the_monitor_are_saved_and_decided_again(
    start, tmp_path, capsys, replayed
):
    planner, stranger = start(incident_folder=str(tmp_path), seed=5)
    say_all(planner, stranger)
    assert stranger.answer().success
    message = stranger.answer('save').message
    (file,) = tmp_path.glob('flight-*.flight')
    assert message == f'SUCCESS (1): {file}'
    code, out = replayed(file, capsys)
    assert code == 0
    assert ' s  monitoring\n' in out
    assert out.splitlines()[-1] == 'reproduced: every command is the same as recorded, to the bit'


def test_a_fault_leaves_what_led_to_it(start, tmp_path, capsys):
    planner, stranger = start(incident_folder=str(tmp_path), seed=5)
    say_all(planner, stranger)
    assert stranger.answer().success
    planner.fail('an error of the test')
    stranger.wait_until(lambda: list(tmp_path.glob('flight-*.flight')))
    (file,) = tmp_path.glob('flight-*.flight')
    code, out = replayed(file, capsys)
    assert code == 0
    assert 'stopping: an error of the test: fail-safe stop' in out


def test_where_no_record_can_be_written_the_answer_says_why(start, tmp_path):
    planner, stranger = start(incident_folder='/dev/null/of_the_test', seed=5)
    say_all(planner, stranger)
    answer = stranger.answer('save')
    assert not answer.success
    assert 'no flight record was written' in answer.message
    assert stranger.answer().success
