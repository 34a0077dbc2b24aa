# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A hundred requests to a node of its own, each answer checked by the reference checker."""

import re
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rrth_planner.collision import reference_checker  # noqa: E402
from rrth_planner.collision.motion_inspection import inspect_motion  # noqa: E402
from rrth_planner.collision.world import arm_world  # noqa: E402
from rrth_planner.kernels.kinematics import pan_tilt_ik  # noqa: E402
from rrth_planner.model.goal import PointingGoal  # noqa: E402
from rrth_planner.model.rotation import quaternion_xyzw  # noqa: E402
from rrth_planner.planning.pointing_goals import target_in_mount  # noqa: E402
from rrth_planner.ros.messages.answer import answer_from_msg, answer_from_text  # noqa: E402
from rrth_planner.ros.messages.fields import nanoseconds_of  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
from rrth_planner.ros.middleware.qos import ANSWERED  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402
import worlds  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
# Targets all round the wearer, then some so near that most of them are blocked.
N_BODIES, N_TARGETS, N_NEAR, MARGIN, RAY = 10, 10, 3, 0.02, 1.0
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Client(Node):
    """Publishes all inputs, and keeps what the planner publishes."""

    def __init__(self):
        """Connect to the planner's topics and service."""
        super().__init__('many_plans')
        self.body = self.create_publisher(MarkerArray, 'body_boxes', LATCHED)
        self.target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.joints = self.create_publisher(JointState, 'joint_states', LATCHED)
        self.motions, self.figures = [], {}
        self.create_subscription(JointTrajectory, 'joint_trajectory', self.motions.append, LATCHED)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_figures, 10)
        self.answers = {}
        topic = 'rrth_planner/answer'
        self.create_subscription(DiagnosticStatus, topic, self._on_answer, ANSWERED)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')

    def _on_answer(self, msg):
        answer = answer_from_msg(msg)
        self.answers[answer.number] = answer

    def _on_figures(self, msg):
        self.figures = {pair.key: pair.value for pair in msg.status[0].values}


def _body_message(scene):
    """Return a scene as the message that replaces the body."""
    markers = [samples.command(Marker.DELETEALL)]
    for box in scene.boxes:
        marker = samples.box(box.name, center=box.center.tolist(), size=box.size.tolist())
        marker.text = box.name
        o = marker.pose.orientation
        o.x, o.y, o.z, o.w = quaternion_xyzw(box.rotation).tolist()
        markers.append(marker)
    return samples.array(*markers)


def _free_start(rng, arm, scene):
    """Return the folded configuration where it is free, or a random free one."""
    q = np.array(samples.FOLDED)
    while reference_checker.first_contact(arm, scene, q[None], RAY, MARGIN + 0.002) is not None:
        q = rng.uniform(*arm.bounds)
    return q


def _is_blocked_by_reference(rng, arm, scene, target):
    """Return whether the target is too near a box, or random goal configurations all violate."""
    for box in scene.boxes:
        local = box.rotation.T @ (target - box.center)
        if (np.abs(local) <= 0.5 * box.size + MARGIN).all():
            return True
    world = arm_world(arm, scene, MARGIN, RAY)
    in_mount = target_in_mount(arm, PointingGoal(target))
    configurations, rays = [], []
    draws = zip(rng.uniform(*arm.bounds, (4000, arm.dof)), rng.integers(2, size=4000), strict=True)
    for q, branch in draws:
        reach = pan_tilt_ik.aim(world.robot, arm.bounds, in_mount, q.copy(), int(branch), q)
        if reach >= 0.0:
            configurations.append(q)
            rays.append([max(RAY, reach)])
    ends = reference_checker.bars(arm, np.array(configurations), np.array(rays))
    collides = np.zeros(len(ends), dtype=bool)
    for box in scene.boxes:
        # Half a centimetre of room: what is only just free may be missed by a finite search.
        half = 0.5 * box.size + MARGIN + 0.005
        collides |= reference_checker.bar_box_contact(ends, box.center, box.rotation, half).any(
            axis=1
        )
    return bool(collides.all())


def test_a_hundred_motions_round_ten_bodies_have_no_contact(wait_until, send, spinning):
    rng = np.random.default_rng(2024)
    arm, limits = worlds.table_1_arm(), worlds.limits()
    client = Client()
    codes, times, lines, moved = {}, [], [], -np.inf
    module = 'rrth_planner.ros.planner_node'
    arguments = ['--ros-args', '-p', 'seed:=7', '-p', 'separation:=false']
    with ChildProcess(module, arguments, lines.append) as child, spinning(client):
        wait_until(client.plan.service_is_ready, 120.0)
        for _ in range(N_BODIES):
            scene = worlds.varied_body(rng)
            q = _free_start(rng, arm, scene)
            # The last motion is found not to be executed: another body does not stop it.
            time.sleep(max(0.0, moved + 0.5 - time.monotonic()))
            send(client, client.joints, samples.joints(q.tolist()))
            time.sleep(0.05)
            send(client, client.body, _body_message(scene))
            for k in range(N_TARGETS + N_NEAR):
                direction = rng.standard_normal(3)
                length = rng.uniform(0.7, 4.0) if k < N_TARGETS else rng.uniform(0.1, 0.5)
                target = length * direction / np.linalg.norm(direction)
                send(client, client.joints, samples.joints(q.tolist()))
                send(client, client.target, samples.target(*target))
                n_before = len(client.motions)
                future = client.plan.call_async(Trigger.Request())
                wait_until(future.done)
                answer = future.result()
                child.check()
                code = answer.message.split(' ')[0]
                codes[code] = codes.get(code, 0) + 1
                if not answer.success:
                    assert code == 'GOAL_IN_COLLISION', answer.message
                    name = re.search(r'box "([^"]+)"', answer.message).group(1)
                    assert name in {box.name for box in scene.boxes}
                    assert _is_blocked_by_reference(rng, arm, scene, target), answer.message
                    assert len(client.motions) == n_before
                    continue
                number = answer_from_text(answer.message).number
                wait_until(lambda n=number: n in client.answers)
                times.append(client.answers[number].figures['planning_time_ms'])
                wait_until(lambda n=n_before: len(client.motions) >= n + 1)
                stamp = nanoseconds_of(client.motions[-1].header.stamp)
                assert client.answers[number].stamp == stamp
                moved = time.monotonic()
                motion = joint_trajectory_from_msg(client.motions[-1], arm.joint_names)
                # Raises where the motion violates at 0.5 ms sampling, or misses by 1 mm.
                inspect_motion(
                    arm,
                    scene,
                    motion,
                    limits,
                    q_present=q,
                    target=target,
                    margin=MARGIN,
                    ray_guard_length=RAY,
                )
                q = motion.positions[-1]
            # Diagnostics come ten times a second only.
            n_asked = sum(codes.values())
            wait_until(lambda n=n_asked: int(client.figures.get('requests', 0)) == n)
    print(codes, 'planning time, ms: p50, p90, p99', np.percentile(times, (50, 90, 99)))
    assert codes['SUCCESS'] >= N_BODIES * N_TARGETS
    assert codes['GOAL_IN_COLLISION'] > N_BODIES
    client.destroy_node()
