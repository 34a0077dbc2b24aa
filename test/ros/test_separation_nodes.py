# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Planner and playback as processes with separation: what the arm is given, how it ends."""

from contextlib import ExitStack
import os
import signal
from threading import Event, Thread
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rrth_planner.collision.reference_checker import separation_violations  # noqa: E402
from rrth_planner.execution.command import begin_of  # noqa: E402
from rrth_planner.model.arm import pointing_error  # noqa: E402
from rrth_planner.model.body_reach import BODY_REACH, lines_shown  # noqa: E402
from rrth_planner.model.scene import Scene  # noqa: E402
from rrth_planner.model.separation import seen_body, SeparationRules  # noqa: E402
from rrth_planner.model.trajectory import part_of  # noqa: E402
from rrth_planner.ros.messages.fields import seconds_of  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import Bool  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402
import worlds  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ARM, TARGET = worlds.table_1_arm(), (1.0, 1.5, 0.8)
PERIOD = 0.01


class Client(Node):
    """Publishes the wearer like a tracker, and records what the nodes publish."""

    def __init__(self):
        """Connect to both nodes."""
        super().__init__('separated')
        self.body = self.create_publisher(MarkerArray, 'body_boxes', 10)
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.states, self.commitments, self.planned, self.said = [], [], [], []
        self.clear, self.stamps, self.figures = [], [], {}
        self.create_subscription(JointState, 'joint_states', self.states.append, 500)
        self.create_subscription(JointTrajectory, 'joint_trajectory', self.commitments.append, 500)
        name = 'rrth_planner/planned_trajectory'
        self.create_subscription(JointTrajectory, name, self.planned.append, LATCHED)
        name = 'rrth_planner/state'
        self.create_subscription(DiagnosticStatus, name, self.said.append, LATCHED)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_figures, 10)
        self.create_subscription(Bool, 'rrth_planner/ray_clear', self.clear.append, 10)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')
        self.is_over, self.is_seen = Event(), Event()
        self.is_seen.set()
        self._thread = Thread(target=self._publish, daemon=True)
        self._thread.start()

    def _on_figures(self, msg):
        self.figures = {pair.key: pair.value for pair in msg.status[0].values}

    def _publish(self):
        markers = [
            samples.box(b.name, center=b.center.tolist(), size=b.size.tolist(), text=b.name)
            for b in worlds.wearer().boxes
        ]
        while not self.is_over.is_set():
            now = self.get_clock().now()
            for marker in markers:
                marker.header.stamp = now.to_msg()
            self.stamps.append(now.nanoseconds * 1e-9)
            if self.is_seen.is_set():
                self.body.publish(samples.array(*markers))
            time.sleep(PERIOD)

    def close(self):
        """End publishing."""
        self.is_over.set()
        self._thread.join()

    def speed(self):
        """Return how fast the arm moved last [rad/s]."""
        return float(np.abs(self.states[-1].velocity).max()) if self.states else 0.0

    def positions(self):
        """Return where the arm was last [rad]."""
        return np.array(self.states[-1].position)


@pytest.fixture
def separated(wait_until, send, spinning):
    """Have nodes that are ready, and a wearer; give the client and the planner."""
    with ExitStack() as stack:

        def begin():
            client = Client()
            stack.callback(client.close)
            planner, playback = (f'rrth_planner.ros.{n}_node' for n in ('planner', 'playback'))
            # So slow that a busy machine has time for a few commitments.
            ros = ['--ros-args', '-p', 'seed:=7', '-p', 'max_velocity:=[0.5]']
            ros += [
                '-p',
                'separation:=true',
                '-p',
                'body_timeout:=1.0',
                '-p',
                'joint_timeout:=1.0',
            ]
            stack.enter_context(ChildProcess(playback, [], lambda _: None))
            child = stack.enter_context(ChildProcess(planner, ros, lambda _: None))
            stack.enter_context(spinning(client))
            wait_until(client.plan.service_is_ready, 120.0)
            wait_until(lambda: client.states)
            send(client, client.target, samples.target(*TARGET))
            return client, child

        yield begin


def asked(client, ask):
    """Return the answer to a request."""
    answer = ask(client.plan)
    assert answer.success, answer.message


def test_all_that_the_arm_is_given_is_separate_and_leads_to_the_target(separated, ask, wait_until):
    client, _ = separated()
    asked(client, ask)
    wait_until(
        lambda: (
            pointing_error(ARM, client.positions(), np.array(TARGET)) < 1e-3
            and client.speed() == 0.0
        ),
        60.0,
    )
    rules, judged, stamps = SeparationRules(), 0, np.array(client.stamps)
    # Those that were published as they are.
    scene = Scene(tuple(b for b in worlds.wearer().boxes if np.allclose(b.rotation, np.eye(3))))
    for msg in client.commitments[:: max(1, len(client.commitments) // 25)]:
        motion = joint_trajectory_from_msg(msg, ARM.joint_names)
        begin = seconds_of(msg.header.stamp)
        # No body can have been known that is newer than its publication; what it repeats from
        # before that belongs to the commitment before it.
        before = -begin_of(0.0, rules.controller_delay)
        age = begin + before - stamps[stamps <= begin + before].max()
        own = part_of(motion, min(before, motion.duration), motion.duration)
        body = seen_body(scene, age, rules)
        assert not separation_violations(ARM, body, own, rules, 0.02, period=5e-3)
        assert not np.abs(motion.velocities[-1]).any()
        judged += 1
    assert judged > 3
    (planned,) = client.planned[-1:]
    assert np.abs(np.array(planned.points[-1].positions) - client.positions()).max() < 1e-3
    assert client.said[0].message == 'NORMAL'
    wait_until(lambda: client.clear and client.clear[-1].data)
    shown = client.figures['reach [m]'].split('; ')
    lines = {words: lines_shown(found) for words, found in BODY_REACH}
    assert shown[:2] == ['"torso" 0 t (torso)', f'"head" {lines["head"]} (head)']
    assert f'"upper_arm_left" {lines["upper arm"]} (upper arm)' in shown


def test_an_arm_whose_planner_is_killed_comes_to_rest_where_it_was_told(
    separated, ask, wait_until
):
    client, child = separated()
    asked(client, ask)
    wait_until(lambda: client.speed() > 0.05)
    os.kill(child.pid, signal.SIGKILL)
    wait_until(lambda: client.speed() == 0.0)
    # On a busy machine the last ones may have come too late for the arm.
    ends = [
        joint_trajectory_from_msg(msg, ARM.joint_names).positions[-1]
        for msg in client.commitments[-50:]
    ]
    wait_until(lambda: np.abs(np.array(ends) - client.positions()).max(axis=1).min() < 1e-6)


def test_an_arm_stops_where_no_body_comes_and_goes_on_with_the_next_one(
    separated, ask, wait_until
):
    client, _ = separated()
    asked(client, ask)
    wait_until(lambda: client.speed() > 0.05)
    client.is_seen.clear()
    wait_until(lambda: client.speed() == 0.0)
    client.is_seen.set()
    wait_until(
        lambda: (
            pointing_error(ARM, client.positions(), np.array(TARGET)) < 1e-3
            and client.speed() == 0.0
        ),
        60.0,
    )
