# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Clients that leave or wait by the hundred, and a planning process that hangs: as processes."""

from contextlib import contextmanager, ExitStack
from itertools import cycle
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from conftest import send, spinning, wait_until  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import Bool  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BODY_PERIOD = 0.02
# One process with some clients: it says when all their requests are sent, and then leaves as soon
# as it is told to, or says how many answers have come.
CLIENTS = """
import sys, time
from nav_msgs.srv import GetPlan
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger
n_clients, n_requests, depth, leaves = map(int, sys.argv[1:])
rclpy.init()
node = Node('many')
profile = QoSProfile(depth=depth)
clients = [
    node.create_client(GetPlan, 'rrth_planner/get_plan', qos_profile=profile)
    for _ in range(n_clients)
]
for client in clients:
    client.wait_for_service()
# Inside of the torso.
request = GetPlan.Request()
request.goal.header.frame_id = 'torso'
executor = SingleThreadedExecutor()
executor.add_node(node)
futures = []
for client in clients:
    for _ in range(n_requests):
        futures.append(client.call_async(request))
        # A writer keeps no more than its depth, too.
        executor.spin_once(timeout_sec=0.1 / depth)
print('sent', flush=True)
if leaves:
    sys.stdin.readline()
    sys.exit(0)
end = time.monotonic() + 60.0
while time.monotonic() < end and not all(future.done() for future in futures):
    executor.spin_once(timeout_sec=0.1)
print(sum(future.done() for future in futures), flush=True)
"""


class Watcher(Node):
    """Publishes body and target, and records how the planner goes on."""

    def __init__(self):
        """Connect to planner and playback."""
        super().__init__('watcher')
        self.body = self.create_publisher(MarkerArray, 'body_boxes', 10)
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.states, self.clear = [], []
        self.create_subscription(JointState, 'joint_states', self.states.append, 500)
        self.create_subscription(
            Bool, 'rrth_planner/ray_clear', lambda _: self.clear.append(time.monotonic()), 100
        )
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')
        self.cancel = self.create_client(Trigger, 'rrth_planner/cancel')
        self.create_timer(BODY_PERIOD, self._publish)

    def _publish(self):
        markers = [samples.box('torso'), samples.box('head', 0, (0.02, 0.0, 0.45), (0.26,) * 3)]
        for marker in markers:
            marker.header.stamp = self.get_clock().now().to_msg()
        self.body.publish(samples.array(*markers))

    def positions(self):
        """Return where the arm was last [rad]."""
        return np.array(self.states[-1].position)

    def lateness(self):
        """Return the longest time between two messages of `~/ray_clear` [s]."""
        return float(np.diff(self.clear).max())


@pytest.fixture(name='nodes', scope='module')
def _nodes(ros_context):
    """Give a watcher, a planner that is ready, and what it has said."""
    with ExitStack() as stack:
        watcher, said = Watcher(), []
        arguments = ['--ros-args', '-p', 'seed:=7', '-p', 'separation:=true']
        # A busy machine is not what this is about.
        arguments += ['-p', 'body_timeout:=1.0', '-p', 'joint_timeout:=1.0']
        arguments += ['-p', 'max_velocity:=[0.3]']
        module = 'rrth_planner.ros.{}_node'
        planner = stack.enter_context(
            ChildProcess(module.format('planner'), arguments, said.append)
        )
        stack.enter_context(ChildProcess(module.format('playback'), [], lambda _: None))
        stack.enter_context(spinning(watcher))
        wait_until(watcher.plan.service_is_ready, 180.0)
        wait_until(lambda: watcher.states)
        yield watcher, planner, said
        planner.check()
        watcher.destroy_node()


@contextmanager
def clients(n_clients, n_requests, depth, leaves):
    """Let clients ask, in a process of their own; give what ends it, and returns what it says."""
    arguments = map(str, (n_clients, n_requests, depth, int(leaves)))
    with subprocess.Popen(
        [sys.executable, '-c', CLIENTS, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout.readline() == 'sent\n'
            yield lambda: process.communicate('\n')[0]
        finally:
            process.kill()


def planning_process(planner):
    """Return the number of the process in which a planner plans."""
    # Any of its threads may have started it.
    threads = Path(f'/proc/{planner.pid}/task').glob('*/children')
    (child,) = [child for path in threads for child in path.read_text().split()]
    return int(child)


def answered(client):
    """Return the answer of a service."""
    future = client.call_async(Trigger.Request())
    wait_until(future.done)
    return future.result()


TARGETS = cycle([(1.0, 1.5, 0.8), (1.5, 0.1, 0.3)])


def set_off(watcher):
    """Have the arm begin a motion to another target."""
    send(watcher, watcher.target, samples.target(*next(TARGETS)))
    wait_until(lambda: answered(watcher.plan).success)


@pytest.mark.parametrize('is_killed', [False, True])
@pytest.mark.parametrize('n_requests', [50, 1000])
def test_a_client_that_leaves_with_open_requests_stops_no_motion_of_another(
    nodes, n_requests, is_killed
):
    watcher, planner, said = nodes
    begin, n_said = watcher.positions(), len(said)
    set_off(watcher)
    wait_until(lambda: np.abs(watcher.positions() - begin).max() > 0.02)
    # Nothing is answered until the client has left.
    os.kill(planning_process(planner), signal.SIGSTOP)
    with clients(1, n_requests, depth=1000, leaves=True) as end:
        watcher.clear.clear()
        if not is_killed:
            end()
    os.kill(planning_process(planner), signal.SIGCONT)

    def n_gone():
        """Return the number of answers that were not sent, as the planner says."""
        lines = [line for line in said[n_said:] if 'clients that are not there' in line]
        return sum(int(line.split()[1]) for line in lines)

    # One that was killed counts as there until its lease ends, one that left for a moment: answers
    # of that time leave, too. The motion comes to its end, and all have left or are dropped.
    wait_until(lambda: np.abs(watcher.states[-1].velocity).max() < 1e-6)
    wait_until(lambda: len(watcher.clear) > 250)
    print(f'{n_requests} open requests: {n_gone()} answers not sent', end=', ')
    print(f'~/ray_clear at most {1e3 * watcher.lateness():.0f} ms after the one before')
    assert not [line for line in said[n_said:] if 'fail-safe stop' in line or 'fault' in line]
    # It goes on answering.
    wait_until(lambda: answered(watcher.plan).success)


@pytest.mark.parametrize(('n_clients', 'n_requests', 'depth'), [(200, 1, 1000), (1, 100, 10)])
def test_all_that_wait_are_answered_when_they_are_cancelled(nodes, n_clients, n_requests, depth):
    watcher, planner, _ = nodes
    os.kill(planning_process(planner), signal.SIGSTOP)
    with clients(n_clients, n_requests, depth, leaves=False) as end:
        answered(watcher.cancel)
        os.kill(planning_process(planner), signal.SIGCONT)
        for _ in range(5):
            answered(watcher.cancel)
        assert int(end()) == n_clients * n_requests


def test_a_planning_process_that_hangs_is_answered_for_and_replaced(nodes):
    watcher, planner, said = nodes
    set_off(watcher)
    hung = planning_process(planner)
    os.kill(hung, signal.SIGSTOP)
    begin = time.monotonic()
    message = answered(watcher.plan).message
    print(f'answered after {time.monotonic() - begin:.1f} s: {message}')
    assert message.startswith('FAILURE (99999): ')
    assert 'since it had not answered in time' in message
    wait_until(lambda: answered(watcher.plan).success, 180.0)
    assert planning_process(planner) != hung
