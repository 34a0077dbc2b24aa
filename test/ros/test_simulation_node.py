# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node arm_simulation, from outside: what it takes and rejects, and what it publishes."""

import numpy as np
import pytest
from recordings import write_child

pytest.importorskip('rclpy')
pytest.importorskip('mujoco')

from conftest import spinning, wait_until  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from rcl_interfaces.msg import Log  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.io.resources import resource_path  # noqa: E402
from rrth_planner.io.text_file import load_yaml  # noqa: E402
from rrth_planner.model.arm import tool_pose  # noqa: E402
from rrth_planner.model.errors import MessageError, SceneError  # noqa: E402
from rrth_planner.model.trajectory import Trajectory  # noqa: E402
from rrth_planner.ros.interface.simulation_parameters import SETTINGS  # noqa: E402
from rrth_planner.ros.messages.controller_points import controller_points_from_msg  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_to_msg  # noqa: E402
from rrth_planner.ros.simulation_node import main, SimulationNode  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

ARM = load_arm()
FOLDED = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])


class Observer(Node):
    """Sends trajectories as a planner does, and records what the simulation publishes."""

    def __init__(self):
        super().__init__('observer')
        self.states, self.contacts, self.logs, self.bodies, self.reports = [], [], [], [], []
        self.motions = self.create_publisher(JointTrajectory, 'joint_trajectory', 10)
        for kind, topic, kept in (
            (JointState, 'joint_states', self.states),
            (DiagnosticArray, 'arm_simulation/contacts', self.contacts),
            (DiagnosticArray, '/diagnostics', self.reports),
            (Log, '/rosout', self.logs),
            (MarkerArray, 'body_boxes', self.bodies),
        ):
            self.create_subscription(kind, topic, kept.append, 100)

    def q(self):
        return np.array(self.states[-1].position)


@pytest.fixture
def started(ros_context):
    """Give what starts a simulation with parameters, and returns who observes it."""
    running = []

    def start(**parameters):
        observer = Observer()
        node = SimulationNode(
            parameter_overrides=[Parameter(name, value=v) for name, v in parameters.items()]
        )
        block = spinning(node, observer)
        block.__enter__()
        running.append((node, observer, block))
        wait_until(lambda: observer.states and observer.motions.get_subscription_count())
        wait_until(lambda: observer.count_publishers('/rosout') > 1)
        return observer

    yield start
    for node, observer, block in running:
        block.__exit__(None, None, None)
        node.destroy_node()
        observer.destroy_node()


def motion(q_from, q_to, duration):
    """Return the message of a motion from rest to rest [rad] in a time [s]."""
    still = np.zeros((2, 4))
    trajectory = Trajectory([0.0, duration], np.array([q_from, q_to]), still, still)
    return joint_trajectory_to_msg(trajectory, ARM.joint_names, 'torso')


def test_the_file_of_parameters_has_each_with_its_default():
    given = load_yaml(resource_path('config/simulation.yaml'))['/**']['ros__parameters']
    assert given == {setting.name: setting.default for setting in SETTINGS}


def test_it_moves_as_commanded_and_publishes_what_a_broadcaster_does(started):
    observer = started()
    goal = FOLDED + [0.4, -0.3, 0.2, 0.1]
    observer.motions.publish(motion(FOLDED, goal, 0.8))
    wait_until(lambda: np.abs(observer.q() - goal).max() < 1e-3)
    states = observer.states
    assert list(states[0].name) == list(ARM.joint_names)
    assert all(len(s.velocity) == len(s.effort) == 4 for s in states)
    stamps = np.array([s.header.stamp.sec + 1e-9 * s.header.stamp.nanosec for s in states])
    # Five steps of 2 ms apart, but where a busy machine had time left out.
    assert np.median(np.diff(stamps)) == pytest.approx(0.01, abs=1e-4)
    # It went there and did not jump: nowhere faster than the motion, whose top is 0.94 rad/s.
    positions = np.array([s.position for s in states])
    assert np.abs(np.diff(positions, axis=0)).max() < 0.02
    assert max(abs(v) for s in states for v in s.velocity) > 0.3
    wait_until(
        lambda: any(r.status[0].name == 'arm_simulation: physics' for r in observer.reports)
    )


BAD = {
    'a joint is missing': (lambda m: m.joint_names.pop(), 'joint_names'),
    'an unknown joint': (lambda m: m.joint_names.__setitem__(0, 'a'), 'joint_names'),
    'no points': (lambda m: m.points.clear(), 'points: 0'),
    'times that stand still': (
        lambda m: setattr(m.points[1], 'time_from_start', m.points[0].time_from_start),
        'strictly increasing',
    ),
    'no positions': (lambda m: setattr(m.points[1], 'positions', []), 'positions: 0 values'),
    'too few velocities': (lambda m: setattr(m.points[1], 'velocities', [0.0]), '1 values'),
    'a number that is none': (
        lambda m: setattr(m.points[1], 'positions', [np.nan] * 4),
        'expected finite',
    ),
    'an effort': (lambda m: setattr(m.points[0], 'effort', [1.0] * 4), 'effort'),
    'moving at the end': (
        lambda m: setattr(m.points[1], 'velocities', [0.1] * 4),
        'velocity of the last point',
    ),
    'over already': (lambda m: setattr(m.header.stamp, 'sec', 5), 'header.stamp'),
}


@pytest.mark.parametrize('name', BAD)
def test_what_the_controller_rejects_is_rejected(name):
    change, words = BAD[name]
    msg = motion(FOLDED, FOLDED - 0.3, 1.0)
    assert len(controller_points_from_msg(msg, ARM.joint_names, 100.0).times) == 2
    change(msg)
    with pytest.raises(MessageError, match=words):
        controller_points_from_msg(msg, ARM.joint_names, 100.0)


def test_points_may_lack_velocities_and_come_in_any_order_of_joints():
    msg = motion(FOLDED, FOLDED - 0.3, 1.0)
    msg.joint_names = list(reversed(ARM.joint_names))
    msg.points[1].velocities, msg.points[1].accelerations = [], []
    points = controller_points_from_msg(msg, ARM.joint_names, 100.0)
    assert (points.positions[0] == FOLDED[::-1]).all()
    assert np.isnan(points.velocities[1]).all()
    assert not np.isnan(points.velocities[0]).any()


def test_a_rejected_message_leaves_the_arm_as_it_is(started):
    observer = started()
    msg = motion(FOLDED, FOLDED - 0.3, 0.5)
    msg.points[1].velocities = [0.1] * 4
    observer.motions.publish(msg)
    wait_until(lambda: any('joint_trajectory rejected' in line.msg for line in observer.logs))
    n = len(observer.states) + 20
    wait_until(lambda: len(observer.states) > n)
    np.testing.assert_allclose(observer.q(), FOLDED, atol=1e-3)


def test_an_arm_that_runs_into_the_wearer_reports_that(started, tmp_path):
    # A wall where the arm swings to.
    q = np.array([0.0, -1.2, np.pi / 2, np.pi / 2])
    center = (tool_pose(ARM, q + [0.8, 0.0, 0.0, 0.0])[:3, 3]).tolist()
    file = tmp_path / 'wall.yaml'
    file.write_text(f'boxes:\n  - {{name: wall, center: {center}, size: [0.1, 0.1, 0.4]}}\n')
    observer = started(wearer='standing', wearer_file=str(file), initial_positions=q.tolist())
    wait_until(lambda: observer.contacts and not observer.contacts[0].status)
    wait_until(lambda: observer.bodies)
    assert [m.ns for m in observer.bodies[0].markers] == ['wall']
    observer.motions.publish(motion(q, q + [1.5, 0.0, 0.0, 0.0], 1.5))
    wait_until(lambda: observer.contacts[-1].status)
    first = next(msg.status[0] for msg in observer.contacts if msg.status)
    assert first.level == DiagnosticStatus.WARN
    bar, part = first.name.split(': ')
    assert (bar in ('link 3', 'link 4'), part) == (True, 'wall')
    values = {v.key: v.value for v in first.values}
    assert 0.05 < float(values['speed at contact [m/s]']) < 1.0
    wait_until(
        lambda: any(
            v.key == 'greatest force of a contact [N]' and float(v.value) > 1.0
            for msg in observer.reports
            for status in msg.status
            for v in status.values
        )
    )
    # And that it ended, once it goes back.
    observer.motions.publish(motion(observer.q(), q, 1.0))
    wait_until(
        lambda: any(
            s.level == DiagnosticStatus.OK and s.message.startswith('contact has ended')
            for msg in observer.contacts
            for s in msg.status
        )
    )


def test_a_recorded_child_is_in_the_scene_where_the_stature_says_so_with_hands_of_a_size(
    started, tmp_path
):
    file = str(write_child(tmp_path / 'child.csv'))
    with pytest.raises(SceneError, match='smaller than the parameter stature says'):
        started(wearer='recorded', wearer_file=file)
    with pytest.raises(SceneError, match=r'hand_size: 0.02, expected 0 or a size from 0.05 to 1'):
        started(wearer='recorded', wearer_file=file, stature=[1.2], hand_size=0.02)
    started(wearer='recorded', wearer_file=file, stature=[1.2], hand_size=0.2)


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (['-p', 'wearer:=nobody'], 'wearer: "nobody", expected none, standing or recorded'),
        (['-p', 'lag:=0.001'], 'lag: 0.001, expected more than 0.0018'),
        (['-p', 'link_mass:=[1.0, 2.0]'], 'link_mass: 2 values, expected 4'),
    ],
)
def test_bad_parameters_end_it_with_one_sentence(call, words, said):
    ended = call(lambda args: main(['simulation_node', *args]), '--ros-args', *words)
    assert ended.returncode == 1
    line = ended.stderr.splitlines()[-1]
    assert '[arm_simulation]: cannot start: ' in line
    assert said in line
