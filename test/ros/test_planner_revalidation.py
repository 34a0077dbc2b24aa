# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Wearer and arm move while the planner's node plans: motions are checked again, or planned."""

from dataclasses import replace
from threading import Event, Timer
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from rrth_planner.collision.violation import Violation  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.io.incident_file import read_incident  # noqa: E402
from rrth_planner.model.arm import tool_pose  # noqa: E402
from rrth_planner.model.scene import Box, Scene  # noqa: E402
from rrth_planner.model.trajectory import positions_at  # noqa: E402
from rrth_planner.ros.messages.body import scene_of  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg  # noqa: E402
from rrth_planner.ros.requests import node_host  # noqa: E402
from samples import array, box, command, fenced, FOLDED, JOINTS, joints, wearer  # noqa: E402
from stranger import _one_try, _start, inputs_of, say_all, TOPICS  # noqa: E402, F401
from visualization_msgs.msg import Marker  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')


def test_a_request_is_planned_again_while_the_wearer_moves(start, wait_until):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs, plan_motion, plans = inputs_of(planner), stranger.script.plans, []

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

    stranger.script.plans = plan_while_a_hand_comes
    assert stranger.answer().success
    assert len(plans) == 2
    stranger.wait_until(lambda: stranger.received['joint_trajectory'])
    (msg,) = stranger.received['joint_trajectory']
    found = joint_trajectory_from_msg(msg, JOINTS)
    np.testing.assert_array_equal(found.positions[1:], plans[1].trajectory.positions)


def test_a_wearer_who_always_moves_into_the_motion_is_reported_after_the_time_limit(
    start, wait_until
):
    planner, stranger = start(time_limit=0.5)
    say_all(planner, stranger)
    inputs, plan_motion, n = inputs_of(planner), stranger.script.plans, []

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
    stranger.script.plans = plan_while_the_wearer_moves
    message = stranger.answer().message
    assert message.startswith('MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE (-3): the wearer')
    assert len(n) > 1
    assert not stranger.received['joint_trajectory']


def test_a_motion_that_begins_elsewhere_is_not_published(start, tmp_path):
    planner, stranger = start(incident_folder=str(tmp_path))
    say_all(planner, stranger)
    plan_question = stranger.script.plans

    def plan_from_elsewhere(question, should_stop):
        stranger.script.plans = plan_question
        q = question.q_start + [0.01, 0.0, 0.0, 0.0]
        return plan_question(replace(question, q_start=q), should_stop)

    stranger.script.plans = plan_from_elsewhere
    message = stranger.answer().message
    assert message.startswith('FAILURE')
    assert 'begins 0.0100 rad (or m) from the start that was asked for' in message
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
    start, wait_until, topic, msg, sentence
):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs, plan_motion = inputs_of(planner), stranger.script.plans

    def plan_while_things_move(*args, **kwargs):
        plan = plan_motion(*args, **kwargs)
        body, positions = inputs.body.value, inputs.joints.value
        stranger.publishers[topic].publish(msg)
        wait_until(lambda: inputs.body.value is not body or inputs.joints.value is not positions)
        return plan

    stranger.script.plans = plan_while_things_move
    message = stranger.answer().message
    code = 'MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE (-3): '
    assert message.startswith(code if topic == 'body_boxes' else 'START_STATE_INVALID (-26): ')
    assert sentence in message
    assert not stranger.received['joint_trajectory']


@pytest.mark.usefixtures('one_try')
@pytest.mark.parametrize(
    ('topic', 'msg', 'answer'),
    [
        ('body_boxes', fenced(), 'the wearer moved'),
        ('body_boxes', array(command(Marker.DELETEALL)), 'has lost parts: "torso/0", "head/0"'),
        ('joint_states', joints([0.5, *FOLDED[1:]]), 'the arm moved by 0.5000'),
        ('joint_states', joints(velocity=[0.3] * 4), 'joint_1 moves at 0.300'),
    ],
)
@pytest.mark.parametrize('is_checked', [False, True])
def test_what_came_but_was_not_read_yet_counts(start, wait_until, is_checked, topic, msg, answer):
    planner, stranger = start()
    say_all(planner, stranger)
    plan_question, violation_seen = stranger.script.plans, stranger.script.checks
    inputs = inputs_of(planner)

    def be_busy(result):
        begun, end = Event(), Event()
        planner.executor.create_task(lambda: begun.set() or end.wait(10.0))
        assert begun.wait(10.0)
        stranger.publishers[topic].publish(msg)
        Timer(0.3, end.set).start()
        return result

    def plan_while_the_node_is_busy(*args):
        stranger.script.plans = plan_question
        return be_busy(plan_question(*args))

    def check_while_the_node_is_busy(*args):
        stranger.script.checks = violation_seen
        return be_busy(violation_seen(*args))

    def plan_while_the_wearer_moves(*args):
        # The second checker is asked only where the wearer has moved.
        stranger.script.plans = plan_question
        plan, body, moved = plan_question(*args), inputs.body.value, wearer()
        moved.markers[-1].pose.position.z -= 1e-4
        stranger.publishers['body_boxes'].publish(moved)
        wait_until(lambda: inputs.body.value is not body)
        return plan

    stranger.script.plans = plan_while_the_node_is_busy
    if is_checked:
        stranger.script.plans = plan_while_the_wearer_moves
        stranger.script.checks = check_while_the_node_is_busy
    response = stranger.answer()
    assert not response.success
    assert answer in response.message
    assert not stranger.received['joint_trajectory']


@pytest.mark.usefixtures('one_try')
@pytest.mark.parametrize('is_in_the_way', [True, False])
def test_a_body_that_comes_while_a_motion_is_checked_is_checked_too(
    start, wait_until, is_in_the_way
):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs, plan_question = inputs_of(planner), stranger.script.plans
    violation_seen, checked = stranger.script.checks, []

    def come(body):
        before = inputs.body.value
        stranger.publishers['body_boxes'].publish(body)
        wait_until(lambda: inputs.body.value is not before)

    def moved(by):
        body = wearer()
        body.markers[-1].pose.position.z -= by
        return body

    def plan_while_a_body_comes(*args, **kwargs):
        plan = plan_question(*args, **kwargs)
        come(moved(1e-4))
        return plan

    def check_while_a_body_comes(*args):
        found = violation_seen(*args)
        checked.append(args)
        come(fenced() if is_in_the_way else moved(2e-4))
        return found

    stranger.script.plans = plan_while_a_body_comes
    stranger.script.checks = check_while_a_body_comes
    message = stranger.answer().message
    # The proof alone decides about that one, and about those that follow.
    assert len(checked) == 1
    assert message.startswith('MOTION_PLAN_INVALIDATED' if is_in_the_way else 'SUCCESS')
    assert bool(stranger.received['joint_trajectory']) == (not is_in_the_way)


def test_no_message_is_processed_while_a_motion_is_published(start):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs, known, planned = inputs_of(planner), [], []

    def send_slowly(topic, msg, send):
        if topic == 'joint_trajectory':
            if not planned:
                body = inputs.body.value
                stranger.publishers['body_boxes'].publish(fenced())
                time.sleep(0.3)
                known.append(inputs.body.value is body)
            planned.append(msg)
        send(msg)

    stranger.script.sends = send_slowly
    assert stranger.answer().success
    assert known[0]
    # Then it is, and the monitor stops the arm. Of messages that quick only the last may arrive.
    motion, received = planned[0], stranger.received['joint_trajectory']
    stranger.wait_until(lambda: received and received[-1].points[-1] != motion.points[-1])


def test_both_checkers_are_asked_when_the_wearer_moved(start, wait_until, tmp_path):
    planner, stranger = start(incident_folder=str(tmp_path))
    say_all(planner, stranger)
    inputs, plan_motion = inputs_of(planner), stranger.script.plans
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

    stranger.script.plans = plan_while_a_box_comes
    stranger.script.checks = disagree
    message = stranger.answer().message
    assert message.startswith('FAILURE (99999): the two collision checks disagree: ray is 0.0100')
    assert not stranger.received['joint_trajectory']
    (file,) = tmp_path.glob('incident-*')
    incident = read_incident(file)
    # Planned for two boxes, checked for three.
    assert len(incident.question.scene.boxes) == 2
    assert [box.name for box in incident.present.boxes][-1] == 'far/0'
    assert stranger.answer().success
    assert len(asked) == 2


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


def test_a_node_that_cannot_read_all_that_came_publishes_no_motion(start, monkeypatch):
    monkeypatch.setattr(node_host, 'LONGEST_READING', 0.0)
    monkeypatch.setattr(node_host, 'SLICE', 0.0)
    planner, stranger = start()
    say_all(planner, stranger)
    plan_question = stranger.script.plans

    def plan_while_the_node_is_busy(*args, **kwargs):
        plan = plan_question(*args, **kwargs)
        begun, end = Event(), Event()
        planner.executor.create_task(lambda: begun.set() or end.wait(10.0))
        assert begun.wait(10.0)
        for topic in ('body_boxes', 'joint_states', 'target'):
            stranger.publishers[topic].publish(TOPICS[topic][1]())
        Timer(0.3, end.set).start()
        return plan

    stranger.script.plans = plan_while_the_node_is_busy
    message = stranger.answer().message
    assert message.startswith('SENSOR_INFO_STALE (-24): the node is busy')
    assert not stranger.received['joint_trajectory']
