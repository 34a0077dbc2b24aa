# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A message continues what is commanded, from before its publication until controllers have it."""

from dataclasses import replace

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.execution.command import (
    ahead,
    BEFORE,
    begin_of,
    continues,
    lead_in,
    led,
    rest_at,
    stop_along,
)
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.model.errors import RrthError
from rrth_planner.model.trajectory import part_of, sample, Trajectory
from sample_motions import planned_motion
from worlds import examples, limits

SEEDS, SHARES = st.integers(0, 2**32 - 1), st.floats(0.05, 0.95)


def states(trajectory, times):
    """Return positions, velocities and accelerations at some times, (3, n, dof)."""
    return np.array(sample(trajectory, times))


@examples(60)
@given(SEEDS, SHARES, st.floats(0.0, 0.2))
def test_a_motion_that_is_led_in_is_the_one_before_and_then_itself(seed, share, long):
    motion = planned_motion(np.random.default_rng(seed))
    at = share * motion.duration
    rest = part_of(motion, at, motion.duration)
    lead = lead_in(motion, at - long, at)
    whole = led(lead, ExecutingMotion(trajectory=rest, start_time=50.0, escape_time=0.0))
    begin = max(at - long, 0.0)
    assert whole.start_time == pytest.approx(50.0 - (at - begin), abs=1e-12)
    times = np.linspace(0.0, whole.trajectory.duration, 200)
    found, expected = states(whole.trajectory, times), states(motion, begin + times)
    # A point that is too near to where they meet is left out.
    assert np.abs(found - expected)[0].max() < 1e-9
    assert np.abs(found - expected)[1].max() < 1e-6


def test_after_its_end_a_motion_rests_where_it_ended():
    motion = planned_motion(np.random.default_rng(3))
    for begin, end in ((-0.1, 0.2), (0.05, 0.3), (0.2, 0.5)):
        lead = lead_in(motion, motion.duration + begin, motion.duration + end)
        assert lead.duration == pytest.approx(end - begin, abs=1e-12)
        q, v, a = states(lead, [lead.duration])
        assert np.abs(q[0] - motion.positions[-1]).max() == 0.0
        assert not v.any() and not a.any()


def test_a_rest_is_followed_by_its_motion_as_it_is():
    motion = planned_motion(np.random.default_rng(4))
    planned = ExecutingMotion(trajectory=motion, start_time=10.0, escape_time=0.25)
    whole = led(rest_at(motion, 0.03), planned)
    np.testing.assert_array_equal(whole.trajectory.positions[1:], motion.positions)
    assert whole.start_time == pytest.approx(9.97)
    # It escapes as long as before, by the clock.
    assert whole.start_time + whole.escape_time == pytest.approx(10.25)
    assert led(rest_at(motion, 0.0), planned).trajectory.duration == motion.duration


@pytest.mark.parametrize(('what', 'by'), [('positions', 1e-4), ('velocities', 1e-2)])
def test_what_does_not_continue_the_command_is_rejected_with_how_far_it_is(what, by):
    motion = planned_motion(np.random.default_rng(5))
    at = 0.4 * motion.duration
    rest, lead = part_of(motion, at, motion.duration), lead_in(motion, at - 0.02, at)
    moved = replace(rest, **{what: getattr(rest, what) + by})
    assert continues(lead, rest) and not continues(lead, moved)
    with pytest.raises(RrthError, match='the motion begins .* from what is commanded then'):
        led(lead, ExecutingMotion(trajectory=moved, start_time=0.0))


@examples(60)
@given(SEEDS, SHARES, st.floats(0.0, 0.15))
def test_a_stop_leaves_its_motion_once_every_controller_has_it(seed, share, delay):
    motion = planned_motion(np.random.default_rng(seed))
    running, now = ExecutingMotion(trajectory=motion, start_time=100.0), 0.0
    now = 100.0 + share * motion.duration
    stop = stop_along(running, now - 100.0, now, limits(), delay)
    assert stop.start_time == pytest.approx(max(begin_of(now, delay), 100.0), abs=1e-9)
    # Whenever it arrives within the delay, it commands what the motion does.
    times = np.linspace(stop.start_time, now + ahead(delay), 50)
    found = states(stop.trajectory, times - stop.start_time)[0]
    # At a rest in the last hundredth of a second it ends.
    assert np.abs(found - states(motion, times - 100.0)[0]).max() < 1e-5
    assert not stop.trajectory.velocities[-1].any()
    # One that is executed on reception begins with what is commanded now.
    stop = stop_along(running, now - 100.0, now, limits(), delay, is_on_reception=True)
    assert stop.start_time == now
    first = states(motion, [now - 100.0])[0, 0]
    assert np.abs(stop.trajectory.positions[0] - first).max() < 1e-9


def test_a_message_begins_before_the_greatest_delay_of_its_controller():
    assert begin_of(10.0, 0.03) == pytest.approx(10.0 - 0.03 - BEFORE)
    assert ahead(0.03) > 0.03


@examples(40)
@given(SEEDS, SHARES, st.floats(0.0, 0.1), st.sampled_from([1.0, 0.5]))
def test_an_arm_that_lags_follows_its_motion_and_one_that_is_slow_does_not(seed, share, lag, rate):
    motion = planned_motion(np.random.default_rng(seed))
    running, taken = ExecutingMotion(trajectory=motion, start_time=0.0), share * motion.duration
    q, v, _ = states(motion, [taken - lag])[:, 0]
    speed = float(np.linalg.norm(v))
    follows = running.follows(q, rate * v, taken, lag)
    if rate == 1.0:
        assert follows
    elif speed > 0.6:
        assert not follows
    assert running.deviation(q, taken, lag) < 4e-3
    assert not running.follows(q + 0.2, v, taken, lag) or motion.duration < 0.3


def test_an_arm_without_velocities_follows_by_its_positions():
    still = np.zeros((2, 4))
    motion = Trajectory([0.0, 1.0], [np.zeros(4), np.full(4, 0.8)], still, still)
    running = ExecutingMotion(trajectory=motion, start_time=0.0)
    q, _, _ = states(motion, [0.5])[:, 0]
    assert running.follows(q, np.zeros(4), 0.5, 0.01)
    assert running.follows(q, np.full(4, np.nan), 0.5, 0.01)
