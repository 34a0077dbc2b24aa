# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm of a page stops before the wearer as the node has it, and says when to plan again."""

import numpy as np
import pytest
from rrth_planner.collision.reference_checker import bars, first_contact
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.remaining_motion import is_remaining_free
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import positions_at
from rrth_planner.visualization.viewer.shown_arm import ShownArm
from worlds import limits, MARGIN, random_motion, RAY, table_1_arm, wearer

ARM, GOAL = table_1_arm(), PointingGoal(np.ones(3))
REQUIRED = RequiredClearance(ARM, MARGIN, RAY)
START, FRAME = 10.0, 1.0 / 30.0
# Of a hand [m/s].
SPEED = 1.5


@pytest.fixture(name='motion', scope='module')
def _motion():
    """Return a motion that is free of the wearer and moves the tool by more than 0.4 m."""
    rng = np.random.default_rng(3)
    while True:
        found = random_motion(rng)
        if found is not None:
            moved = tool_at(found, found.duration) - tool_at(found, 0.0)
            if np.linalg.norm(moved) > 0.4:
                return ExecutingMotion(trajectory=found, start_time=START)


def with_box_at(place):
    """Return the wearer with a small box more."""
    return Scene((*wearer().boxes, Box('hand', place, np.full(3, 0.1), np.eye(3))))


def tool_at(trajectory, time):
    """Return where the tool is at a time of a motion, (3,) [m]."""
    return bars(ARM, positions_at(trajectory, [time]), 0.0)[0, -1, 0]


def resting(motion):
    """Return an arm at the beginning of a motion, without a target, beside the wearer."""
    q = motion.trajectory.positions[0]
    arm = ShownArm(REQUIRED, q, limits())
    arm.see(wearer(), START)
    return arm


def moving(motion):
    """Return an arm that has begun a motion."""
    arm = resting(motion)
    assert arm.begin(motion, GOAL)
    return arm


def watched(arm, scene, begin, end):
    """Have the arm see a wearer, frame by frame, from one time to another [s]; give each."""
    for time in np.arange(begin, end, FRAME):
        arm.see(scene, time)
        yield time


def test_an_arm_without_a_target_needs_a_motion_and_executes_one_that_is_free(motion):
    arm = resting(motion)
    assert arm.needs_motion
    assert arm.begin(motion, GOAL)
    end = START + motion.trajectory.duration
    for time in watched(arm, wearer(), START, end):
        assert not arm.needs_motion
        expected = positions_at(motion.trajectory, [time - START])[0]
        np.testing.assert_allclose(arm.positions_at(time), expected, atol=1e-12)
    # There it stays.
    for time in watched(arm, wearer(), end, end + 2.0):
        assert not arm.needs_motion
        np.testing.assert_array_equal(arm.positions_at(time), motion.trajectory.positions[-1])


def test_a_motion_that_is_no_longer_free_is_not_begun(motion):
    arm = resting(motion)
    blocked = with_box_at(tool_at(motion.trajectory, 0.7 * motion.trajectory.duration))
    arm.see(blocked, START)
    assert not arm.begin(motion, GOAL)
    assert arm.needs_motion


def test_it_stops_before_a_box_in_its_way_and_then_needs_a_motion(motion):
    duration = motion.trajectory.duration
    blocked = with_box_at(tool_at(motion.trajectory, duration))
    arm = moving(motion)
    appears = START + 0.1 * duration
    for _ in watched(arm, wearer(), START, appears):
        pass
    arm.see(blocked, appears)
    assert not arm.needs_motion
    end = arm.end_time
    assert end < START + duration
    times = np.linspace(appears, end + 1.0, 200)
    q = np.array([arm.positions_at(time) for time in times])
    assert first_contact(ARM, blocked, q, 0.0, 0.0) is None
    assert np.ptp(q[times > end], axis=0).max() == 0.0
    arm.see(blocked, end)
    assert arm.needs_motion
    # It asks even where the box is gone: the arm is not at its target.
    arm.see(wearer(), end)
    assert arm.needs_motion


def stops_too_soon(motion, away):
    """Return whether the arm stops for a hand from a side before that is in its way."""
    # It comes as soon as the arm does to where that is half-way.
    half = 0.5 * motion.trajectory.duration
    place, arm = tool_at(motion.trajectory, half), moving(motion)
    for time in np.arange(START, START + half, FRAME):
        scene = with_box_at(place + SPEED * (half - time + START) * away)
        arm.see(scene, time)
        if arm.end_time < START + motion.trajectory.duration:
            return is_remaining_free(motion, time - START, REQUIRED, scene)
    return False


def test_an_arm_stops_before_a_hand_that_is_only_about_to_get_into_its_way(motion):
    sides = np.concatenate([np.eye(3), -np.eye(3)])
    assert any(stops_too_soon(motion, away) for away in sides)


def test_an_arm_at_its_target_needs_a_motion_once_it_is_in_the_way(motion):
    arm = moving(motion)
    end = START + motion.trajectory.duration
    for _ in watched(arm, wearer(), START, end + 5.0):
        pass
    assert not arm.needs_motion
    arm.see(with_box_at(tool_at(motion.trajectory, motion.trajectory.duration)), end + 5.0)
    assert arm.needs_motion


def test_another_target_stops_the_arm_and_needs_a_motion(motion):
    arm = moving(motion)
    half = START + 0.5 * motion.trajectory.duration
    for _ in watched(arm, wearer(), START, half):
        pass
    arm.see(wearer(), half)
    arm.retarget()
    assert half < arm.end_time < START + motion.trajectory.duration
    assert not arm.needs_motion
    arm.see(wearer(), arm.end_time)
    assert arm.needs_motion
    at_rest = resting(motion)
    at_rest.retarget()
    assert at_rest.needs_motion


def test_a_box_that_is_far_away_changes_nothing(motion):
    arm = moving(motion)
    arm.see(with_box_at(np.array([0.0, 0.0, -5.0])), START + 0.1)
    assert arm.end_time == START + motion.trajectory.duration
