# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Planner and playback as processes, with a joint that turns without a stop, and drivers of it."""

import json
import re

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')
pytest.importorskip('tqdm')

from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rrth_planner.cli import point_at  # noqa: E402
from rrth_planner.io.arm_file import arm_to_yaml  # noqa: E402
from rrth_planner.model.arm import ArmModel, pointing_error  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures('ros_context')]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
QUARTER, TURN = 0.5 * np.pi, 2.0 * np.pi
ARM = ArmModel(
    joint_names=('pan', 'tilt'),
    is_prismatic=(False, False),
    dh=np.array([[0.0, 0.0, 0.0, 0.1], [QUARTER, 0.0, QUARTER, 0.0], [QUARTER, 0.0, 0.0, 0.0]]),
    bounds=np.array([[-3.0 * TURN, -1.0], [3.0 * TURN, 1.0]]),
    radii=np.full(3, 0.01),
    T_base_mount=np.eye(4),
    is_continuous=(True, False),
)


class Driver(Node):
    """The inputs of the planner; it reports what the playback does, wrapped or as it is."""

    def __init__(self):
        super().__init__('driver')
        self.wraps, self.states, self.motions = False, [], []
        self.body = self.create_publisher(MarkerArray, 'body_boxes', LATCHED)
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.joints = self.create_publisher(JointState, 'joint_states', 100)
        self.create_subscription(JointState, 'true_states', self._report, 500)
        self.create_subscription(JointTrajectory, 'joint_trajectory', self.motions.append, LATCHED)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')

    def _report(self, msg):
        self.states.append(msg)
        pan, tilt = msg.position
        pan = (pan + np.pi) % TURN - np.pi if self.wraps else pan
        reported = JointState(name=msg.name, position=[pan, tilt], velocity=msg.velocity)
        reported.header = msg.header
        self.joints.publish(reported)


def plays(driver):
    """Return whether both subscriptions of a playback are there, and no other playback's."""
    listeners = driver.get_subscriptions_info_by_topic('joint_trajectory')
    names = [listener.node_name for listener in listeners]
    return driver.states and names.count('arm_playback') == 2


def test_every_motion_begins_at_the_reading_and_ends_on_the_target(
    tmp_path, wait_until, send, ask, spinning
):
    file = tmp_path / 'arm.yaml'
    file.write_text(arm_to_yaml(ARM, 'arm'))
    driver, said = Driver(), []
    ros = ['--ros-args', '-p', f'arm:={file}', '-p']

    def playback(pan):
        driver.states.clear()
        return ChildProcess(
            'rrth_planner.ros.playback_node',
            [*ros, f'initial_positions:=[{pan}, 0.0]', '-r', 'joint_states:=true_states'],
            said.append,
        )

    def told(words):
        """Return how many lines of the nodes begin with some words, their level aside."""
        return sum(line.removeprefix('WARN: ').startswith(words) for line in said)

    def go(way):
        """Have the arm point somewhere else, so far round [rad]."""
        begin = np.array(driver.states[-1].position)
        angle = begin[0] + way
        target = np.array([2.0 * np.cos(angle), 2.0 * np.sin(angle), 0.3])
        send(driver, driver.target, samples.target(*target))
        # On a busy machine a message may come before the planner knows of the new playback, or too
        # late: then the planner sees that the arm ignores it, and is asked again.
        n_executed = told('executing')
        while told('executing') == n_executed:
            n_motions = len(driver.motions)
            answer = ask(driver.plan)
            assert answer.success, (answer.message, said)
            given_up = f'goal of {answer.message.rpartition("; ")[2]} given up'
            wait_until(lambda words=given_up: told('executing') > n_executed or told(words))
        wait_until(lambda: len(driver.motions) > n_motions)
        points = driver.motions[-1].points
        end = np.array(points[-1].positions)
        assert pointing_error(ARM, end, target) < 1e-6

        def is_there():
            state = driver.states[-1]
            return np.abs(end - state.position).max() < 1e-6 and not np.any(state.velocity)

        wait_until(is_there)
        return begin, np.array(points[0].positions), end

    planner = ChildProcess(
        'rrth_planner.ros.planner_node',
        [*ros, 'seed:=3', '-p', 'separation:=false'],
        said.append,
    )
    with planner, spinning(driver):
        wait_until(driver.plan.service_is_ready, 240.0)
        send(driver, driver.body, samples.array(samples.box('far', center=[0.0, 0.0, -5.0])))
        # A driver that counts: it is started again, at another turn each time.
        for pan, way in ((3.1, 0.5), (9.0, 2.0), (-17.0, 1.0)):
            with playback(pan):
                wait_until(lambda: plays(driver))
                begin, first, end = go(way)
                assert np.abs(first - begin).max() < 1e-9
                assert begin[0] == pan and end[0] == pytest.approx(pan + way, abs=1e-6)
        # One that wraps: the arm goes round and round, and the count goes on.
        driver.wraps = True
        with playback(3.0):
            wait_until(lambda: plays(driver))
            for way in (2.0, 2.0, 2.5, -2.5, -2.5, -2.5, -2.5):
                begin, first, end = go(way)
                assert np.abs(first - begin).max() < 1e-9
                assert end[0] == pytest.approx(begin[0] + way, abs=1e-6)
    # Of no motion was the turn another one; what an arm that missed a motion rejects is near.
    found = re.findall(r'begins at position (\S+), the arm is at (\S+),', '\n'.join(said))
    assert all(abs(float(one) - float(other)) < np.pi for one, other in found), said


def test_point_at_follows_an_arm_whose_driver_wraps(tmp_path, wait_until, send, spinning, call):
    file = tmp_path / 'arm.yaml'
    file.write_text(arm_to_yaml(ARM, 'arm'))
    driver, said = Driver(), []
    driver.wraps = True
    ros = ['--ros-args', '-p', f'arm:={file}', '-p']
    playback = [*ros, 'initial_positions:=[3.0, 0.0]', '-r', 'joint_states:=true_states']

    def pointed_at(angle, *options):
        """Return what the command reports of a target in a direction [rad]."""
        target = [f'{x:.9f}' for x in (2.0 * np.cos(angle), 2.0 * np.sin(angle), 0.3)]
        while True:
            ended = call(point_at.main, '--json', *options, '--', *target)
            # On a busy machine the playback may miss a motion before the planner knows of it.
            is_missed = not any('executing' in line for line in said)
            if ended.returncode != point_at.NOT_ARRIVED or not is_missed:
                break
        report = json.loads(ended.stdout)
        assert ended.returncode == 0, (report, ended.stderr, said)
        assert report['pointing_error'] < 1e-3
        return report

    with (
        ChildProcess(
            'rrth_planner.ros.planner_node',
            [*ros, 'seed:=3', '-p', 'separation:=false'],
            said.append,
        ),
        ChildProcess('rrth_planner.ros.playback_node', playback, said.append),
        spinning(driver),
    ):
        wait_until(driver.plan.service_is_ready, 240.0)
        wait_until(lambda: plays(driver))
        send(driver, driver.body, samples.array(samples.box('far', center=[0.0, 0.0, -5.0])))
        # Across half a turn, on through the next one, and back.
        for pan in (4.0, 6.5, 9.0, 7.0):
            assert pointed_at(pan)['arrived'] is True
            assert driver.states[-1].position[0] == pytest.approx(pan, abs=1e-3)
            assert abs(driver.states[-1].position[1]) < 1.0
        # Where it is reported it would not move a joint by a turn either.
        assert pointed_at(8.0, '--no-move')['figures']['duration'] < 3.0
        assert driver.states[-1].position[0] == pytest.approx(7.0, abs=1e-3)
    driver.destroy_node()
