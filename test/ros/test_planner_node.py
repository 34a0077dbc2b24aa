# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The planner's node, called as a stranger would call it: requests and answers, start and end."""

import os
import signal
import subprocess
import sys
from threading import Event
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticStatus  # noqa: E402
from nav_msgs.srv import GetPlan  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.parameter_client import AsyncParameterClient  # noqa: E402
from rclpy.task import Future  # noqa: E402
from requests_alone import _alone  # noqa: E402, F401
from rrth_planner.execution.command import ahead, BEFORE  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.model.arm import pointing_error  # noqa: E402
from rrth_planner.pipeline.planning_process import PlanningProcessError  # noqa: E402
from rrth_planner.ros import planner as planner_module  # noqa: E402
from rrth_planner.ros.client import planner_client  # noqa: E402
from rrth_planner.ros.interface.parameters import RULES  # noqa: E402
from rrth_planner.ros.messages.answer import answer_from_msg, answer_from_text  # noqa: E402
from rrth_planner.ros.messages.fields import (
    nanoseconds_of,  # noqa: E402
    seconds_of,  # noqa: E402
)
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg  # noqa: E402
from samples import array, box, command, fenced, FOLDED, JOINTS, joints, target, wearer  # noqa: E402
from stranger import _start, inputs_of, NAN, say_all, Stranger, TOPICS  # noqa: E402, F401
from visualization_msgs.msg import Marker  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
# With these the search for a path out of the fence does not end.
ENDLESS = {'time_limit': 600.0, 'max_samples': 10**7}


def test_a_plan_is_published_and_then_answered(start):
    planner, stranger = start(seed=3)
    say_all(planner, stranger)
    response = stranger.answer()
    assert response.success
    assert response.message.startswith('SUCCESS (1): ')
    for word in ('waypoints', 'duration', 'path length', 'clearance', 'planning time', 'seed 3'):
        assert word in response.message
    for topic in ('joint_trajectory', 'rrth_planner/tool_path', 'rrth_planner/markers'):
        stranger.wait_until(lambda topic=topic: stranger.received[topic])
    (msg,) = stranger.received['joint_trajectory']
    # It begins at rest shortly before its publication: any controller has it before it moves.
    assert 0.0 < time.time() - seconds_of(msg.header.stamp) < 60.0
    assert msg.header.frame_id == 'torso'
    trajectory = joint_trajectory_from_msg(msg, JOINTS)
    np.testing.assert_array_equal(trajectory.positions[:2], [FOLDED, FOLDED])
    delay = RULES.controller_delay
    assert trajectory.times[1] == pytest.approx(ahead(delay) + delay + BEFORE, abs=2e-3)
    for values in (trajectory.velocities, trajectory.accelerations):
        assert not values[[0, -1]].any()
    assert pointing_error(load_arm(), trajectory.positions[-1], np.array([1.5, 0.1, 0.3])) < 1e-6
    assert len(stranger.received['rrth_planner/tool_path'][0].poses) > 1
    shown = {m.ns for m in stranger.received['rrth_planner/markers'][0].markers}
    assert shown == {'', 'body', 'arm_start', 'arm_goal', 'ray', 'tool_path'}


def test_each_answer_is_published_with_its_figures_and_the_stamp_of_its_motion(start):
    planner, stranger = start(seed=3)
    stranger.subscribe('rrth_planner/answer', DiagnosticStatus, 100)
    stranger.wait_until(lambda: planner.count_subscribers('rrth_planner/answer') > 0)
    say_all(planner, stranger)
    solved = answer_from_text(stranger.answer().message)
    stranger.publishers['target'].publish(target(0.0, 0.0, 0.0))
    stranger.wait_until(lambda: not inputs_of(planner).target.value.target.any())
    rejected = answer_from_text(stranger.answer().message)
    # A request whose answer has no sentence has a number, too.
    request = GetPlan.Request()
    request.goal.pose.position.x = 1.5
    path = stranger.answer('get_plan', request).plan
    received = stranger.received['rrth_planner/answer']
    stranger.wait_until(lambda: len(received) == 3)
    found = [answer_from_msg(msg) for msg in received]
    name = planner.get_fully_qualified_name()[1:]
    assert {msg.name for msg in received} == {f'{name}: answer'}
    assert [ord(msg.level) for msg in received] == [0, 1, 0]
    assert [answer.number for answer in found] == [1, 2, 3]
    assert (solved.number, rejected.number) == (1, 2)
    assert [answer.text for answer in found[:2]] == [solved.text, rejected.text]
    stranger.wait_until(lambda: len(stranger.received['joint_trajectory']) == 2)
    stamps = [nanoseconds_of(m.header.stamp) for m in stranger.received['joint_trajectory']]
    assert [answer.stamp for answer in found] == [stamps[0], None, stamps[1]]
    assert path.poses
    motion = joint_trajectory_from_msg(stranger.received['joint_trajectory'][0], JOINTS)
    figures = found[0].figures
    assert figures['seed'] == 3
    # Before it the arm rests until any controller has it.
    assert figures['duration'] == pytest.approx(motion.duration - motion.times[1], abs=1e-6)
    for key in ('planning_time_ms', 'response_time_ms', 'path_length', 'waypoints'):
        assert figures[key] > 0.0
    assert 'duration' not in found[1].figures


def test_get_plan_takes_its_target_and_returns_the_path_of_the_tool(start):
    planner, stranger = start()
    say_all(planner, stranger, but=('target',))
    request = GetPlan.Request()
    request.goal.pose.position.x, request.goal.pose.position.z = 1.5, 0.3
    path = stranger.answer('get_plan', request).plan
    assert path.header.frame_id == 'torso'
    assert len(path.poses) > 1
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])


@pytest.mark.parametrize(
    ('field', 'value', 'code'),
    [
        ('start.header.frame_id', 'torso', 'INVALID_GOAL_CONSTRAINTS (-16)'),
        ('start.pose.position.x', 0.5, 'INVALID_GOAL_CONSTRAINTS (-16)'),
        ('start.pose.orientation.w', 0.5, 'INVALID_GOAL_CONSTRAINTS (-16)'),
        ('goal.header.frame_id', 'camera', 'FRAME_TRANSFORM_FAILURE (-21)'),
        ('goal.pose.position.x', NAN, 'INVALID_GOAL_CONSTRAINTS (-16)'),
        ('goal.pose.position.x', 0.01, 'GOAL_IN_COLLISION (-12)'),
    ],
)
def test_get_plan_answers_a_bad_request_with_an_empty_path(start, field, value, code):
    planner, stranger = start()
    say_all(planner, stranger)
    request = GetPlan.Request()
    request.goal.pose.position.z = 0.01
    thing, *names = request, *field.split('.')
    for name in names[:-1]:
        thing = getattr(thing, name)
    setattr(thing, names[-1], value)
    assert not stranger.answer('get_plan', request).plan.poses
    stranger.wait_until(lambda: stranger.value('last code') == code)
    assert not stranger.received['joint_trajectory']


@pytest.mark.parametrize(
    ('messages', 'answer'),
    [
        ({'body_boxes': array(command(Marker.DELETEALL))}, 'UNABLE_TO_AQUIRE_SENSOR_DATA (-5): '),
        (
            {'body_boxes': array(box('pack', center=(-0.3, -0.1, 0.3), text='back pack'))},
            'START_STATE_IN_COLLISION (-10): ',
        ),
        ({'joint_states': joints([0.0, 1.0, 0.0, 0.0])}, 'START_STATE_INVALID (-26): joint_2'),
        ({'target': target(0.0, 0.0, 0.0)}, 'GOAL_IN_COLLISION (-12): the target'),
        # Nearer to the axis of the upper arm, in all configurations, than the ray runs beside it.
        ({'target': target(-0.24, -0.1, 0.5)}, 'NO_IK_SOLUTION (-31): no configuration'),
        (
            {'target': target(frame='camera')},
            'FRAME_TRANSFORM_FAILURE (-21): ',
        ),
        ({'target': target(NAN)}, 'INVALID_GOAL_CONSTRAINTS (-16): '),
        (
            {'body_boxes': array(box(frame='camera'))},
            'FRAME_TRANSFORM_FAILURE (-21): ',
        ),
        (
            {'body_boxes': array(box(size=(0.0, 1.0, 1.0)))},
            'UNABLE_TO_AQUIRE_SENSOR_DATA (-5): no good body yet',
        ),
        (
            {'joint_states': joints(FOLDED[:3], JOINTS[:3])},
            'UNABLE_TO_AQUIRE_SENSOR_DATA (-5): no good joint positions yet',
        ),
    ],
)
def test_each_obstacle_to_planning_has_its_code(start, messages, answer):
    planner, stranger = start()
    say_all(planner, stranger, **messages)
    response = stranger.answer()
    assert not response.success
    assert response.message.startswith(answer)
    stranger.wait_until(lambda: stranger.value('last code') == answer.split(':')[0])
    assert not stranger.received['joint_trajectory']


@pytest.mark.parametrize(
    ('option', 'value', 'answer'),
    [('max_samples', 100, 'PLANNING_FAILED (-1): '), ('time_limit', 0.05, 'TIMED_OUT (-6): ')],
)
def test_the_search_may_run_out_of_samples_or_time(start, option, value, answer):
    planner, stranger = start(**{**ENDLESS, option: value})
    say_all(planner, stranger, body_boxes=fenced())
    assert stranger.answer().message.startswith(answer)


def test_a_plan_is_cancelled_with_those_that_wait(start, wait_until):
    planner, stranger = start(**ENDLESS)
    say_all(planner, stranger, body_boxes=fenced())
    running, waiting = stranger.ask('plan'), stranger.ask('plan')
    stranger.await_turn()
    assert stranger.answer('cancel').message == 'SUCCESS (1): requests cancelled: 2'
    wait_until(lambda: running.done() and waiting.done())
    for future in (running, waiting):
        assert future.result().message.startswith('PREEMPTED (-7): ')
    assert not stranger.received['joint_trajectory']
    # Of a publisher of its own: another description, not a stream that sees no plates any more.
    stranger.say('body_boxes', wearer())
    wait_until(lambda: inputs_of(planner).body.value.n_boxes == 2)
    assert stranger.answer().success


def test_messages_are_received_and_callers_wait_while_it_plans(start, wait_until):
    planner, stranger = start(**ENDLESS)
    say_all(planner, stranger, body_boxes=fenced())
    first = stranger.ask('plan')
    stranger.await_turn()
    for k in range(20):
        stranger.publishers['target'].publish(target(1.4, 0.01 * k, 0.2))
        wait_until(lambda k=k: inputs_of(planner).target.value.target[1] == 0.01 * k)
    # Of a publisher of its own: another description, not a stream that sees no plates any more.
    stranger.say('body_boxes', wearer())
    wait_until(lambda: inputs_of(planner).body.value.n_boxes == 2)
    assert not first.done()
    stranger.answer('cancel')
    futures = [stranger.ask('plan') for _ in range(3)]
    wait_until(lambda: first.done() and all(f.done() for f in futures))
    assert not first.result().success
    assert all(f.result().success for f in futures)


def test_whatever_goes_wrong_is_answered(start, tmp_path):
    planner, stranger = start(incident_folder=str(tmp_path))
    say_all(planner, stranger)
    plan_question = stranger.script.plans

    def fail(*_):
        stranger.script.plans = plan_question
        raise ZeroDivisionError('of a test')

    stranger.script.plans = fail
    message = stranger.answer().message
    sentence = 'FAILURE (99999): planning failed unexpectedly: ZeroDivisionError: of a test; '
    (file,) = tmp_path.glob('incident-*')
    assert message == f'{sentence}to replay it: ./run exec replay {file}; answer 1'
    assert not stranger.received['joint_trajectory']
    assert stranger.answer().success


def test_a_planning_process_that_dies_is_an_answer_and_no_end(start, tmp_path):
    planner, stranger = start(incident_folder=str(tmp_path))
    say_all(planner, stranger)
    plan_question = stranger.script.plans

    def die(*_):
        stranger.script.plans = plan_question
        raise PlanningProcessError('the planning process ended with code -9 while working')

    stranger.script.plans = die
    message = stranger.answer().message
    assert message.startswith('FAILURE (99999): planning failed unexpectedly: PlanningProcessErr')
    assert 'ended with code -9' in message
    # What was asked is kept, to be asked again.
    assert len(list(tmp_path.glob('incident-*'))) == 1
    assert not stranger.received['joint_trajectory']
    assert stranger.answer().success


def test_what_was_cancelled_is_never_published(alone):
    one, ended = alone(), []
    # After the revalidation.
    one.host.on_read = lambda: ended.append(one.queue.cancel())
    assert one.answer().text == 'PREEMPTED (-7): the request was cancelled; answer 1'
    assert ended == [1]
    assert not one.publishers.motions
    one.host.on_read = lambda: None
    assert one.answer().trajectory is not None
    assert len(one.publishers.motions) == 1


def test_a_cancel_does_not_count_what_was_published(alone):
    one, ended = alone(), []
    one.publishers.on_view = lambda: ended.append(one.queue.cancel())
    assert one.answer().trajectory is not None
    one.run_until(lambda: ended)
    assert ended == [0]


def test_a_request_is_answered_before_its_motion_is_shown(start):
    planner, stranger = start()
    say_all(planner, stranger)
    is_answered = Event()

    def show_late(topic, msg, send):
        assert topic != 'markers' or is_answered.wait(30.0)
        send(msg)

    stranger.script.sends = show_late
    assert stranger.answer().success
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])
    assert not stranger.received['rrth_planner/markers']
    is_answered.set()
    stranger.wait_until(lambda: stranger.received['rrth_planner/markers'])


def test_an_error_in_showing_a_motion_does_not_revoke_it(start):
    planner, stranger = start()
    say_all(planner, stranger)
    failed = []

    def fail_to_show(topic, msg, send):
        if topic == 'markers':
            failed.append(msg)
            raise RuntimeError('no colours')
        send(msg)

    stranger.script.sends = fail_to_show
    for n in range(2):
        assert stranger.answer().success
        stranger.wait_until(lambda n=n: len(failed) == n + 1)


def test_nothing_is_published_once_the_node_closes(alone):
    one = alone()
    # After the revalidation.
    one.host.on_read = one.queue.close
    assert one.answer().text.startswith('PREEMPTED (-7): ')
    assert not one.publishers.motions


def test_a_new_algorithm_is_warmed_up_before_the_next_request(start):
    planner, stranger = start()
    say_all(planner, stranger)
    order, plan_question = [], stranger.script.plans

    def warm_up(_, options, __):
        time.sleep(0.2)
        order.append(type(options).__name__)

    def plan_in_turn(*question):
        order.append('plan')
        return plan_question(*question)

    stranger.script.warms_up, stranger.script.plans = warm_up, plan_in_turn
    planner.set_parameters([Parameter(name='margin', value=0.03)])
    planner.set_parameters([Parameter(name='algorithm', value='rrt')])
    assert stranger.answer().success
    assert order == ['RRTOptions', 'plan']


def test_parameters_are_asked_for_again_where_an_answer_is_lost(start, monkeypatch):
    planner, _ = start(margin=0.03)
    n_asked = []

    class Lossy(AsyncParameterClient):
        def get_parameters(self, names, callback=None):
            n_asked.append(len(names))
            return Future() if len(n_asked) % 2 else super().get_parameters(names, callback)

    monkeypatch.setattr(planner_client, 'AsyncParameterClient', Lossy)
    monkeypatch.setattr(planner_client, 'ASK_AGAIN', 0.1)
    client = planner_client.PlannerClient(namespace=planner.get_namespace())
    try:
        assert planner_client.parameters_of_planner(client).margin == 0.03
    finally:
        client.destroy_node()
    assert len(n_asked) >= 4


def test_diagnostics_bear_the_name_of_the_node_and_keep_to_10_hz(start):
    planner, stranger = start()
    arrays = stranger.received['/diagnostics']
    stranger.wait_until(lambda: arrays)
    name = planner.get_fully_qualified_name()[1:]
    assert arrays[-1].status[0].name == f'{name}: planning'
    begin, n_before, n_asked = time.monotonic(), len(arrays), 0
    request = GetPlan.Request()
    while time.monotonic() < begin + 1.0:
        n_asked += 1
        request.start.header.frame_id = f'frame_{n_asked}'
        stranger.answer('get_plan', request)
    # Each of them is a change.
    assert n_asked > 30
    assert 5 <= len(arrays) - n_before <= 13
    stranger.wait_until(lambda: f'"frame_{n_asked}"' in stranger.value('last sentence'), 0.9)


def test_the_same_seed_gives_the_same_trajectory(start):
    motions = []
    for _ in range(2):
        planner, stranger = start(seed=7, improve_time=0.0)
        say_all(planner, stranger)
        assert stranger.answer().success
        stranger.wait_until(lambda s=stranger: s.received['joint_trajectory'])
        motions.append(stranger.received['joint_trajectory'][-1])
    one, other = (joint_trajectory_from_msg(msg, JOINTS) for msg in motions)
    # How long each rests before it begins is up to the clock.
    for values in zip(one.states, other.states, strict=True):
        np.testing.assert_array_equal(*values)
    np.testing.assert_allclose(one.times, other.times, atol=2e-3)


def test_many_calls_at_once_are_all_answered(start):
    planner, stranger = start()
    say_all(planner, stranger)
    futures = [stranger.ask('plan') for _ in range(40)]
    stranger.wait_until(lambda: all(future.done() for future in futures))
    assert all(future.result().success for future in futures)


@pytest.fixture(name='process')
def _process():
    processes = []

    def run(*arguments):
        processes.append(
            subprocess.Popen(
                [sys.executable, '-m', 'rrth_planner.ros.planner_node', *arguments],
                stderr=subprocess.PIPE,
                text=True,
                env=os.environ | {'PYTHONPATH': os.pathsep.join(sys.path)},
            )
        )
        return processes[-1]

    yield run
    for process in processes:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_process_even_while_it_plans(process, spinning, wait_until, number):
    namespace = f'/process_{number}'
    given = ENDLESS | {'separation': 'false'}
    options = [word for k, v in given.items() for word in ('-p', f'{k}:={v}')]
    running = process('--ros-args', '-r', f'__ns:={namespace}', *options)
    stranger = Stranger(namespace, wait_until)
    with spinning(stranger.node):
        for name, (_, make) in TOPICS.items():
            stranger.say(name, fenced() if name == 'body_boxes' else make())
        wait_until(stranger.services['plan'].service_is_ready, 120.0)
        wait_until(
            lambda: all(
                stranger.value(f'age of {n} [s]') not in (None, 'inf')
                for n in ('body', 'target', 'joints')
            )
        )
        asked = stranger.ask('plan')
        # The request was sent before this answer, and requests are handled in turn.
        stranger.answer('get_plan', GetPlan.Request(start=_framed()))
        assert not asked.done()
        running.send_signal(number)
        _, errors = running.communicate(timeout=30)
    stranger.node.destroy_node()
    assert running.returncode == 0, errors
    assert 'Traceback' not in errors


def _framed():
    request = GetPlan.Request()
    request.start.header.frame_id = 'nowhere'
    return request.start


@pytest.mark.parametrize(
    ('argument', 'sentence'),
    [
        ('margin:=3.0', 'margin: 3.0, expected a number from 0 to 1 [m]'),
        ('margin:=1', 'margin: 1, expected a number from 0 to 1 [m]: write 1.0'),
        ('margn:=0.1', 'margn: no such parameter, the closest name is margin'),
        ('max_velocity:=[]', 'max_velocity: [], expected numbers from 0.001 to 1000000 [rad/s]'),
        ('max_velocity:=[1, 2, 1, 1]', 'write [1.0, 2.0, 1.0, 1.0]'),
        ('algorithm:=7', 'algorithm: 7, expected a text'),
        ('max_jerk:=[1.0, 2.0]', 'max_jerk: [1.0, 2.0], expected 4 values'),
    ],
)
def test_a_bad_parameter_ends_the_start_with_one_line(call, argument, sentence):
    ended = call(planner_module.run, '--ros-args', '-p', argument)
    assert ended.returncode == 1
    (line,) = ended.stderr.strip().splitlines()
    assert sentence in line


def test_a_start_that_fails_ends_the_process_and_its_planning_process(process):
    running = process('--ros-args', '-p', 'margin:=3.0')
    # The pipe closes when both have ended.
    _, errors = running.communicate(timeout=60)
    assert running.returncode == 1
    (line,) = errors.strip().splitlines()
    assert 'margin: 3.0, expected a number from 0 to 1 [m]' in line
