# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The action point_head of planner and playback, by the real control_msgs/action/PointHead."""

import asyncio
from contextlib import ExitStack
import math
import os
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from action_msgs.msg import GoalStatus  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PointStamped, Vector3  # noqa: E402
import message_packages  # noqa: E402
from rclpy.action import ActionClient  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.model.arm import pointing_angle  # noqa: E402
from rrth_planner.model.errors import MessageError  # noqa: E402
from rrth_planner.model.trajectory import REST_SPEED  # noqa: E402
from rrth_planner.ros.client import PlannerClient  # noqa: E402
from rrth_planner.ros.client.planner_client import NotInTimeError  # noqa: E402
from rrth_planner.ros.messages import point_head  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
from rrth_planner.ros.middleware.qos import LATCHED  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
from rrth_planner.timing.parameterization import peaks  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
EXAMPLES = Path(__file__).parents[2] / 'examples' / 'ros'
ARM = load_arm()
FRONT, LEFT, HIGH = (1.5, 0.1, 0.3), (0.8, 1.6, 0.6), (1.0, -0.3, 1.9)
SUCCEEDED, CANCELED, ABORTED = (
    getattr(GoalStatus, f'STATUS_{name}') for name in ('SUCCEEDED', 'CANCELED', 'ABORTED')
)
# An arm moves from this speed on [rad/s]; it points at a target up to this angle [rad].
MOVING, POINTING = 0.05, 3e-3


class Client(Node):
    """Publishes inputs of the planner, sends goals, and records the joint states."""

    def __init__(self, action, wait_until):
        """Connect to both nodes."""
        super().__init__('head')
        self.action, self.wait_until = action, wait_until
        self.body = self.create_publisher(MarkerArray, 'body_boxes', LATCHED)
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.states, self.motions, self.reports, self.errors = [], [], [], []
        self.create_subscription(JointTrajectory, 'joint_trajectory', self.motions.append, 10)
        self.create_subscription(JointState, 'joint_states', self.states.append, 500)
        self.create_subscription(DiagnosticArray, '/diagnostics', self.reports.append, 10)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')
        self.heads = ActionClient(self, action, 'rrth_planner/point_head')

    def goal(self, target, **fields):
        """Return a goal to point at a target of the base frame [m]."""
        return self.action.Goal(target=samples.target(*target), **fields)

    def start(self, goal):
        """Send a goal, and return its handle and the future of its result."""
        self.errors.clear()
        sent = self.asked(
            self.heads.send_goal_async,
            goal,
            lambda msg: self.errors.append(msg.feedback.pointing_angle_error),
        )
        self.wait_until(sent.done)
        assert sent.result().accepted
        return sent.result(), self.asked(sent.result().get_result_async)

    def asked(self, ask, *words):
        """
        Return the future of an action client's question, asked by the thread that spins.

        The clients of rclpy 7.1 lose an answer that another thread takes before they have noted
        the question.
        """
        task = self.executor.create_task(ask, *words)
        self.wait_until(task.done)
        return task.result()

    def status(self, result):
        """Return how a goal ended, once it has."""
        self.wait_until(result.done)
        return result.result().status

    def reach(self, target):
        """Let the arm arrive at a target."""
        assert self.status(self.start(self.goal(target))[1]) == SUCCEEDED, self.said[-10:]

    def speed(self):
        """Return how fast the arm moved last [rad/s]."""
        return float(np.abs(self.states[-1].velocity).max())

    def angle(self, target):
        """Return by which angle the ray misses a target [rad]."""
        return pointing_angle(ARM, np.array(self.states[-1].position), np.array(target))

    def wait_for_report(self, key, start):
        """Return once the diagnostics say something that begins so."""

        def is_reported():
            values = {v.key: v.value for m in self.reports for v in m.status[0].values}
            return values.get(key, '').startswith(start)

        self.wait_until(is_reported)


@pytest.fixture(name='client', scope='module')
def _client(request, ros_context):
    """Give a client of a planner and an arm, all in processes of their own."""
    folder = message_packages.available('control_msgs', request.config.cache.mkdir)
    from conftest import send, spinning, wait_until
    from control_msgs.action import PointHead

    said = []
    with ExitStack() as stack:
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        paths = [folder, os.environ.get('PYTHONPATH', '')]
        patch.setenv('PYTHONPATH', os.pathsep.join(filter(None, paths)))
        ros = ['--ros-args', '-p', 'seed:=7', '-p', 'separation:=false']
        for name, words in (('planner', ros), ('playback', [])):
            module = f'rrth_planner.ros.{name}_node'
            stack.enter_context(ChildProcess(module, words, said.append))
        client = Client(PointHead, wait_until)
        client.said = said
        client.folder = folder
        stack.enter_context(spinning(client))
        wait_until(client.heads.server_is_ready, 120.0)
        wait_until(lambda: client.states)
        send(client, client.body, samples.wearer())
        # The planner may find the arm later than this client does: for its motions, to which the
        # arm subscribes twice, ...
        client.wait_for_report('subscribers of motions', '3')
        # ... and by its joint states.
        n_states = len(client.states)
        wait_until(lambda: len(client.states) > n_states + 100)
        yield client
        client.heads.destroy()
    # Its publishers would give their last body to each planner of the tests after these.
    client.destroy_node()


def test_a_goal_is_reached_at_its_pace_and_says_how_far_it_is(client):
    client.states.clear()
    client.motions.clear()
    goal = client.goal(FRONT, pointing_frame='tool', pointing_axis=Vector3(z=2.0))
    goal.max_velocity, goal.min_duration.sec = 0.9, 3
    assert client.status(client.start(goal)[1]) == SUCCEEDED, client.said
    assert client.angle(FRONT) < POINTING
    client.wait_until(lambda: client.speed() == 0.0)
    client.wait_for_report('last sentence', 'the arm has arrived, pointing error 0.00')
    errors = np.array(client.errors)
    assert len(errors) > 20
    assert errors[0] > 1.0 > POINTING > errors[-1]
    assert max(np.abs(state.velocity).max() for state in client.states) < 1.01 * 0.9
    (motion,) = client.motions
    assert 3.0 <= joint_trajectory_from_msg(motion, ARM.joint_names).duration < 3.05


def test_a_goal_is_reached_no_faster_than_it_says(client):
    client.reach(LEFT)
    client.motions.clear()
    client.start(client.goal(HIGH, max_velocity=0.6))
    client.wait_until(lambda: client.motions)
    motion = joint_trajectory_from_msg(client.motions[0], ARM.joint_names)
    assert 0.55 < peaks(motion)[0].max() < 0.6 * 1.01
    client.motions.clear()
    client.wait_until(lambda: client.speed() > 0.4)
    # From a motion that is faster.
    _, result = client.start(client.goal(FRONT, max_velocity=0.2))
    client.wait_until(lambda: client.motions)
    motion = joint_trajectory_from_msg(client.motions[0], ARM.joint_names)
    assert np.abs(motion.velocities[0]).max() > 0.2
    late = motion.times > 0.5 * motion.duration
    assert 0.15 < np.abs(motion.velocities[late]).max() < 0.2 * 1.01
    assert client.status(result) == SUCCEEDED


@pytest.mark.parametrize(
    ('fields', 'code', 'sentence'),
    [
        (
            {'pointing_axis': Vector3(x=1.0)},
            'INVALID_GOAL_CONSTRAINTS (-16)',
            'goal of point_head: pointing_axis: (1, 0, 0), expected (0, 0, 1), the z axis of the '
            'tool, or zeros',
        ),
        (
            {'pointing_frame': 'camera'},
            'INVALID_GOAL_CONSTRAINTS (-16)',
            'goal of point_head: pointing_frame: "camera", expected "tool" or an empty frame',
        ),
        (
            {'max_velocity': -0.5},
            'INVALID_GOAL_CONSTRAINTS (-16)',
            'goal of point_head: max_velocity: -0.5, expected at least 0.001, or 0 for that of '
            'the planner [rad/s]',
        ),
        (
            {'max_velocity': math.nan},
            'INVALID_GOAL_CONSTRAINTS (-16)',
            'goal of point_head: max_velocity: nan, expected',
        ),
        (
            {'sec': -1},
            'INVALID_GOAL_CONSTRAINTS (-16)',
            'goal of point_head: min_duration: -1, expected a time from 0 to 60 [s]',
        ),
        (
            {'frame': 'camera'},
            'FRAME_TRANSFORM_FAILURE (-21)',
            'goal of point_head: frame "camera", expected ',
        ),
        ({'x': 0.0}, 'GOAL_IN_COLLISION (-12)', 'the target'),
    ],
    ids=lambda value: ' '.join(value) if isinstance(value, dict) else '',
)
def test_a_bad_goal_is_aborted_with_a_code_and_a_sentence(client, fields, code, sentence):
    fields = dict(fields)
    sec, frame, x = (fields.pop(n, d) for n, d in (('sec', 0), ('frame', 'torso'), ('x', 1.5)))
    goal = client.goal((x, 0.0, 0.0), **fields)
    goal.min_duration.sec, goal.target.header.frame_id = sec, frame
    client.reports.clear()
    assert client.status(client.start(goal)[1]) == ABORTED
    client.wait_for_report('last code', code)
    client.wait_for_report('last sentence', sentence)
    assert client.speed() <= REST_SPEED


def test_a_cancelled_goal_stops_the_arm_on_its_way(client):
    client.reach(LEFT)
    handle, result = client.start(client.goal(HIGH, max_velocity=0.5))
    client.wait_until(lambda: client.speed() > MOVING)
    client.reports.clear()
    answer = client.asked(handle.cancel_goal_async)
    client.wait_until(answer.done)
    assert len(answer.result().goals_canceling) == 1
    assert client.status(result) == CANCELED
    assert client.speed() <= REST_SPEED
    client.wait_until(lambda: client.speed() == 0.0)
    assert client.angle(HIGH) > 0.1
    client.wait_for_report('last code', 'PREEMPTED (-7)')
    client.wait_for_report('last stop', 'the goal of point_head was cancelled: fail-safe stop')
    # It is not planned for again, and the next goal is reached.
    n = len(client.states)
    client.wait_until(lambda: len(client.states) > n + 100)
    assert not any(np.any(state.velocity) for state in client.states[n:])
    client.reach(HIGH)


def test_a_newer_goal_replaces_an_older_one_in_mid_motion(client):
    client.reach(LEFT)
    _, first = client.start(client.goal(HIGH))
    client.wait_until(lambda: client.speed() > MOVING)
    client.states.clear()
    _, second = client.start(client.goal(FRONT))
    assert client.status(first) == ABORTED
    assert not second.done()
    assert client.status(second) == SUCCEEDED
    assert client.angle(FRONT) < POINTING


def test_a_request_of_a_service_replaces_a_goal_but_a_bad_goal_does_not(client, send):
    client.reach(LEFT)
    send(client, client.target, samples.target(*FRONT))
    _, result = client.start(client.goal(HIGH, max_velocity=0.5))
    client.wait_until(lambda: client.speed() > MOVING)
    _, bad = client.start(client.goal(FRONT, pointing_frame='camera'))
    assert client.status(bad) == ABORTED
    assert not result.done()
    client.reports.clear()
    client.plan.call_async(Trigger.Request())
    assert client.status(result) == ABORTED
    # In the log: within a tenth of a second the diagnostics may have the service's own report.
    replaced = 'another motion has replaced the one to the goal'
    client.wait_until(lambda: any(replaced in line for line in client.said))
    client.wait_until(lambda: client.speed() == 0.0 and client.angle(FRONT) < POINTING)


def test_a_goal_stays_active_after_a_stop_until_it_is_given_up(client, send):
    client.reach(LEFT)
    client.reports.clear()
    _, result = client.start(client.goal(FRONT, max_velocity=0.5))
    client.wait_until(lambda: client.speed() > MOVING)
    body = samples.wearer()
    # Round the target.
    body.markers.append(samples.box('wall', center=FRONT, size=(0.6, 0.6, 0.6)))
    send(client, client.body, body)
    client.wait_for_report('last stop', 'the remaining motion is not proven free of the wearer')
    assert not result.done()
    assert client.status(result) == ABORTED
    client.wait_for_report('last code', 'GOAL_IN_COLLISION (-12)')
    assert client.speed() <= REST_SPEED
    send(client, client.body, samples.wearer())


@pytest.mark.parametrize(
    ('name', 'lines'),
    [
        ('point_at_by_service', ['SUCCESS: ', 'SUCCESS after ']),
        ('point_at_by_action', ['rad to go', 'status 4']),
        ('follow_by_topics', ['a motion to [']),
    ],
)
def test_an_example_of_a_client_runs_and_is_short(client, name, lines):
    file = EXAMPLES / f'{name}.py'
    assert len(file.read_text(encoding='utf-8').splitlines()) <= 32
    folders = [str(EXAMPLES.parents[1]), client.folder, os.environ.get('PYTHONPATH', '')]
    done = subprocess.run(
        [sys.executable, str(file)],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, folders))},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    for line in lines:
        assert line in done.stdout


def test_the_public_client_says_what_it_was_given_and_what_it_waited_for():
    client = PlannerClient('lonely', timeout=0.05, namespace='/nowhere')
    # A planner warns of two publishers of the body: who only points is none.
    assert client.count_publishers('/nowhere/body_boxes') == 0
    with pytest.raises(MessageError, match=r'^target: .*expected .*\[m\]$'):
        client.point_at((1.0, math.nan, 0.0))
    for wait in (client.point_at, lambda t: asyncio.run(client.point_at_async(t))):
        with pytest.raises(NotInTimeError, match='^service .*rrth_planner/plan: nothing for 0.05'):
            wait((1.0, 0.0, 0.0))


def test_without_control_msgs_no_action_is_offered(monkeypatch):
    from rrth_planner.pipeline.in_process_planner import InProcessPlanner

    monkeypatch.setattr(point_head, 'PointHead', None)
    node = PlannerNode(InProcessPlanner(), namespace='/without')
    try:
        names = [
            name
            for name, _ in node.get_service_names_and_types_by_node(
                node.get_name(), node.get_namespace()
            )
        ]
        assert '/without/rrth_planner/plan' in names
        assert not [name for name in names if '_action' in name]
    finally:
        node.close()
        node.destroy_node()
