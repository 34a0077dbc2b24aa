# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The clock of a real planner steps while an arm moves: the arm stops along its path."""

from threading import Event, Thread

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rclpy.time import Time  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
from rrth_planner.ros.playback_node import PlaybackNode  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TARGET = (1.0, 1.5, 0.8)
# The arm is under way after this [s]; its motion lasts for seconds more.
UNDER_WAY = 1.0


class Machine:
    """A machine whose clock can be set."""

    def __init__(self):
        """Begin with the right time."""
        self.step = 0

    def nodes(self, kind):
        """Return a kind of node that runs on this machine."""
        machine = self

        class OnMachine(kind):
            """Has the clock of the machine."""

            def get_clock(self):
                """Return the clock."""
                return SetClock(super().get_clock(), machine)

        return OnMachine


class SetClock:
    """A clock that was set forward."""

    def __init__(self, clock, machine):
        """Take the time from a clock."""
        self._clock, self._machine = clock, machine

    def now(self):
        """Return the time."""
        now = self._clock.now()
        return Time(nanoseconds=now.nanoseconds + self._machine.step, clock_type=now.clock_type)

    def __getattr__(self, name):
        return getattr(self._clock, name)


class Client(Node):
    """Publishes a wearer, and keeps what the nodes publish."""

    def __init__(self, **options):
        """Connect to both nodes."""
        super().__init__('client', **options)
        body = self.create_publisher(MarkerArray, 'body_boxes', LATCHED)
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.states, self.motions, self.reports = [], [], []
        self.create_subscription(JointState, 'joint_states', self.states.append, 500)
        self.create_subscription(JointTrajectory, 'joint_trajectory', self.motions.append, 50)
        self.create_subscription(DiagnosticArray, '/diagnostics', self.reports.append, 50)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')
        self._is_over = Event()

        def publish():
            # By the time of the machine, which may stand still.
            while not self._is_over.wait(0.02):
                body.publish(samples.wearer())

        self._thread = Thread(target=publish, daemon=True)
        self._thread.start()

    def close(self):
        """End publishing."""
        self._is_over.set()
        self._thread.join()

    def speed(self):
        """Return how fast the arm moved last [rad/s]."""
        return float(np.abs(self.states[-1].velocity).max())

    def says(self, words):
        """Return whether the diagnostics of the planner have said something."""
        texts = [v.value for m in self.reports for s in m.status for v in s.values]
        return any(words in text for text in texts)


def _parameters(**values):
    return [Parameter(name, value=value) for name, value in values.items()]


@pytest.fixture(name='under_way')
def _under_way(wait_until, send, spinning, ask):
    """Have an arm under way on a machine; give what was moved by the client."""
    nodes, blocks = [], []

    def begin(separation, machines, sim=False):
        for_all = {'use_sim_time': True} if sim else {}
        values = {'separation': separation, 'body_timeout': 1.0, 'joint_timeout': 1.0, 'seed': 7}
        given = _parameters(max_velocity=[0.4], **values, **for_all)
        planner = machines[0].nodes(PlannerNode)(parameter_overrides=given)
        arm = machines[1].nodes(PlaybackNode)(parameter_overrides=_parameters(**for_all))
        client = Client()
        nodes.extend([planner, arm, client])
        for node in (planner, arm, client):
            block = spinning(node)
            block.__enter__()
            blocks.append(block)
        wait_until(client.plan.service_is_ready, 120.0)
        wait_until(lambda: client.states)
        send(client, client.target, samples.target(*TARGET))
        answer = ask(client.plan)
        assert answer.success, answer.message
        wait_until(lambda: client.speed() > 0.3)
        return client

    yield begin
    for block in reversed(blocks):
        block.__exit__(None, None, None)
    for node in nodes:
        if hasattr(node, 'close'):
            node.close()


def _distance(client, begin):
    """Return how far the arm has moved since one of its states [rad]."""
    return float(np.abs(np.subtract(client.states[-1].position, begin.position)).max())


@pytest.mark.parametrize('separation', [True, False])
@pytest.mark.parametrize('step', [-0.09, 1.0])
def test_a_step_of_the_clock_stops_the_arm_and_it_goes_on(under_way, step, separation, wait_until):
    machine = Machine()
    client = under_way(separation, (machine, machine))
    n_states, n_motions = len(client.states), len(client.motions)
    machine.step = int(1e9 * step)
    wait_until(lambda: client.speed() == 0.0)
    begin, end = client.states[n_states], client.states[-1]
    # It slows down with 4 rad/s^2 and 40 rad/s^3.
    assert np.abs(np.subtract(end.position, begin.position)).max() < 0.2
    q = np.array([s.position for s in client.states[n_states - 1 :]])
    assert np.abs(np.diff(q, axis=0)).max() < 0.4 * 0.1
    # No message steps back, nor far ahead: the arm is where its stop begins.
    stop = client.motions[n_motions]
    way = np.array([s.position for s in client.states])
    assert np.abs(way - np.array(stop.points[0].positions)).max(axis=1).min() < 5e-3
    wait_until(lambda: client.says('the clock was set'))
    # By itself, with `resume: auto`.
    wait_until(lambda: _distance(client, end) > 0.05)


def test_a_controller_with_another_clock_is_stopped_too(under_way, wait_until):
    client = under_way(False, (planner := Machine(), Machine()))
    end = np.array(client.motions[-1].points[-1].positions)
    planner.step = int(0.5e9)
    wait_until(lambda: client.speed() == 0.0)
    # Before its end; on a busy machine the playback may reject the first stop, and take the next.
    assert np.abs(np.subtract(client.states[-1].position, end)).max() > 0.05


@pytest.mark.parametrize('set_back', [0.5, 0.0])
def test_a_simulated_clock_that_is_set_back_or_stands_still_stops_the_arm(
    under_way, wait_until, spinning, set_back
):
    is_over, time_now, is_running = Event(), [100.0], Event()
    is_running.set()
    sim = Node('simulator')
    clock = sim.create_publisher(Clock, '/clock', 10)

    def publish():
        while not is_over.wait(0.005):
            if is_running.is_set():
                time_now[0] += 0.005
            msg = Clock()
            msg.clock = Time(nanoseconds=int(1e9 * time_now[0])).to_msg()
            clock.publish(msg)

    thread = Thread(target=publish, daemon=True)
    thread.start()
    try:
        client = under_way(False, (Machine(), Machine()), sim=True)
        if set_back:
            time_now[0] -= set_back
            words = 'the clock was set back'
        else:
            is_running.clear()
            words = 'stood still'
        wait_until(lambda: client.says(words))
        is_running.set()
        n_states = len(client.states)
        wait_until(lambda: len(client.states) > n_states and client.speed() == 0.0)
    finally:
        is_over.set()
        thread.join()
