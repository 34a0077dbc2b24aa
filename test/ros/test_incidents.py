# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What never should happen, through the node: answered, kept in a file, never published."""

from contextlib import suppress
from dataclasses import replace
import os
from pathlib import Path
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticStatus  # noqa: E402
from monitored import without_separation  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rrth_planner.cli import replay  # noqa: E402
from rrth_planner.collision import trajectory_validation  # noqa: E402
from rrth_planner.collision.violation import Disagreement, Violation  # noqa: E402
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
from rrth_planner.ros.interface.parameters import declare_parameters  # noqa: E402
from rrth_planner.ros.messages.body import WearerBody  # noqa: E402
import samples  # noqa: E402
from stranger import _start, inputs_of, say_all  # noqa: E402, F401
from visualization_msgs.msg import Marker  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
ROOT = Path(__file__).parent.parent.parent
VIOLATION = Violation(0.25, 0.0123, 'pointing ray', 'head')
UNEXPECTED = 'FAILURE (99999): planning failed unexpectedly: '
SENTENCE = (
    'FAILURE (99999): the two collision checks disagree: pointing ray is 0.0123 m from box "head" '
    'at 0.250 s, expected at least 0.02 m'
)


@pytest.fixture(name='node')
def _node():
    node = Node('incidents')
    yield node
    node.destroy_node()


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


def disagree(stranger):
    """Have the two checkers disagree about the next motion that is planned."""
    plan_question = stranger.script.plans

    def plan(*question):
        stranger.script.plans = plan_question
        found = plan_question(*question)
        disagreement = Disagreement(found.trajectory, VIOLATION, found.escape_time)
        return replace(
            found,
            status=PlanStatus.NOT_CERTIFIED,
            sentence=f'{disagreement.sentence(0.02)}, seed 5',
            trajectory=None,
            disagreement=disagreement,
        )

    stranger.script.plans = plan


def send_no_motion(stranger):
    """Have the middleware fail to send the next motion."""

    def sends(topic, msg, send):
        if topic == 'joint_trajectory':
            stranger.script.sends = lambda topic, msg, send: send(msg)
            raise OSError('no publisher')
        send(msg)

    stranger.script.sends = sends


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
    stranger.wait_until(lambda: stranger.value('last code') == 'FAILURE (99999)')
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
    start, tmp_path, capsys
):
    planner, stranger = start(incident_folder=str(tmp_path), seed=5, replan=False)
    say_all(planner, stranger)
    assert stranger.answer().success
    asked, violation_seen = [], stranger.script.checks

    def plan_again():
        """Have the fence taken away, and a motion begin."""
        gone = [samples.command(Marker.DELETE, 'plate', k) for k in range(4)]
        free = samples.array(*gone, *samples.wearer().markers)

        def is_planned():
            # What is taken away while the arm moves is still there for a while.
            stranger.publishers['body_boxes'].publish(free)
            return stranger.answer().success

        stranger.wait_until(is_planned)

    def check(violation):
        """Have the arm stopped for a fence, by a checker that then finds this; return the stop."""
        asked.clear()

        def seen(*arguments):
            found = violation_seen(*arguments)
            asked.append(arguments)
            return violation or found

        stranger.script.checks = seen
        for _ in range(10):
            # A body that a busy machine checks late stops it, too, but unproven.
            stranger.publishers['body_boxes'].publish(samples.fenced())
            with suppress(AssertionError):
                stranger.wait_until(lambda: asked, 3.0)
                return asked[0][2]
            plan_again()
        raise AssertionError('no stop was proven')

    # What agrees leaves nothing behind.
    check(None)
    plan_again()
    stop = check(VIOLATION)
    stranger.wait_until(lambda: list(tmp_path.glob('incident-*')))
    (file,) = tmp_path.glob('incident-*')
    stranger.wait_until(lambda: stranger.value('last incident') == str(file))
    assert stranger.value('incidents') == '1'
    incident = read_incident(file)
    assert incident.violation == VIOLATION
    np.testing.assert_array_equal(incident.trajectory.positions, stop.positions)
    assert replayed(file, capsys)[0] == 1


def test_a_folder_that_cannot_be_written_does_not_break_the_answer(start, tmp_path):
    file = tmp_path / 'file'
    file.write_text('')
    planner, stranger = start(incident_folder=str(file / 'folder'), seed=5)
    say_all(planner, stranger)
    disagree(stranger)
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
    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path))
    disagree(stranger)
    message = stranger.answer().message
    (file,) = (tmp_path / 'rrth_planner').glob('incident-*')
    assert message.endswith(f'{file}; answer 1')


def test_an_error_that_cannot_be_recorded_is_answered(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)

    send_no_motion(stranger)
    monkeypatch.setattr(incidents, 'error_incident', lambda *_: 1 / 0)
    message = stranger.answer().message
    assert message == f'{UNEXPECTED}OSError: no publisher; answer 1'
    assert stranger.answer().success


def test_an_error_after_the_plan_is_kept_with_the_motion(start, tmp_path, capsys):
    planner, stranger = start(incident_folder=str(tmp_path), seed=5)
    say_all(planner, stranger)

    send_no_motion(stranger)
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


def test_each_request_is_logged_once_with_figures_or_with_its_code(start, tmp_path):
    planner, stranger = start(seed=3, incident_folder=str(tmp_path))
    logged = stranger.lines(planner)
    say_all(planner, stranger)
    answers = [stranger.answer() for _ in range(2)]
    disagree(stranger)
    answers.append(stranger.answer())
    stranger.say('target', samples.target(0.0, 0.0, 0.0))
    stranger.wait_until(lambda: not inputs_of(planner).target.value.target.any())
    answers.append(stranger.answer())

    def lines():
        return [(LEVELS[level], line) for level, line in logged if '): ' in line]

    stranger.wait_until(lambda: len(lines()) == len(answers))
    levels, said = zip(*lines(), strict=True)
    assert list(said) == [answer.message for answer in answers]
    assert levels == ('info', 'info', 'error', 'warning')
    for word in ('waypoints', 'duration', 'path length', 'clearance', 'planning time', 'seed 3'):
        assert word in said[0]
    assert said[-1].startswith('GOAL_IN_COLLISION (-12): the target (0.000, 0.000, 0.000)')


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


def test_the_summary_of_diagnostics_is_what_is_worst():
    given = {'separation': False, 'body_timeout': 1.0}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    parameters = declare_parameters(Node('summary', parameter_overrides=overrides))
    inputs = Inputs('body', 'target', 'joints')

    def summary(now=10.0, code=None, sentence=''):
        last = None if code is None else Outcome(code, sentence)
        return reporter.summary(now, inputs, parameters, last)

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


def test_only_so_many_lost_parts_are_remembered_as_named(node):
    lines = []
    node.get_logger = lambda: SimpleNamespace(warning=lambda line, **_: lines.append(line))
    inputs = Inputs('body', 'target', 'joints')
    reporting = reporter.Reporter(node, inputs, without_separation(node))

    def lose(name, n):
        """Return the lines that are logged where so many parts of a name are lost."""
        lines.clear()
        hats = [samples.box(name, k) for k in range(n)]
        for hat in hats:
            hat.lifetime.nanosec = 1
        inputs.body.value = WearerBody().apply(samples.array(*hats), 0.0, 'torso')
        time.sleep(reporter.SHORTEST_PERIOD)
        reporting.publish()
        return [line for line in lines if 'lifetime of' in line]

    assert len(lose('hat', reporter.MOST_NAMED + 1)) == 1
    assert not lose('hat', reporter.MOST_NAMED + 1)
    # Of more than so many only those are remembered that are lost now.
    assert len(lose('glove', 1)) == 1
    assert not lose('glove', 1)
    assert len(lose('hat', 1)) == 1


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
