# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The planner's node where the arm moves, or was stopped: handovers, and plans after a stop."""

from itertools import pairwise
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from monitored import know  # noqa: E402
from nav_msgs.srv import GetPlan  # noqa: E402
from rrth_planner.execution.watch import Stop  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.model.arm import pointing_error  # noqa: E402
from rrth_planner.model.scene import Scene  # noqa: E402
from rrth_planner.model.status import ErrorCode  # noqa: E402
from rrth_planner.model.trajectory import Trajectory  # noqa: E402
from rrth_planner.pipeline import in_process_planner  # noqa: E402
from rrth_planner.requests import request_queue  # noqa: E402
from rrth_planner.requests.outcome import Outcome  # noqa: E402
from samples import fenced, FOLDED, joints  # noqa: E402
from stranger import _one_try, _start, inputs_of, say_all  # noqa: E402, F401

pytestmark = pytest.mark.usefixtures('ros_context')


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


def stop_for(planner, scene=None):
    """
    Have a stop of the arm, which was moving to the target, replanned; it is over.

    scene: the wearer that it was proven free of, if it was.
    """
    goal, parameters = inputs_of(planner).target.value, planner._reporter.parameters
    still = np.zeros((1, 4))
    over = Trajectory(times=[0.0], positions=[FOLDED], velocities=still, accelerations=still)
    monitor = planner._monitor
    stop = Stop(over, goal, parameters, scene, True, monitor.watch.n_motions)
    # In the thread that also decides.
    planner.executor.create_task(know, monitor, stops=(*monitor.watch.stops, stop))


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
    tried = []

    async def plan_in_vain(*_):
        tried.append(bool(inputs_of(planner).joints.value.velocities.any()))
        return Outcome(ErrorCode.PLANNING_FAILED, 'of the test')

    monkeypatch.setattr(request_queue, 'plan_request', plan_in_vain)
    monkeypatch.setattr(planner._planner, 'violation_seen', lambda *_: None)
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
        know(planner._monitor, n_stops=planner._monitor.watch.n_stops + 1)
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
            known = {'n_stops': monitor.watch.n_stops + 1, 'n_faults': monitor.watch.n_faults + 1}
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
    know(planner._monitor, n_motions=planner._monitor.watch.n_motions + 1)
    stranger.publishers['joint_states'].publish(joints())
    stranger.wait_until(lambda: not planner._queue._open)
    assert planner._reporter.n_requests == 0
    assert not planner._queue._open


def test_a_request_does_not_wait_for_the_rest_of_an_arm_that_was_stopped(start, monkeypatch):
    monkeypatch.setattr(request_queue, 'LONGEST_SETTLING', 300.0)
    planner, stranger = start()
    say_all(planner, stranger)
    # No joint state comes that would show it at rest.
    stop_for(planner)
    assert stranger.answer().success
    # It is reported once it has been answered.
    stranger.wait_until(lambda: planner._reporter.n_requests == 1)
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
