# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The planner's node, called as a stranger would call it."""

from dataclasses import replace
from itertools import pairwise
import os
import re
import signal
import subprocess
import sys
from threading import Event, Thread, Timer
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from monitored import know  # noqa: E402
from nav_msgs.msg import Path  # noqa: E402
from nav_msgs.srv import GetPlan  # noqa: E402
from rclpy.duration import Duration  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.parameter_client import AsyncParameterClient  # noqa: E402
from rclpy.qos import (  # noqa: E402
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.task import Future  # noqa: E402
from rrth_planner.collision import reference_checker, trajectory_validation  # noqa: E402
from rrth_planner.collision.violation import Violation  # noqa: E402
from rrth_planner.execution.command import ahead, BEFORE  # noqa: E402
from rrth_planner.execution.watch import Stop  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.io.incident_file import read_incident  # noqa: E402
from rrth_planner.model.arm import (  # noqa: E402
    forward_kinematics,
    pointing_error,
    tool_pose,
)
from rrth_planner.model.scene import Box, Scene  # noqa: E402
from rrth_planner.model.status import ErrorCode  # noqa: E402
from rrth_planner.model.trajectory import positions_at, Trajectory  # noqa: E402
from rrth_planner.pipeline import in_process_planner  # noqa: E402
from rrth_planner.pipeline.in_process_planner import InProcessPlanner  # noqa: E402
from rrth_planner.pipeline.planning_process import PlanningProcessError  # noqa: E402
from rrth_planner.ros import planner as planner_module  # noqa: E402
from rrth_planner.ros.client import planner_client  # noqa: E402
from rrth_planner.ros.interface.parameters import RULES  # noqa: E402
from rrth_planner.ros.interface.reporter import PlanReport  # noqa: E402
from rrth_planner.ros.messages.body import scene_of  # noqa: E402
from rrth_planner.ros.messages.fields import seconds_of  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg  # noqa: E402
from rrth_planner.ros.middleware import executor_barrier  # noqa: E402
from rrth_planner.ros.middleware.executor_barrier import ExecutorBarrier  # noqa: E402
from rrth_planner.ros.monitor import execution_monitor  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
from rrth_planner.ros.requests import request_queue  # noqa: E402
from rrth_planner.ros.requests.plan_request import PlanOutcome  # noqa: E402
from rrth_planner.ros.requests.revalidation import Revalidation  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

array, box, command, fenced = samples.array, samples.box, samples.command, samples.fenced
FOLDED, JOINTS, joints = samples.FOLDED, samples.JOINTS, samples.joints
target, wearer = samples.target, samples.wearer

pytestmark = pytest.mark.usefixtures('ros_context')
NAN = float('nan')
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
VOLATILE = QoSProfile(depth=10)
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
# With these the search for a path out of the fence does not end.
ENDLESS = {'time_limit': 600.0, 'max_samples': 10**7}
TOPICS = {
    'body_boxes': (MarkerArray, wearer),
    'target': (PointStamped, target),
    'joint_states': (JointState, joints),
}


class Stranger:
    """A node that talks with the planner of its namespace."""

    def __init__(self, namespace, wait_until):
        self.node = Node('stranger', namespace=namespace)
        self.wait_until = wait_until
        self.received = {}
        self.publishers = {}
        for name, msg_type in (
            ('joint_trajectory', JointTrajectory),
            ('rrth_planner/tool_path', Path),
            ('rrth_planner/markers', MarkerArray),
        ):
            self.subscribe(name, msg_type, LATCHED)
        self.subscribe('/diagnostics', DiagnosticArray, 10)
        self.services = {
            name: self.node.create_client(kind, f'rrth_planner/{name}')
            for name, kind in (('plan', Trigger), ('get_plan', GetPlan), ('cancel', Trigger))
        }

    def subscribe(self, name, msg_type, profile):
        self.received[name] = []
        self.node.create_subscription(msg_type, name, self.received[name].append, profile)

    def say(self, topic, msg, profile=LATCHED):
        publisher = self.node.create_publisher(type(msg), topic, profile)
        self.publishers[topic] = publisher
        publisher.publish(msg)

    def ask(self, name, request=None):
        client = self.services[name]
        self.wait_until(client.service_is_ready)
        return client.call_async(client.srv_type.Request() if request is None else request)

    def answer(self, name='plan', request=None):
        future = self.ask(name, request)
        self.wait_until(future.done)
        return future.result()

    def value(self, key):
        """Return a value of the last diagnostics; they are of all namespaces in a process."""
        arrays = self.received['/diagnostics']
        if not arrays:
            return None
        return {v.key: v.value for v in arrays[-1].status[0].values}[key]


@pytest.fixture(name='start')
def _start(spinning, wait_until, request):
    running = []
    namespace = f'/test_{abs(hash(request.node.name)) % 10**9}'

    def start(**parameters):
        parameters = {'separation': False} | parameters
        given = [Parameter(name=name, value=value) for name, value in parameters.items()]
        planner = PlannerNode(InProcessPlanner(), namespace=namespace, parameter_overrides=given)
        stranger = Stranger(namespace, wait_until)
        contexts = [spinning(planner), spinning(stranger.node)]
        for context in contexts:
            context.__enter__()
        running.append((planner, stranger, contexts))
        return planner, stranger

    yield start
    for planner, stranger, contexts in running:
        planner.close()
        for context in contexts:
            context.__exit__(None, None, None)
        planner.destroy_node()
        stranger.node.destroy_node()


def inputs_of(planner):
    return planner._scene_monitor._inputs


def say_all(planner, stranger, but=(), **messages):
    """Publish all inputs, but some, and wait until they have come in."""
    topics = [name for name in TOPICS if name not in but]
    for name in topics:
        stranger.say(name, messages.get(name, TOPICS[name][1]()))
    inputs = inputs_of(planner)
    of_topic = dict(zip(TOPICS, (inputs.body, inputs.target, inputs.joints), strict=True))
    stranger.wait_until(
        lambda: all(of_topic[n].measured is not None or of_topic[n].rejection for n in topics)
    )


def test_a_plan_is_published_and_then_answered(start):
    planner, stranger = start(seed=3)
    say_all(planner, stranger)
    response = stranger.answer()
    assert response.success
    assert response.message.startswith('SUCCESS (1): ')
    for word in ('waypoints', 'duration', 'path length', 'clearance', 'planning time', 'seed 3'):
        assert word in response.message
    for topic in ('joint_trajectory', 'rrth_planner/tool_path', 'rrth_planner/markers'):
        stranger.wait_until(lambda topic=topic: stranger.received[topic])
    (msg,) = stranger.received['joint_trajectory']
    # It begins at rest shortly before its publication: any controller has it before it moves.
    assert 0.0 < time.time() - seconds_of(msg.header.stamp) < 60.0
    assert msg.header.frame_id == 'torso'
    trajectory = joint_trajectory_from_msg(msg, JOINTS)
    np.testing.assert_array_equal(trajectory.positions[:2], [FOLDED, FOLDED])
    delay = RULES.controller_delay
    assert trajectory.times[1] == pytest.approx(ahead(delay) + delay + BEFORE, abs=2e-3)
    for values in (trajectory.velocities, trajectory.accelerations):
        assert not values[[0, -1]].any()
    assert pointing_error(load_arm(), trajectory.positions[-1], np.array([1.5, 0.1, 0.3])) < 1e-6
    assert len(stranger.received['rrth_planner/tool_path'][0].poses) > 1
    shown = {m.ns for m in stranger.received['rrth_planner/markers'][0].markers}
    assert shown == {'', 'body', 'arm_start', 'arm_goal', 'ray', 'tool_path'}


def test_get_plan_takes_its_target_and_returns_the_path_of_the_tool(start):
    planner, stranger = start()
    say_all(planner, stranger, but=('target',))
    request = GetPlan.Request()
    request.goal.pose.position.x, request.goal.pose.position.z = 1.5, 0.3
    path = stranger.answer('get_plan', request).plan
    assert path.header.frame_id == 'torso'
    assert len(path.poses) > 1
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])


@pytest.mark.parametrize(
    ('field', 'value', 'code'),
    [
        ('start.header.frame_id', 'torso', 'INVALID_GOAL_CONSTRAINTS (-16)'),
        ('start.pose.position.x', 0.5, 'INVALID_GOAL_CONSTRAINTS (-16)'),
        ('start.pose.orientation.w', 0.5, 'INVALID_GOAL_CONSTRAINTS (-16)'),
        ('goal.header.frame_id', 'camera', 'FRAME_TRANSFORM_FAILURE (-21)'),
        ('goal.pose.position.x', NAN, 'INVALID_GOAL_CONSTRAINTS (-16)'),
        ('goal.pose.position.x', 0.01, 'GOAL_IN_COLLISION (-12)'),
    ],
)
def test_get_plan_answers_a_bad_request_with_an_empty_path(start, field, value, code):
    planner, stranger = start()
    say_all(planner, stranger)
    request = GetPlan.Request()
    request.goal.pose.position.z = 0.01
    thing, *names = request, *field.split('.')
    for name in names[:-1]:
        thing = getattr(thing, name)
    setattr(thing, names[-1], value)
    assert not stranger.answer('get_plan', request).plan.poses
    stranger.wait_until(lambda: stranger.value('last code') == code)
    assert not stranger.received['joint_trajectory']


@pytest.mark.parametrize('missing', TOPICS)
def test_without_an_input_the_answer_names_its_topic(start, missing):
    planner, stranger = start()
    say_all(planner, stranger, but=(missing,))
    response = stranger.answer()
    assert not response.success
    assert response.message.startswith('UNABLE_TO_AQUIRE_SENSOR_DATA (-5): no ')
    assert f'/{missing}, expected' in response.message
    assert not stranger.received['joint_trajectory']


@pytest.mark.parametrize(
    ('messages', 'answer'),
    [
        ({'body_boxes': array(command(Marker.DELETEALL))}, 'UNABLE_TO_AQUIRE_SENSOR_DATA (-5): '),
        (
            {'body_boxes': array(box('pack', center=(-0.3, -0.1, 0.3), text='back pack'))},
            'START_STATE_IN_COLLISION (-10): ',
        ),
        ({'joint_states': joints([0.0, 1.0, 0.0, 0.0])}, 'START_STATE_INVALID (-26): joint_2'),
        ({'target': target(0.0, 0.0, 0.0)}, 'GOAL_IN_COLLISION (-12): the target'),
        # Nearer to the axis of the upper arm, in all configurations, than the ray runs beside it.
        ({'target': target(-0.24, -0.1, 0.5)}, 'NO_IK_SOLUTION (-31): no configuration'),
        (
            {'target': target(frame='camera')},
            'FRAME_TRANSFORM_FAILURE (-21): ',
        ),
        ({'target': target(NAN)}, 'INVALID_GOAL_CONSTRAINTS (-16): '),
        (
            {'body_boxes': array(box(frame='camera'))},
            'FRAME_TRANSFORM_FAILURE (-21): ',
        ),
        (
            {'body_boxes': array(box(size=(0.0, 1.0, 1.0)))},
            'UNABLE_TO_AQUIRE_SENSOR_DATA (-5): no good body yet',
        ),
        (
            {'joint_states': joints(FOLDED[:3], JOINTS[:3])},
            'UNABLE_TO_AQUIRE_SENSOR_DATA (-5): no good joint positions yet',
        ),
    ],
)
def test_each_obstacle_to_planning_has_its_code(start, messages, answer):
    planner, stranger = start()
    say_all(planner, stranger, **messages)
    response = stranger.answer()
    assert not response.success
    assert response.message.startswith(answer)
    stranger.wait_until(lambda: stranger.value('last code') == answer.split(':')[0])
    assert not stranger.received['joint_trajectory']


def leaned(deeper=0.0):
    """Return a wearer whose hand the tool of the folded arm is in, so much deeper [m]."""
    arm, body = load_arm(), wearer()
    T = tool_pose(arm, np.array(FOLDED))
    # Behind the ray, 0.5 m down, which runs 0.0075 m inside its edge.
    center = T[:3, 3] + 0.5 * T[:3, 2] - np.array([0.05 + 0.02 - 0.012 - deeper, 0.0, 0.0])
    body.markers.append(box('hand', center=tuple(center), size=(0.1, 0.1, 0.1)))
    return body


def pressed(deeper=0.0):
    """Return a wearer whose hand the third link of the folded arm is in, so much deeper [m]."""
    arm, body = load_arm(), wearer()
    poses = forward_kinematics(arm, np.array(FOLDED))
    middle = poses[2, :3, 3] - 0.5 * arm.dh[2, 3] * poses[2, :3, 2]
    # Beside the link, which is upright to y.
    center = middle - np.array([0.0, 0.05 + 0.02 - 0.0275 - deeper, 0.0])
    body.markers.append(box('hand', center=tuple(center), size=(0.1, 0.1, 0.1)))
    return body


@pytest.mark.parametrize(
    ('body', 'sentence'),
    [
        (pressed, ', escape from box "hand/0", penetration depth 0.0275 m at link 3'),
        (leaned, ', escape of the pointing ray from box "hand/0"'),
    ],
)
def test_an_arm_that_the_wearer_leaned_into_escapes_and_the_answer_says_so(
    start, monkeypatch, body, sentence
):
    # A machine that stands still stops the arm, too.
    monkeypatch.setattr(execution_monitor, 'LONGEST_WAIT', 30.0)
    planner, stranger = start(seed=3)
    say_all(planner, stranger, body_boxes=body())
    response = stranger.answer()
    assert response.success, response.message
    assert sentence in response.message
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])
    # The present body, published again, does not stop it.
    stranger.publishers['body_boxes'].publish(body())
    stranger.wait_until(lambda: stranger.value('last code') == 'SUCCESS (1)')
    (msg,) = stranger.received['joint_trajectory']
    trajectory = joint_trajectory_from_msg(msg, JOINTS)
    np.testing.assert_array_equal(trajectory.positions[0], FOLDED)
    for values in (trajectory.velocities, trajectory.accelerations):
        assert not values[[0, -1]].any()


@pytest.fixture(name='one_try')
def _one_try(monkeypatch):
    """Have a request planned once, however wearer and arm move."""
    monkeypatch.setattr(PlanOutcome, 'is_outdated', False)
    monkeypatch.setattr(PlanOutcome, 'is_in_the_way', False)


def test_a_request_is_planned_again_while_the_wearer_moves(start, monkeypatch, wait_until):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs, plan_motion, plans = inputs_of(planner), in_process_planner.plan_question, []

    def plan_while_a_hand_comes(*args, **kwargs):
        plan, body = plan_motion(*args, **kwargs), inputs.body.value
        plans.append(plan)
        if len(plans) == 1:
            middle = positions_at(plan.trajectory, [0.5 * plan.trajectory.duration])[0]
            T = tool_pose(load_arm(), middle)
            hand = box('hand', 0, T[:3, 3] + 0.4 * T[:3, 2], (0.05, 0.05, 0.05))
            stranger.publishers['body_boxes'].publish(array(hand))
            wait_until(lambda: inputs.body.value is not body)
        return plan

    monkeypatch.setattr(in_process_planner, 'plan_question', plan_while_a_hand_comes)
    assert stranger.answer().success
    assert len(plans) == 2
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])
    (msg,) = stranger.received['joint_trajectory']
    found = joint_trajectory_from_msg(msg, JOINTS)
    np.testing.assert_array_equal(found.positions[1:], plans[1].trajectory.positions)


def test_a_wearer_who_always_moves_into_the_motion_is_reported_after_the_time_limit(
    start, monkeypatch, wait_until
):
    planner, stranger = start(time_limit=0.5)
    say_all(planner, stranger)
    inputs, plan_motion, n = inputs_of(planner), in_process_planner.plan_question, []

    def plan_while_the_wearer_moves(question, *args):
        # Each motion is planned round the wearer, and invalid for the fence that comes.
        plan, body = plan_motion(replace(question, scene=open_scene), *args), inputs.body.value
        fence = fenced()
        fence.markers[-1].pose.position.z += 1e-4 * len(n)
        n.append(1)
        stranger.publishers['body_boxes'].publish(fence)
        wait_until(lambda: inputs.body.value is not body)
        return plan

    open_scene = scene_of(inputs.body.value)
    monkeypatch.setattr(in_process_planner, 'plan_question', plan_while_the_wearer_moves)
    message = stranger.answer().message
    assert message.startswith('MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE (-3): the wearer')
    assert len(n) > 1
    assert not stranger.received['joint_trajectory']


def test_a_hand_that_rests_in_the_ray_of_an_arm_at_rest_is_no_reason_to_stay(start):
    planner, stranger = start(seed=3)
    # In the middle of the hand, deeper than `escape_depth`.
    say_all(planner, stranger, body_boxes=leaned(0.04))
    response = stranger.answer()
    assert response.success, response.message
    assert ', escape of the pointing ray from box "hand/0"' in response.message
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])
    (msg,) = stranger.received['joint_trajectory']
    trajectory = joint_trajectory_from_msg(msg, JOINTS)
    q = positions_at(trajectory, np.arange(0.0, trajectory.duration, 5e-3))
    arm, scene = load_arm(), scene_of(inputs_of(planner).body.value.at(0.0))
    assert reference_checker.least_clearance(arm, scene, q[:1], 1.0) == 0.0
    # The bars keep the margin, and at the end the ray does.
    assert reference_checker.least_clearance(arm, scene, q, 0.0) > 0.02 - 1e-5
    assert reference_checker.least_clearance(arm, scene, q[-1:], 1.0) > 0.02 - 1e-5


def test_deeper_than_escape_depth_is_rejected(start):
    planner, stranger = start(escape_depth=0.01)
    say_all(planner, stranger, body_boxes=pressed())
    response = stranger.answer()
    assert not response.success
    assert response.message.startswith(
        'START_STATE_IN_COLLISION (-10): link 3 is 0.0075 m inside box "hand/0": '
        'penetration depth 0.0275 m including the margin, expected less than 0.01 m (escape_depth)'
    )
    planner.set_parameters([Parameter(name='escape_depth', value=0.03)])
    assert stranger.answer().success


@pytest.mark.usefixtures('one_try')
def test_an_escape_is_revalidated_when_the_wearer_moved(start, monkeypatch, wait_until):
    planner, stranger = start()
    say_all(planner, stranger, body_boxes=leaned())
    inputs, plan_motion = inputs_of(planner), in_process_planner.plan_question
    moves = iter((leaned(), array(*fenced().markers, leaned().markers[-1])))

    def plan_while_the_body_changes(*args, **kwargs):
        plan = plan_motion(*args, **kwargs)
        body, changed = inputs.body.value, next(moves)
        changed.markers.append(box('far', center=(0.0, 0.0, -5.0), size=(0.1, 0.1, 0.1)))
        stranger.publishers['body_boxes'].publish(changed)
        wait_until(lambda: inputs.body.value is not body)
        return plan

    monkeypatch.setattr(in_process_planner, 'plan_question', plan_while_the_body_changes)
    assert stranger.answer().success
    message = stranger.answer().message
    assert message.startswith('MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE (-3): the wearer')


@pytest.mark.usefixtures('one_try')
@pytest.mark.parametrize(('depth', 'answer'), [(0.05, 'SUCCESS'), (0.028, 'MOTION_PLAN_INVAL')])
def test_no_escape_is_published_once_the_arm_is_too_deep(
    start, monkeypatch, wait_until, depth, answer
):
    # It is 0.0275 m deep at first.
    planner, stranger = start(escape_depth=depth)
    say_all(planner, stranger, body_boxes=pressed())
    inputs, plan_motion = inputs_of(planner), in_process_planner.plan_question

    def plan_while_the_wearer_leans(*args, **kwargs):
        plan, body = plan_motion(*args, **kwargs), inputs.body.value
        stranger.publishers['body_boxes'].publish(pressed(0.001))
        wait_until(lambda: inputs.body.value is not body)
        return plan

    monkeypatch.setattr(in_process_planner, 'plan_question', plan_while_the_wearer_leans)
    assert stranger.answer().message.startswith(answer)


@pytest.mark.usefixtures('one_try')
def test_both_checkers_check_an_escape_when_the_wearer_moved(
    start, monkeypatch, wait_until, tmp_path
):
    planner, stranger = start(incident_folder=str(tmp_path))
    say_all(planner, stranger, body_boxes=leaned())
    inputs, plan_motion, violations = inputs_of(planner), in_process_planner.plan_question, []

    def plan_while_a_box_comes(*args, **kwargs):
        plan = plan_motion(*args, **kwargs)
        body = inputs.body.value
        far = box('far', body.n_boxes, center=(0.0, 0.0, -5.0), size=(0.1, 0.1, 0.1))
        stranger.publishers['body_boxes'].publish(array(far))
        wait_until(lambda: inputs.body.value is not body)
        for violation in violations:
            monkeypatch.setattr(
                trajectory_validation, 'first_escape_violation', lambda *_, found=violation: found
            )
        return plan

    monkeypatch.setattr(in_process_planner, 'plan_question', plan_while_a_box_comes)
    with monkeypatch.context() as patch:
        patch.setattr(trajectory_validation, 'leads_out', lambda *_: False)
        message = stranger.answer().message
    assert message.startswith('MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE (-3): the wearer')
    violations.append(Violation(0.001, 0.01, 'pointing ray', 'hand/0'))
    message = stranger.answer().message
    assert message.startswith('FAILURE (99999): the two collision checks disagree: pointing ray')
    assert not stranger.received['joint_trajectory']


@pytest.mark.parametrize(
    ('timeout', 'answer'),
    [('body_timeout', 'SENSOR_INFO_STALE (-24)'), ('joint_timeout', 'ROBOT_STATE_STALE (-23)')],
)
def test_old_inputs_are_rejected_with_their_age(start, timeout, answer):
    planner, stranger = start(**{timeout: 1e-6})
    say_all(planner, stranger)
    message = stranger.answer().message
    assert message.startswith(answer)
    assert f's old, expected at most 1e-06 s ({timeout})' in message


def test_joint_positions_age_from_their_stamp_on(start):
    planner, stranger = start(joint_timeout=1.0)
    say_all(planner, stranger)
    source, old = inputs_of(planner).joints, joints()
    for age, is_fresh in ((5.0, False), (0.01, True), (3600.0, False), (-3600.0, True)):
        n_good = source.n_good
        stamp = planner.get_clock().now() - Duration(seconds=age)
        old.header.stamp = stamp.to_msg()
        stranger.publishers['joint_states'].publish(old)
        stranger.wait_until(lambda n=n_good: source.n_good > n)
        message = stranger.answer().message
        if is_fresh:
            assert message.startswith('SUCCESS'), message
        else:
            assert message.startswith('ROBOT_STATE_STALE (-23)'), message
            assert f' is {age:.0f}.' in message
            assert ' s old, expected at most 1 s (joint_timeout)' in message


def test_joint_states_that_waited_for_a_busy_node_are_all_taken_at_once(start, wait_until):
    planner, stranger = start()
    say_all(planner, stranger)
    source, order = inputs_of(planner).joints, []
    timer = planner.create_timer(0.001, lambda: order.append('another callback'))
    accept = source.accept

    def accepted(*arguments):
        order.append('joint state')
        return accept(*arguments)

    source.accept = accepted

    def are_taken_at_once():
        # A busy machine may deliver some of them later.
        order.clear()
        n_good = source.n_good
        planner.executor.create_task(lambda: time.sleep(0.3))
        for _ in range(8):
            stranger.publishers['joint_states'].publish(joints())
        wait_until(lambda: source.n_good == n_good + 8)
        begin = order.index('joint state')
        return order[begin : begin + 8] == ['joint state'] * 8

    assert any(are_taken_at_once() for _ in range(5))
    planner.destroy_timer(timer)


@pytest.mark.parametrize(
    ('option', 'value', 'answer'),
    [('max_samples', 100, 'PLANNING_FAILED (-1): '), ('time_limit', 0.05, 'TIMED_OUT (-6): ')],
)
def test_the_search_may_run_out_of_samples_or_time(start, option, value, answer):
    planner, stranger = start(**{**ENDLESS, option: value})
    say_all(planner, stranger, body_boxes=fenced())
    assert stranger.answer().message.startswith(answer)


def test_a_plan_is_cancelled_with_those_that_wait(start, wait_until):
    planner, stranger = start(**ENDLESS)
    say_all(planner, stranger, body_boxes=fenced())
    running, waiting = stranger.ask('plan'), stranger.ask('plan')
    wait_until(lambda: len(planner._queue._open) == 2)
    assert stranger.answer('cancel').message == 'SUCCESS (1): requests cancelled: 2'
    wait_until(lambda: running.done() and waiting.done())
    for future in (running, waiting):
        assert future.result().message.startswith('PREEMPTED (-7): ')
    assert not stranger.received['joint_trajectory']
    # Of a publisher of its own: another description, not a stream that sees no plates any more.
    stranger.say('body_boxes', wearer())
    wait_until(lambda: inputs_of(planner).body.value.n_boxes == 2)
    assert stranger.answer().success


def test_messages_are_received_and_callers_wait_while_it_plans(start, wait_until):
    planner, stranger = start(**ENDLESS)
    say_all(planner, stranger, body_boxes=fenced())
    first = stranger.ask('plan')
    wait_until(lambda: len(planner._queue._open) == 1)
    for k in range(20):
        stranger.publishers['target'].publish(target(1.4, 0.01 * k, 0.2))
        wait_until(lambda k=k: inputs_of(planner).target.value.target[1] == 0.01 * k)
    # Of a publisher of its own: another description, not a stream that sees no plates any more.
    stranger.say('body_boxes', wearer())
    wait_until(lambda: inputs_of(planner).body.value.n_boxes == 2)
    assert not first.done()
    stranger.answer('cancel')
    futures = [stranger.ask('plan') for _ in range(3)]
    wait_until(lambda: first.done() and all(f.done() for f in futures))
    assert not first.result().success
    assert all(f.result().success for f in futures)


def test_whatever_goes_wrong_is_answered(start, monkeypatch, tmp_path):
    planner, stranger = start(incident_folder=str(tmp_path))
    say_all(planner, stranger)

    def fail(*_, **__):
        raise ZeroDivisionError('of a test')

    with monkeypatch.context() as patch:
        patch.setattr(in_process_planner, 'plan_question', fail)
        message = stranger.answer().message
    sentence = 'FAILURE (99999): planning failed unexpectedly: ZeroDivisionError: of a test; '
    (file,) = tmp_path.iterdir()
    assert message == f'{sentence}to replay it: ./run exec replay {file}'
    assert not stranger.received['joint_trajectory']
    assert stranger.answer().success


def test_a_motion_that_begins_elsewhere_is_not_published(start, monkeypatch, tmp_path):
    planner, stranger = start(incident_folder=str(tmp_path))
    say_all(planner, stranger)
    plan_question = in_process_planner.plan_question

    def plan_from_elsewhere(question, should_stop):
        q = question.q_start + [0.01, 0.0, 0.0, 0.0]
        return plan_question(replace(question, q_start=q), should_stop)

    with monkeypatch.context() as patch:
        patch.setattr(in_process_planner, 'plan_question', plan_from_elsewhere)
        message = stranger.answer().message
    assert message.startswith('FAILURE')
    assert 'begins 0.0100 rad from the start that was asked for' in message
    assert not stranger.received['joint_trajectory']
    assert stranger.answer().success


@pytest.mark.usefixtures('one_try')
@pytest.mark.parametrize(
    ('topic', 'msg', 'sentence'),
    [
        (
            'body_boxes',
            array(box('arm', center=(0.1, 0.1, 0.45), size=(3.0, 3.0, 3.0))),
            'the wearer moved',
        ),
        ('joint_states', joints([0.5, *FOLDED[1:]]), 'joint_1 moves at'),
        ('joint_states', joints([0.002, *FOLDED[1:]]), 'joint_1 moves at'),
    ],
)
def test_a_plan_for_what_is_no_longer_there_is_not_published(
    start, monkeypatch, wait_until, topic, msg, sentence
):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs, plan_motion = inputs_of(planner), in_process_planner.plan_question

    def plan_while_things_move(*args, **kwargs):
        plan = plan_motion(*args, **kwargs)
        body, positions = inputs.body.value, inputs.joints.value
        stranger.publishers[topic].publish(msg)
        wait_until(lambda: inputs.body.value is not body or inputs.joints.value is not positions)
        return plan

    monkeypatch.setattr(in_process_planner, 'plan_question', plan_while_things_move)
    message = stranger.answer().message
    code = 'MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE (-3): '
    assert message.startswith(code if topic == 'body_boxes' else 'START_STATE_INVALID (-26): ')
    assert sentence in message
    assert not stranger.received['joint_trajectory']


def test_a_handover_begins_at_the_present_velocity(start):
    planner, stranger = start()
    say_all(planner, stranger, joint_states=joints(velocity=[0.3, 0.0, 0.0, -0.2]))
    assert stranger.answer().success
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])
    msg = stranger.received['joint_trajectory'][-1]
    assert list(msg.points[0].velocities) == [0.3, 0.0, 0.0, -0.2]
    assert not any(msg.points[-1].velocities)
    # It begins at a time that it names, so that a late message causes no jump.
    assert msg.header.stamp.sec > 0


@pytest.mark.parametrize('by', [1e-5, 0.02])
def test_an_arm_that_rests_beyond_a_limit_is_led_in(start, by):
    planner, stranger = start()
    say_all(planner, stranger, joint_states=joints([0.0, by, *FOLDED[2:]]))
    response = stranger.answer()
    assert response.success, response.message
    assert f'joint_2 led in from {by:.2g} rad beyond its limit' in response.message
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])
    points = stranger.received['joint_trajectory'][-1].points
    places = [point.positions[1] for point in points]
    inside = next(i for i, place in enumerate(places) if place <= 0.0)
    assert places[0] == by
    assert all(before >= after for before, after in pairwise(places[: inside + 1]))
    assert max(places[inside:]) <= 0.0


def test_velocities_that_are_no_numbers_are_rejected(start):
    planner, stranger = start()
    say_all(planner, stranger, joint_states=joints(velocity=[NAN, 0.0, 0.0, 0.0]))
    assert stranger.answer().message == (
        'START_STATE_INVALID (-26): joint_1 moves at nan rad/s, expected a velocity for every '
        'joint'
    )
    stranger.publishers['joint_states'].publish(joints(velocity=[0.009] * 4))
    stranger.wait_until(lambda: inputs_of(planner).joints.value.velocities[1] == 0.009)
    assert stranger.answer().success


@pytest.mark.usefixtures('one_try')
def test_there_is_no_handover_of_an_arm_above_its_limits(start):
    planner, stranger = start()
    say_all(planner, stranger, joint_states=joints(velocity=[0.0, 1.7, 0.0, 0.0]))
    assert stranger.answer().message.startswith(
        'START_STATE_INVALID (-26): joint_2 moves at up to 1.700 rad/s, expected at most 1.5 '
    )


def test_nothing_is_published_when_the_arm_begins_to_move(start, monkeypatch, wait_until):
    planner, stranger = start()
    say_all(planner, stranger)
    source, plan_motion = inputs_of(planner).joints, in_process_planner.plan_question

    def plan_while_it_starts(*args, **kwargs):
        plan = plan_motion(*args, **kwargs)
        stranger.publishers['joint_states'].publish(joints(velocity=[0.0, 0.3, 0.0, 0.0]))
        wait_until(lambda: source.value.velocities[1] == 0.3)
        return plan

    monkeypatch.setattr(in_process_planner, 'plan_question', plan_while_it_starts)
    message = stranger.answer().message
    assert message.startswith('START_STATE_INVALID (-26): joint_2 moves at 0.300 rad/s')
    assert not stranger.received['joint_trajectory']


@pytest.mark.usefixtures('one_try')
@pytest.mark.parametrize(
    ('owner', 'step', 'topic', 'msg', 'answer'),
    [
        (in_process_planner, 'plan_question', 'body_boxes', fenced(), 'the wearer moved'),
        (Revalidation, 'disagreement', 'body_boxes', fenced(), 'the wearer moved'),
        (
            Revalidation,
            'disagreement',
            'body_boxes',
            array(command(Marker.DELETEALL)),
            'has lost parts: "torso/0", "head/0"',
        ),
        (
            Revalidation,
            'disagreement',
            'joint_states',
            joints([0.5, *FOLDED[1:]]),
            'the arm moved by 0.5000',
        ),
        (
            Revalidation,
            'disagreement',
            'joint_states',
            joints(velocity=[0.3] * 4),
            'joint_1 moves at 0.300',
        ),
    ],
)
def test_what_came_but_was_not_read_yet_counts(
    start, monkeypatch, owner, step, topic, msg, answer
):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 30.0)
    planner, stranger = start()
    say_all(planner, stranger)
    original = getattr(owner, step)

    def work_while_the_node_is_busy(*args, **kwargs):
        monkeypatch.setattr(owner, step, original)
        result = original(*args, **kwargs)
        begun, end = Event(), Event()
        planner.executor.create_task(lambda: begun.set() or end.wait(10.0))
        assert begun.wait(10.0)
        stranger.publishers[topic].publish(msg)
        Timer(0.3, end.set).start()
        return result

    monkeypatch.setattr(owner, step, work_while_the_node_is_busy)
    response = stranger.answer()
    assert not response.success
    assert answer in response.message
    assert not stranger.received['joint_trajectory']


@pytest.mark.usefixtures('one_try')
@pytest.mark.parametrize('is_in_the_way', [True, False])
def test_a_body_that_comes_while_a_motion_is_checked_is_checked_too(
    start, monkeypatch, wait_until, is_in_the_way
):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs, disagreement = inputs_of(planner), Revalidation.disagreement
    checked = []

    def check_while_a_body_comes(revalidation, planner):
        found, body = disagreement(revalidation, planner), inputs.body.value
        checked.append(body)
        far = box('far', len(checked), center=(0.0, 0.0, -5.0), size=(0.1, 0.1, 0.1))
        stranger.publishers['body_boxes'].publish(fenced() if is_in_the_way else array(far))
        wait_until(lambda: inputs.body.value is not body)
        return found

    monkeypatch.setattr(Revalidation, 'disagreement', check_while_a_body_comes)
    message = stranger.answer().message
    # The proof alone decides about that one, and about those that follow.
    assert len(checked) == 1
    assert message.startswith('MOTION_PLAN_INVALIDATED' if is_in_the_way else 'SUCCESS')
    assert bool(stranger.received['joint_trajectory']) == (not is_in_the_way)


def test_no_message_is_processed_while_a_motion_is_published(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs, publishers = inputs_of(planner), planner._queue._publishers
    publish, known, planned = publishers.publish_motion, [], []

    def publish_slowly(trajectory, parameters, begin):
        if not planned:
            body = inputs.body.value
            stranger.publishers['body_boxes'].publish(fenced())
            time.sleep(0.3)
            known.append(inputs.body.value is body)
        planned.append(publishers.motion(trajectory, parameters, begin))
        publish(trajectory, parameters, begin)

    monkeypatch.setattr(publishers, 'publish_motion', publish_slowly)
    assert stranger.answer().success
    assert known[0]
    # Then it is, and the monitor stops the arm. Of messages that quick only the last may arrive.
    motion, received = planned[0], stranger.received['joint_trajectory']
    stranger.wait_until(lambda: received and received[-1].points[-1] != motion.points[-1])


def test_a_busy_node_publishes_no_motion(start, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 0.2)
    planner, stranger = start()
    say_all(planner, stranger)
    end, call = Event(), ExecutorBarrier.call

    def call_a_busy_node(barrier, work):
        begun = Event()
        planner.executor.create_task(lambda: begun.set() or end.wait(10.0))
        assert begun.wait(10.0)
        try:
            return call(barrier, work)
        finally:
            end.set()

    monkeypatch.setattr(ExecutorBarrier, 'call', call_a_busy_node)
    message = stranger.answer().message
    assert message.startswith('SENSOR_INFO_STALE (-24): the node is busy')
    assert not stranger.received['joint_trajectory']


def stop_for(planner, scene=None):
    """
    Have a stop of the arm, which was moving to the target, replanned; it is over.

    scene: the wearer that it was proven free of, if it was.
    """
    goal, parameters = inputs_of(planner).target.value, planner._reporter.parameters
    still = np.zeros((1, 4))
    over = Trajectory(times=[0.0], positions=[FOLDED], velocities=still, accelerations=still)
    monitor = planner._monitor
    stop = Stop(over, goal, parameters, scene, True, monitor.n_motions)
    know(monitor, stops=(*monitor.watch.stops, stop))


def test_after_a_stop_it_plans_again_from_where_the_arm_has_come_to_rest(start, monkeypatch):
    monkeypatch.setattr(request_queue, 'LONGEST_SETTLING', 30.0)
    planner, stranger = start()
    say_all(planner, stranger, joint_states=joints(velocity=[0.0, 0.3, 0.0, 0.0]))
    stop_for(planner)
    # Time enough for a plan that does not wait for rest.
    time.sleep(0.2)
    stranger.publishers['joint_states'].publish(joints([0.1, *FOLDED[1:]]))
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])
    (msg,) = stranger.received['joint_trajectory']
    assert list(msg.points[0].positions) == [0.1, *FOLDED[1:]]
    assert not any(msg.points[0].velocities)
    error = pointing_error(load_arm(), np.array(msg.points[-1].positions), [1.5, 0.1, 0.3])
    assert error < 1e-6


@pytest.mark.parametrize('is_free', [True, False])
def test_from_a_stop_that_is_proven_free_it_plans_before_the_arm_rests_and_once_it_does(
    start, monkeypatch, is_free
):
    monkeypatch.setattr(request_queue, 'LONGEST_SETTLING', 30.0)
    planner, stranger = start()
    say_all(planner, stranger, joint_states=joints(velocity=[0.0, 0.3, 0.0, 0.0]))
    queue, work, tried = planner._queue, planner._queue._work, []

    def work_in_vain(*arguments):
        tried.append(bool(inputs_of(planner).joints.value.velocities.any()))
        return work(*arguments)

    monkeypatch.setattr(queue, '_work', work_in_vain)
    monkeypatch.setattr(
        request_queue,
        'plan_request',
        lambda *_: PlanOutcome(ErrorCode.PLANNING_FAILED, 'of the test'),
    )
    monkeypatch.setattr(queue, '_check_stop', lambda stop: None)
    stop_for(planner, Scene(()) if is_free else None)
    if is_free:
        stranger.wait_until(lambda: tried)
    time.sleep(0.2)
    assert tried == [True] * is_free
    # The arm holds only where it rests.
    assert stranger.value('monitor') != 'holding'
    stranger.publishers['joint_states'].publish(joints([0.1, *FOLDED[1:]]))
    stranger.wait_until(lambda: len(tried) > is_free)
    assert not tried[is_free]
    stranger.wait_until(lambda: stranger.value('monitor') == 'holding')


def test_a_plan_from_before_a_stop_is_not_published(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)
    plan_motion = in_process_planner.plan_question

    def plan_while_the_arm_is_stopped(*args, **kwargs):
        know(planner._monitor, n_stops=planner._monitor.n_stops + 1)
        return plan_motion(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(in_process_planner, 'plan_question', plan_while_the_arm_is_stopped)
        message = stranger.answer().message
    assert message.startswith(
        'MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE (-3): the arm was stopped while its motion'
    )
    assert not stranger.received['joint_trajectory']
    assert stranger.answer().success


def test_a_request_from_before_an_error_moves_no_arm_after_it(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)
    plan_motion, errors = in_process_planner.plan_question, ['the monitor failed']

    def plan_while_the_monitor_fails(*args, **kwargs):
        if errors:
            # As `fail` of a motion in progress.
            monitor = planner._monitor
            known = {'n_stops': monitor.n_stops + 1, 'n_faults': monitor.n_faults + 1}
            know(monitor, **known, stop_reason=errors.pop())
        return plan_motion(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(in_process_planner, 'plan_question', plan_while_the_monitor_fails)
        message = stranger.answer().message
    assert message.startswith('FAILURE (99999): an error while the motion was planned: the monit')
    assert not errors
    assert not stranger.received['joint_trajectory']
    assert stranger.answer().success


def test_after_a_stop_it_plans_for_nothing_once_another_motion_has_begun(start, monkeypatch):
    monkeypatch.setattr(request_queue, 'LONGEST_SETTLING', 30.0)
    planner, stranger = start()
    say_all(planner, stranger, joint_states=joints(velocity=[0.0, 0.3, 0.0, 0.0]))
    stop_for(planner)
    stranger.wait_until(lambda: planner._queue._open)
    know(planner._monitor, n_motions=planner._monitor.n_motions + 1)
    stranger.publishers['joint_states'].publish(joints())
    stranger.wait_until(lambda: not planner._queue._open)
    planner._queue._worker.submit(lambda: None).result(30.0)
    assert planner._reporter.report.n_requests == 0
    assert not planner._queue._open


def test_a_request_does_not_wait_for_the_rest_of_an_arm_that_was_stopped(start, monkeypatch):
    monkeypatch.setattr(request_queue, 'LONGEST_SETTLING', 300.0)
    planner, stranger = start()
    say_all(planner, stranger)
    # No joint state comes that would show it at rest.
    stop_for(planner)
    assert stranger.answer().success
    # It is reported once it has been answered, by another thread.
    stranger.wait_until(lambda: planner._reporter.report.n_requests == 1)
    planner._queue._worker.submit(lambda: None).result(30.0)
    assert planner._reporter.report.n_requests == 1
    stranger.wait_until(lambda: not planner._queue._open)


def test_a_request_without_a_motion_leaves_the_plan_after_a_stop_to_be_made(start, monkeypatch):
    monkeypatch.setattr(request_queue, 'LONGEST_SETTLING', 300.0)
    planner, stranger = start()
    say_all(planner, stranger)
    queue = planner._queue
    stop_for(planner)
    stranger.wait_until(lambda: queue._open)
    rejected = stranger.answer('get_plan', GetPlan.Request()).plan
    assert not rejected.poses
    assert not stranger.received['joint_trajectory']
    assert len(queue._open) == 1
    stranger.publishers['joint_states'].publish(joints())
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])
    stranger.wait_until(lambda: not queue._open)


def test_where_it_cannot_replan_after_a_stop_it_holds_and_reports_why(start):
    planner, stranger = start(max_samples=100)
    say_all(planner, stranger, body_boxes=fenced())
    stop_for(planner)
    stranger.publishers['joint_states'].publish(joints())
    stranger.wait_until(lambda: stranger.value('monitor') == 'holding')
    said = stranger.value('last stop')
    assert said.startswith('arm holds its position: PLANNING_FAILED (-1): ')
    assert not stranger.received['joint_trajectory']


def test_broken_joint_positions_are_not_replaced_by_those_before(start):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs = inputs_of(planner)
    good = inputs.joints.value
    for n, bad in enumerate((joints([NAN] * 4), joints(FOLDED[:3], velocity=[])), 1):
        stranger.publishers['joint_states'].publish(bad)
        stranger.wait_until(lambda n=n: inputs.joints.n_rejected == n)
        message = stranger.answer().message
        assert message.startswith('ROBOT_STATE_STALE (-23): the last message on /test_')
        assert f'was rejected: {inputs.joints.rejection}' in message
    assert inputs.joints.value is good
    assert not stranger.received['joint_trajectory']
    stranger.publishers['joint_states'].publish(joints())
    stranger.wait_until(lambda: inputs.joint_rejection is None)
    assert stranger.answer().success


def test_both_checkers_are_asked_when_the_wearer_moved(start, monkeypatch, wait_until, tmp_path):
    planner, stranger = start(incident_folder=str(tmp_path))
    say_all(planner, stranger)
    inputs, plan_motion = inputs_of(planner), in_process_planner.plan_question
    asked = []

    def plan_while_a_box_comes(*args, **kwargs):
        plan = plan_motion(*args, **kwargs)
        body = inputs.body.value
        far = box('far', len(asked), center=(0.0, 0.0, -5.0), size=(0.1, 0.1, 0.1))
        stranger.publishers['body_boxes'].publish(array(far))
        wait_until(lambda: inputs.body.value is not body)
        return plan

    def disagree(*args, **_):
        asked.append(args)
        return Violation(0.1, 0.01, 'ray', 'torso') if len(asked) == 1 else None

    monkeypatch.setattr(in_process_planner, 'plan_question', plan_while_a_box_comes)
    monkeypatch.setattr(planner._planner, 'violation_seen', disagree)
    message = stranger.answer().message
    assert message.startswith('FAILURE (99999): the two collision checks disagree: ray is 0.0100')
    assert not stranger.received['joint_trajectory']
    (file,) = tmp_path.iterdir()
    incident = read_incident(file)
    # Planned for two boxes, checked for three.
    assert len(incident.question.scene.boxes) == 2
    assert [box.name for box in incident.present.boxes][-1] == 'far/0'
    assert stranger.answer().success
    assert len(asked) == 2


def test_a_planning_process_that_dies_is_an_answer_and_no_end(start, monkeypatch, tmp_path):
    planner, stranger = start(incident_folder=str(tmp_path))
    say_all(planner, stranger)

    def die(*_):
        raise PlanningProcessError('the planning process ended with code -9 while working')

    with monkeypatch.context() as patch:
        patch.setattr(planner._planner, 'plan', die)
        message = stranger.answer().message
    assert message.startswith('FAILURE (99999): planning failed unexpectedly: PlanningProcessErr')
    assert 'ended with code -9' in message
    # What was asked is kept, to be asked again.
    assert len(list(tmp_path.iterdir())) == 1
    assert not stranger.received['joint_trajectory']
    assert stranger.answer().success


def test_what_was_cancelled_is_never_published(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)
    queue, disagreement = planner._queue, Revalidation.disagreement
    ended = []

    def cancel_after_the_revalidation(*args):
        found = disagreement(*args)
        ended.append(queue.cancel())
        return found

    with monkeypatch.context() as patch:
        patch.setattr(Revalidation, 'disagreement', cancel_after_the_revalidation)
        message = stranger.answer().message
    assert ended == [1]
    assert message == 'PREEMPTED (-7): the request was cancelled'
    assert not stranger.received['joint_trajectory']
    assert stranger.answer().success
    stranger.wait_until(lambda: len(stranger.received['joint_trajectory']) == 1)


def test_a_cancel_does_not_count_what_was_published(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)
    queue, ended = planner._queue, []
    show = queue._show

    def cancel_first(*args):
        ended.append(queue.cancel())
        return show(*args)

    monkeypatch.setattr(queue, '_show', cancel_first)
    assert stranger.answer().success
    stranger.wait_until(lambda: ended)
    assert ended == [0]


def test_a_request_is_answered_before_its_motion_is_shown(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)
    queue, is_answered = planner._queue, Event()
    show = queue._show

    def show_late(*args):
        assert is_answered.wait(30.0)
        show(*args)

    monkeypatch.setattr(queue, '_show', show_late)
    assert stranger.answer().success
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])
    assert not stranger.received['rrth_planner/markers']
    is_answered.set()
    stranger.wait_until(lambda: stranger.received['rrth_planner/markers'])


def test_an_error_in_showing_a_motion_does_not_revoke_it(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)

    def fail(*args):
        raise RuntimeError('no colours')

    monkeypatch.setattr(planner._queue, '_show', fail)
    for _ in range(2):
        assert stranger.answer().success


def test_nothing_is_published_once_the_node_closes(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)
    queue, disagreement = planner._queue, Revalidation.disagreement
    closers = []

    def close_after_the_revalidation(*args):
        found = disagreement(*args)
        closers.append(Thread(target=queue.close))
        closers[0].start()
        stranger.wait_until(lambda: queue._is_closed)
        return found

    monkeypatch.setattr(Revalidation, 'disagreement', close_after_the_revalidation)
    assert stranger.answer().message.startswith('PREEMPTED (-7): ')
    closers[0].join(30.0)
    assert not stranger.received['joint_trajectory']


def test_a_new_algorithm_is_warmed_up_before_the_next_request(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)
    order, plan_motion = [], in_process_planner.plan_question

    def warm_up(_, options, __):
        time.sleep(0.2)
        order.append(type(options).__name__)

    def plan_in_turn(*args, **kwargs):
        order.append('plan')
        return plan_motion(*args, **kwargs)

    monkeypatch.setattr(planner._planner, 'warm_up', warm_up)
    monkeypatch.setattr(in_process_planner, 'plan_question', plan_in_turn)
    planner.set_parameters([Parameter(name='margin', value=0.03)])
    planner.set_parameters([Parameter(name='algorithm', value='rrt')])
    assert stranger.answer().success
    assert order == ['RRTOptions', 'plan']


def test_a_box_whose_lifetime_has_passed_is_named_and_nothing_is_planned(start, monkeypatch):
    planner, stranger = start()
    warnings = []
    monkeypatch.setattr(planner.get_logger(), 'warning', warnings.append)
    body = wearer()
    pack = box('pack', center=(-1.0, 0.0, -1.0), text='a pack')
    pack.lifetime.nanosec = 10**8
    body.markers.append(pack)
    say_all(planner, stranger, body_boxes=body)
    stranger.wait_until(lambda: stranger.value('lost parts') == '"a pack"')
    stranger.wait_until(lambda: any('lifetime of "a pack"' in line for line in warnings))
    for _ in range(2):
        message = stranger.answer().message
        assert message.startswith('SENSOR_INFO_STALE (-24): the body on'), message
        assert 'has lost parts: ' in message, message
        assert '"a pack"' in message
    assert sum('lifetime of "a pack"' in line for line in warnings) == 1
    assert not stranger.received['joint_trajectory']
    gone = box('pack')
    gone.action = Marker.DELETE
    stranger.publishers['body_boxes'].publish(array(gone))
    stranger.wait_until(lambda: not stranger.value('lost parts'))
    assert stranger.answer().success


def test_a_second_publisher_of_the_body_is_reported(start, monkeypatch):
    planner, stranger = start()
    warnings = []
    monkeypatch.setattr(planner.get_logger(), 'warning', warnings.append)
    say_all(planner, stranger)
    stranger.wait_until(lambda: stranger.value('publishers of the body') == '1')
    other = stranger.node.create_publisher(MarkerArray, 'body_boxes', 10)
    stranger.wait_until(lambda: stranger.value('publishers of the body') == '2')
    stranger.node.destroy_publisher(other)
    stranger.wait_until(lambda: stranger.value('publishers of the body') == '1')
    (line,) = [line for line in warnings if 'publishers' in line]
    assert 'body_boxes has 2 publishers: for each marker the last edit counts' in line, line


def test_parameters_are_asked_for_again_where_an_answer_is_lost(start, monkeypatch):
    planner, _ = start(margin=0.03)
    n_asked = []

    class Lossy(AsyncParameterClient):
        def get_parameters(self, names, callback=None):
            n_asked.append(len(names))
            return Future() if len(n_asked) % 2 else super().get_parameters(names, callback)

    monkeypatch.setattr(planner_client, 'AsyncParameterClient', Lossy)
    monkeypatch.setattr(planner_client, 'ASK_AGAIN', 0.1)
    client = planner_client.PlannerClient(namespace=planner.get_namespace())
    try:
        assert planner_client.parameters_of_planner(client).margin == 0.03
    finally:
        client.destroy_node()
    assert len(n_asked) >= 4


def hand_in_the_way():
    """Return a hand as large as the arm at its shoulder, which no motion is free of."""
    shoulder = np.asarray(load_arm().T_base_mount)[:3, 3]
    return Scene((Box('hand', shoulder, np.ones(3), np.eye(3)),))


def test_a_motion_begins_only_once_no_part_is_about_to_move_into_its_way(start, monkeypatch):
    planner, stranger = start()
    say_all(planner, stranger)
    # A hand that comes nearer, and turns back before it is there.
    expected = [hand_in_the_way()] * 5
    inputs = inputs_of(planner)
    monkeypatch.setattr(
        inputs, 'expected_scene', lambda: expected.pop() if expected else Scene(())
    )
    assert stranger.answer().success
    assert not expected


def test_a_part_that_stays_about_to_move_into_the_way_ends_the_request(start, monkeypatch):
    planner, stranger = start(time_limit=0.3)
    say_all(planner, stranger)
    monkeypatch.setattr(inputs_of(planner), 'expected_scene', hand_in_the_way)
    message = stranger.answer().message
    assert message.startswith('MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE (-3): '), message
    assert 'the wearer is about to move into the path of the arm' in message
    assert not stranger.received['joint_trajectory']


@pytest.mark.parametrize('age', [1.0, 3600.0])
def test_a_body_that_was_measured_long_ago_is_stale_however_new_the_message(start, age):
    planner, stranger = start(body_timeout=0.2)
    body = wearer()
    measured = planner.get_clock().now() - Duration(seconds=age)
    for marker in body.markers:
        marker.header.stamp = measured.to_msg()
    say_all(planner, stranger, body_boxes=body)
    message = stranger.answer().message
    assert message.startswith('SENSOR_INFO_STALE (-24): the last good message on'), message
    found = re.search(r'is ([0-9.]+) s old, expected at most 0.2 s \(body_timeout\)', message)
    assert age <= float(found.group(1)) < age + 60.0
    assert not stranger.received['joint_trajectory']


def test_a_body_without_a_required_box_is_rejected_until_it_comes(start):
    planner, stranger = start(required_boxes=['hat', 'torso'])
    say_all(planner, stranger)
    message = stranger.answer().message
    assert message.startswith('UNABLE_TO_AQUIRE_SENSOR_DATA (-5): the body on'), message
    assert 'has no box hat, expected each of required_boxes' in message
    assert not stranger.received['joint_trajectory']
    stranger.publishers['body_boxes'].publish(array(box('hat', center=(-1.0, 0.0, -1.0))))
    stranger.wait_until(lambda: not inputs_of(planner).body.value.without(['hat']))
    assert stranger.answer().success
    stranger.wait_until(lambda: stranger.value('age of body at decisions').startswith('1, last '))


def test_diagnostics_bear_the_name_of_the_node_and_keep_to_10_hz(start):
    planner, stranger = start()
    arrays = stranger.received['/diagnostics']
    stranger.wait_until(lambda: arrays)
    name = planner.get_fully_qualified_name()[1:]
    assert arrays[-1].status[0].name == f'{name}: planning'
    begin, n_before = time.monotonic(), len(arrays)
    while time.monotonic() < begin + 1.0:
        planner._reporter.publish()
        time.sleep(0.005)
    assert 5 <= len(arrays) - n_before <= 13
    planner._reporter.conclude(ErrorCode.FAILURE, 'the last', PlanReport())
    stranger.wait_until(lambda: stranger.value('last sentence') == 'the last', 0.9)


def test_the_same_seed_gives_the_same_trajectory(start):
    planner, stranger = start(seed=7, improve_time=0.0)
    say_all(planner, stranger)
    assert stranger.answer().success
    # The arm does not execute it: then it is taken to be held where it rests.
    stranger.wait_until(lambda: planner._monitor.hold(-np.inf) is None)
    assert stranger.answer().success
    stranger.wait_until(lambda: len(stranger.received['joint_trajectory']) == 2)
    one, other = (
        joint_trajectory_from_msg(msg, JOINTS) for msg in stranger.received['joint_trajectory']
    )
    # How long each rests before it begins is up to the clock.
    for values in zip(one.states, other.states, strict=True):
        np.testing.assert_array_equal(*values)
    np.testing.assert_allclose(one.times, other.times, atol=2e-3)


@pytest.mark.parametrize('profile', [LATCHED, VOLATILE, BEST_EFFORT])
def test_publishers_of_every_quality_are_received_once(start, profile):
    planner, stranger = start()
    for name, (_, make) in TOPICS.items():
        stranger.say(name, make(), profile)
        publisher = stranger.publishers[name]
        stranger.wait_until(lambda p=publisher: p.get_subscription_count() > 0)
    inputs = inputs_of(planner)
    if profile is not LATCHED:
        for name, (_, make) in TOPICS.items():
            stranger.publishers[name].publish(make())
    stranger.wait_until(lambda: all(i.measured is not None for i in inputs.all.values()))
    if profile is not BEST_EFFORT:
        # What the best-effort reader misses comes by another one.
        subscriptions = planner._scene_monitor._subscriptions
        stranger.wait_until(lambda: all(profile.durability in h._reliable for h in subscriptions))


def test_what_was_latched_before_the_start_is_received(start, spinning, wait_until):
    early = Node('early', namespace='/latched')
    publishers = [
        (early.create_publisher(kind, name, LATCHED), make)
        for name, (kind, make) in TOPICS.items()
    ]
    for publisher, make in publishers:
        publisher.publish(make())
    planner = PlannerNode(InProcessPlanner(), namespace='/latched')
    with spinning(early), spinning(planner):
        wait_until(lambda: all(i.measured is not None for i in inputs_of(planner).all.values()))
    planner.close()
    planner.destroy_node()
    early.destroy_node()


@pytest.mark.parametrize(
    ('topic', 'msg', 'sentence'),
    [
        ('body_boxes', array(box(center=(NAN, 0.0, 0.0))), 'expected finite numbers [m]'),
        ('body_boxes', array(box(size=(-1.0, 1.0, 1.0))), 'expected three lengths > 0 [m]'),
        ('body_boxes', array(box('ok'), box(frame='camera')), 'marker 1 ("torso/0"): frame'),
        ('joint_states', joints(FOLDED[:3], JOINTS[:3]), "no ['joint_4']"),
    ],
)
def test_a_rejected_message_is_reported_and_nothing_is_planned_until_a_good_one(
    start, topic, msg, sentence
):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs = inputs_of(planner)
    before = (inputs.body.value, inputs.joints.value)
    stranger.publishers[topic].publish(msg)
    name = {'body_boxes': 'body', 'joint_states': 'joints'}[topic]
    stranger.wait_until(lambda: stranger.value(f'rejected messages, {name}') == '1')
    assert sentence in stranger.value(f'last rejection, {name}')
    assert (inputs.body.value, inputs.joints.value) == before
    if topic == 'body_boxes':
        # Of joint positions only those of all joints count.
        message = stranger.answer().message
        assert message.startswith('SENSOR_INFO_STALE (-24): the last message on'), message
        assert sentence in message
        stranger.publishers[topic].publish(wearer())
        stranger.wait_until(lambda: not inputs.body.is_last_rejected)
    assert stranger.answer().success


def test_many_calls_at_once_are_all_answered(start):
    planner, stranger = start()
    say_all(planner, stranger)
    futures = [stranger.ask('plan') for _ in range(40)]
    stranger.wait_until(lambda: all(future.done() for future in futures))
    assert all(future.result().success for future in futures)


def test_what_two_threads_report_is_all_counted(start):
    planner, _ = start()
    reporter, n, n_before = planner._reporter, 300, planner._reporter.report.n_requests
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)

    def work():
        for _ in range(n):
            reporter.conclude(ErrorCode.SUCCESS, 'done', PlanReport())
            reporter.stop_published(1e-3)

    try:
        threads = [Thread(target=work) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert reporter.report.n_requests - n_before == reporter.report.n_solved == 2 * n
    assert reporter._stops_published.n == 2 * n


def test_a_rejected_target_is_not_replaced_by_the_one_before(start):
    planner, stranger = start()
    say_all(planner, stranger)
    stranger.publishers['target'].publish(target(frame='camera'))
    stranger.wait_until(lambda: inputs_of(planner).target.n_rejected == 1)
    assert stranger.answer().message.startswith('FRAME_TRANSFORM_FAILURE (-21): the last message')
    stranger.publishers['target'].publish(target())
    stranger.wait_until(lambda: not inputs_of(planner).target.is_last_rejected)
    assert stranger.answer().success


def test_joint_states_of_other_machines_are_ignored(start):
    planner, stranger = start()
    say_all(planner, stranger)
    stranger.publishers['joint_states'].publish(joints([NAN], ['wheel']))
    stranger.publishers['joint_states'].publish(joints([0.1, *FOLDED[1:]]))
    source = inputs_of(planner).joints
    stranger.wait_until(lambda: source.value.positions[0] == 0.1)
    assert source.n_rejected == 0


@pytest.fixture(name='process')
def _process():
    processes = []

    def run(*arguments):
        processes.append(
            subprocess.Popen(
                [sys.executable, '-m', 'rrth_planner.ros.planner_node', *arguments],
                stderr=subprocess.PIPE,
                text=True,
                env=os.environ | {'PYTHONPATH': os.pathsep.join(sys.path)},
            )
        )
        return processes[-1]

    yield run
    for process in processes:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_process_even_while_it_plans(process, spinning, wait_until, number):
    namespace = f'/process_{number}'
    given = ENDLESS | {'separation': 'false'}
    options = [word for k, v in given.items() for word in ('-p', f'{k}:={v}')]
    running = process('--ros-args', '-r', f'__ns:={namespace}', *options)
    stranger = Stranger(namespace, wait_until)
    with spinning(stranger.node):
        for name, (_, make) in TOPICS.items():
            stranger.say(name, fenced() if name == 'body_boxes' else make())
        wait_until(stranger.services['plan'].service_is_ready, 120.0)
        wait_until(
            lambda: all(
                stranger.value(f'age of {n} [s]') not in (None, 'inf')
                for n in ('body', 'target', 'joints')
            )
        )
        asked = stranger.ask('plan')
        # The request was sent before this answer, and requests are handled in turn.
        stranger.answer('get_plan', GetPlan.Request(start=_framed()))
        assert not asked.done()
        running.send_signal(number)
        _, errors = running.communicate(timeout=30)
    stranger.node.destroy_node()
    assert running.returncode == 0, errors
    assert 'Traceback' not in errors


def _framed():
    request = GetPlan.Request()
    request.start.header.frame_id = 'nowhere'
    return request.start


@pytest.mark.parametrize(
    ('argument', 'sentence'),
    [
        ('margin:=3.0', 'margin: 3.0, expected a number from 0 to 1 [m]'),
        ('margin:=1', 'margin: 1, expected a number from 0 to 1 [m]: write 1.0'),
        ('margn:=0.1', 'margn: no such parameter, the closest name is margin'),
        ('max_velocity:=[]', 'max_velocity: [], expected numbers from 0.001 to 1000000 [rad/s]'),
        ('max_velocity:=[1, 2, 1, 1]', 'write [1.0, 2.0, 1.0, 1.0]'),
        ('algorithm:=7', 'algorithm: 7, expected a text'),
        ('max_jerk:=[1.0, 2.0]', 'max_jerk: [1.0, 2.0], expected 4 values'),
    ],
)
def test_a_bad_parameter_ends_the_start_with_one_line(call, argument, sentence):
    ended = call(planner_module.run, '--ros-args', '-p', argument)
    assert ended.returncode == 1
    (line,) = ended.stderr.strip().splitlines()
    assert sentence in line


def test_a_start_that_fails_ends_the_process_and_its_planning_process(process):
    running = process('--ros-args', '-p', 'margin:=3.0')
    # The pipe closes when both have ended.
    _, errors = running.communicate(timeout=60)
    assert running.returncode == 1
    (line,) = errors.strip().splitlines()
    assert 'margin: 3.0, expected a number from 0 to 1 [m]' in line
