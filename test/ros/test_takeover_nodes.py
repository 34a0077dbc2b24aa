# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Planner and playback as processes: new targets in mid-motion, without a stop or a jump."""

import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rrth_planner.collision import reference_checker  # noqa: E402
from rrth_planner.model.rotation import quaternion_xyzw  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402
import worlds  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TARGETS = ((2.0, 0.3, 0.4), (1.0, 1.5, 0.8), (1.5, -0.8, 1.2), (2.5, 0.8, 0.2), (0.8, 0.4, 2.0))
ROUNDS = 2
# At 500 Hz and half the rate a busy machine delays the arm's process: the planner finds that, or
# the arm rejects a late motion. A motion from rest is never published for a moving arm.
MOST_HELD_UP, OFF_COURSE = 3, ('the arm deviates from its trajectory by', 'the motion begins at ')
FROM_REST = 'begins at velocity 0,'
# An arm moves from this speed on [rad/s]; so long it is waited for until it does [s].
MOVING, LONGEST_REST = 0.05, 1.0


class Client(Node):
    """Publishes inputs of the planner, and records the joint states."""

    def __init__(self):
        """Connect to both nodes."""
        super().__init__('handover')
        self.body = self.create_publisher(MarkerArray, 'body_boxes', LATCHED)
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.states = []
        self.create_subscription(JointState, 'joint_states', self.states.append, 500)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')

    def speed(self):
        """Return how fast the arm moved last [rad/s]."""
        return float(np.abs(self.states[-1].velocity).max()) if self.states else 0.0


def _body():
    boxes = []
    for box in worlds.wearer().boxes:
        marker = samples.box(box.name, center=box.center.tolist(), size=box.size.tolist())
        o = marker.pose.orientation
        o.x, o.y, o.z, o.w = quaternion_xyzw(box.rotation).tolist()
        boxes.append(marker)
    return samples.array(*boxes)


@pytest.mark.parametrize('settings', [{}, {'rate': 500.0, 'time_scale': 0.5}], ids=str)
def test_handovers_to_new_targets_are_without_a_jump(wait_until, send, ask, spinning, settings):
    client, said, answers = Client(), [], []
    planner, playback = (f'rrth_planner.ros.{name}_node' for name in ('planner', 'playback'))
    ros = ['--ros-args', '-p', 'seed:=7', '-p', 'separation:=false']
    options = [part for name, value in settings.items() for part in ('-p', f'{name}:={value}')]
    with (
        ChildProcess(planner, ros, lambda _: None) as one,
        ChildProcess(playback, ['--ros-args', *options], said.append) as other,
        spinning(client),
    ):
        wait_until(client.plan.service_is_ready, 120.0)
        wait_until(lambda: client.states)
        send(client, client.body, _body())
        for target in TARGETS * ROUNDS:
            send(client, client.target, samples.target(*target))
            speeds = []
            answer = ask(client.plan, lambda speeds=speeds: speeds.append(client.speed()))
            answers.append((speeds[-1] > MOVING, answer))
            n = len(client.states)
            wait_until(lambda n=n: len(client.states) > n + 30)
            # The next one is asked for while the arm moves, unless it has arrived already.
            end = time.monotonic() + LONGEST_REST
            while client.speed() <= MOVING and time.monotonic() < end:
                time.sleep(0.002)
            one.check()
            other.check()
        wait_until(lambda: client.speed() == 0.0)
    moving = [answer for was_moving, answer in answers if was_moving]
    assert len(moving) >= 3
    rejected = [a.message for a in moving if not a.success]
    by_the_arm = [line for line in said if 'rejected' in line]
    rejected += by_the_arm
    assert all(any(place in sentence for place in OFF_COURSE) for sentence in rejected), rejected
    assert not any(FROM_REST in sentence for sentence in rejected), rejected
    assert len(rejected) <= (MOST_HELD_UP if settings else 0), rejected
    stamps = np.array([s.header.stamp.sec + 1e-9 * s.header.stamp.nanosec for s in client.states])
    q, v = (
        np.array([getattr(s, name) for s in client.states]) for name in ('position', 'velocity')
    )
    step = np.diff(stamps)[:, None]
    limits = worlds.limits()
    # A hundredth more than the limits, and what the stamps are off by.
    assert (np.abs(v) <= 1.01 * limits.velocity).all()
    assert (np.abs(np.diff(v, axis=0)) <= 1.01 * limits.acceleration * step + 5e-3).all()
    jump = np.diff(q, axis=0) - 0.5 * step * (v[1:] + v[:-1])
    # Where the busy machine lost messages the steps are long; the velocity bends within them.
    assert (np.abs(jump) <= 1e-3 + limits.jerk * step**3 / 12.0).all()
    if by_the_arm:
        # It may have kept to the motion before.
        return
    last = [t for t, (_, answer) in zip(TARGETS * ROUNDS, answers, strict=True) if answer.success]
    tool = reference_checker.frames(worlds.table_1_arm(), q[-1:])[0, -1]
    past = last[-1] - tool[:3, 3]
    assert np.linalg.norm(past - (past @ tool[:3, 2]) * tool[:3, 2]) < 1e-3
