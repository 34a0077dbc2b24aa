# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm that the wearer leaned into, as the planner's node leads it out."""

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticStatus  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rrth_planner.collision import reference_checker, trajectory_validation  # noqa: E402
from rrth_planner.collision.violation import Violation  # noqa: E402
from rrth_planner.execution import step  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.model.arm import forward_kinematics, tool_pose  # noqa: E402
from rrth_planner.model.trajectory import positions_at  # noqa: E402
from rrth_planner.ros.messages.body import scene_of  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg  # noqa: E402
from samples import array, box, fenced, FOLDED, JOINTS, wearer  # noqa: E402
from stranger import _one_try, _start, inputs_of, LATCHED, say_all  # noqa: E402, F401

pytestmark = pytest.mark.usefixtures('ros_context')


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
    monkeypatch.setattr(step, 'LONGEST_WAIT', 30.0)
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


def test_with_separation_an_arm_waits_until_a_hand_is_out_of_its_ray_and_says_so(start):
    planner, stranger = start(
        separation=True, time_limit=0.6, body_timeout=30.0, joint_timeout=30.0
    )
    stranger.subscribe('rrth_planner/state', DiagnosticStatus, LATCHED)
    states = stranger.received['rrth_planner/state']
    say_all(planner, stranger, body_boxes=leaned(0.04))
    response = stranger.answer()
    assert response.message.startswith('START_STATE_IN_COLLISION (-10): RAY_BLOCKED: hand/0 is in')
    waits = 'PROTECTIVE_STOP: the arm waits until hand/0 is out of its pointing ray'
    stranger.wait_until(lambda: any(msg.message == waits for msg in states))
    stranger.wait_until(lambda: states[-1].message == 'NORMAL')
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
@pytest.mark.parametrize(
    ('is_fenced', 'answer'),
    [
        (False, 'SUCCESS'),
        (True, 'MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE (-3): the wearer'),
    ],
)
def test_an_escape_is_revalidated_when_the_wearer_moved(start, wait_until, is_fenced, answer):
    planner, stranger = start()
    say_all(planner, stranger, body_boxes=leaned())
    inputs, plan_motion = inputs_of(planner), stranger.script.plans

    def plan_while_the_body_changes(*args, **kwargs):
        plan, body = plan_motion(*args, **kwargs), inputs.body.value
        changed = array(*fenced().markers, leaned().markers[-1]) if is_fenced else leaned()
        changed.markers.append(box('far', center=(0.0, 0.0, -5.0), size=(0.1, 0.1, 0.1)))
        stranger.publishers['body_boxes'].publish(changed)
        wait_until(lambda: inputs.body.value is not body)
        return plan

    stranger.script.plans = plan_while_the_body_changes
    assert stranger.answer().message.startswith(answer)


@pytest.mark.usefixtures('one_try')
@pytest.mark.parametrize(('depth', 'answer'), [(0.05, 'SUCCESS'), (0.028, 'MOTION_PLAN_INVAL')])
def test_no_escape_is_published_once_the_arm_is_too_deep(start, wait_until, depth, answer):
    # It is 0.0275 m deep at first.
    planner, stranger = start(escape_depth=depth)
    say_all(planner, stranger, body_boxes=pressed())
    inputs, plan_motion = inputs_of(planner), stranger.script.plans

    def plan_while_the_wearer_leans(*args, **kwargs):
        plan, body = plan_motion(*args, **kwargs), inputs.body.value
        stranger.publishers['body_boxes'].publish(pressed(0.001))
        wait_until(lambda: inputs.body.value is not body)
        return plan

    stranger.script.plans = plan_while_the_wearer_leans
    assert stranger.answer().message.startswith(answer)


@pytest.mark.usefixtures('one_try')
def test_both_checkers_check_an_escape_when_the_wearer_moved(
    start, monkeypatch, wait_until, tmp_path
):
    planner, stranger = start(incident_folder=str(tmp_path))
    say_all(planner, stranger, body_boxes=leaned())
    inputs, plan_motion, checked = inputs_of(planner), stranger.script.plans, []

    def plan_while_a_box_comes(*args):
        plan = plan_motion(*args)
        body = inputs.body.value
        far = box('far', body.n_boxes, center=(0.0, 0.0, -5.0), size=(0.1, 0.1, 0.1))
        stranger.publishers['body_boxes'].publish(array(far))
        wait_until(lambda: inputs.body.value is not body)
        return plan

    def check(*args):
        checked.append(args)
        return Violation(0.001, 0.01, 'pointing ray', 'hand/0')

    stranger.script.plans = plan_while_a_box_comes
    with monkeypatch.context() as patch:
        patch.setattr(trajectory_validation, 'leads_out', lambda *_: False)
        message = stranger.answer().message
    assert message.startswith('MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE (-3): the wearer')
    stranger.script.checks = check
    message = stranger.answer().message
    assert message.startswith('FAILURE (99999): the two collision checks disagree: pointing ray')
    assert not stranger.received['joint_trajectory']
    # The second one was told how long the escape lasts.
    ((*_, escape_time),) = checked
    assert escape_time > 0.0
