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
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rrth_planner.execution.tracked_motion import forget_command  # noqa: E402
from rrth_planner.model.errors import LONGEST_SENTENCE  # noqa: E402
from rrth_planner.pipeline.in_process_planner import InProcessPlanner  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
from rrth_planner.ros.playback_node import MOST_BYTES, PlaybackNode  # noqa: E402
from samples import array, box, FOLDED, JOINTS, joints, target, wearer  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import Header  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
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
MANY = settings(max_examples=300, deadline=None)


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
        self.errors = []

    def error(self, line):
        if 'Traceback' in line:
            self.errors.append(line)

    def warning(self, line, **_):
        if not line.isprintable() or len(line) > LONGEST_SENTENCE + 200:
            self.errors.append(line)

    info = warning


class Wire:
    """Gives messages to the planner as the middleware would, and keeps what it publishes."""

    def __init__(self, planner):
        self.planner, self.sent = planner, count(1)
        self.inputs = planner._scene_monitor._inputs
        self.subscriptions = dict(
            zip(('body', 'target', 'joints'), planner._scene_monitor._subscriptions, strict=True)
        )
        self.published, self.complaints = [], Complaints()
        planner.get_logger = lambda: self.complaints
        publishers = planner._queue._publishers
        publishers.publish_motion = lambda *motion: self.published.append(
            publishers.motion(*motion)
        )
        publishers.publish_view = lambda *a: None

    def say(self, name, msg, is_reliable=False):
        """Return whether a message was taken."""
        source = self.inputs.all[name]
        before = (source.n_rejected, source.value, source.measured)
        data = msg if isinstance(msg, bytes) else serialize_message(msg)
        n = next(self.sent)
        subscription = self.subscriptions[name]
        info = {'source_timestamp': n, 'publication_sequence_number': n}
        subscription._on_copy(data, info, 'reliable' if is_reliable else None)
        assert not self.complaints.errors
        if source.n_rejected > before[0]:
            assert source.n_rejected == before[0] + 1
            assert (source.value, source.measured) == before[1:]
            assert is_a_sentence(str(source.rejection))
            return False
        return True

    def plan(self):
        """Return the answer to a request, after checking what was published."""
        before = len(self.published)
        answer = finish(self.planner._on_plan(Trigger.Request(), Trigger.Response()), self.planner)
        assert is_a_sentence(answer.message)
        assert 'FAILURE (99999)' not in answer.message
        assert not self.complaints.errors
        assert len(self.published) == before + answer.success
        return answer

    def is_well(self):
        """Return whether good messages are taken, and planned with."""
        # The arm has executed nothing: what it was commanded before does not count.
        monitor = self.planner._monitor
        with monitor._lock:
            know(monitor, tracked=forget_command(monitor.watch.tracked))
        good = {'body': wearer(), 'target': target(), 'joints': joints()}
        return all(self.say(name, msg) for name, msg in good.items()) and self.plan().success


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
    yield Wire(planner)
    planner.close()
    planner.destroy_node()


@pytest.fixture(name='playback', scope='module')
def _playback(ros_context):
    node = PlaybackNode(namespace='/fire')
    complaints = Complaints()
    node.get_logger = lambda: complaints
    yield node
    assert not complaints.errors
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


@settings(max_examples=60, deadline=None)
@given(body=ARRAYS, aim=TARGETS, state=STATES)
def test_every_request_is_answered_and_the_next_good_one_succeeds(wire, body, aim, state):
    assert wire.is_well()
    for name, msg in (('body', body), ('target', aim), ('joints', state)):
        wire.say(name, msg)
    wire.plan()
    assert wire.is_well()


@settings(max_examples=60, deadline=None)
@given(
    q=st.lists(st.one_of(st.floats(-0.3, 0.3), NUMBERS), min_size=4, max_size=4),
    v=st.lists(st.one_of(st.floats(-1.6, 1.6), NUMBERS), min_size=4, max_size=4),
)
def test_any_moving_arm_gets_a_handover_or_a_rejection(wire, q, v):
    assert wire.is_well()
    wire.say('joints', joints(np.add(FOLDED, q).tolist(), velocity=v))
    wire.say('body', wearer())
    wire.plan()


@settings(max_examples=100, deadline=None)
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
    before = len(wire.published)
    planner = wire.planner
    answer = finish(planner._on_get_plan(request, GetPlan.Response()), planner)
    assert bool(answer.plan.poses) == len(wire.published) - before
    last = planner._reporter.last
    assert last is None or is_a_sentence(last.text)


@settings(max_examples=100, deadline=None)
@given(
    name=st.sampled_from(['algorithm', 'margin', 'seed', 'max_velocity', 'time_limit', 'nothing']),
    value=st.one_of(NUMBERS, st.integers(-(2**63), 2**63 - 1), TEXTS, ROWS, st.booleans()),
)
def test_any_parameter_is_taken_or_rejected_in_a_sentence(wire, name, value):
    planner = wire.planner
    before = planner._reporter.parameters
    known = [p for p in ('algorithm', 'margin', 'seed', 'max_velocity', 'time_limit') if p == name]
    old = [planner.get_parameter(p) for p in known]
    try:
        (result,) = planner.set_parameters([Parameter(name, value=value)])
    except Exception as problem:
        assert not known, problem
        return
    if not result.successful:
        assert is_a_sentence(result.reason)
        assert planner._reporter.parameters is before
    assert all(r.successful for r in planner.set_parameters(old))


def test_after_all_of_this_a_good_plan_succeeds(wire):
    assert wire.is_well()


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
    before = playback._playback
    playback._on_raw_trajectory(serialize_message(spoiled(spoils)))
    if should_stop:
        answer = playback._on_stop(Trigger.Request(), Trigger.Response())
        assert answer.success
        assert is_a_sentence(answer.message)
    playback._publish()
    assert np.isfinite(playback._state.position).all()
    assert np.isfinite(playback._state.velocity).all()
    if playback._playback is not before:
        # Back to where good motions begin.
        playback._follow(before)


@MANY
@given(data=st.binary(max_size=80))
def test_bytes_that_are_no_trajectory_are_rejected(playback, data):
    before = playback._playback
    playback._on_raw_trajectory(b'\0\1\0\0' + data)
    playback._on_raw_trajectory(data)
    assert playback._playback is before


def test_a_motion_of_too_many_bytes_is_rejected(playback):
    before = playback._playback
    playback._on_raw_trajectory(serialize_message(good_motion()) + bytes(MOST_BYTES))
    assert playback._playback is before


def test_after_all_of_this_a_good_motion_is_followed(playback):
    before = playback._playback
    playback._on_raw_trajectory(serialize_message(good_motion()))
    assert playback._playback is not before


def test_whatever_comes_over_the_wire_the_nodes_live_on(spinning, send, wait_until):
    planner = PlannerNode(
        InProcessPlanner(),
        namespace='/wire',
        parameter_overrides=[Parameter('separation', value=False)],
    )
    playback = PlaybackNode(namespace='/wire')
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

    @settings(max_examples=25, deadline=None, phases=[Phase.generate])
    @given(st.data())
    def fire(data):
        for publisher, messages, _ in publishers.values():
            publisher.publish(data.draw(messages))
            publisher.publish(b'\0\1\0\0' + data.draw(st.binary(max_size=40)))
        ask()

    # The planner's own motions would move the arm, whose joints the fire is about.
    playback.destroy_publisher(playback._joint_states)
    playback._joint_states = playback.create_publisher(JointState, 'elsewhere', 10)
    with spinning(planner), spinning(playback), spinning(stranger):
        wait_until(plan.service_is_ready)
        fire()
        for publisher, _, good in publishers.values():
            if good is not None:
                send(stranger, publisher, good)
        n, inputs = len(motions), planner._scene_monitor._inputs
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
