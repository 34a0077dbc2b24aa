# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The planner's node where the arm moves, or was stopped: handovers, and plans after a stop."""

from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from monitored import know  # noqa: E402
from requests_alone import _alone  # noqa: E402, F401
from rrth_planner.execution.watch import Stop  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.model.arm import pointing_error  # noqa: E402
from rrth_planner.model.goal import PointingGoal  # noqa: E402
from rrth_planner.model.scene import Scene  # noqa: E402
from rrth_planner.model.status import PlanStatus  # noqa: E402
from rrth_planner.model.trajectory import Trajectory  # noqa: E402
from rrth_planner.pipeline.motion_plan import MotionPlan  # noqa: E402
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


def test_nothing_is_published_when_the_arm_begins_to_move(start, wait_until):
    planner, stranger = start()
    say_all(planner, stranger)
    source, plan_question = inputs_of(planner).joints, stranger.script.plans

    def plan_while_it_starts(*question):
        plan = plan_question(*question)
        stranger.publishers['joint_states'].publish(joints(velocity=[0.0, 0.3, 0.0, 0.0]))
        wait_until(lambda: source.value.velocities[1] == 0.3)
        return plan

    stranger.script.plans = plan_while_it_starts
    message = stranger.answer().message
    assert message.startswith('START_STATE_INVALID (-26): joint_2 moves at 0.300 rad/s')
    assert not stranger.received['joint_trajectory']


def stop_for(one, scene=None):
    """
    Have a stop of the arm, which was moving to the target, replanned; it is over.

    scene: the wearer that it was proven free of, if it was.
    """
    still = np.zeros((1, 4))
    over = Trajectory(times=[0.0], positions=[FOLDED], velocities=still, accelerations=still)
    watch = one.monitor.watch
    stop = Stop(over, one.goal, one.reporter.parameters, scene, True, watch.n_motions)
    know(one.monitor, stops=(*watch.stops, stop))
    # It is taken up.
    one.step()


MOVING = joints(velocity=[0.0, 0.3, 0.0, 0.0])


def test_after_a_stop_it_plans_again_from_where_the_arm_has_come_to_rest(alone):
    one = alone()
    one.read(MOVING)
    stop_for(one)
    # Time enough for a plan that does not wait for rest.
    one.run_for(0.2)
    assert not one.publishers.motions
    one.stream(joints([0.1, *FOLDED[1:]]))
    one.run_until(lambda: one.publishers.motions)
    ((motion, _),) = one.publishers.motions
    assert list(motion.positions[0]) == [0.1, *FOLDED[1:]]
    assert not motion.velocities[0].any()
    assert pointing_error(load_arm(), motion.positions[-1], one.goal.target) < 1e-6


@pytest.mark.parametrize('is_free', [True, False])
def test_from_a_stop_that_is_proven_free_it_plans_before_the_arm_rests_and_once_it_does(
    alone, is_free
):
    one, tried = alone(), []

    def plan_in_vain(question, _):
        tried.append(question.moving is not None)
        return MotionPlan(
            status=PlanStatus.SAMPLE_LIMIT, sentence='of the test', seed=0, planning_time=0.0
        )

    one.script.plans, one.script.checks = plan_in_vain, lambda *_: None
    one.read(MOVING)
    stop_for(one, Scene(()) if is_free else None)
    if is_free:
        one.run_until(lambda: tried)
    one.run_for(0.2)
    assert tried == [True] * is_free
    # The arm holds only where it rests.
    assert one.reporter.monitor_state[0] != 'holding'
    one.stream(joints([0.1, *FOLDED[1:]]))
    one.run_until(lambda: len(tried) > is_free)
    assert not tried[is_free]
    one.run_until(lambda: one.reporter.monitor_state[0] == 'holding')


def test_a_plan_from_before_a_stop_is_not_published(alone):
    one = alone(time_limit=0.3)
    plan_question = one.script.plans

    def plan_while_the_arm_is_stopped(*question):
        know(one.monitor, n_stops=one.monitor.watch.n_stops + 1)
        return plan_question(*question)

    one.script.plans = plan_while_the_arm_is_stopped
    assert one.answer().text.startswith(
        'MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE (-3): the arm was stopped while its motion'
    )
    assert not one.publishers.motions
    one.script.plans = plan_question
    assert one.answer().trajectory is not None


def test_a_request_from_before_an_error_moves_no_arm_after_it(alone):
    one = alone()
    plan_question = one.script.plans

    def plan_while_the_monitor_fails(*question):
        one.script.plans, watch = plan_question, one.monitor.watch
        # As `fail` of a motion in progress.
        known = {'n_stops': watch.n_stops + 1, 'n_faults': watch.n_faults + 1}
        know(one.monitor, **known, stop_reason='the monitor failed')
        return plan_question(*question)

    one.script.plans = plan_while_the_monitor_fails
    text = one.answer().text
    assert text.startswith('FAILURE (99999): an error while the motion was planned: the monit')
    assert not one.publishers.motions
    assert one.answer().trajectory is not None


def test_after_a_stop_it_plans_for_nothing_once_another_motion_has_begun(alone):
    one = alone()
    one.read(MOVING)
    stop_for(one)
    assert one.queue.pursues(one.goal)
    know(one.monitor, n_motions=one.monitor.watch.n_motions + 1)
    one.read(joints())
    one.run_until(lambda: not one.queue.pursues(one.goal))
    one.run_for(0.1)
    assert one.reporter.n_requests == 0


def test_a_request_does_not_wait_for_the_rest_of_an_arm_that_was_stopped(alone):
    one = alone()
    # No joint state comes that would show it at rest.
    stop_for(one)
    assert one.queue.pursues(one.goal)
    assert one.answer().trajectory is not None
    one.run_until(lambda: not one.queue.pursues(one.goal))
    assert one.reporter.n_requests == 1


def test_a_request_without_a_motion_leaves_the_plan_after_a_stop_to_be_made(alone):
    one = alone()
    stop_for(one)
    rejected = one.answer(PointingGoal(np.zeros(3)))
    assert rejected.trajectory is None
    assert not one.publishers.motions
    assert one.queue.pursues(one.goal)
    one.read(joints())
    one.run_until(lambda: one.publishers.motions)
    one.run_until(lambda: not one.queue.pursues(one.goal))


def test_where_it_cannot_replan_after_a_stop_it_holds_and_reports_why(alone):
    one = alone(max_samples=100)
    one.see(fenced())
    stop_for(one)
    one.read(joints())
    one.run_until(lambda: one.reporter.monitor_state[0] == 'holding')
    said = one.reporter.monitor_state[1]
    assert said.startswith('arm holds its position: PLANNING_FAILED (-1): ')
    assert not one.publishers.motions
