# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the planner says of a motion that nobody follows, and of a goal that it gives up."""

from contextlib import ExitStack, suppress
import json
from threading import Event, Thread
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')
pytest.importorskip('tqdm')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rrth_planner.cli import point_at  # noqa: E402
from rrth_planner.model.arm import pointing_error  # noqa: E402
from rrth_planner.ros.client import PlannerClient  # noqa: E402
from rrth_planner.ros.client.planner_client import GivenUpError  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
from rrth_planner.ros.middleware.qos import LATCHED  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402
import worlds  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
PLANNER, PLAYBACK = (f'rrth_planner.ros.{name}_node' for name in ('planner', 'playback'))
ARM, TARGET = worlds.table_1_arm(), (1.0, 1.5, 0.8)
PERIOD = 0.02
# A busy machine is late; and slow motions leave it time for a few commitments.
SETTINGS = {
    'seed': 7,
    'separation': 'true',
    'max_velocity': '[0.5]',
    'body_timeout': 1.0,
    'joint_timeout': 5.0,
}
# With these nothing becomes stale.
PATIENT = {'body_timeout': 0.0, 'joint_timeout': 0.0}
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Wearer(Node):
    """Publishes the wearer like a tracker, and an arm that never moves; hears what is said."""

    def __init__(self, namespace, motions):
        """Connect to the planner of a namespace; motions: the topic of the arm's controller."""
        super().__init__('wearer', namespace=namespace)
        self.body = self.create_publisher(MarkerArray, 'body_boxes', 10)
        self.joints = self.create_publisher(JointState, 'joint_states', 10)
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.states, self.said, self.reports, self.motions = [], [], [], []
        self.create_subscription(JointState, 'joint_states', self.states.append, 500)
        self.create_subscription(DiagnosticStatus, 'rrth_planner/state', self.said.append, LATCHED)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_report, 100)
        if motions:
            self.create_subscription(JointTrajectory, motions, self.motions.append, 100)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')
        self.is_over, self.is_seen, self.is_standing = Event(), Event(), Event()
        self.is_seen.set()
        self._thread = Thread(target=self._publish, daemon=True)
        self._thread.start()

    def _on_report(self, msg):
        name = f'{self.get_namespace().strip("/")}/rrth_planner: planning'
        self.reports += [status for status in msg.status if status.name == name]

    def _publish(self):
        markers = [
            samples.box(b.name, center=b.center.tolist(), size=b.size.tolist())
            for b in worlds.wearer().boxes
        ]
        while not self.is_over.is_set():
            stamp = self.get_clock().now().to_msg()
            for marker in markers:
                marker.header.stamp = stamp
            if self.is_seen.is_set():
                self.body.publish(samples.array(*markers))
            if self.is_standing.is_set():
                state = samples.joints()
                state.header.stamp = stamp
                self.joints.publish(state)
            time.sleep(PERIOD)

    def close(self):
        """End publishing."""
        self.is_over.set()
        self._thread.join()

    def speed(self):
        """Return how fast the arm moved last [rad/s]."""
        return float(np.abs(self.states[-1].velocity).max()) if self.states else 0.0

    def has_arrived(self):
        """Return whether the arm rests and points at the target."""
        q = np.array(self.states[-1].position)
        return self.speed() == 0.0 and pointing_error(ARM, q, np.array(TARGET)) < 1e-3

    def value(self, key):
        """Return a value of the last diagnostics; None before."""
        if not self.reports:
            return None
        return {v.key: v.value for v in self.reports[-1].values}.get(key)

    def levels(self):
        """Return the last levels of diagnostics and state."""
        return {messages[-1].level for messages in (self.reports, self.said) if messages}


@pytest.fixture(name='begin')
def _begin(wait_until, send, spinning, request):
    """Give what starts a planner beside a wearer, and an arm if it is to move."""
    with ExitStack() as stack:
        namespace = f'/said_{abs(hash(request.node.name)) % 10**9}'
        lines = []

        def begin(motions='', arm=None, **settings):
            wearer = Wearer(namespace, motions)
            stack.callback(wearer.close)
            values = SETTINGS | settings
            words = ['--ros-args', '-r', f'__ns:={namespace}']
            remap = ['-r', f'joint_trajectory:={motions}'] if motions else []
            own = [w for name, value in values.items() for w in ('-p', f'{name}:={value}')]
            stack.enter_context(ChildProcess(PLANNER, [*words, *remap, *own], lines.append))
            if arm is None:
                wearer.is_standing.set()
            else:
                given = [w for name, value in arm.items() for w in ('-p', f'{name}:={value}')]
                own = [*words, *remap, *given]
                stack.enter_context(ChildProcess(PLAYBACK, own, lines.append))
            stack.enter_context(spinning(wearer))
            wait_until(wearer.plan.service_is_ready, 120.0)
            wait_until(lambda: wearer.states)
            send(wearer, wearer.target, samples.target(*TARGET))
            wait_until(lambda: wearer.levels() == {OK})
            return wearer

        begin.lines, begin.namespace, begin.stack = lines, namespace, stack
        yield begin


def asked(wearer, ask):
    """Return the sentence of the answer to a request that has a motion."""
    answer = ask(wearer.plan)
    assert answer.success, answer.message
    return answer.message


def holds(wearer):
    """Return whether the planner holds the arm."""
    return wearer.value('monitor') == 'holding'


@pytest.mark.parametrize('separation', ['true', 'false'])
def test_an_arm_that_ignores_motions_is_reported_with_the_topic_of_its_controller(
    begin, wait_until, ask, separation
):
    topic = f'{begin.namespace}/controller/joint_trajectory'
    wearer = begin('controller/joint_trajectory', separation=separation, **PATIENT)
    if separation == 'false':
        # A body that a busy machine checks late would stop the arm.
        wearer.is_seen.clear()
    assert 'nobody' not in asked(wearer, ask)
    wait_until(lambda: 'does not follow it' in wearer.reports[-1].message)
    wait_until(lambda: wearer.levels() == {WARN})
    if separation == 'false':
        # With it the planner tries three times by itself.
        for _ in range(2):
            wait_until(lambda: holds(wearer))
            assert wearer.levels() == {WARN}
            asked(wearer, ask)
            wait_until(lambda: not holds(wearer))
    wait_until(lambda: holds(wearer) and wearer.levels() == {ERROR})
    for messages in (wearer.reports, wearer.said)[: 1 + (separation == 'true')]:
        assert topic in messages[-1].message
        assert '3 motions one after the other' in messages[-1].message
    assert not any(said.message.startswith('SLOWED') for said in wearer.said[-1:])
    # Until a motion is followed.
    n = len(wearer.reports)
    wait_until(lambda: len(wearer.reports) > n + 2)
    assert wearer.levels() == {ERROR}
    wearer.is_standing.clear()
    words = ['--ros-args', '-r', f'__ns:={begin.namespace}', '-r', f'joint_trajectory:={topic}']
    n = len(wearer.states)
    begin.stack.enter_context(ChildProcess(PLAYBACK, words, begin.lines.append))
    wait_until(lambda: len(wearer.states) > n)
    # A controller that the planner has not discovered yet gets no motion.
    for _ in range(10):
        asked(wearer, ask)
        with suppress(AssertionError):
            wait_until(lambda: wearer.speed() > 0.05, 3.0)
            break
    wait_until(lambda: wearer.levels() == {OK}, 60.0)


def test_where_nobody_is_subscribed_to_motions_the_answer_and_both_levels_say_so_at_once(
    begin, wait_until, ask
):
    wearer = begin(**PATIENT)
    sentence = f'nobody is subscribed to {begin.namespace}/joint_trajectory'
    assert sentence in asked(wearer, ask)
    wait_until(lambda: WARN in {report.level for report in wearer.reports[-5:]})
    for messages in (wearer.reports, wearer.said):
        wait_until(lambda m=messages: any(sentence in one.message for one in m))


def test_an_arm_with_lower_limits_than_the_stops_of_the_planner_says_which_two_parameters(
    begin, wait_until, ask
):
    wearer = begin(
        arm={'max_acceleration': '[4.0]'}, stop_acceleration='[20.0]', stop_jerk='[900.0]'
    )
    ask(wearer.plan)
    wait_until(lambda: any('rejected' in line for line in begin.lines))
    (line, *_) = [line for line in begin.lines if 'rejected' in line]
    assert ': acceleration ' in line
    assert 'expected -4.04 to 4.04 [rad/s^2]: max_acceleration of the arm' in line
    assert 'stop_acceleration of the planner' in line
    wait_until(lambda: wearer.levels() == {ERROR})
    assert f'executes {begin.namespace}/joint_trajectory' in wearer.reports[-1].message


def test_a_goal_goes_on_whose_inputs_come_back_after_the_arm_has_come_to_rest(
    begin, wait_until, ask
):
    wearer = begin(arm={}, patience=60.0)
    asked(wearer, ask)
    wait_until(lambda: wearer.speed() > 0.05)
    # Too old a body stops the arm, and is still too old when a motion is planned again.
    wearer.is_seen.clear()
    wait_until(lambda: holds(wearer))
    assert 'SENSOR_INFO_STALE (-24)' in wearer.value('last stop')
    assert WARN in wearer.levels()
    assert wearer.value('given up') == ''
    wearer.is_seen.set()
    wait_until(wearer.has_arrived, 60.0)
    wait_until(lambda: wearer.levels() == {OK})
    assert wearer.said[-1].message == 'NORMAL'
    assert wearer.value('given up') == ''


def test_who_waits_for_a_goal_that_is_given_up_hears_why(begin, wait_until, call):
    wearer = begin(arm={}, patience=0.5)
    client = PlannerClient('asking', timeout=120.0, namespace=begin.namespace)
    # One that was reached before, and the given up one of another request, do not count.
    answer = client.point_at(TARGET)
    assert answer.number >= 1
    client.wait_for(wearer.has_arrived, 'the arm at the target')
    assert client.why_given_up(answer) == ''
    second = client.point_at((1.5, -0.8, 1.2))
    client.wait_for(lambda: wearer.speed() > 0.05, 'the arm in motion')
    wearer.is_seen.clear()
    client.wait_for(lambda: client.why_given_up(second) != '', 'the end of the goal')
    assert client.why_given_up(second).startswith('SENSOR_INFO_STALE (-24): ')
    with pytest.raises(GivenUpError, match='given this target up: SENSOR_INFO_STALE'):
        client.require_pursued(second)
    assert 'another request' in client.why_given_up(answer)
    wearer.is_seen.set()
    third = client.point_at(TARGET)
    assert third.number > second.number
    assert client.why_given_up(third) == ''
    client.wait_for(wearer.has_arrived, 'the arm at the target')
    assert 'another request' in client.why_given_up(second)
    client.receive_for(0.5)
    assert client.why_given_up(third) == ''
    client.destroy_node()

    def blind():
        wait_until(lambda: wearer.speed() > 0.05, 120.0)
        wearer.is_seen.clear()

    thread = Thread(target=blind, daemon=True)
    thread.start()
    words = ('--timeout', 120.0, '--json', '--ros-args', '-r', f'__ns:={begin.namespace}', '--')
    begun = time.monotonic()
    ended = call(point_at.main, 1.5, -0.8, 1.2, *words)
    thread.join()
    # Not after the timeout.
    assert time.monotonic() - begun < 120.0
    assert ended.returncode == 4, ended
    report = json.loads(ended.stdout)
    assert report['name'] == 'SUCCESS'
    assert 'given this target up: SENSOR_INFO_STALE (-24): ' in report['sentence']
