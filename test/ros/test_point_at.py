# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The command point_at from outside: beside real nodes, beside half of them, and alone.

Most runs are calls of its `main`, as a process takes seconds to load what this one has.
"""

from dataclasses import replace
from functools import partial
import gc
from itertools import count
import json
import os
import signal
import subprocess
import sys
import time
import warnings

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')
pytest.importorskip('tqdm')

from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rrth_planner.cli import point_at  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.io.resources import resource_path  # noqa: E402
from rrth_planner.io.wearer_file import load_body  # noqa: E402
from rrth_planner.model.arm import pointing_error  # noqa: E402
from rrth_planner.model.errors import MessageError, RrthError  # noqa: E402
from rrth_planner.model.status import ErrorCode  # noqa: E402
from rrth_planner.model.trajectory import Trajectory  # noqa: E402
from rrth_planner.requests.answer import Answer  # noqa: E402
from rrth_planner.ros.client import dry_run  # noqa: E402
from rrth_planner.ros.client.follow_motion import follow  # noqa: E402
from rrth_planner.ros.client.planner_client import NotInTimeError, PlannerClient  # noqa: E402
from rrth_planner.ros.messages.answer import (  # noqa: E402
    answer_from_msg,
    answer_from_text,
    answer_to_msg,
)
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.body_writer import body_from_file, body_to_msg  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_to_msg
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
from samples import FOLDED, joints  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Cold, the planner is compiled first [s].
LONGEST_RUN = 280.0
START = 250.0
BOXES = resource_path('config/body.yaml')
MARKERS = resource_path('msg_examples/body.yaml')
COMMAND = [sys.executable, '-m', 'rrth_planner.cli.point_at']


def run(*arguments):
    """Return how the command ended, as a process."""
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=LONGEST_RUN
    )


@pytest.fixture(name='call')
def _call(call):
    """Give what does as `run` does, but in this process."""
    return partial(call, point_at.main)


def report_of(how, *arguments):
    """Return the output of the command with --json, its exit code included; `run` or `call` it."""
    ended = how(*arguments, '--json')
    (line,) = ended.stdout.splitlines()
    report = json.loads(line)
    assert report['exit_code'] == ended.returncode, ended.stderr
    return report


def impatient(patch, owner, name, timeout):
    """Shorten the timeout of the command to a time [s] from the call of a function on."""
    function = getattr(owner, name)

    def hurried(client, *arguments):
        client.timeout = timeout
        return function(client, *arguments)

    patch.setattr(owner, name, hurried)


def read(client, msg):
    """Have a client take a joint state, as its executor would."""
    topic = client.resolve_topic_name('joint_states')
    take = next(s.callback for s in client.subscriptions if s.topic_name == topic)
    n = next(SENT)
    take(serialize_message(msg), {'source_timestamp': n, 'publication_sequence_number': n})


SENT = count(1)


class Bystander(Node):
    """Receives inputs and outputs of the planner, and stands in for an arm."""

    def __init__(self):
        """Subscribe."""
        super().__init__('bystander')
        self.motions, self.bodies = [], []
        # Not latched: what an earlier test has the planner publish is none of this one's.
        self.create_subscription(JointTrajectory, 'joint_trajectory', self.motions.append, 10)
        self.create_subscription(MarkerArray, 'body_boxes', self.bodies.append, 10)
        self._joints = self.create_publisher(JointState, 'joint_states', 10)

    def stand(self):
        """Publish the joints of an arm that never moves."""
        self.create_timer(0.05, lambda: self._joints.publish(joints()))


@pytest.fixture(scope='module')
def planner(ros_context):
    """Have a planner running as a process."""
    with ChildProcess(
        'rrth_planner.ros.planner_node',
        ['--ros-args', '-p', 'seed:=3', '-p', 'separation:=false'],
        lambda _: None,
    ) as child:
        yield child


@pytest.fixture
def bystander(ros_context, spinning):
    """Give a node that subscribes."""
    node = Bystander()
    with spinning(node):
        yield node
    node.destroy_node()


@pytest.fixture
def arm(planner):
    """Have a playback running as a process."""
    with ChildProcess('rrth_planner.ros.playback_node', [], lambda _: None) as child:
        yield child


@pytest.mark.slow
def test_with_separation_the_body_of_a_file_stands_there_until_the_arm_has_arrived(ros_context):
    separated = ['--ros-args', '-r', '__ns:=/separated']
    settings = ['-p', 'separation:=true', '-p', 'seed:=3']
    with (
        ChildProcess('rrth_planner.ros.planner_node', [*separated, *settings], lambda _: None),
        ChildProcess('rrth_planner.ros.playback_node', separated, lambda _: None),
    ):
        words = ('--body', BOXES, '--timeout', START, *separated, '--')
        report = report_of(run, 1.5, 0.1, 0.3, *words)
    assert report['exit_code'] == 0, report
    assert report['arrived'] is True
    assert report['pointing_error'] < 1e-3


@pytest.mark.slow
def test_the_arm_points_at_the_requested_target(arm, bystander, call, wait_until):
    # Volatile subscribers must be known to the planner before it publishes.
    wait_until(lambda: bystander.count_publishers('joint_trajectory'), START)
    wait_until(lambda: bystander.count_subscribers('joint_trajectory') > 1, START)
    time.sleep(1.0)
    report = report_of(run, 1.5, 0.1, 0.3, '--body', BOXES, '--timeout', START)
    assert report['exit_code'] == 0, report
    assert (report['code'], report['name'], report['arrived']) == (1, 'SUCCESS', True)
    assert report['pointing_error'] < 1e-3
    wait_until(lambda: bystander.motions)
    (motion,) = bystander.motions
    end = motion.points[-1].time_from_start
    # It rests a little before it begins.
    assert 0.0 < end.sec + 1e-9 * end.nanosec - report['figures']['duration'] < 0.1
    assert report['figures']['seed'] == 3
    assert report['figures']['least_clearance'] >= 0.02
    assert (
        pointing_error(load_arm(), np.array(motion.points[-1].positions), [1.5, 0.1, 0.3]) < 1e-6
    )

    # The body stays; without --json the figures are those of the answer.
    ended = call(0.3, 1.3, 0.2)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith('SUCCESS (1): ')
    assert 'the ray misses the target by' in ended.stdout
    wait_until(lambda: len(bystander.motions) >= 2)

    # A target that the planner rejects moves nothing.
    report = report_of(call, 0, 0, 0)
    assert (report['exit_code'], report['name']) == (1, 'GOAL_IN_COLLISION')
    assert 'inside box' in report['sentence']
    assert report['arrived'] is False
    ended = call(1.5, 0.1, 0.3, '--frame', 'nowhere')
    assert ended.returncode == 1
    assert ended.stderr.startswith('FRAME_TRANSFORM_FAILURE (-21): ')
    assert len(bystander.motions) == 2


@pytest.mark.slow
@pytest.mark.parametrize('body', [BOXES, MARKERS])
def test_planning_without_moving_publishes_nothing(planner, bystander, call, body):
    bystander.stand()
    report = report_of(call, 1.5, 0.1, 0.3, '--no-move', '--body', body, '--timeout', START)
    assert (report['exit_code'], report['name'], report['arrived']) == (0, 'SUCCESS', None)
    # The planner's own seed and limits, so that this is the motion that it would make.
    assert report['figures']['seed'] == 3
    assert report['figures']['duration'] > 0.5
    assert report['pointing_error'] < 1e-6
    rejected = report_of(call, 0, 0, 0, '--no-move', '--body', body)
    assert (rejected['exit_code'], rejected['name']) == (1, 'GOAL_IN_COLLISION')
    assert not bystander.motions
    assert not bystander.bodies


@pytest.mark.slow
def test_a_dry_run_plans_round_the_received_body(planner, bystander, call, monkeypatch):
    bystander.stand()
    with monkeypatch.context() as patch:
        impatient(patch, dry_run, 'plan_without_moving', 2.0)
        silent = report_of(call, 1.5, 0.1, 0.3, '--no-move', '--timeout', START)
    assert silent['exit_code'] == 3
    assert '/body_boxes' in silent['sentence']
    latched = bystander.create_publisher(MarkerArray, 'body_boxes', LATCHED)
    latched.publish(body_to_msg(load_body(), 'torso'))
    received = report_of(call, 1.5, 0.1, 0.3, '--no-move', '--timeout', START)
    assert received['exit_code'] == 0, received
    assert not bystander.motions


@pytest.mark.slow
def test_an_arm_that_does_not_follow_has_not_arrived(planner, bystander, call):
    bystander.stand()
    begin = time.monotonic()
    report = report_of(call, 1.5, 0.1, 0.3, '--body', MARKERS, '--timeout', START)
    # The planner says so, long before the timeout.
    assert time.monotonic() - begin < START
    assert (report['exit_code'], report['name'], report['arrived']) == (4, 'SUCCESS', False)
    assert 'the arm is at rest off its motion, and does not follow it' in report['sentence']
    assert report['pointing_error'] > 0.1


def test_an_arm_that_stays_off_the_end_of_its_motion_is_not_waited_for_for_ever(ros_context):
    # No planner of other tests sends it a motion.
    client, arm = PlannerClient('point_at', 0.5, namespace='/alone'), load_arm()
    client.joint_names = arm.joint_names
    motion, message = turn(np.array(FOLDED) + 0.1, 0.1)
    client.commanded = [message]
    read(client, joints(FOLDED))
    with pytest.raises(NotInTimeError, match='is 0.1000 from the end of its motion of 0.10 s'):
        follow(client, arm, motion, None, 1e-3, Answer(ErrorCode.SUCCESS, ''))


@pytest.mark.slow
def test_without_joint_positions_nothing_is_asked_for(planner, bystander, call, monkeypatch):
    impatient(monkeypatch, PlannerClient, 'wait_for_state', 0.5)
    report = report_of(call, 1.5, 0.1, 0.3, '--body', MARKERS, '--timeout', START)
    assert report['exit_code'] == 3
    assert '/joint_states of joint_1' in report['sentence']
    assert not bystander.bodies


def test_without_a_planner_it_says_so_in_time(call):
    begin = time.monotonic()
    ended = call(1.5, 0.1, 0.3, '--timeout', '0.5', '--ros-args', '-r', '__ns:=/alone')
    assert ended.returncode == 3
    assert ended.stdout == ''
    assert len(ended.stderr.splitlines()) == 1
    assert '/alone/rrth_planner' in ended.stderr
    assert time.monotonic() - begin < LONGEST_RUN


def test_it_can_be_interrupted(bystander, wait_until):
    process = subprocess.Popen(
        [*COMMAND, '1.5', '0.1', '0.3', '--json', '--ros-args', '-r', '__ns:=/alone'],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        # A signal before Python is up would end it without a word.
        nodes = bystander.get_node_names_and_namespaces
        wait_until(lambda: ('point_at', '/alone') in nodes(), 120.0)
        process.send_signal(signal.SIGTERM)
        words, _ = process.communicate(timeout=60.0)
    finally:
        process.kill()
    assert process.returncode == 130
    assert json.loads(words)['sentence'] == 'interrupted'


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['1', '2'], 'Z'),
        (['1', 'two', '3'], '"two", expected a finite number [m]'),
        (['1', 'nan', '3'], 'nan, expected a finite number [m]'),
        (['1', '2', '3', '--timeout', '0'], '--timeout: 0, expected a number > 0 [s]'),
        (['1', '2', '3', '--body', '/nowhere.yaml'], '--body: file /nowhere.yaml'),
        (['1', '2', '3', '--body', str(resource_path('config/arm.yaml'))], 'no body, expected'),
        (['1', '2', '3', '--ros-args', '-r', 'nonsense'], '--ros-args'),
    ],
)
def test_wrong_usage_is_said_before_anything_is_waited_for(arguments, words, call):
    ended = call(*arguments)
    assert ended.returncode == 2
    assert words in ended.stderr


def test_wrong_words_for_ros_are_wrong_usage():
    ended = run('1', '2', '3', '--ros-args', '-r', 'nonsense')
    assert ended.returncode == 2
    assert ended.stderr.startswith('point_at: --ros-args: ')
    assert len(ended.stderr.splitlines()) == 1


def test_the_help_names_every_exit_code(call):
    ended = call('--help')
    assert ended.returncode == 0
    codes = ended.stdout.split('exit codes:')[1].split('--json')[0].split('\n')
    assert [line.split()[0] for line in codes if line[2:3].isdigit()] == [
        '0',
        '1',
        '2',
        '3',
        '4',
        '130',
    ]


@pytest.fixture
def client(ros_context):
    """Give a client without a planner."""
    client = PlannerClient('point_at', 0.5)
    yield client
    client.destroy_node()


def test_a_destroyed_client_leaves_nothing_to_destroy_again(ros_context, monkeypatch):
    ignored = []
    monkeypatch.setattr(sys, 'unraisablehook', ignored.append)
    client = PlannerClient('point_at', 0.5)
    condition = client._spinner._sigint_gc
    client.destroy_node()
    # The garbage collector may take it before what holds it.
    condition.__del__()
    client._spinner.__del__()
    del client, condition
    gc.collect()
    assert not ignored


def test_an_interrupt_in_mid_step_leaves_no_other_words(client):
    def interrupt():
        raise KeyboardInterrupt

    client.create_timer(0.001, interrupt)
    with warnings.catch_warnings():
        with pytest.raises(KeyboardInterrupt):
            client.take_messages(10.0)
        assert warnings.filters[0][:3:2] == ('ignore', RuntimeWarning)


def turn(to, duration, begin=0.0):
    """Return a motion from rest to rest, and its message that starts at a time [s]."""
    motion = Trajectory(
        times=[0.0, duration],
        positions=[FOLDED, to],
        velocities=np.zeros((2, 4)),
        accelerations=np.zeros((2, 4)),
    )
    return motion, joint_trajectory_to_msg(motion, load_arm().joint_names, '', begin)


def test_a_motion_of_another_machine_is_ignored(client):
    arm = load_arm()
    client.joint_names = arm.joint_names
    first, message = turn(np.array(FOLDED) + 0.1, 0.1, 100.5)
    second, newer = turn(np.array(FOLDED) + 0.2, 0.1, 101.5)
    other = JointTrajectory(header=message.header, joint_names=['wheel'])
    answer = Answer(ErrorCode.SUCCESS, '', number=3, stamp=100_500_000_000)
    for stamp, expected in (
        (answer.stamp, 'joint_trajectory: nothing for'),
        (None, 'rrth_planner/answer: no stamp of answer 3'),
    ):
        client.commanded = [other, newer]
        with pytest.raises(NotInTimeError, match=expected):
            client.motion_of(replace(answer, stamp=stamp))
    # Not the last one, nor by its duration.
    client.commanded = [other, message, newer]
    assert client.motion_of(answer).positions.tolist() == first.positions.tolist()
    # Afterwards the planner sends the arm elsewhere, and the other machine gets a motion.
    came = iter([[], [other], [newer, other]])

    def take_messages(_):
        time.sleep(0.02)
        client.commanded += next(came, [])
        ours = [msg for msg in client.commanded if msg.points][-1]
        read(client, joints(ours.points[-1].positions))
        read(client, joints(FOLDED[:2]))

    client.take_messages = take_messages
    follow(client, arm, first, None, 1e-3, Answer(ErrorCode.SUCCESS, ''))
    assert client.positions().tolist() == second.positions[-1].tolist()


def test_joint_positions_that_are_none_do_not_count(client):
    client.joint_names = load_arm().joint_names
    read(client, joints(FOLDED))
    for bad in (joints(FOLDED[:2]), joints([float('nan')] * 4), JointState(name=['wheel'])):
        read(client, bad)
    assert client.positions().tolist() == FOLDED
    assert len(client.observed) == 1


def test_an_answer_is_read_back():
    figures = {'waypoints': 2, 'duration': 1.426, 'path_length': 1.943, 'seed': 1043618065}
    figures |= {'least_clearance': -0.0389, 'planning_time_ms': 3.9, 'response_time_ms': 12.5}
    for given in (
        Answer(ErrorCode.SUCCESS, 'so; answer 12', figures, 12, 1764410692_000000007),
        Answer(ErrorCode.NO_IK_SOLUTION, 'no; answer 13', {'seed': 7}, 13),
    ):
        msg = answer_to_msg('rrth_planner: answer', given)
        assert answer_from_msg(msg) == given
        # Without the figures the text says which one it is.
        assert answer_from_text(given.text) == replace(given, figures={}, stamp=None)
        assert answer_from_text(msg.message).number == given.number
    assert 'stamp' not in {pair.key for pair in msg.values}
    for text in ('', 'SUCCESS', 'SUCCESS (2): what'):
        with pytest.raises(MessageError, match='expected NAME'):
            answer_from_text(text)
    for pair, value in ((msg.values[0], 'many'), (msg.values[-1], '1.5 apples')):
        pair.value, before = value, pair.value
        with pytest.raises(MessageError, match='expected an answer'):
            answer_from_msg(msg)
        pair.value = before
    msg.values.clear()
    with pytest.raises(MessageError, match='expected an answer'):
        answer_from_msg(msg)


def test_a_body_of_either_layout_is_the_same_body():
    scenes = [
        scene_of(WearerBody().apply(body_from_file(path, 'torso'), 0.0, 'torso'))
        for path in (BOXES, MARKERS)
    ]
    for one, other in zip(*(scene.boxes for scene in scenes), strict=True):
        assert one.name.split('/')[0] == other.name.split('/')[0]
        np.testing.assert_allclose(one.center, other.center)
        np.testing.assert_allclose(one.size, other.size)
        np.testing.assert_allclose(one.rotation, other.rotation, atol=1e-12)


def test_a_body_replaces_every_box_before():
    before = WearerBody().apply(body_from_file(MARKERS, 'torso'), 0.0, 'torso')
    after = before.apply(body_to_msg(load_body(), 'torso'), 0.0, 'torso')
    assert after.n_boxes == len(load_body().boxes)


def test_a_file_that_is_no_body_is_rejected_by_name(tmp_path):
    file = tmp_path / 'boxes.yaml'
    for text in ('boxes: []', 'markers: 7', 'markers: [{nothing: 1}]', '[]', '}{'):
        file.write_text(text)
        with pytest.raises(RrthError, match=os.path.basename(file)):
            body_from_file(file, 'torso')
