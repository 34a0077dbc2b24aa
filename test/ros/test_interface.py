# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Names, frames, clocks and liveliness of the nodes, from outside."""

import os
import signal
import time
from types import SimpleNamespace

from builtin_interfaces.msg import Time
import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from geometry_msgs.msg import Point, PointStamped, TransformStamped  # noqa: E402
from rclpy.clock import ROSClock  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rclpy.time import Time as RosTime  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.model.arm import pointing_error  # noqa: E402
from rrth_planner.pipeline.in_process_planner import InProcessPlanner  # noqa: E402
from rrth_planner.ros.interface import scene_monitor  # noqa: E402
from rrth_planner.ros.messages import frames  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
from rrth_planner.ros.playback_node import PlaybackNode  # noqa: E402
from samples import array, box, command, FOLDED, JOINTS, joints, target, wearer  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from stranger import (  # noqa: E402, F401
    _start,
    inputs_of,
    LATCHED,
    say_all,
    Stranger,
    VOLATILE,
)
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')


def motion(q_to, seconds):
    """Return a motion from the folded state."""
    msg = JointTrajectory(joint_names=JOINTS)
    for k, q in enumerate((FOLDED, list(q_to))):
        point = JointTrajectoryPoint(positions=q, velocities=[0.0] * 4, accelerations=[0.0] * 4)
        point.time_from_start.sec = k * seconds
        msg.points.append(point)
    return msg


def test_markers_act_over_the_wire_as_in_rviz(start):
    planner, stranger = start()
    say_all(planner, stranger)
    body = inputs_of(planner).body

    def present():
        return body.value.at(planner.get_clock().now().nanoseconds * 1e-9)

    def boxes():
        return {b.name for _, part in present().parts for b in part.boxes}

    def say(*markers):
        stranger.publishers['body_boxes'].publish(array(*markers))

    hands = box('hands', center=(0.1, 0.0, 0.0), size=(0.05, 0.05, 0.05))
    hands.type, hands.points = Marker.CUBE_LIST, [Point(y=0.3), Point(y=-0.3)]
    hat = box('hat', center=(0.0, 0.0, 0.7), size=(0.2, 0.2, 0.1))
    hat.lifetime.nanosec = 3 * 10**8
    say(hands, hat)
    of_hands = {'hands/0[0]', 'hands/0[1]'}
    stranger.wait_until(lambda: boxes() == {'torso/0', 'head/0', 'hat/0', *of_hands})
    assert stranger.answer().success
    stranger.wait_until(lambda: boxes() == {'torso/0', 'head/0', *of_hands})
    say(command(Marker.DELETE, 'hands'), command(Marker.DELETE, 'head', 7))
    stranger.wait_until(lambda: boxes() == {'torso/0', 'head/0'})
    say(command(Marker.DELETEALL, 'head'))
    stranger.wait_until(lambda: boxes() == {'torso/0'})
    # Nothing is seen any more, but it is somewhere.
    say(command(Marker.DELETEALL))
    stranger.wait_until(lambda: not boxes())
    message = stranger.answer().message
    assert message.startswith('SENSOR_INFO_STALE (-24): the body on ')
    assert 'has lost parts: "hat/0", ' in message
    say(*(command(Marker.DELETE, ns) for ns in ('hat', 'head', 'torso')))
    # A motion was commanded: what is deleted meanwhile is kept for a while.
    stranger.wait_until(lambda: not present().lost)
    message = stranger.answer().message
    assert message.startswith('UNABLE_TO_AQUIRE_SENSOR_DATA (-5): the body on ')
    assert 'is empty' in message


def test_a_hand_that_a_stream_leaves_out_is_lost_over_the_wire(start):
    planner, stranger = start(keep_lost=0.5)
    say_all(planner, stranger)
    out, body = stranger.publishers['body_boxes'], inputs_of(planner).body
    hand = box('hands', 3, center=(0.2, 0.0, -0.5), size=(0.1, 0.1, 0.1), text='left hand')

    def until(condition, *markers):
        # A stream, whatever the machine does besides.
        def streamed():
            out.publish(array(*markers))
            return condition()

        stranger.wait_until(streamed)

    def known():
        return body.value.at(planner.get_clock().now().nanoseconds * 1e-9)

    until(lambda: known().n_boxes == 3, *wearer().markers, hand)
    until(lambda: stranger.value('lost parts') == '"left hand"', *wearer().markers)
    message = stranger.answer().message
    assert 'has lost parts: "left hand"; expected each of them to be published again' in message
    # Nothing moves: what is deleted is gone at once.
    gone = command(Marker.DELETE, 'hands', 3)
    until(lambda: not known().lost, gone, *wearer().markers[1:])
    until(lambda: known().n_boxes == 3, *wearer().markers, hand)
    assert stranger.answer().success
    # A motion was commanded: whoever deletes a part may not see it, which is no reason to hit it.
    until(lambda: known().lost, gone, *wearer().markers[1:])
    ((key, part),) = known().lost
    assert key == ('hands', 3)
    assert part.ends == pytest.approx(part.expires + 0.5)
    until(lambda: not known().lost, gone, *wearer().markers[1:])
    # After a pause another description of the same publisher replaces all of the last one.
    until(lambda: known().n_boxes == 3, *wearer().markers, hand)
    stranger.wait_until(lambda: stranger.value('monitor') in ('no motion', 'holding'))
    time.sleep(1.2)
    out.publish(wearer())
    stranger.wait_until(lambda: known().n_boxes == 2)
    assert not known().lost


def test_two_planners_on_one_host_answer_each_for_its_own_topics(spinning, wait_until):
    words = ['--ros-args', '-p', 'separation:=false', '-r', 'body_boxes:=/wearer', '-r', '__ns:=']
    planners = [
        PlannerNode(InProcessPlanner(), cli_args=[*words[:-1], f'{words[-1]}{ns}'])
        for ns in ('/a', '/b')
    ]
    strangers = [Stranger(ns, wait_until) for ns in ('/a', '/b')]
    assert [p.get_fully_qualified_name() for p in planners] == [
        '/a/rrth_planner',
        '/b/rrth_planner',
    ]
    points = ((1.5, 0.5, 0.3), (1.5, -0.5, 0.3))
    with spinning(*planners), spinning(*(s.node for s in strangers)):
        # One wearer for both, but a target and joints for each.
        strangers[0].say('/wearer', wearer())
        strangers[0].say('joint_states', joints())
        strangers[0].say('target', target(*points[0]))
        all_inputs = [inputs_of(p) for p in planners]
        wait_until(lambda: all_inputs[0].target.measured is not None)
        wait_until(lambda: all_inputs[0].joints.measured is not None)
        wait_until(lambda: all(inputs.body.measured is not None for inputs in all_inputs))
        assert strangers[0].answer().success
        assert 'no target yet on /b/target' in strangers[1].answer().message
        strangers[1].say('joint_states', joints())
        strangers[1].say('target', target(*points[1]))
        wait_until(lambda: all_inputs[1].joints.measured is not None)
        wait_until(lambda: all_inputs[1].target.measured is not None)
        assert strangers[1].answer().success
        wait_until(lambda: all(s.received['joint_trajectory'] for s in strangers))
    for stranger, point in zip(strangers, points, strict=True):
        (msg,) = stranger.received['joint_trajectory']
        q = np.array(msg.points[-1].positions)
        assert pointing_error(load_arm(), q, np.array(point)) < 1e-6
    for planner, stranger in zip(planners, strangers, strict=True):
        planner.close()
        planner.destroy_node()
        stranger.node.destroy_node()


class FakeTransformError(Exception):
    """What tf2_ros raises for a frame that it does not know."""


class FakeBuffer:
    """The part of tf2_ros.Buffer that the planner uses: one frame is known."""

    made = []

    def __init__(self, *, node):
        self.node, self.listener = node, None
        self.made.append(self)
        # The newest transform that came [ns]; it moves forward by a metre each second.
        self.newest = 0

    def lookup_transform(self, target_frame, source_frame, time):
        """Return a transform: a metre forward, turned about z by 90 degrees."""
        assert target_frame == 'torso'
        if source_frame == 'camera' and time.nanoseconds > self.newest:
            raise FakeTransformError('would require extrapolation into the future')
        if source_frame == 'broken':
            return TransformStamped()
        if source_frame != 'camera':
            raise FakeTransformError(f'"{source_frame}" passed to lookupTransform\nis unknown')
        stamped = TransformStamped()
        stamped.transform.translation.x = 1.0
        r = stamped.transform.rotation
        r.z = r.w = float(np.sqrt(0.5))
        return stamped

    def get_latest_common_time(self, target_frame, source_frame):
        """Return when the newest transform was."""
        if source_frame != 'camera':
            raise FakeTransformError('unknown')
        return RosTime(nanoseconds=self.newest)


class FakeListener:
    """Fills a buffer, in the life of a node."""

    def __init__(self, buffer, node):
        buffer.listener = node


@pytest.fixture(name='tf')
def _tf(monkeypatch):
    fake = SimpleNamespace(
        Buffer=FakeBuffer, TransformListener=FakeListener, TransformException=FakeTransformError
    )
    monkeypatch.setattr(frames, 'tf2_ros', fake)


@pytest.mark.usefixtures('tf')
def test_frames_that_tf_knows_are_transformed_and_others_named(start):
    planner, stranger = start()
    buffer = FakeBuffer.made[-1]
    assert buffer.node is buffer.listener is planner
    # (0.1, -0.5, 0.3) from the camera is (1.5, 0.1, 0.3) from the torso.
    say_all(planner, stranger, target=target(0.1, -0.5, 0.3, 'camera'))
    inputs = inputs_of(planner)
    np.testing.assert_allclose(inputs.target.value.target, [1.5, 0.1, 0.3], atol=1e-12)
    hat = box('hat', center=(0.0, 1.0, 0.7), size=(0.3, 0.2, 0.1), frame='camera')
    stranger.publishers['body_boxes'].publish(array(hat))
    stranger.wait_until(lambda: inputs.body.value.n_boxes == 3)
    placed = inputs.body.value.parts[-1][1].boxes[0]
    np.testing.assert_allclose(placed.center, [0.0, 0.0, 0.7], atol=1e-12)
    np.testing.assert_allclose(placed.rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-12)
    assert stranger.answer().success
    stranger.publishers['target'].publish(target(frame='gone'))
    stranger.wait_until(lambda: inputs.target.is_last_rejected)
    message = stranger.answer().message
    assert message.startswith('FRAME_TRANSFORM_FAILURE (-21): ')
    assert 'frame "gone", expected a frame that TF can transform to "torso": ' in message
    assert message.isprintable()


def with_late_hat(start, monkeypatch):
    """Publish a hat before its frame is known; return planner, stranger, hat and its stamp."""
    monkeypatch.setattr(scene_monitor, 'LONGEST_WAIT', 1e6)
    planner, stranger = start()
    say_all(planner, stranger)
    now = planner.get_clock().now()
    hat = box('hat', center=(0.0, 1.0, 0.7), size=(0.3, 0.2, 0.1), frame='camera')
    hat.header.stamp = now.to_msg()
    stranger.publishers['body_boxes'].publish(array(hat))
    return planner, stranger, hat, now


@pytest.mark.usefixtures('tf')
def test_a_body_waits_for_its_frame_and_those_after_it_wait_too(start, monkeypatch):
    planner, stranger, hat, now = with_late_hat(start, monkeypatch)
    body, buffer = inputs_of(planner).body, FakeBuffer.made[-1]
    out, n_good, n_boxes = stranger.publishers['body_boxes'], body.n_good, body.value.n_boxes
    out.publish(array(command(Marker.DELETE, 'hat'), box('pack', center=(-1.0, 0.0, -1.0))))
    stranger.await_turn()
    assert body.n_good == n_good
    buffer.newest = now.nanoseconds
    stranger.wait_until(lambda: body.n_good == n_good + 2)
    assert body.value.n_boxes == n_boxes + 1
    assert not body.value.without(['pack'])
    # One whose frame never comes is rejected.
    monkeypatch.setattr(scene_monitor, 'LONGEST_WAIT', 0.0)
    buffer.newest -= 10**9
    out.publish(array(hat))
    stranger.wait_until(lambda: body.is_last_rejected)
    assert 'extrapolation into the future' in str(body.rejection)
    assert stranger.answer().message.startswith('SENSOR_INFO_STALE (-24): the last message')


def test_what_measures_no_part_makes_no_body_younger(start):
    planner, stranger = start(body_timeout=1.0)
    say_all(planner, stranger)
    body, out = inputs_of(planner).body, stranger.publishers['body_boxes']
    measured = body.measured

    def is_old():
        out.publish(array())
        out.publish(array(command(Marker.DELETE, 'scarf')))
        return body.age(seconds(planner)) > 1.0

    stranger.wait_until(is_old)
    assert body.measured == measured
    assert stranger.answer().message.startswith('SENSOR_INFO_STALE (-24): the last good message')
    # Nor does it lift a rejection.
    out.publish(array(box('hat', center=(float('nan'), 0.0, 0.7))))
    stranger.wait_until(lambda: body.is_last_rejected)
    n_good = body.n_good
    out.publish(array())
    stranger.wait_until(lambda: body.n_good > n_good)
    assert stranger.answer().message.startswith('SENSOR_INFO_STALE (-24): the last message on')
    out.publish(wearer())
    stranger.wait_until(lambda: not body.is_last_rejected)
    assert stranger.answer().success


@pytest.mark.usefixtures('tf')
def test_what_is_no_body_stands_rejected_though_one_before_it_is_read_later(start, monkeypatch):
    planner, stranger, hat, now = with_late_hat(start, monkeypatch)
    body, buffer = inputs_of(planner).body, FakeBuffer.made[-1]
    out = stranger.publishers['body_boxes']
    out.publish(b'\0\1\0\0' + b'\xff' * 40)
    stranger.wait_until(lambda: body.is_last_rejected)
    n_good, measured = body.n_good, body.measured
    buffer.newest = now.nanoseconds
    stranger.wait_until(lambda: body.n_good == n_good + 1)
    assert body.value.without(['hat']) == []
    assert body.is_last_rejected
    assert body.measured == measured
    assert stranger.answer().message.startswith('SENSOR_INFO_STALE (-24): the last message')
    hat.header.stamp = planner.get_clock().now().to_msg()
    buffer.newest = now.nanoseconds + 10**12
    out.publish(array(hat))
    stranger.wait_until(lambda: not body.is_last_rejected)
    assert stranger.answer().success


@pytest.fixture(name='clock')
def _clock(spinning):
    node = Node('clock')
    publisher = node.create_publisher(Clock, '/clock', 10)

    def send(seconds):
        sec, nanosec = divmod(round(seconds * 10**9), 10**9)
        msg = Clock(clock=Time(sec=sec, nanosec=nanosec))
        publisher.publish(msg)

    yield send
    node.destroy_node()


def seconds(node):
    """Return what time it is for a node [s]."""
    assert isinstance(node.get_clock(), ROSClock)
    return node.get_clock().now().nanoseconds * 1e-9


def set_clock(clock, now, wait_until, *nodes):
    """Publish a time until all nodes have it; clocks are published often, not latched."""

    def is_received():
        clock(now)
        return all(abs(seconds(node) - now) < 1e-6 for node in nodes)

    wait_until(is_received)


def test_simulated_time_may_stand_still_or_be_set_back(start, clock, wait_until):
    planner, stranger = start(use_sim_time=True, body_timeout=1.0, joint_timeout=5.0)
    # Before the first clock message the time is 0, and plans are made all the same.
    say_all(planner, stranger)
    assert seconds(planner) == 0.0
    assert stranger.answer().success
    n = len(stranger.received['/diagnostics'])
    wait_until(lambda: len(stranger.received['/diagnostics']) > n + 2)
    set_clock(clock, 100.0, wait_until, planner)
    inputs = inputs_of(planner)
    for now, is_fresh in ((100.0, True), (100.5, True), (101.5, False), (20.0, False)):
        if now == 100.0:
            say_inputs(stranger, inputs, wait_until, 100.0)
        set_clock(clock, now, wait_until, planner)
        message = stranger.answer().message
        assert message.startswith('SUCCESS' if is_fresh else 'SENSOR_INFO_STALE (-24)'), message
    # Messages after the clock was set back count from then on.
    say_inputs(stranger, inputs, wait_until, 20.0)
    assert stranger.answer().success
    for _ in range(3):
        assert stranger.answer().success


def say_inputs(stranger, inputs, wait_until, now):
    """Publish all inputs again until they are received at a time [s]."""
    messages = {'body_boxes': wearer(), 'target': target(), 'joint_states': joints()}

    def are_received():
        for name, msg in messages.items():
            stranger.publishers[name].publish(msg)
        # A body without stamp counts as measured `body_latency` and its way here before.
        return all(abs(source.measured - now) < 0.2 for source in inputs.all.values())

    wait_until(are_received)


def test_a_handover_works_while_simulated_time_stands_still(start, clock, wait_until):
    planner, stranger = start(use_sim_time=True)
    set_clock(clock, 7.0, wait_until, planner)
    say_all(planner, stranger, joint_states=joints(velocity=[0.1, 0.0, 0.0, 0.0]))
    assert stranger.answer().message


def is_at(state, now):
    """Return whether joint states are of a time, or of the last period before it [s]."""
    return abs(state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec - now) < 0.02


def test_a_playback_in_simulated_time_stays_where_it_is_when_the_clock_is_set_back(
    spinning, clock, wait_until
):
    node = PlaybackNode(
        namespace='/sim', parameter_overrides=[Parameter('use_sim_time', value=True)]
    )
    observer, states = Node('observer', namespace='/sim'), []
    observer.create_subscription(JointState, 'joint_states', states.append, 100)
    motions = observer.create_publisher(JointTrajectory, 'joint_trajectory', VOLATILE)

    def advance(times, is_enough):
        """Set one time after another, each state awaited, until something is so; return it."""
        for now in times:
            set_clock(clock, now, wait_until, node)
            wait_until(lambda now=now: states and is_at(states[-1], now))
            if is_enough():
                return now
        raise AssertionError('the arm does not move')

    with spinning(node), spinning(observer):
        wait_until(lambda: motions.get_subscription_count() > 0)
        set_clock(clock, 50.0, wait_until, node)
        there = (np.array(FOLDED) - 0.3).tolist()
        motions.publish(motion(there, 2))
        times = iter(50.0 + 0.01 * np.arange(400))
        stood_since = advance(times, lambda: abs(states[-1].position[0] - FOLDED[0]) > 0.05)
        n = len(states)
        # While the clock stands still the arm does too.
        for _ in range(20):
            clock(stood_since)
        assert len(states) <= n + 3
        stood = states[-1].position
        assert abs(stood[0] - there[0]) > 0.05
        for k in range(1, 100):
            set_clock(clock, 10.0 + 0.01 * k, wait_until, node)
        wait_until(lambda: states[-1].header.stamp.sec == 10)
        np.testing.assert_allclose(states[-1].position, stood, atol=0.01)
        assert not any(states[-1].velocity)
        # And it moves again from there.
        back = motion(FOLDED, 2)
        back.points[0].positions = list(states[-1].position)
        motions.publish(back)
        times = iter(11.0 + 0.01 * np.arange(400))
        advance(times, lambda: abs(states[-1].position[0] - stood[0]) > 0.02)
    node.destroy_node()
    observer.destroy_node()


def test_a_plan_keeps_to_the_parameters_of_its_begin(start):
    planner, stranger = start(seed=5)
    say_all(planner, stranger)
    jerks, plan_motion = [], stranger.script.plans

    def plan_while_it_is_set(question, should_stop):
        if not jerks:
            planner.set_parameters(
                [
                    Parameter('seed', value=6),
                    Parameter('max_jerk', value=[30.0]),
                    Parameter('margin', value=0.03),
                ]
            )
        jerks.append(question.limits.jerk[0])
        return plan_motion(question, should_stop)

    stranger.script.plans = plan_while_it_is_set
    # They monitor the motion, too.
    for seed, margin in ((5, 0.02), (6, 0.03)):
        assert stranger.answer().message.split('; ')[0].endswith(f'seed {seed}')
        assert planner._monitor.watch.rules.required.margin == margin
    assert jerks == [40.0, 30.0]


def test_a_speed_of_rest_holds_from_the_next_joint_state_on(start, wait_until):
    planner, stranger = start()
    say_all(planner, stranger)
    slow, came = joints(velocity=[0.05, 0.0, 0.0, 0.0]), inputs_of(planner).joints
    for rest_speed, is_moving in ((0.01, True), (0.1, False), (0.04, True)):
        planner.set_parameters([Parameter('rest_speed', value=rest_speed)])
        before = came.value
        stranger.publishers['joint_states'].publish(slow)
        wait_until(lambda before=before: came.value is not before)
        assert came.value.is_moving(came.value.taken) == is_moving
        assert came.value.rests_after(came.value.received) != is_moving


@pytest.mark.parametrize('profile', [LATCHED, VOLATILE])
def test_the_playback_receives_from_reliable_publishers(spinning, wait_until, profile):
    node, planner = PlaybackNode(namespace='/quality'), Node('planner', namespace='/quality')
    motions, states = planner.create_publisher(JointTrajectory, 'joint_trajectory', profile), []
    planner.create_subscription(JointState, 'joint_states', states.append, 10)
    with spinning(node, planner):
        wait_until(lambda: motions.get_subscription_count() > 0)
        motions.publish(motion((np.array(FOLDED) - 0.1).tolist(), 1))
        wait_until(lambda: states and any(states[-1].velocity))
    node.destroy_node()
    planner.destroy_node()


def test_bytes_and_huge_messages_from_the_wire_end_no_node(start, spinning, wait_until):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs, topics = inputs_of(planner), ('body_boxes', 'target', 'joint_states')
    for k, (topic, source) in enumerate(zip(topics, inputs.all.values(), strict=True)):
        before = source.value
        stranger.publishers[topic].publish(b'\0\1\0\0' + b'\xff' * 40)
        wait_until(lambda h=source: h.n_rejected == 1)
        assert 'bytes that are no ' in str(source.rejection)
        assert source.value is before, k
    stranger.publishers['body_boxes'].publish(array(*(box(index=k) for k in range(3000))))
    wait_until(lambda: inputs.body.n_rejected == 2)
    assert 'bytes, expected a MarkerArray of at most' in str(inputs.body.rejection)
    for name, msg in (('body_boxes', wearer()), ('target', target()), ('joint_states', joints())):
        stranger.publishers[name].publish(msg)
    wait_until(lambda: not any(source.is_last_rejected for source in inputs.all.values()))
    assert stranger.answer().success


class Watcher(Node):
    """Publishes inputs of the planner of its namespace, and records the joint states."""

    def __init__(self):
        super().__init__('watcher', namespace='/killed')
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.body = self.create_publisher(MarkerArray, 'body_boxes', latched)
        self.target = self.create_publisher(PointStamped, 'target', latched)
        self.states, self.motions = [], []
        self.create_subscription(JointState, 'joint_states', self.states.append, 500)
        self.create_subscription(JointTrajectory, 'joint_trajectory', self.motions.append, latched)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')
        self.arm = self.create_publisher(JointTrajectory, 'joint_trajectory', 1)

    def publish_slowly(self, positions):
        """Command a motion of 100 s, which is as fast after two of them as in the mean."""
        msg = motion(positions, 100)
        begin = np.array(self.states[-1].position)
        mean = (np.array(positions) - begin) / 100.0
        moving = JointTrajectoryPoint(
            positions=(begin + mean).tolist(), velocities=mean.tolist(), accelerations=[0.0] * 4
        )
        moving.time_from_start.sec = 2
        msg.points[0].positions = begin.tolist()
        msg.points.insert(1, moving)
        self.arm.publish(msg)

    @property
    def speed(self):
        """How fast the arm moved last [rad/s]."""
        return float(np.abs(self.states[-1].velocity).max()) if self.states else 0.0

    def has_arrived(self, *point):
        """Return whether the arm is at rest and points at a point [m]."""
        q = np.array(self.states[-1].position)
        return self.speed == 0.0 and pointing_error(load_arm(), q, np.array(point)) < 1e-3


def test_a_planner_that_was_killed_leaves_an_arm_at_rest_and_is_replaced(spinning, wait_until):
    watcher, said, lines = Watcher(), [], []
    ros = ['--ros-args', '-r', '__ns:=/killed', '-p', 'seed:=7', '-p', 'separation:=false']
    module = 'rrth_planner.ros.planner_node'

    def ask():
        # A killed node stays in the lists of others for a while: some requests reach no node.
        wait_until(watcher.plan.service_is_ready, 120.0)
        while True:
            future, end = watcher.plan.call_async(Trigger.Request()), time.monotonic() + 2.0
            while time.monotonic() < end and not future.done():
                time.sleep(0.005)
            # A node that has just come up may know nothing yet, or what is half a second old.
            early = ('UNABLE_TO_AQUIRE', 'MOTION_PLAN_INVALIDATED')
            if future.done() and not future.result().message.startswith(early):
                return future.result()

    with (
        ChildProcess('rrth_planner.ros.playback_node', ros[:3], said.append) as playback,
        spinning(watcher),
    ):
        watcher.body.publish(wearer())
        watcher.target.publish(target())
        # So slow that the motion would last for a minute.
        with ChildProcess(module, [*ros, '-p', 'max_velocity:=[0.03]'], lambda _: None) as first:
            answer = ask()
            assert answer.success, answer.message
            wait_until(lambda: watcher.speed > 0.02)
            os.kill(first.pid, signal.SIGKILL)
        wait_until(lambda: watcher.speed == 0.0)
        goal = watcher.motions[0].points[-1].positions
        assert np.abs(np.array(watcher.states[-1].position) - goal).max() > 0.1
        wait_until(lambda: any('planner liveliness lost' in line for line in said))
        # A publisher without supervised liveliness moves the arm on.
        watcher.publish_slowly(goal)
        wait_until(lambda: watcher.speed > 0.011)
        further = (1.2, 0.9, 0.6)
        watcher.target.publish(target(*further))
        with ChildProcess(module, ros, lines.append) as second:
            wait_until(lambda: any('ready after' in line for line in lines), 120.0)
            # All this time the playback went on.
            assert watcher.speed > 0.011
            playback.check()
            # A handover from an unknown motion may come too late; a machine that stands still ends
            # the motion in a stop.
            while not watcher.has_arrived(*further):
                n_said, n_lines = len(said), len(lines)
                answer, end = ask(), time.monotonic() + 10.0
                assert answer.success, answer.message
                while not watcher.has_arrived(*further) and time.monotonic() < end:
                    time.sleep(0.01)
                excuses = str(said[n_said:] + lines[n_lines:])
                is_excused = 'rejected' in excuses or 'fail-safe stop' in excuses
                assert watcher.has_arrived(*further) or is_excused, (said, lines)
            second.check()
    q = np.array([state.position for state in watcher.states])
    stamps = np.array([s.header.stamp.sec + 1e-9 * s.header.stamp.nanosec for s in watcher.states])
    # Where a busy machine lost messages the steps are long.
    assert (np.abs(np.diff(q, axis=0)).max(axis=1) < 0.03 + 2.0 * np.diff(stamps)).all()
    assert pointing_error(load_arm(), q[-1], np.array(further)) < 1e-3
    watcher.destroy_node()
