# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm beside a wearer who moves stops before him, and says when it needs another motion."""

import numpy as np
import pytest
from rrth_planner.collision.reference_checker import bars, first_contact
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.monitored_arm import arm_at_rest, monitored, retargeted, started
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import positions_at
from worlds import limits, MARGIN, random_motion, RAY, table_1_arm, wearer

ARM = table_1_arm()
START = 10.0


@pytest.fixture(scope='module')
def motion():
    """Return a motion that is free of the wearer and moves the tool by more than 0.4 m."""
    rng = np.random.default_rng(3)
    while True:
        found = random_motion(rng)
        if found is not None:
            moved = tool_at(found, found.duration) - tool_at(found, 0.0)
            if np.linalg.norm(moved) > 0.4:
                return ExecutingMotion(trajectory=found, start_time=START)


def resting(motion):
    """Return an arm at the beginning of a motion, without a target."""
    q = motion.trajectory.positions[0]
    return arm_at_rest(RequiredClearance(ARM, MARGIN, RAY), q, limits())


def with_box_at(place):
    """Return the wearer with a small box more."""
    box = Box('hand', place, np.full(3, 0.1), np.eye(3))
    return Scene((*wearer().boxes, box))


def tool_at(trajectory, time):
    """Return where the tool is at a time of a motion, (3,) [m]."""
    return bars(ARM, positions_at(trajectory, [time]), 0.0)[0, -1, 0]


def test_an_arm_without_a_target_needs_a_motion_and_takes_one_that_is_free(motion):
    arm = resting(motion)
    assert arm.needs_motion(wearer(), START)
    arm = started(arm, motion, wearer(), START)
    for time in START + np.linspace(0.0, motion.trajectory.duration, 20):
        arm = monitored(arm, wearer(), time)
        assert not arm.needs_motion(wearer(), time)
        expected = positions_at(motion.trajectory, [time - START])[0]
        np.testing.assert_allclose(arm.positions_at(time), expected, atol=1e-12)
    assert arm.is_at_rest(time)


def test_a_motion_that_is_no_longer_free_is_not_begun(motion):
    arm = resting(motion)
    blocked = with_box_at(tool_at(motion.trajectory, 0.7 * motion.trajectory.duration))
    assert started(arm, motion, blocked, START) is arm


def test_it_stops_before_a_box_in_its_way_and_then_needs_a_motion(motion):
    duration = motion.trajectory.duration
    blocked = with_box_at(tool_at(motion.trajectory, duration))
    arm = started(resting(motion), motion, wearer(), START)
    appears = START + 0.1 * duration
    arm = monitored(arm, blocked, appears)
    assert arm.playback.is_stopping
    assert not arm.needs_motion(blocked, appears)
    end = arm.playback.end_time
    assert end < START + duration
    times = np.linspace(appears, end + 1.0, 200)
    q = np.array([arm.positions_at(time) for time in times])
    assert first_contact(ARM, blocked, q, 0.0, 0.0) is None
    assert np.ptp(q[times > end], axis=0).max() == 0.0
    assert arm.needs_motion(blocked, end)
    # It asks even where the box is gone: the arm is not at its target.
    assert arm.needs_motion(wearer(), end)


def test_an_arm_at_its_target_needs_a_motion_once_it_is_in_the_way(motion):
    arm = started(resting(motion), motion, wearer(), START)
    end = arm.playback.end_time
    assert not arm.needs_motion(wearer(), end + 5.0)
    assert arm.needs_motion(
        with_box_at(tool_at(motion.trajectory, motion.trajectory.duration)), end + 5.0
    )


def test_another_target_stops_the_arm_and_needs_a_motion(motion):
    arm = started(resting(motion), motion, wearer(), START)
    half = START + 0.5 * motion.trajectory.duration
    arm = retargeted(arm, half)
    assert arm.playback.is_stopping
    arm = monitored(arm, wearer(), half)
    assert arm.needs_motion(wearer(), arm.playback.end_time)
    at_rest = retargeted(resting(motion), START)
    assert at_rest.needs_motion(wearer(), START)


def test_a_box_that_is_far_away_changes_nothing(motion):
    arm = started(resting(motion), motion, wearer(), START)
    far = with_box_at(np.array([0.0, 0.0, -5.0]))
    assert monitored(arm, far, START + 0.1) is arm
