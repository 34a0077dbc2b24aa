# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the arm rests has one definition: whoever asks hears the same of a reading."""

from dataclasses import replace
import math

from decisions import ARM, BEGIN, turn
import numpy as np
import pytest
from rrth_planner.execution.commitments import Commitments, ExecutionRules, note_rest
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.tracked_motion import check_command, GRACE, is_over, TrackedMotion

RULES = ExecutionRules(None, 0.0, False)
MOTION = ExecutingMotion(trajectory=turn(), start_time=BEGIN)
# Long after the end of the motion, far from it [s].
NOW = BEGIN + 1.5 + 2.0 * GRACE
ASIDE = MOTION.trajectory.positions[-1] + 0.5


def reading_of(speed, given=0.0, **changes):
    """Return a reading of joints that go on at a speed, velocities as given [rad/s]."""
    times = NOW + np.linspace(-0.3, 0.0, 31)
    positions = ASIDE + speed * (times - NOW)[:, None]
    reading = JointReading(
        positions[-1], np.full(ARM.dof, given), NOW, NOW, math.inf, (times, positions)
    )
    return replace(reading, **changes)


def answers(reading):
    """Return what each of those says who ask whether the arm rests."""
    tracked = TrackedMotion(motion=MOTION, command=MOTION)
    known, _ = note_rest(Commitments(), reading, MOTION, RULES)
    return {
        not reading.is_moving(NOW),
        reading.rests_after(NOW),
        is_over(tracked, reading, NOW),
        check_command(tracked, reading, NOW, NOW).off_since is not None,
        known.rest is not None,
    }


@pytest.mark.parametrize('rest_speed', [0.01, 0.05])
@pytest.mark.parametrize('speed', [0.0, 0.009, -0.02, 0.049, 0.06])
def test_a_reading_rests_by_the_speed_that_it_was_made_with(speed, rest_speed):
    assert answers(reading_of(speed, rest_speed=rest_speed)) == {abs(speed) <= rest_speed}


def test_velocities_count_where_the_positions_do_not_change_until_they_expire():
    assert answers(reading_of(0.0, 0.1)) == {False}
    assert answers(reading_of(0.0, math.nan)) == {False}
    assert answers(reading_of(0.02, math.nan)) == {False}
    # Differentiated ones, as drivers have them, do not where it does.
    assert answers(reading_of(0.005, math.nan)) == {True}
    assert answers(reading_of(0.0, 0.1, velocities_expire=NOW - 0.1)) == {True}
    assert answers(reading_of(0.06, velocities_expire=NOW - 0.1)) == {True}


def test_an_earlier_reading_says_nothing_of_the_rest_after_a_stop():
    reading = reading_of(0.0)
    assert reading.rests_after(NOW - 1e-3)
    assert not reading.rests_after(NOW + 1e-3)


def test_another_speed_is_named():
    reading = reading_of(0.005)
    assert reading.is_moving(NOW, 1e-3)
    assert not reading.is_moving(NOW)
    assert not reading.is_moving(NOW, 0.1)
