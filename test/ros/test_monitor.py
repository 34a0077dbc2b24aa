# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Planner and playback as processes: the wearer moves into the way of a running motion."""

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rrth_planner.collision import reference_checker  # noqa: E402
from rrth_planner.model.arm import pointing_error  # noqa: E402
from rrth_planner.model.rotation import quaternion_xyzw  # noqa: E402
from rrth_planner.model.scene import Box, Scene  # noqa: E402
from rrth_planner.model.trajectory import sample  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402
import worlds  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
FAR, OTHER = (1.0, 1.5, 0.8), (2.0, 0.3, 0.4)


class Client(Node):
    """Publishes all inputs, and records what the nodes publish."""

    def __init__(self):
        """Connect to both nodes."""
        super().__init__('monitored')
        self.body = self.create_publisher(MarkerArray, 'body_boxes', LATCHED)
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.states, self.motions, self.figures = [], [], {}
        self.create_subscription(JointState, 'joint_states', self.states.append, 500)
        self.create_subscription(JointTrajectory, 'joint_trajectory', self.motions.append, LATCHED)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_figures, 10)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')

    def _on_figures(self, msg):
        self.figures = {pair.key: pair.value for pair in msg.status[0].values}

    def speed(self):
        """Return how fast the arm moved last [rad/s]."""
        return float(np.abs(self.states[-1].velocity).max()) if self.states else 0.0

    def motion(self, k=-1):
        """Return a motion that was published."""
        return joint_trajectory_from_msg(self.motions[k], worlds.table_1_arm().joint_names)


def body(*more):
    """Return the wearer, and some boxes more, as a message and as a scene."""
    markers, boxes = [samples.command(Marker.DELETEALL)], [*worlds.wearer().boxes, *more]
    for box in boxes:
        marker = samples.box(box.name, center=box.center.tolist(), size=box.size.tolist())
        o = marker.pose.orientation
        o.x, o.y, o.z, o.w = quaternion_xyzw(box.rotation).tolist()
        markers.append(marker)
    return samples.array(*markers), Scene(tuple(boxes))


@pytest.fixture
def scene_of_a_motion(wait_until, send, spinning):
    """Have an arm in motion to a target; give the client."""

    def begin(*settings):
        client = Client()
        planner, playback = (f'rrth_planner.ros.{n}_node' for n in ('planner', 'playback'))
        # So slow that a busy machine has time to stop the arm.
        ros = ['--ros-args', '-p', 'seed:=7', '-p', 'separation:=false']
        ros += ['-p', 'max_velocity:=[0.5, 0.5, 0.5, 0.5]']
        for setting in settings:
            ros += ['-p', setting]
        stack.enter_context(ChildProcess(planner, ros, said.append))
        stack.enter_context(ChildProcess(playback, [], said.append))
        stack.enter_context(spinning(client))
        wait_until(client.plan.service_is_ready, 120.0)
        wait_until(lambda: client.figures.get('age of joints [s]', 'inf') != 'inf')
        wearer = body()[0]
        send(client, client.body, wearer)
        send(client, client.target, samples.target(*FAR))
        future = client.plan.call_async(Trigger.Request())

        def is_moving():
            # However busy the machine is, the body is not stale before the arm moves.
            client.body.publish(wearer)
            assert not future.done() or future.result().success
            return client.motions and client.speed() > 0.3

        wait_until(is_moving)
        return client, said

    from contextlib import ExitStack

    said = []
    with ExitStack() as stack:
        yield begin
    # Shown where a test fails.
    print(*said, sep='\n')


def in_the_way(client, ahead):
    """Return a box that the arm would collide with so much later [s]."""
    arm, motion = worlds.table_1_arm(), client.motion()
    gaps = np.linspace(0.0, motion.duration, 500)
    q, _, _ = sample(motion, gaps)
    now = gaps[np.argmin(np.linalg.norm(q - client.states[-1].position, axis=1))]
    later, _, _ = sample(motion, [now + ahead])
    tip = reference_checker.frames(arm, later)[0, -1]
    # On the ray, where the tool does not get.
    return Box('hand', tip[:3, 3] + 0.4 * tip[:3, 2], np.full(3, 0.05), np.eye(3))


def test_a_wearer_who_moves_into_the_way_stops_the_arm_and_it_goes_round(
    scene_of_a_motion, wait_until
):
    client, said = scene_of_a_motion()
    n, box = len(client.states), in_the_way(client, 1.6)
    msg, scene = body(box)
    client.body.publish(msg)
    wait_until(lambda: len(client.motions) >= 2)
    stop = client.motion(1)
    assert stop.velocities[0].any()
    assert stop.duration < client.motion(0).duration
    # It replans, or holds and reports that.
    wait_until(lambda: len(client.motions) >= 3 or 'holding' in client.figures.get('monitor', ''))
    wait_until(lambda: client.speed() == 0.0)
    q = np.array([state.position for state in client.states[n:]])
    contact = reference_checker.first_contact(worlds.table_1_arm(), scene, q, 1.0, 0.0)
    assert contact is None
    assert any('not proven free of the wearer' in line for line in said)
    assert not [line for line in said if 'rejected' in line]
    wait_until(lambda: client.figures['fail-safe stops'].startswith('1,'))


def test_a_hand_that_is_lost_in_the_way_of_a_motion_is_not_driven_into(
    scene_of_a_motion, wait_until, ask
):
    client, _ = scene_of_a_motion()
    n, hand = len(client.states), in_the_way(client, 1.6)
    msg, scene = body(hand)
    # The tracker sees it once, and never again.
    msg.markers[-1].lifetime.nanosec = 10**8
    client.body.publish(msg)
    wait_until(lambda: len(client.motions) >= 2)
    wait_until(lambda: client.figures.get('lost parts') == '"hand/0"')
    wait_until(lambda: client.speed() == 0.0)
    # Where it is nobody knows: the arm stays.
    future = client.plan.call_async(Trigger.Request())
    wait_until(future.done)
    message = future.result().message
    assert message.startswith('SENSOR_INFO_STALE (-24): the body on'), message
    assert 'has lost parts: "hand/0"' in message
    q = np.array([state.position for state in client.states[n:]])
    assert reference_checker.first_contact(worlds.table_1_arm(), scene, q, 1.0, 0.0) is None
    # Once it is seen again, or deleted, the arm goes on.
    client.body.publish(samples.array(samples.command(Marker.DELETE, 'hand')))
    wait_until(lambda: not client.figures.get('lost parts'))
    answer = ask(client.plan)
    assert answer.success, answer.message


def off_other(q):
    """Return by how much the ray misses the target OTHER at a configuration [m]."""
    return pointing_error(worlds.table_1_arm(), np.array(q), np.array(OTHER))


def test_a_new_target_is_planned_for_while_the_arm_stops(scene_of_a_motion, wait_until, send, ask):
    client, said = scene_of_a_motion()
    n, box = len(client.states), in_the_way(client, 1.6)
    msg, scene = body(box)
    send(client, client.target, samples.target(*OTHER))
    client.body.publish(msg)
    wait_until(lambda: len(client.motions) >= 2)
    # For the new target, whether the arm was at rest or in motion to the old one.
    answer = ask(client.plan)
    assert answer.success, answer.message
    assert off_other(client.motion().positions[-1]) < 1e-6
    # On a busy machine after another stop, and then perhaps in another posture.
    wait_until(lambda: client.speed() == 0.0 and off_other(client.states[-1].position) < 1e-6)
    q = np.array([state.position for state in client.states[n:]])
    assert reference_checker.first_contact(worlds.table_1_arm(), scene, q, 1.0, 0.0) is None
    assert not [line for line in said if 'rejected' in line]


def test_a_wearer_who_moves_elsewhere_stops_nothing(scene_of_a_motion, wait_until):
    client, said = scene_of_a_motion()
    arm = worlds.table_1_arm()
    away = Box('hand', np.array([0.0, -3.0, 0.0]), np.full(3, 0.1), np.eye(3))
    for _ in range(5):
        client.body.publish(body(away)[0])
        n = len(client.states)
        wait_until(lambda n=n: len(client.states) > n + 2)
    wait_until(
        lambda: (
            client.speed() == 0.0
            and pointing_error(arm, client.states[-1].position, np.array(FAR)) < 1e-4
        )
    )
    stops = [line for line in said if 'fail-safe stop' in line]
    # A machine that stands still while a body arrives is no fault of the wearer's.
    assert all('after its arrival' in line for line in stops), stops
    assert len(client.motions) == 1 or stops


def test_a_body_that_stops_coming_stops_the_arm_and_it_holds(scene_of_a_motion, wait_until):
    client, said = scene_of_a_motion('body_timeout:=1.0')
    wait_until(lambda: len(client.motions) >= 2)
    wait_until(lambda: client.figures.get('monitor') == 'holding')
    wait_until(lambda: client.speed() == 0.0)
    assert any('body_timeout' in line for line in said)
    # Only the stop, published again where a busy machine took it too late.
    again = [line for line in said if 'stop published again' in line]
    assert len(client.motions) == 2 + len(again)
    assert len([line for line in said if 'SUCCESS' in line]) == 1


def test_without_replan_the_arm_holds_where_it_stopped(scene_of_a_motion, wait_until):
    client, said = scene_of_a_motion('replan:=false')
    client.body.publish(body(in_the_way(client, 1.6))[0])
    wait_until(lambda: client.figures.get('monitor') == 'holding')
    wait_until(lambda: client.speed() == 0.0)
    assert len(client.motions) == 2
