# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A motion at a rate that changes: the same path, within limits, from any state it can be in."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import sample
from rrth_planner.timing.parameterization import excess, limit_ratio, parameterize
from rrth_planner.timing.rate_profile import (
    continued,
    rate_state,
    RateProfile,
    scaled,
    steady,
    steered,
)
from sample_motions import path_distance, planned_motion
from worlds import examples, limits

SEEDS = st.integers(0, 2**32 - 1)
LIMITS = limits()
PERIOD = 1.0 / 120.0
# Pieces as short as this have jerks of rounding [s]; an arm is at rest at so small a rate [-].
SHORT, NO_RATE = 1e-4, 1e-6


def chain(rng, n_steps=60, is_steady=False):
    """
    Yield a motion, a profile, when another one replaces it, that one, and whether it is steered.

    As an executor does: targets change at random, mostly after some periods; where limits forbid
    a change the profile goes on.
    """
    motion = planned_motion(rng)
    profile, target = steady(0.0, float(rng.choice([0.0, 1.0, rng.random()]))), 1.0
    for _ in range(n_steps):
        time = PERIOD if is_steady or rng.random() < 0.8 else float(rng.uniform(0.0, 0.3))
        state = rate_state(profile, time)
        if state[0] >= motion.duration - 1e-6:
            return
        if rng.random() < 0.25:
            # At times nearly the present one.
            near = min(max(state[1] + 1e-4 * rng.standard_normal(), 0.0), 1.0)
            target = float(rng.choice([0.0, 1.0, rng.random(), near]))
        found = steered(motion, state, target, LIMITS)
        after = continued(profile, time) if found is None else found
        yield motion, profile, time, after, target if found is not None else None
        profile = after


def states_of(profile, times):
    """Return times within the motion, rates and their derivatives, (n,) each."""
    return np.array([rate_state(profile, time) for time in times]).T


@examples(40)
@given(seed=SEEDS)
def test_every_profile_stays_on_the_path_and_within_limits_and_ends_at_rest(seed):
    for motion, _, _, profile, _ in chain(np.random.default_rng(seed)):
        found = scaled(motion, profile)
        if len(found.times) == 1:
            continue
        if np.diff(found.times).min() > SHORT:
            assert excess(found, LIMITS) <= 1.01
            assert limit_ratio(found, LIMITS) <= 1.003
        tau, rate, _ = states_of(profile, found.times)
        tau = np.minimum(tau, motion.duration)
        q, v, _ = sample(motion, tau)
        np.testing.assert_allclose(found.positions, q, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(
            found.velocities[:-1], (v * rate[:, None])[:-1], rtol=0.0, atol=1e-9
        )
        assert not found.velocities[-1].any()
        assert not found.accelerations[-1].any()
        assert (np.diff(tau) >= -1e-9).all()
        final = rate_state(profile, profile.change_time)[1]
        if final > NO_RATE or tau[-1] >= motion.duration - 1e-9:
            assert tau[-1] == pytest.approx(motion.duration, abs=2e-9)
            np.testing.assert_allclose(found.positions[-1], motion.positions[-1], atol=1e-9)
        else:
            # It comes to rest on its way.
            assert found.duration == pytest.approx(profile.change_time, abs=2e-9)
            assert tau[-1] <= motion.duration


@examples(40)
@given(seed=SEEDS)
def test_between_its_points_a_motion_is_on_the_path(seed):
    rng = np.random.default_rng(seed)
    for motion, _, _, profile, _ in chain(rng, 12):
        found = scaled(motion, profile)
        times = np.append(rng.uniform(0.0, found.duration, 30), found.duration)
        q, _, _ = sample(found, times)
        end = min(motion.duration, rate_state(profile, found.duration)[0] + 1e-6)
        near = np.abs(q - sample(motion, np.minimum(states_of(profile, times)[0], end))[0])
        if near.max() > 1e-6:
            assert path_distance(q, motion, profile.begin, end).max() < 1e-5


def test_a_phase_that_is_shorter_than_points_may_be_close_does_no_harm():
    # The rate fades to its last value within 40 microseconds, and the next point is far.
    motion = parameterize(Path([[0.0] * 4, [2.5, -0.5, 0.3, 0.8]]), (), LIMITS)
    jerk, lasts = 26.0, (1.3e-3, 0.0, 4e-5)
    phases, jerks = [], (-jerk, 0.0, jerk)
    tau, rate, slope = 0.6, 0.7, jerk * (lasts[0] - lasts[2])
    for span, j in zip(lasts, jerks, strict=True):
        phases.append([span, tau, rate, slope, j])
        tau += span * (rate + span * (0.5 * slope + span * j / 6.0))
        rate, slope = rate + span * (slope + 0.5 * span * j), slope + span * j
    assert slope == pytest.approx(0.0, abs=1e-12)
    phases = np.array(phases)
    profile = RateProfile(phases)
    found = scaled(motion, profile)
    times = np.linspace(0.0, found.duration, 500)
    tau, rate, _ = states_of(profile, times)
    q, v, _ = sample(motion, np.minimum(tau, motion.duration))
    got = sample(found, times)
    np.testing.assert_allclose(got[0], q, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(got[1], v * rate[:, None], rtol=0.0, atol=1e-7)


@examples(80)
@given(seed=SEEDS)
def test_where_one_profile_replaces_another_the_motion_is_continuous(seed):
    for motion, before, time, after, _ in chain(np.random.default_rng(seed), 30):
        one, other = scaled(motion, before), scaled(motion, after)
        if len(one.times) == 1 or len(other.times) == 1 or time >= one.duration:
            continue
        gaps = [
            np.abs(a[0] - b[0]).max()
            for a, b in zip(sample(one, [time]), other.states, strict=True)
        ]
        # Points closer than 50 microseconds are left out, and with them a jump of the jerk.
        assert gaps[0] <= 1e-7
        assert gaps[1] <= 1e-5
        assert gaps[2] <= 5e-3


@examples(40)
@given(seed=SEEDS)
def test_the_rate_is_never_beyond_what_it_leads_from_and_to(seed):
    for _, before, time, after, target in chain(np.random.default_rng(seed)):
        times = np.linspace(0.0, after.change_time + 0.1, 60)
        tau, rate, slope = states_of(after, times)
        assert rate.min() >= -NO_RATE
        assert rate.max() <= 1.0 + NO_RATE
        # Each is the derivative of the one before.
        h = 1e-6
        ahead, behind = states_of(after, times + h), states_of(after, np.maximum(times - h, 0.0))
        width = times + h - np.maximum(times - h, 0.0)
        np.testing.assert_allclose((ahead[0] - behind[0]) / width, rate, atol=2e-4)
        np.testing.assert_allclose((ahead[1] - behind[1]) / width, slope, atol=5e-3)
        np.testing.assert_allclose(
            rate_state(after, 0.0), rate_state(before, time), rtol=0.0, atol=1e-12
        )
        if target is not None:
            last = rate_state(after, after.change_time + 1.0)
            # A change that small is none.
            assert last[1] == pytest.approx(target, abs=1e-3)
            assert last[2] == 0.0


def test_an_arm_at_rest_may_always_stay_at_rest():
    rng = np.random.default_rng(11)
    for _ in range(20):
        motion = planned_motion(rng)
        for time in rng.uniform(0.0, 0.9, 5) * motion.duration:
            found = steered(motion, np.array([time, 0.0, 0.0]), 0.0, LIMITS)
            assert found is not None
            assert len(scaled(motion, found).times) == 1


@examples(60)
@given(seed=SEEDS)
def test_a_steered_rate_goes_straight_to_its_target(seed):
    for motion, before, time, _, _ in chain(np.random.default_rng(seed), 12):
        state = rate_state(before, time)
        for target in (0.0, 0.4, 1.0):
            found = steered(motion, state, target, LIMITS)
            if found is None:
                continue
            _, rate, slope = states_of(found, np.linspace(0.0, found.change_time, 80))
            # Besides what the derivative carries on with at first it changes in one direction.
            sign = np.sign(slope[np.abs(slope) > 1e-6])
            assert (np.diff(sign) != 0).sum() <= 1
            carried = state[1] + np.sign(state[2]) * np.abs(rate - state[1]).max()
            low, high = min(state[1], target, carried), max(state[1], target, carried)
            assert low - 1e-9 <= rate.min()
            assert rate.max() <= high + 1e-9


def test_the_rate_of_an_arm_that_moves_at_a_steady_one_changes_at_once():
    rng, n_faster, n = np.random.default_rng(8), 0, 0
    for _ in range(60):
        motion = planned_motion(rng)
        for time in rng.uniform(0.05, 0.9, 5) * motion.duration:
            rate = float(rng.uniform(0.3, 0.7))
            state = np.array([time, rate, 0.0])
            same = steered(motion, state, rate, LIMITS)
            assert same.change_time < 1e-9
            np.testing.assert_array_equal(same.phases[0, 1:4], state)
            slower, faster = (
                steered(motion, state, rate + change, LIMITS) for change in (-0.2, 0.2)
            )
            n += 1
            n_faster += faster is not None and slower is not None
            for found in (slower, faster):
                # As fast as acceleration and jerk permit where the motion is slowest.
                assert found is None or found.change_time < 0.8
    assert n_faster > 0.8 * n


def test_from_rest_anywhere_some_rate_is_reached():
    rng = np.random.default_rng(9)
    for _ in range(40):
        motion = planned_motion(rng)
        for time in (0.0, *rng.uniform(0.0, 0.99, 8) * motion.duration):
            found = [steered(motion, np.array([time, 0.0, 0.0]), r, LIMITS) for r in (1.0, 0.5)]
            assert found[0] is not None or found[1] is not None


@examples(40)
@given(seed=SEEDS)
def test_a_target_of_nothing_comes_to_rest_on_the_way(seed):
    rng, motion = np.random.default_rng(seed), None
    motion = planned_motion(rng)
    time = rng.uniform(0.0, 0.5) * motion.duration
    state = np.array([time, rng.uniform(0.2, 1.0), 0.0])
    profile = steered(motion, state, 0.0, LIMITS)
    if profile is None:
        return
    reached = rate_state(profile, profile.change_time)
    assert abs(reached[1]) < 1e-9
    found = scaled(motion, profile)
    np.testing.assert_allclose(rate_state(profile, 9.0), [reached[0], 0.0, 0.0], atol=1e-7)
    if reached[0] < motion.duration:
        assert found.duration == pytest.approx(profile.change_time, abs=2e-9)
        np.testing.assert_allclose(
            found.positions[-1], sample(motion, [reached[0]])[0][0], rtol=0.0, atol=1e-12
        )
    assert len(scaled(motion, continued(profile, profile.change_time + 0.1)).times) == 1


@examples(25)
@given(seed=SEEDS)
def test_what_is_left_of_a_profile_is_the_same_from_there_on(seed):
    rng = np.random.default_rng(seed)
    for motion, _, _, profile, _ in chain(rng, 10):
        for time in (0.0, profile.change_time, *rng.uniform(0.0, profile.change_time + 0.2, 3)):
            rest = continued(profile, time)
            assert rest.begin == pytest.approx(rate_state(profile, time)[0], abs=1e-12)
            assert rest.change_time == pytest.approx(
                max(0.0, profile.change_time - time), abs=1e-12
            )
            for later in rng.uniform(0.0, 0.5, 5):
                np.testing.assert_allclose(
                    rate_state(rest, later), rate_state(profile, time + later), atol=1e-9
                )
            if rest.begin >= motion.duration:
                continue
            whole, part = scaled(motion, profile), scaled(motion, rest)
            assert part.duration == pytest.approx(max(0.0, whole.duration - time), abs=4e-9)


def test_at_a_steady_rate_a_motion_takes_as_much_longer():
    rng = np.random.default_rng(10)
    for _ in range(20):
        motion = planned_motion(rng)
        for rate in (1.0, 0.5, 0.1):
            found = scaled(motion, steady(0.0, rate))
            assert found.duration == pytest.approx(motion.duration / rate, abs=2e-9)
            times = rng.uniform(0.0, motion.duration, 40)
            exact = sample(motion, times)
            for got, expected, power in zip(
                sample(found, times / rate), exact, (0, 1, 2), strict=True
            ):
                np.testing.assert_allclose(
                    got, expected * rate**power, rtol=0.0, atol=(1e-9, 1e-6, 2e-2)[power]
                )
