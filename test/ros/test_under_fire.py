# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever comes over the wire, no callback fails, and what is rejected changes nothing."""

from itertools import count
import math
import time

from hypothesis import assume, given, Phase, settings, strategies as st
import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from builtin_interfaces.msg import Duration, Time  # noqa: E402
from geometry_msgs.msg import (  # noqa: E402
    Point,
    PointStamped,
    Pose,
    PoseStamped,
    Quaternion,
    Vector3,
)
from monitored import know  # noqa: E402
from nav_msgs.srv import GetPlan  # noqa: E402
import rclpy  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from rrth_planner.execution.tracked_motion import TrackedMotion  # noqa: E402
from rrth_planner.execution.watch import MonitorState  # noqa: E402
from rrth_planner.model.errors import LONGEST_SENTENCE  # noqa: E402
from rrth_planner.pipeline.in_process_planner import InProcessPlanner  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
from rrth_planner.ros.playback_node import MOST_BYTES, PlaybackNode  # noqa: E402
from samples import array, box, FOLDED, JOINTS, joints, target, wearer  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import Header  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from stranger import inputs_of  # noqa: E402
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')

NASTY = [math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1e-310, 1e4, -1e4, 1e300, -1.8e308 / 2]
NUMBERS = st.one_of(st.sampled_from(NASTY), st.floats(-2.0, 2.0), st.floats())
LENGTHS = st.one_of(st.floats(0.01, 2.0), NUMBERS)
# Control characters that would write more lines into a log, and some beyond the first plane.
TEXTS = st.one_of(
    st.sampled_from(['', 'torso', 'torso', 'camera', 'a\nb', '\x1b[2J', 'Ω🦾\u202e', 'x' * 2000]),
    st.text(max_size=20),
)
STAMPS = st.builds(
    Time,
    sec=st.one_of(st.sampled_from([0, 2**31 - 1, -(2**31), -1]), st.integers(-(2**31), 2**31 - 1)),
    nanosec=st.one_of(st.sampled_from([0, 2**32 - 1]), st.integers(0, 2**32 - 1)),
)
LIFETIMES = st.builds(
    Duration,
    sec=st.sampled_from([0, 0, 0, 1, -1, 2**31 - 1, -(2**31)]),
    nanosec=st.sampled_from([0, 1, 2**32 - 1]),
)
HEADERS = st.builds(Header, stamp=STAMPS, frame_id=TEXTS)
POINTS = st.builds(Point, x=NUMBERS, y=NUMBERS, z=NUMBERS)
QUATERNIONS = st.one_of(
    st.just(Quaternion(w=1.0)),
    st.just(Quaternion(w=0.0)),
    st.builds(Quaternion, x=NUMBERS, y=NUMBERS, z=NUMBERS, w=NUMBERS),
)
POSES = st.builds(Pose, position=POINTS, orientation=QUATERNIONS)
MARKERS = st.builds(
    Marker,
    header=HEADERS,
    ns=TEXTS,
    id=st.one_of(st.integers(-2, 2), st.sampled_from([-(2**31), 2**31 - 1])),
    type=st.one_of(st.sampled_from([Marker.CUBE, Marker.CUBE_LIST]), st.integers(-1, 20)),
    action=st.one_of(st.sampled_from([0, 2, 3]), st.integers(-(2**31), 2**31 - 1)),
    pose=POSES,
    scale=st.builds(Vector3, x=LENGTHS, y=LENGTHS, z=LENGTHS),
    lifetime=LIFETIMES,
    points=st.lists(POINTS, max_size=3),
    text=TEXTS,
)
ARRAYS = st.builds(MarkerArray, markers=st.lists(MARKERS, max_size=4))
TARGETS = st.builds(PointStamped, header=HEADERS, point=POINTS)
NAMES = st.one_of(
    st.just(JOINTS),
    st.permutations(JOINTS),
    st.lists(st.one_of(st.sampled_from(JOINTS), TEXTS), max_size=8),
)
ROWS = st.one_of(st.lists(NUMBERS, min_size=4, max_size=4), st.lists(NUMBERS, max_size=9))
STATES = st.builds(
    JointState, header=HEADERS, name=NAMES, position=ROWS, velocity=ROWS, effort=ROWS
)
# One thing after another is wrong with a motion that would be taken.
SPOILS = st.lists(
    st.one_of(
        st.tuples(
            st.sampled_from(['positions', 'velocities', 'accelerations', 'effort']),
            st.integers(0, 2),
            ROWS,
        ),
        st.tuples(
            st.just('time_from_start'),
            st.integers(0, 2),
            st.builds(
                Duration,
                sec=st.sampled_from([0, 1, 2, -1, 2**31 - 1, -(2**31)]),
                nanosec=st.sampled_from([0, 1, 2**32 - 1]),
            ),
        ),
        st.tuples(st.just('stamp'), st.just(0), STAMPS),
        st.tuples(st.just('joint_names'), st.just(0), NAMES),
        st.tuples(st.just('end'), st.integers(0, 2), st.floats(-1.0, 1.0)),
    ),
    max_size=3,
)
WIRES = {
    'body': ('/fire/body_boxes', MarkerArray),
    'target': ('/fire/target', PointStamped),
    'joints': ('/fire/joint_states', JointState),
}
MANY = settings(max_examples=300)


def is_a_sentence(text):
    """Return whether a text is one line of bounded length."""
    return 0 < len(text) <= LONGEST_SENTENCE and text.isprintable()


def finish(coroutine, planner):
    """Return what a service's callback returns, without an executor."""
    end = time.monotonic() + 30.0
    try:
        while time.monotonic() < end:
            coroutine.send(None)
            planner.host.go_on()
    except StopIteration as answered:
        return answered.value
    raise AssertionError('not answered')


class Complaints:
    """A logger that keeps what only a fault of the node itself writes."""

    def __init__(self):
        self.errors, self.infos = [], []

    def error(self, line):
        if 'Traceback' in line:
            self.errors.append(line)

    def warning(self, line, **_):
        if not line.isprintable() or len(line) > LONGEST_SENTENCE + 200:
            self.errors.append(line)

    def info(self, line, **_):
        self.infos.append(line)
        self.warning(line)


def callbacks(entities, name):
    """Return what the executor calls for a topic or a service of a node, one for each reader."""
    return [e.callback for e in entities if name in (getattr(e, 'topic_name', ''), _service(e))]


def _service(entity):
    return getattr(entity, 'service_name', '')


class Listener:
    """Keeps what a node publishes on a topic."""

    def __init__(self, msg_type, topic):
        self.node, self.received = Node('listener'), []
        profile = QoSProfile(depth=100, durability=DurabilityPolicy.VOLATILE)
        self.node.create_subscription(msg_type, topic, self.received.append, profile)

    def count(self, at_least=0):
        """Return how many messages have come in all, once there are so many."""
        end = time.monotonic() + 30.0
        n = -1
        while n != len(self.received) or n < at_least:
            assert time.monotonic() < end, f'{n} messages, expected {at_least}'
            n = len(self.received)
            rclpy.spin_once(self.node, timeout_sec=0.1 if n < at_least else 0.0)
        return n


class Wire:
    """Gives messages to the planner as the middleware would, and keeps what it publishes."""

    def __init__(self, planner):
        self.planner, self.sent = planner, count(1)
        self.inputs = inputs_of(planner)
        self.complaints = Complaints()
        planner.get_logger = lambda: self.complaints
        self.listener = Listener(JointTrajectory, '/fire/joint_trajectory')
        # Of these it reads by another reader, too.
        stranger, topics = self.listener.node, {}
        for name, (topic, kind) in WIRES.items():
            stranger.create_publisher(kind, topic, 10)
            topics[name] = topic
        end = time.monotonic() + 30.0
        while any(len(self.readers(topic)) < 2 for topic in topics.values()):
            assert time.monotonic() < end
            rclpy.spin_once(planner, timeout_sec=0.1)
        self.callbacks = {name: self.readers(topic) for name, topic in topics.items()}
        self.services = {
            name: callbacks(planner.services, f'/fire/rrth_planner/{name}')[0]
            for name in ('plan', 'get_plan')
        }

    def readers(self, topic):
        """Return what takes messages of a topic: of a best-effort reader, of a reliable one."""
        return callbacks(self.planner.subscriptions, topic)

    def say(self, name, msg, is_reliable=False):
        """Return whether a message was taken."""
        source = self.inputs.all[name]
        before = (source.n_rejected, source.value, source.measured)
        data = msg if isinstance(msg, bytes) else serialize_message(msg)
        n = next(self.sent)
        info = {'source_timestamp': n, 'publication_sequence_number': n}
        self.callbacks[name][is_reliable](data, info)
        assert not self.complaints.errors
        if source.n_rejected > before[0]:
            assert source.n_rejected == before[0] + 1
            assert (source.value, source.measured) == before[1:]
            assert is_a_sentence(str(source.rejection))
            return False
        return True

    def answer(self, name, request, response):
        """Return the answer of a service."""
        answer = finish(self.services[name](request, response), self.planner)
        assert not self.complaints.errors
        return answer

    def plan(self):
        """Return the answer to a request, after checking what was published."""
        for timer in self.planner.timers:
            timer.callback()
        before = self.listener.count()
        answer = self.answer('plan', Trigger.Request(), Trigger.Response())
        assert is_a_sentence(answer.message)
        assert 'FAILURE (99999)' not in answer.message
        assert self.listener.count(before + answer.success) == before + answer.success
        return answer

    def check(self):
        """Check that good messages are taken, and planned with."""
        # The arm has executed nothing: there is neither a command nor a motion to stop.
        idle = {'tracked': TrackedMotion(), 'state': MonitorState.IDLE, 'pending': None}
        know(self.planner._monitor, **idle)
        good = {'body': wearer(), 'target': target(), 'joints': joints()}
        for name, msg in good.items():
            assert self.say(name, msg), self.inputs.all[name].rejection
        answer = self.plan()
        while answer.message.startswith('TIMED_OUT'):
            # A busy machine.
            answer = self.plan()
        assert answer.success, answer.message


@pytest.fixture(name='wire', scope='module')
def _wire(ros_context):
    planner = PlannerNode(
        InProcessPlanner(),
        namespace='/fire',
        parameter_overrides=[
            Parameter('time_limit', value=0.2),
            Parameter('replan', value=False),
            Parameter('separation', value=False),
        ],
    )
    wire = Wire(planner)
    yield wire
    planner.close()
    for node in (planner, wire.listener.node):
        node.destroy_node()


class Arm:
    """A playback in simulated time, which is given motions as the middleware would."""

    def __init__(self):
        self.complaints = Complaints()
        self.node = PlaybackNode(
            namespace='/fire', parameter_overrides=[Parameter('use_sim_time', value=True)]
        )
        self.node.get_logger = lambda: self.complaints
        # Only one of its two readers passes on what it is given; the other one supervises.
        self.readers = callbacks(self.node.subscriptions, '/fire/joint_trajectory')
        (self.stop,) = callbacks(self.node.services, '/fire/arm_playback/stop')
        (self.tell,) = callbacks(self.node.subscriptions, '/clock')
        (timer,) = self.node.timers
        self.publish = timer.callback
        self.listener, self.n_published, self.now = (
            Listener(JointState, '/fire/joint_states'),
            0,
            0,
        )
        self.wait(1000)

    def take(self, data):
        """Return whether a motion is executed, by its bytes."""
        for read in self.readers:
            read(data)
        assert not self.complaints.errors
        lines, self.complaints.infos = self.complaints.infos, []
        return any(line.startswith('executing a motion') for line in lines)

    def wait(self, seconds):
        """Let a time pass; return where the arm is, and how fast."""
        self.now += seconds
        self.tell(Clock(clock=Time(sec=self.now)))
        self.publish()
        self.n_published += 1
        assert self.listener.count(self.n_published) == self.n_published
        state = self.listener.received[-1]
        return np.array(state.position), np.array(state.velocity)

    def go_home(self):
        """Return whether it can be stopped, and moved to where good motions begin."""
        assert self.stop(Trigger.Request(), Trigger.Response()).success
        q, v = self.wait(100)
        assert not v.any()
        rest = {'velocities': [0.0] * 4, 'accelerations': [0.0] * 4}
        points = [
            JointTrajectoryPoint(positions=row, time_from_start=Duration(sec=since), **rest)
            for row, since in ((q.tolist(), 0), (FOLDED, 100))
        ]
        msg = JointTrajectory(joint_names=JOINTS, points=points)
        return self.take(serialize_message(msg)) and self.is_home(200)

    def is_home(self, seconds=0):
        """Return whether it rests, after a time [s], where good motions begin."""
        q, v = self.wait(seconds)
        return not v.any() and np.abs(q - FOLDED).max() < 1e-9


@pytest.fixture(name='playback', scope='module')
def _playback(ros_context):
    arm = Arm()
    yield arm
    for node in (arm.node, arm.listener.node):
        node.destroy_node()


@MANY
@given(msg=ARRAYS, is_reliable=st.booleans())
def test_any_body_is_taken_or_rejected_whole(wire, msg, is_reliable):
    wire.say('body', msg, is_reliable)
    body = wire.inputs.body.value
    assert len({key for key, _ in body.parts}) == len(body.parts)
    for _, part in body.parts:
        for b in part.boxes:
            assert np.isfinite(b.center).all()
            assert (b.size > 0.0).all()
            assert is_a_sentence(b.name)


@MANY
@given(msg=TARGETS)
def test_any_target_is_taken_or_rejected(wire, msg):
    is_taken = wire.say('target', msg)
    if is_taken:
        assert np.isfinite(wire.inputs.target.value.target).all()


@MANY
@given(msgs=st.lists(STATES, min_size=1, max_size=3))
def test_any_joint_states_are_taken_rejected_or_of_others(wire, msgs):
    for msg in msgs:
        wire.say('joints', msg)
        reading = wire.inputs.joints.value
        if reading is not None:
            assert np.isfinite(reading.positions).all()


@MANY
@given(
    name=st.sampled_from(['body', 'target', 'joints']),
    data=st.binary(max_size=60),
    header=st.sampled_from([b'', b'\0\1\0\0', b'\0\0\0\0', b'\0\3\0\0']),
)
def test_bytes_that_are_no_message_are_rejected(wire, name, data, header):
    wire.say(name, header + data)


@settings(max_examples=60)
@given(body=ARRAYS, aim=TARGETS, state=STATES)
def test_every_request_is_answered_and_the_next_good_one_succeeds(wire, body, aim, state):
    wire.check()
    for name, msg in (('body', body), ('target', aim), ('joints', state)):
        wire.say(name, msg)
    wire.plan()
    wire.check()


@settings(max_examples=60)
@given(
    q=st.lists(st.one_of(st.floats(-0.3, 0.3), NUMBERS), min_size=4, max_size=4),
    v=st.lists(st.one_of(st.floats(-1.6, 1.6), NUMBERS), min_size=4, max_size=4),
)
def test_any_moving_arm_gets_a_handover_or_a_rejection(wire, q, v):
    wire.check()
    wire.say('joints', joints(np.add(FOLDED, q).tolist(), velocity=v))
    wire.say('body', wearer())
    wire.plan()


@settings(max_examples=100)
@given(
    start=st.builds(PoseStamped, header=HEADERS, pose=POSES),
    goal=st.builds(PoseStamped, header=HEADERS, pose=POSES),
    is_empty=st.booleans(),
)
def test_get_plan_answers_whatever_is_asked(wire, start, goal, is_empty):
    assume(is_empty or start != PoseStamped())
    wire.say('body', wearer())
    wire.say('joints', joints())
    request = GetPlan.Request(start=PoseStamped() if is_empty else start, goal=goal)
    before = wire.listener.count()
    answer = wire.answer('get_plan', request, GetPlan.Response())
    expected = before + bool(answer.plan.poses)
    assert wire.listener.count(expected) == expected
    last = reporter_of(wire).last
    assert last is None or is_a_sentence(last.text)


def reporter_of(wire):
    return wire.planner._reporter


@settings(max_examples=100)
@given(
    name=st.sampled_from(['algorithm', 'margin', 'seed', 'max_velocity', 'time_limit', 'nothing']),
    value=st.one_of(NUMBERS, st.integers(-(2**63), 2**63 - 1), TEXTS, ROWS, st.booleans()),
)
def test_any_parameter_is_taken_or_rejected_in_a_sentence(wire, name, value):
    planner = wire.planner
    reporter = reporter_of(wire)
    before = reporter.parameters
    known = [p for p in ('algorithm', 'margin', 'seed', 'max_velocity', 'time_limit') if p == name]
    old = [planner.get_parameter(p) for p in known]
    try:
        (result,) = planner.set_parameters([Parameter(name, value=value)])
    except Exception as problem:
        assert not known, problem
        return
    if not result.successful:
        assert is_a_sentence(result.reason)
        assert reporter.parameters is before
    assert all(r.successful for r in planner.set_parameters(old))


def test_after_all_of_this_a_good_plan_succeeds(wire):
    wire.check()


def good_motion():
    """Return a motion of three points that the playback takes from the folded state."""
    points = [
        JointTrajectoryPoint(
            positions=(np.array(FOLDED) - 0.02 * k).tolist(),
            velocities=[0.0] * 4,
            accelerations=[0.0] * 4,
            time_from_start=Duration(sec=k),
        )
        for k in range(3)
    ]
    return JointTrajectory(joint_names=JOINTS, points=points)


def spoiled(spoils):
    """Return a good motion after some changes."""
    msg = good_motion()
    for field, k, value in spoils:
        if field == 'stamp':
            msg.header.stamp = value
        elif field == 'joint_names':
            msg.joint_names = value
        elif field == 'end':
            msg.points[k].positions = [p + value for p in msg.points[k].positions]
        else:
            setattr(msg.points[k], field, value)
    return msg


@MANY
@given(spoils=SPOILS, should_stop=st.booleans())
def test_any_trajectory_is_executed_or_rejected(playback, spoils, should_stop):
    is_taken = playback.take(serialize_message(spoiled(spoils)))
    if should_stop:
        answer = playback.stop(Trigger.Request(), Trigger.Response())
        assert answer.success
        assert is_a_sentence(answer.message)
    states = playback.wait(0), playback.wait(1)
    assert np.isfinite(states).all()
    # By then it has stopped.
    assert not (should_stop and states[-1][1].any())
    assert playback.go_home() if is_taken else playback.is_home()


@MANY
@given(data=st.binary(max_size=80))
def test_bytes_that_are_no_trajectory_are_rejected(playback, data):
    assert not playback.take(b'\0\1\0\0' + data)
    assert not playback.take(data)


def test_a_motion_of_too_many_bytes_is_rejected(playback):
    assert not playback.take(serialize_message(good_motion()) + bytes(MOST_BYTES))
    assert playback.is_home(1)


def test_after_all_of_this_a_good_motion_is_followed(playback):
    assert playback.take(serialize_message(good_motion()))
    assert not playback.is_home(1)


def test_whatever_comes_over_the_wire_the_nodes_live_on(spinning, send, wait_until):
    planner = PlannerNode(
        InProcessPlanner(),
        namespace='/wire',
        parameter_overrides=[Parameter('separation', value=False)],
    )
    # The planner's own motions would move the arm, whose joints the fire is about.
    elsewhere = ['--ros-args', '-r', 'joint_states:=elsewhere']
    playback = PlaybackNode(namespace='/wire', cli_args=elsewhere)
    stranger, motions = Node('stranger', namespace='/wire'), []
    topics = {
        'body_boxes': (ARRAYS, wearer()),
        'target': (TARGETS, target()),
        'joint_states': (STATES, joints()),
        'joint_trajectory': (SPOILS.map(spoiled), None),
    }
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publishers = {}
    for name, (messages, good) in topics.items():
        kind = type(good) if good is not None else JointTrajectory
        publishers[name] = (stranger.create_publisher(kind, name, latched), messages, good)
    stranger.create_subscription(JointTrajectory, 'joint_trajectory', motions.append, latched)
    plan = stranger.create_client(Trigger, 'rrth_planner/plan')

    def ask():
        future = plan.call_async(Trigger.Request())
        wait_until(future.done)
        assert is_a_sentence(future.result().message)
        return future.result()

    @settings(max_examples=25, phases=[Phase.generate])
    @given(st.data())
    def fire(data):
        for publisher, messages, _ in publishers.values():
            publisher.publish(data.draw(messages))
            publisher.publish(b'\0\1\0\0' + data.draw(st.binary(max_size=40)))
        ask()

    with spinning(planner), spinning(playback), spinning(stranger):
        wait_until(plan.service_is_ready)
        fire()
        for publisher, _, good in publishers.values():
            if good is not None:
                send(stranger, publisher, good)
        n, inputs = len(motions), inputs_of(planner)
        wait_until(lambda: not any(source.is_last_rejected for source in inputs.all.values()))
        wait_until(lambda: ask().success)
        wait_until(lambda: len(motions) > n)
    planner.close()
    for node in (planner, playback, stranger):
        node.destroy_node()


def test_a_body_between_good_ones_does_not_shift_it(wire):
    assert wire.say('body', wearer())
    n = wire.inputs.body.value.n_boxes
    assert not wire.say('body', array(box('new'), box('bad', size=(math.nan, 1.0, 1.0))))
    assert wire.inputs.body.value.n_boxes == n
