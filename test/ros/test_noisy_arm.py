# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Real nodes with an arm whose encoders are noisy or coarse: its requests begin all the same."""

from collections import deque
from contextlib import ExitStack
from itertools import cycle
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
COUNT = 2.0 * np.pi / 4096
# Of each kind of encoder: what it makes of positions, (dof,) [rad].
ENCODERS = {
    '0.1 mrad': lambda q, rng: q + 1e-4 * rng.standard_normal(len(q)),
    '1 mrad': lambda q, rng: q + 1e-3 * rng.standard_normal(len(q)),
    '4,096 counts': lambda q, rng: COUNT * np.round((q + 1e-4 * rng.standard_normal(4)) / COUNT),
}
TARGETS = (1.5, 0.1, 0.3), (1.5, 0.5, 0.4)
# So many requests of each kind.
N_REQUESTS = {'0.1 mrad': 2, '1 mrad': 6, '4,096 counts': 2}
# A mean of 31 readings is hardly ever further off [rad], nor is a count.
OFF, FIRST_OFF = 1.2e-3, 5e-3


class Encoders(Node):
    """Passes the states of an exact arm on as its encoders would, and publishes a wearer."""

    def __init__(self):
        """Connect both nodes."""
        super().__init__('encoders')
        self.encode, self._rng = ENCODERS['1 mrad'], np.random.default_rng(0)
        self._before = None
        self.exact, self.motions = deque(maxlen=40), []
        self.body = self.create_publisher(MarkerArray, 'body_boxes', LATCHED)
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self._states = self.create_publisher(JointState, 'joint_states', 10)
        self.create_subscription(JointState, 'exact_states', self._on_exact, 50)
        self.create_subscription(JointTrajectory, 'joint_trajectory', self.motions.append, 50)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.create_timer(0.02, self._on_timer)
        # Which the planner sees beside this one.
        self.n_listeners = 0

    def _on_diagnostics(self, msg):
        values = {v.key: v.value for status in msg.status for v in status.values}
        self.n_listeners = int(values.get('subscribers of motions', '1')) - 1

    def _on_timer(self):
        self.body.publish(samples.wearer())

    def _on_exact(self, msg):
        self.exact.append(np.array(msg.position))
        now = msg.header.stamp.sec + 1e-9 * msg.header.stamp.nanosec
        q = self.encode(self.exact[-1], self._rng)
        # As drivers do it.
        then, before = self._before or (now - 0.01, q)
        self._before = now, q
        msg.position = q.tolist()
        msg.velocity = ((q - before) / max(now - then, 1e-6)).tolist()
        self._states.publish(msg)

    def has_arrived(self):
        """Return whether the arm has rested for a while."""
        # Copied at once: another thread appends.
        exact = self.exact.copy()
        return len(exact) == 40 and all((q == exact[0]).all() for q in exact)


@pytest.mark.parametrize('separation', ['true', 'false'])
def test_all_requests_begin_and_where_the_arm_is(separation, wait_until, send, spinning):
    with ExitStack() as stack:
        client, said = Encoders(), []
        remapped = ['--ros-args', '-r', 'joint_states:=exact_states']
        values = f'separation:={separation}', 'body_timeout:=10.0', 'joint_timeout:=10.0'
        given = ['--ros-args', *(word for value in values for word in ('-p', value))]
        node = 'rrth_planner.ros.{}_node'.format
        stack.enter_context(ChildProcess(node('playback'), remapped, said.append))
        stack.enter_context(ChildProcess(node('planner'), given, said.append))
        stack.enter_context(spinning(client))
        wait_until(client.plan.service_is_ready, 120.0)
        # The planner may find bodies, joint states and the arm later than its service is found.
        wait_until(client.body.get_subscription_count)
        # The arm subscribes twice.
        wait_until(lambda: client.n_listeners > 1)
        time.sleep(0.5)
        targets, is_first = cycle(TARGETS), True
        for kind, n_requests in N_REQUESTS.items():
            client.encode = ENCODERS[kind]
            for _ in range(n_requests):
                send(client, client.target, samples.target(*next(targets)))
                wait_until(client.has_arrived)
                q = client.exact[-1]
                client.motions.clear()
                future = client.plan.call_async(Trigger.Request())
                wait_until(future.done)
                assert future.result().success, f'{kind}: {future.result().message}'
                wait_until(lambda: client.motions)
                start = np.array(client.motions[0].points[0].positions)
                # Of the first motion the planner may have had a single reading before.
                assert np.abs(start - q).max() <= (FIRST_OFF if is_first else OFF), kind
                is_first = False
                wait_until(lambda q=q: not (client.exact[-1] == q).all())
