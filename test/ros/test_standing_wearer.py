# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Planner and playback as processes: a body that is sent once, and one that comes as a stream."""

from contextlib import ExitStack
from threading import Event, Thread
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rclpy.time import Time  # noqa: E402
from rrth_planner.model.arm import pointing_error  # noqa: E402
from rrth_planner.model.trajectory import positions_at  # noqa: E402
from rrth_planner.pipeline.in_process_planner import InProcessPlanner  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import Bool  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402
import worlds  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ARM = worlds.table_1_arm()
TARGETS = ((1.0, 1.5, 0.8), (1.5, 0.1, 0.3))
NO_PROMISE = 'nothing is promised of a wearer who moves'
# A later body of the same publisher is another description [s].
APART = 1.1
# Of a tracker [s].
PERIOD = 1 / 30
# Of an arm in motion [rad/s].
MOVING = 0.05


class Client(Node):
    """Sends bodies and targets, and records what the nodes publish."""

    def __init__(self):
        """Connect to both nodes."""
        super().__init__('plain')
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.states, self.motions, self.planned, self.said, self.clear = [], [], [], [], []
        self.diagnostics = []
        for kind, topic, take, profile in (
            (JointState, 'joint_states', self.states, 500),
            (JointTrajectory, 'joint_trajectory', self.motions, 500),
            (JointTrajectory, 'rrth_planner/planned_trajectory', self.planned, LATCHED),
            (DiagnosticStatus, 'rrth_planner/state', self.said, LATCHED),
            (Bool, 'rrth_planner/ray_clear', self.clear, 10),
            (DiagnosticArray, '/diagnostics', self.diagnostics, 10),
        ):
            self.create_subscription(kind, topic, take.append, profile)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')

    def speed(self):
        """Return how fast the arm moved last [rad/s]."""
        return float(np.abs(self.states[-1].velocity).max()) if self.states else 0.0

    def points_at(self, target):
        """Return whether the arm rests, and points at a target."""
        error = pointing_error(ARM, np.array(self.states[-1].position), np.array(target))
        return error < 1e-3 and self.speed() == 0.0

    def latched_motions(self, wait_until):
        """Return what a subscriber of latched motions receives that comes now."""
        found, n = [], len(self.states)
        subscription = self.create_subscription(
            JointTrajectory, 'joint_trajectory', found.append, LATCHED
        )
        wait_until(lambda: found or len(self.states) > n + 100)
        self.destroy_subscription(subscription)
        return found


class Tracker:
    """Publishes a wearer from a node of its own, as a tracker does, while it is wanted."""

    def __init__(self, is_stamped=False):
        """Begin."""
        self.node, self.is_stamped = Node('tracker'), is_stamped
        self._body = self.node.create_publisher(MarkerArray, 'body_boxes', 10)
        self._is_over, self.n_sent = Event(), 0
        self._thread = Thread(target=self._publish, daemon=True)
        self._thread.start()

    def _publish(self):
        while not self._is_over.is_set():
            self._body.publish(body(self.node.get_clock().now() if self.is_stamped else None))
            self.n_sent += 1
            time.sleep(PERIOD)

    def end(self):
        """End publishing."""
        self._is_over.set()
        self._thread.join()


def body(stamp=None):
    """Return the wearer, without a stamp, or measured at a time."""
    msg = samples.array(
        *(
            samples.box(b.name, center=b.center.tolist(), size=b.size.tolist())
            for b in worlds.wearer().boxes
        )
    )
    for marker in msg.markers if stamp is not None else ():
        marker.header.stamp = stamp.to_msg()
    return msg


def send_once(send, stamp=None):
    """Send a body by a publisher that is gone afterwards, as `ros2 topic pub --once` does."""
    node = Node('once')
    send(node, node.create_publisher(MarkerArray, 'body_boxes', LATCHED), body(stamp))
    node.destroy_node()


@pytest.fixture(name='start')
def _start(wait_until, spinning):
    """Give what starts planner and playback, with parameters of the planner."""
    with ExitStack() as stack:

        def start(*settings):
            client = Client()
            # So slow that a busy machine has time for what happens in mid-motion.
            options = ['seed:=7', 'max_velocity:=[0.5]', 'joint_timeout:=1.0', *settings]
            ros = ['--ros-args', *(part for o in options for part in ('-p', o))]
            playback = 'rrth_planner.ros.playback_node'
            stack.enter_context(ChildProcess(playback, [], lambda _: None))
            stack.enter_context(start_planner(ros))
            stack.enter_context(spinning(client))
            wait_until(client.plan.service_is_ready, 120.0)
            wait_until(lambda: client.states)
            return client

        yield start


def start_planner(ros):
    """Return the process of a planner, with arguments of ROS."""
    return ChildProcess('rrth_planner.ros.planner_node', ros, lambda _: None)


@pytest.fixture(name='tracker')
def _tracker():
    """Give what starts a tracker, which ends with the test."""
    trackers = []

    def track(**options):
        trackers.append(Tracker(**options))
        return trackers[-1]

    yield track
    for tracker in trackers:
        tracker.end()


def test_bodies_that_are_sent_once_bring_whole_motions(start, send, ask, wait_until):
    client = start()
    for k in range(3):
        target = TARGETS[k % 2]
        # Each by a publisher of its own.
        send_once(send)
        send(client, client.target, samples.target(*target))
        n = len(client.motions)
        answer = ask(client.plan)
        assert answer.success, answer.message
        assert NO_PROMISE in answer.message
        wait_until(lambda target=target: client.points_at(target))
        # One message from rest to rest.
        (msg,) = client.motions[n:]
        assert msg.header.stamp.sec > 0
        motion = joint_trajectory_from_msg(msg, ARM.joint_names)
        assert not motion.velocities[[0, -1]].any()
        assert pointing_error(ARM, motion.positions[-1], np.array(target)) < 1e-6
        # It rests shortly before it begins, so that every controller has it.
        (planned,) = (joint_trajectory_from_msg(m, ARM.joint_names) for m in client.planned[-1:])
        np.testing.assert_array_equal(planned.positions, motion.positions[1:])
        # It is there for who comes late, as with a command line.
        assert client.latched_motions(wait_until) == [msg]
    assert client.said[-1].message.startswith('UNSEPARATED: ' + NO_PROMISE)
    assert client.said[-1].level == DiagnosticStatus.WARN
    wait_until(
        lambda: (
            client.diagnostics[-1].status[0].level == DiagnosticStatus.WARN
            and NO_PROMISE in client.diagnostics[-1].status[0].message
        )
    )
    wait_until(lambda: client.clear)
    assert not any(msg.data for msg in client.clear)


def test_a_client_may_change_the_body_between_requests(start, send, ask, wait_until):
    client = start()
    publisher = client.create_publisher(MarkerArray, 'body_boxes', LATCHED)
    for k in range(4):
        sent = time.monotonic()
        send(client, publisher, body())
        send(client, client.target, samples.target(*TARGETS[k % 2]))
        n = len(client.motions)
        answer = ask(client.plan)
        assert answer.success, answer.message
        wait_until(lambda k=k: client.points_at(TARGETS[k % 2]))
        (msg,) = client.motions[n:]
        end = joint_trajectory_from_msg(msg, ARM.joint_names).positions[-1]
        assert pointing_error(ARM, end, np.array(TARGETS[k % 2])) < 1e-6
        wait_until(lambda sent=sent: time.monotonic() > sent + APART)


@pytest.mark.parametrize('is_stamped', [False, True], ids=['unstamped', 'stamped'])
def test_a_stream_brings_separation_for_good(start, send, ask, wait_until, tracker, is_stamped):
    client = start('body_timeout:=1.0')
    source = tracker(is_stamped=is_stamped)
    send(client, client.target, samples.target(*TARGETS[0]))
    answer = ask(client.plan)
    assert answer.success, answer.message
    assert NO_PROMISE not in answer.message
    wait_until(lambda: client.speed() > MOVING)
    # A stream that stops is stale, and stops the arm.
    source.end()
    wait_until(lambda: client.speed() == 0.0)
    assert len(client.motions) > 1
    assert not client.points_at(TARGETS[0])
    # Nothing is latched that a controller could execute late.
    assert not client.latched_motions(wait_until)
    # A body that is sent once afterwards shows nobody who stands still.
    wait_until(lambda: 'SENSOR_INFO_STALE' in ask(client.plan).message)
    send_once(send)
    begin = time.monotonic()
    wait_until(lambda: time.monotonic() > begin + APART)
    answer = ask(client.plan)
    assert answer.message.startswith('SENSOR_INFO_STALE (-24): '), answer.message
    assert 'a stream of bodies' in answer.message
    assert not any(msg.message.startswith('UNSEPARATED') for msg in client.said)


@pytest.mark.parametrize('is_stamped', [False, True], ids=['unstamped', 'stamped'])
def test_a_stream_that_begins_in_mid_motion_stops_the_arm_and_goes_on(
    start, send, ask, wait_until, tracker, is_stamped
):
    client = start('body_timeout:=1.0')
    send_once(send)
    send(client, client.target, samples.target(*TARGETS[0]))
    answer = ask(client.plan)
    assert answer.success, answer.message
    wait_until(lambda: client.speed() > MOVING)
    assert len(client.motions) == 1
    tracker(is_stamped=is_stamped)
    # The next message is the stop, on the curve of the motion.
    wait_until(lambda: len(client.motions) > 1)
    whole, stop = (joint_trajectory_from_msg(m, ARM.joint_names) for m in client.motions[:2])
    assert not stop.velocities[-1].any()
    passed = positions_at(whole, np.linspace(0.0, whole.duration, 2000))
    gaps = np.abs(stop.positions[:, None] - passed[None]).max(axis=2)
    assert gaps.min(axis=1).max() < 0.01
    assert np.abs(stop.positions[-1] - whole.positions[-1]).max() > 0.05
    # From rest the arm goes on by commitments, each of them safe by itself.
    wait_until(lambda: client.points_at(TARGETS[0]), 60.0)
    assert len(client.motions) > 3
    assert not client.latched_motions(wait_until)
    wait_until(lambda: client.said[-1].message.startswith('NORMAL'))
    answer = ask(client.plan)
    assert answer.success, answer.message
    assert NO_PROMISE not in answer.message


def test_a_planner_that_starts_beside_a_tracker_begins_no_whole_motion(
    wait_until, send, ask, spinning, tracker
):
    client = Client()
    tracker()
    with (
        ChildProcess('rrth_planner.ros.playback_node', [], lambda _: None),
        spinning(client),
    ):
        for _ in range(3):
            with start_planner(['--ros-args', '-p', 'joint_timeout:=1.0']):
                wait_until(client.plan.service_is_ready, 120.0)
                client.target.publish(samples.target(*TARGETS[0]))
                # At once: whatever comes of it, it is no whole motion.
                future = client.plan.call_async(Trigger.Request())
                wait_until(future.done)
                assert NO_PROMISE not in future.result().message
                assert not any(m.message.startswith('UNSEPARATED') for m in client.said)
            wait_until(lambda: not client.plan.service_is_ready())


def test_a_body_that_was_old_on_arrival_is_rejected(start, send, ask):
    client = start()
    old = Time(nanoseconds=client.get_clock().now().nanoseconds - 10**9)
    send_once(send, old)
    send(client, client.target, samples.target(*TARGETS[0]))
    answer = ask(client.plan)
    assert answer.message.startswith('SENSOR_INFO_STALE (-24): '), answer.message
    assert not client.motions


def test_beside_a_node_that_makes_bodies_a_body_that_is_sent_once_is_stale(
    start, send, ask, wait_until
):
    client = start()
    # Its name is enough: it may see nobody yet.
    node = Node('body_boxes_node')
    wait_until(lambda: 'rrth_planner' in node.get_node_names())
    send_once(send)
    begin = time.monotonic()
    send(client, client.target, samples.target(*TARGETS[0]))
    wait_until(lambda: time.monotonic() > begin + 0.5)
    answer = ask(client.plan)
    assert answer.message.startswith('SENSOR_INFO_STALE (-24): '), answer.message
    assert not client.motions


# A text, too, as launch files pass it on.
@pytest.mark.parametrize('value', ['true', '"False"'])
def test_separation_may_be_chosen_for_good(start, send, ask, wait_until, value):
    client = start(f'separation:={value}')
    is_separated = value.strip('"').lower() == 'true'
    send_once(send)
    send(client, client.target, samples.target(*TARGETS[0]))
    begin = time.monotonic()
    wait_until(lambda: time.monotonic() > begin + 0.5)
    answer = ask(client.plan)
    assert answer.success is not is_separated, answer.message
    assert NO_PROMISE not in answer.message
    if is_separated:
        assert answer.message.startswith('SENSOR_INFO_STALE (-24): ')
    else:
        wait_until(lambda: client.points_at(TARGETS[0]))
        assert len(client.motions) == 1
        assert not client.planned
        assert not client.said


class InterruptedPlanner(InProcessPlanner):
    """Plans, and has something done before it returns its first plan."""

    def __init__(self, interrupt):
        """Begin without a plan."""
        super().__init__()
        self._interrupt, self.questions = interrupt, []

    def plan(self, question, should_stop):
        """Return a plan."""
        self.questions.append(question)
        found = super().plan(question, should_stop)
        if len(self.questions) == 1:
            self._interrupt()
        return found


@pytest.mark.parametrize('is_stamped', [False, True], ids=['description', 'stream'])
def test_a_body_that_comes_while_a_motion_is_planned_is_taken_note_of(
    send, ask, wait_until, spinning, is_stamped
):
    client = Client()
    joints = client.create_publisher(JointState, 'joint_states', LATCHED)

    def interrupt():
        send_once(send, client.get_clock().now() if is_stamped else None)

    planner = InterruptedPlanner(interrupt)
    options = {'body_timeout': 20.0, 'joint_timeout': 20.0, 'body_speeds': [': 0']}
    node = PlannerNode(
        planner,
        parameter_overrides=[Parameter(name=name, value=value) for name, value in options.items()],
    )
    with spinning(node), spinning(client):
        send(client, joints, samples.joints())
        send_once(send)
        send(client, client.target, samples.target(*TARGETS[0]))
        answer = ask(client.plan)
        assert answer.success, answer.message
        # Neither the first plan, for an earlier body, nor without rules beside a stream.
        assert len(planner.questions) > 1
        assert (planner.questions[-1].rules is not None) == is_stamped
        assert (NO_PROMISE in answer.message) != is_stamped
        wait_until(lambda: client.planned and client.motions)
        # The whole motion, after a short rest, or a stretch of it.
        whole = len(client.motions[0].points) == 1 + len(client.planned[0].points)
        ends = client.motions[0].points[-1].positions == client.planned[0].points[-1].positions
        assert is_stamped or (whole and ends)
        node.close()
    node.destroy_node()
