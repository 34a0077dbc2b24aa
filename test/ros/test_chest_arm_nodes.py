# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Planner and playback as processes, with the arm of six joints and the seated wearer."""

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rrth_planner.collision.reference_checker import first_contact  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.io.resources import resource_path  # noqa: E402
from rrth_planner.io.wearer_file import load_body  # noqa: E402
from rrth_planner.model.arm import pointing_error  # noqa: E402
from rrth_planner.model.rotation import quaternion_xyzw  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures('ros_context')]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ARM, BODY = 'config/examples/chest_arm.yaml', 'config/examples/seated_body.yaml'
TARGETS = ((1.0, 0.5, 0.0), (0.3, -1.2, -0.6), (0.2, 1.5, 0.1))
MARGIN, RAY = 0.02, 1.0


class Client(Node):
    """Publishes inputs of the planner, and records the joint states."""

    def __init__(self):
        """Connect to both nodes."""
        super().__init__('chest_arm')
        self.body = self.create_publisher(MarkerArray, 'body_boxes', LATCHED)
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.states, self.motions = [], []
        self.create_subscription(JointState, 'joint_states', self.states.append, 500)
        self.create_subscription(JointTrajectory, 'joint_trajectory', self.motions.append, LATCHED)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')


def _body(scene):
    boxes = []
    for box in scene.boxes:
        marker = samples.box(box.name, center=box.center.tolist(), size=box.size.tolist())
        o = marker.pose.orientation
        o.x, o.y, o.z, o.w = quaternion_xyzw(box.rotation).tolist()
        boxes.append(marker)
    return samples.array(*boxes)


def test_both_nodes_work_with_another_arm(wait_until, send, ask, spinning):
    file = resource_path(ARM)
    arm, scene = load_arm(file), load_body(resource_path(BODY))
    client, said = Client(), []
    planner, playback = (f'rrth_planner.ros.{name}_node' for name in ('planner', 'playback'))
    ros = ['--ros-args', '-p', f'arm:={file}', '-p']
    with (
        ChildProcess(planner, [*ros, 'seed:=3', '-p', 'separation:=false'], said.append) as one,
        ChildProcess(playback, [*ros, f'initial_positions:={[0.0] * 6}'], said.append) as other,
        spinning(client),
    ):
        wait_until(client.plan.service_is_ready, 240.0)
        wait_until(lambda: client.states)
        assert client.states[0].name == list(arm.joint_names)
        send(client, client.body, _body(scene))
        for target in TARGETS:
            send(client, client.target, samples.target(*target))
            n_states, n_motions = len(client.states), len(client.motions)
            answer = ask(client.plan)
            assert answer.success, (target, answer.message)
            wait_until(lambda n=n_motions: len(client.motions) > n)
            motion = client.motions[-1]
            assert motion.joint_names == list(arm.joint_names)
            end = np.array(motion.points[-1].positions)
            wait_until(
                lambda end=end: (
                    np.abs(end - client.states[-1].position).max() < 1e-6
                    and not np.any(client.states[-1].velocity)
                )
            )
            one.check()
            other.check()
            assert pointing_error(arm, end, np.array(target)) < 1e-6
            seen = np.array([state.position for state in client.states[n_states:]])
            contact = first_contact(arm, scene, seen, RAY, MARGIN)
            assert contact is None, (contact, seen[contact.index], len(client.motions), said)
    assert not [line for line in said if 'rejected' in line or 'ERROR' in line]


def test_a_start_for_another_number_of_joints_is_rejected_in_a_sentence(wait_until):
    said = []
    arguments = ['--ros-args', '-p', f'arm:={resource_path(ARM)}']
    with ChildProcess('rrth_planner.ros.playback_node', arguments, said.append):
        wait_until(lambda: said, 60.0)
    assert 'initial_positions: 4 values, expected 6' in said[0]
