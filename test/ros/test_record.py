# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A recording holds the published messages, as an independent library reads them."""

from contextlib import contextmanager
from itertools import pairwise
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('mcap')
rosbags = pytest.importorskip('rosbags.highlevel')

from geometry_msgs.msg import PointStamped  # noqa: E402
from mcap.reader import make_reader  # noqa: E402
from mcap_ros2.decoder import DecoderFactory  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rosbags.typesys import get_types_from_msg, get_typestore, Stores  # noqa: E402
from rrth_planner.cli import record  # noqa: E402
from rrth_planner.cli.parsers.record import TOPICS  # noqa: E402
from rrth_planner.cli.plot import main as plot  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.ros.client.recording_reader import RecordingReader  # noqa: E402
from rrth_planner.ros.messages.definitions import definition_of, type_name, type_of_name  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
from samples import target, wearer  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

MODULE = [sys.executable, '-m', 'rrth_planner.cli.record']
# Cold, the planner is compiled first [s].
LONGEST_WAIT = 240.0
LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

pytestmark = pytest.mark.usefixtures('ros_context')


@contextmanager
def recording(*arguments):
    """Run a recorder until the block is left, then end it by Ctrl-C; yields its process."""
    process = subprocess.Popen(
        [*MODULE, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
        process.send_signal(signal.SIGINT)
        process.wait(LONGEST_WAIT)
    finally:
        process.kill()
        process.wait()


def subscribes(node, *topics):
    """Return whether the recorder subscribes to some topics, besides its best-effort reader."""
    return all(
        'rrth_recorder' in {info.node_name for info in node.get_subscriptions_info_by_topic(topic)}
        for topic in topics
    )


def messages_of(path):
    """Return the messages of a file by topic, as (log time, message), in the file's order."""
    found = {}
    with rosbags.AnyReader([path]) as reader:
        for connection, stamp, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((stamp, message))
    return found


def nanoseconds(stamp):
    """Return a stamp [ns]."""
    return stamp.sec * 10**9 + stamp.nanosec


@pytest.fixture(scope='module', name='run')
def _run(ros_context, tmp_path_factory):
    """Record one motion of planner and playback; return the file and what a node received."""
    path = tmp_path_factory.mktemp('run') / 'run.mcap'
    node, lines, motion, states = Node('test_client'), [], [], []
    node.create_subscription(JointTrajectory, 'joint_trajectory', motion.append, LATCHED)
    node.create_subscription(JointState, 'joint_states', states.append, 10)
    bodies = node.create_publisher(MarkerArray, 'body_boxes', LATCHED)
    targets = node.create_publisher(PointStamped, 'target', BEST_EFFORT)
    plan = node.create_client(Trigger, 'rrth_planner/plan')
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def wait_until(condition):
        end = time.monotonic() + LONGEST_WAIT
        while not condition():
            assert time.monotonic() < end, 'the condition did not come true in time'
            executor.spin_once(timeout_sec=0.05)

    # Before any subscription.
    bodies.publish(wearer())
    with (
        ChildProcess(
            'rrth_planner.ros.planner_node',
            ['--ros-args', '-p', 'seed:=1', '-p', 'separation:=false'],
            lines.append,
        ),
        ChildProcess('rrth_planner.ros.playback_node', [], lines.append),
    ):
        wait_until(plan.service_is_ready)
        wait_until(lambda: states)
        with recording('-o', path) as process:
            topics = [topic if topic[0] == '/' else f'/{topic}' for topic in TOPICS]
            wait_until(lambda: subscribes(node, *topics))
            wait_until(lambda: node.count_subscribers('target') > 1)
            # The planner and the arm know of the recorder.
            missing = {'receiving /diagnostics', 'receiving /joint_states'}
            while missing:
                line = process.stdout.readline()
                assert line, process.stderr.read()
                missing.discard(line.strip())
            while not motion:
                targets.publish(target())
                time.sleep(0.3)
                answer = plan.call_async(Trigger.Request())
                wait_until(answer.done)
                if answer.result().success:
                    wait_until(lambda: motion)
            q_end = np.array(motion[0].points[-1].positions)
            wait_until(lambda: np.abs(np.array(states[-1].position) - q_end).max() < 1e-6)
            # The file has the arm at rest, and a second of the planner's diagnostics.
            time.sleep(1.5)
        words = process.communicate()
    node.destroy_node()
    return path, motion[0], process.returncode, words


def test_a_recorder_ends_well_and_says_what_it_has(run):
    path, _, code, (said, complaints) = run
    assert code == 0, complaints
    found = messages_of(path)
    for topic in TOPICS:
        name = topic if topic[0] == '/' else f'/{topic}'
        assert f'{len(found[name]):8d}  {name}\n' in said
    assert f'{sum(map(len, found.values()))} messages in ' in said


def test_all_topics_of_a_run_are_there_with_their_types(run):
    with rosbags.AnyReader([run[0]]) as reader:
        types = {c.topic.lstrip('/'): c.msgtype for c in reader.connections}
    assert types == {topic.lstrip('/'): name for topic, name in TOPICS.items()}


def test_the_recorded_trajectory_is_the_received_one(run):
    ((_, found),) = messages_of(run[0])['/joint_trajectory']
    received = run[1]
    assert list(found.joint_names) == list(received.joint_names)
    assert nanoseconds(found.header.stamp) == nanoseconds(received.header.stamp)
    assert found.header.frame_id == received.header.frame_id
    assert len(found.points) == len(received.points)
    for one, other in zip(found.points, received.points, strict=True):
        assert nanoseconds(one.time_from_start) == nanoseconds(other.time_from_start)
        for field in ('positions', 'velocities', 'accelerations', 'effort'):
            np.testing.assert_array_equal(getattr(one, field), getattr(other, field))


def test_what_was_latched_before_is_recorded_once(run):
    ((_, body),) = messages_of(run[0])['/body_boxes']
    expected = wearer()
    assert [(m.ns, m.id, m.action) for m in body.markers] == [
        (m.ns, m.id, m.action) for m in expected.markers
    ]
    for one, other in zip(body.markers, expected.markers, strict=True):
        for axis in 'xyz':
            assert getattr(one.scale, axis) == getattr(other.scale, axis)
            assert getattr(one.pose.position, axis) == getattr(other.pose.position, axis)


def test_what_was_sent_with_best_effort_is_recorded(run):
    for _, found in messages_of(run[0])['/target']:
        point = target().point
        assert (found.point.x, found.point.y, found.point.z) == (point.x, point.y, point.z)


def test_every_message_has_its_times_and_none_comes_twice(run):
    now = time.time_ns()
    stamps = {'/joint_states': [], '/arm_playback/tool_pose': []}
    with run[0].open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            # On one machine, so on one clock: nothing comes before it was sent.
            assert now - 3600 * 10**9 < message.publish_time <= message.log_time < now
            if channel.topic in stamps:
                stamp = nanoseconds(decoded.header.stamp)
                assert stamp <= message.publish_time
                stamps[channel.topic].append((message.publish_time, stamp))
    for items in stamps.values():
        assert len(items) > 50
        in_order = [stamp for _, stamp in sorted(items)]
        assert all(a < b for a, b in pairwise(in_order))


def test_a_recording_reads_back_as_a_run(run):
    path, received, *_ = run
    arm = load_arm()
    reader = RecordingReader(path, arm, 'torso')
    found = reader.recording()
    assert not reader.rejected
    expected = joint_trajectory_from_msg(received, arm.joint_names)
    (motion,) = found.commanded
    for name in ('times', 'positions', 'velocities', 'accelerations'):
        np.testing.assert_array_equal(
            getattr(motion.trajectory, name), getattr(expected, name), name
        )
    np.testing.assert_allclose(found.positions[-1], expected.positions[-1], atol=1e-6)
    # The playback executes it to the bit, from its reception on, which is a little later.
    late = found.times[np.flatnonzero(found.velocities.any(axis=1))[0]] - motion.begin
    assert late > 0.0
    (since, scene), (_, aim) = found.bodies[-1], found.targets[-1]
    assert [box.name for box in scene.boxes] == ['torso/0', 'head/0']
    assert since < motion.begin
    point = target().point
    np.testing.assert_array_equal(aim, [point.x, point.y, point.z])
    states = {state for _, state in found.monitor_states}
    assert states
    assert states <= {'no motion', 'monitoring'}


@pytest.mark.parametrize('kind', ['png', 'svg', 'pdf'])
def test_a_recording_is_drawn(run, tmp_path, kind):
    image = pytest.importorskip('matplotlib.image')
    path = tmp_path / f'run.{kind}'
    assert plot(['recording', str(run[0]), '-o', str(path)]) == 0
    if kind == 'png':
        pixels = image.imread(path)[..., :3]
        assert all(half.std() > 0.02 for half in np.array_split(pixels, 2, axis=1))
    else:
        assert path.stat().st_size > 20_000


def test_names_follow_namespace_and_remaps_and_types_are_looked_up(tmp_path, spinning, wait_until):
    path, node = tmp_path / 'left.mcap', Node('talker')
    aims = node.create_publisher(PointStamped, '/aim', BEST_EFFORT)
    words = node.create_publisher(String, '/left/words', LATCHED)
    words.publish(String(data='a word'))
    options = ['--topics', 'target', 'words', 'words', '--duration', LONGEST_WAIT]
    remaps = ['--ros-args', '-r', '__ns:=/left', '-r', 'target:=/aim']
    with spinning(node), recording('-o', path, *options, *remaps) as process:
        wait_until(lambda: subscribes(node, '/aim', '/left/words'), LONGEST_WAIT)
        wait_until(lambda: aims.get_subscription_count() > 0, LONGEST_WAIT)
        for k in range(5):
            aims.publish(target(x=float(k)))
            time.sleep(0.1)
        time.sleep(1.0)
    node.destroy_node()
    assert process.returncode == 0
    found = messages_of(path)
    assert set(found) == {'/aim', '/left/words'}
    assert [message.data for _, message in found['/left/words']] == ['a word']
    x = [message.point.x for _, message in found['/aim']]
    assert x
    assert x == sorted(set(x))


@pytest.fixture(name='rejection')
def _rejection(call):
    """Give what returns the one sentence of a recorder that ends with code 1."""

    def sentence(*arguments):
        ended = call(record.main, *arguments)
        assert ended.returncode == 1, ended.stderr
        assert ended.stderr.startswith('record: ')
        assert len(ended.stderr.splitlines()) == 1, ended.stderr
        return ended.stderr

    return sentence


def test_a_recorder_without_messages_reports_that_and_leaves_no_file(tmp_path, rejection):
    path = tmp_path / 'run.mcap'
    said = rejection('-o', path, '--duration', 0.5, '--topics', 'target', 'nobody_says_this')
    assert 'no message received' in said
    assert 'ROS_DOMAIN_ID' in said
    assert not path.exists()


def test_a_file_is_never_overwritten(tmp_path, rejection):
    path = tmp_path / 'run.mcap'
    path.write_text('precious')
    assert 'exists already' in rejection('-o', path, '--duration', 0.5)
    assert path.read_text() == 'precious'


def test_a_folder_that_is_missing_is_named(tmp_path, rejection):
    said = rejection('-o', tmp_path / 'nowhere' / 'run.mcap', '--duration', 0.5)
    assert 'No such file or directory' in said


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--topics', 'bad name'], 'topic name must not contain'),
        (['--ros-args', '-r', 'nonsense'], 'nonsense'),
    ],
)
def test_names_that_are_none_are_rejected(tmp_path, rejection, arguments, words):
    path = tmp_path / 'run.mcap'
    said = rejection('-o', path, '--duration', 0.5, *arguments)
    assert words in said
    assert '.c:' not in said
    assert not path.exists()


@pytest.mark.parametrize('value', ['0', '-1', 'nan', 'soon'])
def test_a_bad_duration_is_rejected(value, call):
    ended = call(record.main, f'--duration={value}')
    assert ended.returncode == 2
    assert '--duration' in ended.stderr.splitlines()[-1]


def test_a_recording_that_cannot_begin_ends_the_process(tmp_path):
    ended = subprocess.run(
        [*MODULE, '-o', str(tmp_path / 'nowhere' / 'run.mcap'), '--duration', '0.5'],
        capture_output=True,
        text=True,
        timeout=LONGEST_WAIT,
    )
    assert ended.returncode == 1, ended.stderr
    assert ended.stderr.startswith('record: ')
    assert len(ended.stderr.splitlines()) == 1, ended.stderr


FULL = """
import resource, sys
from pathlib import Path
from sensor_msgs.msg import JointState
import os
from rrth_planner.model.errors import RrthError
from rrth_planner.ros.client.recorder import RecordingFile
path = Path(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
try:
    with RecordingFile(path) as file:
        file.add_topic('/joint_states', JointState)
        for k in range(1000):
            file.add('/joint_states', os.urandom(10_000), k, k)
except RrthError as problem:
    print(problem)
    sys.exit(0 if k < 999 else 3)
sys.exit(4)
"""


def test_a_disk_that_is_full_ends_the_recording_with_one_sentence(tmp_path):
    path = tmp_path / 'run.mcap'
    ended = subprocess.run(
        [sys.executable, '-c', FULL, str(path)],
        capture_output=True,
        text=True,
        timeout=LONGEST_WAIT,
        env=os.environ,
    )
    assert ended.returncode == 0, ended.stderr
    assert not ended.stderr
    (said,) = ended.stdout.splitlines()
    assert said == f'{path}: File too large, expected a writable file'


@pytest.mark.parametrize('name', [*dict.fromkeys([*TOPICS.values(), type_name(String)])])
def test_definitions_are_those_that_others_know(name):
    found = get_types_from_msg(definition_of(type_of_name(name)), name)
    known = get_typestore(Stores.ROS2_JAZZY).fielddefs
    assert name in found
    for inner, definition in found.items():
        assert definition[1] == known[inner][1], inner
