# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node arm_playback, from outside: what it takes, what it rejects, how it ends."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

rclpy = pytest.importorskip('rclpy')

from conftest import LONGEST_WAIT, spinning, wait_until  # noqa: E402
from geometry_msgs.msg import PoseStamped  # noqa: E402
from rcl_interfaces.msg import Log  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.io.resources import resource_path  # noqa: E402
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.arm import tool_pose  # noqa: E402
from rrth_planner.model.rotation import rotation_matrix  # noqa: E402
from rrth_planner.model.trajectory import MotionLimits, sample, Trajectory  # noqa: E402
from rrth_planner.ros.interface.playback_parameters import SETTINGS  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_to_msg  # noqa: E402
from rrth_planner.ros.playback_node import main, PlaybackNode  # noqa: E402
from rrth_planner.timing.fast_stop import fast_stop  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402

ARM = load_arm()
FOLDED = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])
STILL = np.zeros(4)
LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
MODULE = [sys.executable, '-m', 'rrth_planner.ros.playback_node']


class Observer(Node):
    """Sends trajectories as a planner does, and records what the playback publishes."""

    def __init__(self):
        super().__init__('observer')
        self.states, self.poses, self.logs = [], [], []
        self.motions = self.create_publisher(JointTrajectory, 'joint_trajectory', LATCHED)
        self.create_subscription(JointState, 'joint_states', self.states.append, 100)
        self.create_subscription(PoseStamped, 'arm_playback/tool_pose', self.poses.append, 10)
        self.create_subscription(Log, '/rosout', self.logs.append, 100)
        self.stop = self.create_client(Trigger, 'arm_playback/stop')

    @property
    def q(self):
        return np.array(self.states[-1].position)

    @property
    def v(self):
        return np.array(self.states[-1].velocity)

    def is_still_at(self, q):
        """Return whether the latest state is at rest at a configuration."""
        return not self.v.any() and np.abs(self.q - q).max() < 1e-9

    def wait_for_states(self, n):
        """Wait until so many more states have come."""
        wanted = len(self.states) + n
        wait_until(lambda: len(self.states) >= wanted)

    def wait_for_rejection(self, *words, first):
        """Wait until a line after the first ones is a rejection with some words."""
        words = ('joint_trajectory rejected, ', *words)
        wait_until(lambda: any(all(w in line.msg for w in words) for line in self.logs[first:]))


@pytest.fixture
def observer(ros_context):
    """Have an observer and no playback."""
    node = Observer()
    yield node
    node.destroy_node()


@pytest.fixture
def playback(observer):
    """Return a function that starts a playback, which runs until the end of the test."""
    running = []

    def start(**parameters):
        node = PlaybackNode(
            parameter_overrides=[Parameter(name, value=v) for name, v in parameters.items()]
        )
        block = spinning(node, observer)
        block.__enter__()
        running.append((node, block))
        wait_until(lambda: observer.states)
        wait_until(lambda: observer.motions.get_subscription_count() > 0)
        wait_until(lambda: observer.count_publishers('/rosout') > 1)
        wait_until(observer.stop.service_is_ready)

    yield start
    for node, block in running:
        block.__exit__(None, None, None)
        node.destroy_node()


def motion(q_from, q_to, duration, v_from=STILL):
    """Return the message of a motion between two configurations [rad] in a time [s]."""
    trajectory = Trajectory(
        times=[0.0, duration],
        positions=[q_from, q_to],
        velocities=[v_from, STILL],
        accelerations=[STILL, STILL],
    )
    return joint_trajectory_to_msg(trajectory, ARM.joint_names, 'torso')


def changed(change):
    """Return a good motion after a change."""
    msg = motion(FOLDED, FOLDED - 0.3, 1.0)
    change(msg)
    return msg


def _set(name, value):
    return lambda point: setattr(point, name, value)


# What is done to a good motion, and the words of its rejection.
BAD = {
    'a joint is missing': (
        lambda m: setattr(m, 'joint_names', list(ARM.joint_names[:3])),
        'joint_names',
    ),
    'no joints': (lambda m: setattr(m, 'joint_names', []), 'joint_names'),
    'an unknown joint': (
        lambda m: setattr(m, 'joint_names', ['a', *ARM.joint_names[1:]]),
        'joint_names',
    ),
    'a joint twice': (
        lambda m: setattr(m, 'joint_names', [ARM.joint_names[0]] * 4),
        'joint_names',
    ),
    'no points': (lambda m: setattr(m, 'points', []), 'points: none'),
    'moving at the end': (
        lambda m: _set('velocities', [0.0, 0.0, 1e-6, 0.0])(m.points[-1]),
        'velocity of the last point',
    ),
    'ended long ago': (lambda m: setattr(m.header.stamp, 'sec', 1), 'header.stamp'),
    'times that stand still': (
        lambda m: setattr(m.points[1].time_from_start, 'sec', 0),
        'strictly increasing',
    ),
    'no time at all': (lambda m: m.points.append(m.points[-1]), 'strictly increasing'),
    'negative first time': (
        lambda m: setattr(m.points[0].time_from_start, 'sec', -1),
        'points[0].time_from_start',
    ),
    'no positions': (lambda m: _set('positions', [])(m.points[0]), 'points[0].positions'),
    'a position too few': (
        lambda m: _set('positions', [0.0] * 3)(m.points[1]),
        'points[1].positions',
    ),
    'a velocity too many': (
        lambda m: _set('velocities', [0.0] * 5)(m.points[0]),
        'points[0].velocities',
    ),
    'an acceleration too few': (
        lambda m: _set('accelerations', [0.0])(m.points[0]),
        'points[0].accelerations',
    ),
    'a velocity that is not a number': (
        lambda m: _set('velocities', [0.0, np.nan, 0.0, 0.0])(m.points[1]),
        'points[1].velocities: [0.0, nan',
    ),
    'no velocities': (lambda m: _set('velocities', [])(m.points[1]), 'points[1].velocities'),
    'no accelerations': (
        lambda m: _set('accelerations', [])(m.points[1]),
        'points[1].accelerations',
    ),
    'late first time': (
        lambda m: setattr(m.points[0].time_from_start, 'nanosec', 1),
        'points[0].time_from_start',
    ),
    'efforts': (lambda m: _set('effort', [0.0] * 4)(m.points[0]), 'effort'),
    'not a number': (
        lambda m: _set('positions', [np.nan, *FOLDED[1:]])(m.points[1]),
        'points[1].positions: [nan',
    ),
    'infinite': (
        lambda m: _set('accelerations', [np.inf, 0.0, 0.0, 0.0])(m.points[0]),
        'points[0].accelerations: [inf',
    ),
    'beyond the limits of a joint': (
        lambda m: _set('positions', FOLDED + [0, 0.4, 0, 0])(m.points[1]),
        'joint_2: position 0.05',
    ),
    'too fast': (
        lambda m: _set('positions', FOLDED + [1.0, 0, 0, 0])(m.points[1]),
        'joint_1: velocity',
    ),
    'too hard': (
        lambda m: _set('accelerations', [0.0, 0.0, 5.0, 0.0])(m.points[0]),
        'joint_3: acceleration',
    ),
    'a jump at the start': (
        lambda m: _set('positions', FOLDED + 0.02)(m.points[0]),
        'joint_2: the motion begins at position',
    ),
    'a leap at the start': (
        lambda m: _set('velocities', [0.0, 0.0, 0.0, 0.2])(m.points[0]),
        'joint_4: the motion begins at velocity',
    ),
}


def test_an_arm_at_rest_publishes_its_state(playback, observer):
    playback(initial_positions=[0.1, -0.2, 0.3, 0.4], base_frame='chest')
    observer.wait_for_states(20)
    wait_until(lambda: observer.poses)
    assert all(list(state.name) == list(ARM.joint_names) for state in observer.states)
    assert all(list(state.position) == [0.1, -0.2, 0.3, 0.4] for state in observer.states)
    assert all(list(state.velocity) == [0.0] * 4 for state in observer.states)
    stamps = [rclpy.time.Time.from_msg(state.header.stamp) for state in observer.states]
    behind = observer.get_clock().now().nanoseconds - stamps[-1].nanoseconds
    assert 0 <= behind < 60e9
    assert all(before < after for before, after in zip(stamps, stamps[1:], strict=False))
    pose, T = observer.poses[-1], tool_pose(ARM, np.array([0.1, -0.2, 0.3, 0.4]))
    p, o = pose.pose.position, pose.pose.orientation
    assert pose.header.frame_id == 'chest'
    np.testing.assert_allclose([p.x, p.y, p.z], T[:3, 3], atol=1e-12)
    np.testing.assert_allclose(rotation_matrix([o.x, o.y, o.z, o.w]), T[:3, :3], atol=1e-9)


def test_a_motion_is_followed_to_its_end_and_the_next_from_there(playback, observer):
    playback()
    there = FOLDED - 0.3
    observer.motions.publish(motion(FOLDED, there, 0.8))
    wait_until(lambda: observer.is_still_at(there))
    assert any(np.abs(state.velocity).max() > 0.3 for state in observer.states)
    back = motion(there, FOLDED, 0.8)
    back.joint_names.reverse()
    for point in back.points:
        point.positions = point.positions[::-1]
    observer.motions.publish(back)
    wait_until(lambda: observer.is_still_at(FOLDED))


def test_whatever_is_rejected_is_named_and_moves_nothing(playback, observer):
    playback()
    for change, words in BAD.values():
        n_logs, n_states = len(observer.logs), len(observer.states)
        observer.motions.publish(changed(change))
        observer.wait_for_rejection('arm holds its position: ', words, first=n_logs)
        observer.wait_for_states(3)
        assert all((state.position == FOLDED).all() for state in observer.states[n_states:])
        assert not any(np.any(state.velocity) for state in observer.states[n_states:])


def test_an_arm_beyond_a_limit_moves_in_but_not_out(playback, observer):
    beyond = np.array([0.0, 0.01, np.pi / 2, np.pi / 2])
    playback(initial_positions=beyond.tolist())
    for q_to in (beyond + [0.0, 0.01, 0.0, 0.0], beyond + [0.3, 0.0005, 0.0, 0.0]):
        n_logs = len(observer.logs)
        observer.motions.publish(motion(beyond, q_to, 1.0))
        observer.wait_for_rejection('joint_2: position 0.0', first=n_logs)
        assert observer.is_still_at(beyond)
    observer.motions.publish(motion(beyond, FOLDED, 1.2))
    wait_until(lambda: observer.is_still_at(FOLDED))
    n_logs = len(observer.logs)
    observer.motions.publish(motion(FOLDED, beyond, 1.2))
    observer.wait_for_rejection('joint_2: position', first=n_logs)
    assert observer.is_still_at(FOLDED)


def test_the_list_of_rejections_begins_with_a_motion_that_is_taken(playback, observer):
    playback()
    observer.motions.publish(changed(lambda m: None))
    wait_until(lambda: observer.is_still_at(FOLDED - 0.3))


def test_a_rejected_motion_leaves_the_running_one_alone(playback, observer):
    playback()
    observer.motions.publish(motion(FOLDED, FOLDED - 0.5, 1.5))
    wait_until(lambda: observer.v.any())
    n_logs = len(observer.logs)
    observer.motions.publish(changed(BAD['not a number'][0]))
    observer.wait_for_rejection('continues its motion', first=n_logs)
    wait_until(lambda: observer.is_still_at(FOLDED - 0.5))


def test_a_motion_from_the_present_state_replaces_the_running_one(playback, observer):
    playback(start_tolerance=0.1)
    observer.motions.publish(motion(FOLDED, FOLDED - 0.4, 4.0))
    wait_until(lambda: (np.abs(observer.v) > 0.05).all())
    elsewhere = FOLDED - [0.5, 0.5, -0.5, -0.5]
    observer.motions.publish(motion(observer.q, elsewhere, 1.2, observer.v))
    wait_until(lambda: observer.is_still_at(elsewhere))


@pytest.mark.parametrize('scale', [1.0, 0.5])
def test_a_stop_is_on_the_path_and_the_next_motion_begins_there(playback, observer, scale):
    playback(time_scale=scale)
    way = np.array([-1.0, -1.0, 0.5, 0.5])
    observer.motions.publish(motion(FOLDED, FOLDED + way, 2.0))
    wait_until(lambda: np.abs(observer.v).max() > 0.5 * scale)
    answer = observer.stop.call(Trigger.Request(), timeout_sec=LONGEST_WAIT)
    assert answer.success
    assert 'at rest in' in answer.message
    wait_until(lambda: not observer.v.any())
    stopped_at = observer.q
    along = (stopped_at - FOLDED) @ way / (way @ way)
    assert 0.05 < along < 0.95
    for state in observer.states:
        offset = np.array(state.position) - FOLDED
        assert np.abs(offset - way * (offset @ way) / (way @ way)).max() < 1e-9
    observer.wait_for_states(20)
    assert observer.is_still_at(stopped_at)
    answer = observer.stop.call(Trigger.Request(), timeout_sec=LONGEST_WAIT)
    assert answer.success
    assert 'already' in answer.message
    observer.motions.publish(motion(stopped_at, FOLDED, 1.4))
    wait_until(lambda: observer.is_still_at(FOLDED))


@pytest.mark.parametrize('lag', [0.0, 0.1])
def test_joint_states_are_those_of_the_command_of_a_lag_before(playback, observer, lag):
    playback(lag=lag)
    there = FOLDED - [1.0, 0.5, 0.5, 0.5]
    whole = Trajectory([0.0, 1.5], [FOLDED, there], np.zeros((2, 4)), np.zeros((2, 4)))
    braking = fast_stop(whole, 0.6, MotionLimits(*np.outer([1.5, 4.0, 40.0], np.ones(4))))
    begin = observer.get_clock().now().nanoseconds * 1e-9 + 0.3
    # The second one is sent while the first one runs; the arm is behind both of them.
    observer.motions.publish(joint_trajectory_to_msg(whole, ARM.joint_names, 'torso', begin))
    wait_until(lambda: observer.v.any())
    msg = joint_trajectory_to_msg(braking, ARM.joint_names, 'torso', begin + 0.6)
    observer.motions.publish(msg)
    wait_until(lambda: observer.is_still_at(braking.positions[-1]))
    assert len(observer.states) > 30
    for state in observer.states:
        then = rclpy.time.Time.from_msg(state.header.stamp).nanoseconds * 1e-9 - lag - begin
        curve, since = (whole, then) if then < 0.6 else (braking, then - 0.6)
        q, v, _ = sample(curve, [since])
        # The node's two clocks are read a little after one another.
        np.testing.assert_allclose(state.position, q[0], atol=1e-3)
        np.testing.assert_allclose(state.velocity, v[0], atol=4e-3)


def test_a_latched_motion_of_the_past_is_not_replayed(playback, observer):
    observer.motions.publish(motion(FOLDED, FOLDED - 0.3, 0.8))
    playback()
    observer.wait_for_states(50)
    assert all((state.position == FOLDED).all() for state in observer.states)


def test_slow_motion_counts_from_the_next_motion_on(playback, observer):
    playback(time_scale=0.25)
    observer.motions.publish(motion(FOLDED, FOLDED - 0.1, 0.5))
    wait_until(lambda: observer.is_still_at(FOLDED - 0.1))
    fastest = max(np.abs(state.velocity).max() for state in observer.states)
    assert fastest == pytest.approx(0.25 * 1.875 * 0.1 / 0.5, rel=0.02)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_process_with_code_0_and_no_traceback(observer, number):
    process = subprocess.Popen(MODULE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        with spinning(observer):
            wait_until(lambda: observer.states)
        process.send_signal(number)
        words, _ = process.communicate(timeout=LONGEST_WAIT)
    finally:
        process.kill()
    assert process.returncode == 0, words
    assert 'Traceback' not in words


@pytest.mark.parametrize(
    'setting',
    [
        'rate:=0.0',
        'rate:=fast',
        'time_scale:=1.5',
        'start_tolerance:=-1.0',
        'initial_positions:=[0.0, -1.0]',
        'initial_positions:=[0.0, 1.0, 0.0, 0.0]',
        'initial_positions:=[.nan, -1.0, 0.0, 0.0]',
        'max_velocity:=[1.0, 1.0]',
        'max_acceleration:=[0.0]',
        'max_jerk:=[-40.0]',
        'max_jerk:=[40.0, 40.0]',
        'max_velocity:=[]',
        'rate:=100',
        'tiem_scale:=0.5',
    ],
)
def test_a_bad_parameter_ends_the_command_with_one_line_that_names_it(call, monkeypatch, setting):
    monkeypatch.setenv('NUMBA_DISABLE_JIT', '0')
    ended = call(main, '--ros-args', '-p', setting)
    assert ended.returncode == 1
    (line,) = ended.stderr.splitlines()
    assert setting.split(':')[0] in line


def test_a_bad_parameter_ends_the_process_with_one_line_that_names_it():
    ended = subprocess.run(
        [*MODULE, '--ros-args', '-p', 'max_jerk:=[40.0, 40.0]'],
        capture_output=True,
        text=True,
        timeout=LONGEST_WAIT,
    )
    assert ended.returncode == 1
    assert len(ended.stderr.splitlines()) == 1, ended.stderr
    assert 'max_jerk' in ended.stderr


def test_the_packaged_file_holds_every_parameter_with_its_default():
    file = load_yaml(resource_path('config/playback.yaml'))['/**']['ros__parameters']
    defaults = {setting.name: setting.default for setting in SETTINGS}
    assert file.keys() == defaults.keys()
    for name, value in file.items():
        one_for_all = name in ('max_velocity', 'max_acceleration', 'max_jerk')
        assert value == (defaults[name] * 4 if one_for_all else defaults[name])


def test_the_node_starts_without_the_compiler():
    code = (
        'import sys, rrth_planner.ros.playback_node; '
        'print([m for m in sys.modules if m.split(".")[0] == "numba"])'
    )
    ended = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, env=os.environ, check=True
    )
    assert ended.stdout.strip() == '[]'
