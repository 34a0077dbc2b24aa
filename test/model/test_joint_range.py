# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where joints may be at the start, on the way and at a goal; what leads them in."""

from dataclasses import replace

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.io.arm_file import arm_from_mapping, arm_to_mapping
from rrth_planner.model.errors import ModelError
from rrth_planner.model.joint_range import (
    bounds_from,
    goal_bounds,
    joints_beyond,
    not_led_in,
    start_bounds,
)
from rrth_planner.model.trajectory import sample, Trajectory
from worlds import examples, table_1_arm, table_1_mapping

ARM = table_1_arm()
HIGH = 0.0  # of joint_2 [rad]


def mixed_arm():
    """Return an arm whose joints turn, slide, turn without a stop, and hardly move."""
    data = table_1_mapping()
    data['joints'][1] |= {'type': 'prismatic', 'lower': 0.0, 'upper': 0.2}
    data['joints'][2]['type'] = 'continuous'
    data['joints'][3] |= {'lower': 1.0, 'upper': 1.008}
    return arm_from_mapping(data)


def test_goals_keep_inside_the_limits_and_starts_may_be_a_little_outside():
    arm = mixed_arm()
    low, high = arm.bounds
    np.testing.assert_allclose(goal_bounds(arm)[0] - low, [0.005, 0.0005, 0.005, 0.002])
    np.testing.assert_allclose(high - goal_bounds(arm)[1], [0.005, 0.0005, 0.005, 0.002])
    np.testing.assert_allclose(low - start_bounds(arm)[0], [0.05, 0.005, 2.0 * np.pi, 0.05])
    np.testing.assert_allclose(start_bounds(arm)[1] - high, [0.05, 0.005, 2.0 * np.pi, 0.05])
    q = np.array([low[0] - 0.05, 0.204, high[2] + 6.0, 1.1])
    expected = np.array([[q[0], *low[1:]], [high[0], 0.204, q[2], high[3]]])
    np.testing.assert_array_equal(bounds_from(arm, q), expected)
    assert joints_beyond(arm, q).tolist() == [0, 1, 2, 3]
    assert joints_beyond(arm, np.clip(q, low - 1e-7, high + 1e-7)).tolist() == []


def test_a_file_says_how_often_a_continuous_joint_may_turn():
    row = {
        'name': 'joint_3',
        'type': 'continuous',
        'alpha': 1.0,
        'a': 0.0,
        'offset': 0.0,
        'd': 0.1,
    }
    data = table_1_mapping()
    for given_turns, n_turns in (({}, 3.0), ({'max_turns': 0.5}, 0.5), ({'max_turns': 1.7}, 1.7)):
        data['joints'][2] = row | given_turns
        arm = arm_from_mapping(data)
        assert arm.bounds[:, 2].tolist() == [-n_turns * 2.0 * np.pi, n_turns * 2.0 * np.pi]
        written = arm_to_mapping(arm, 'arm')['joints'][2]
        assert written['max_turns'] == n_turns and 'lower' not in written
    data['joints'][2] = row | {'lower': -1.0, 'upper': 2.0}
    arm = arm_from_mapping(data)
    assert arm.bounds[:, 2].tolist() == [-1.0, 2.0]
    assert arm_to_mapping(arm, 'arm')['joints'][2]['upper'] == 2.0
    for wrong in (0, -1.0, 2000, 'many'):
        data['joints'][2] = row | {'max_turns': wrong}
        with pytest.raises(ModelError, match='"joint_3": max_turns: .*, expected a number'):
            arm_from_mapping(data)
    for both in ({'lower': -1.0, 'upper': 2.0, 'max_turns': 1.0}, {'lower': -1.0}):
        data['joints'][2] = row | both
        with pytest.raises(ModelError, match='expected'):
            arm_from_mapping(data)


def test_which_joints_are_continuous_is_kept_in_a_file_and_must_fit_the_arm():
    arm = mixed_arm()
    assert arm.is_continuous == (False, False, True, False)
    assert arm_from_mapping(arm_to_mapping(arm, 'mixed')).is_continuous == arm.is_continuous
    assert table_1_arm().is_continuous == (False,) * 4
    for wrong in ((True,), (False, True, False, False)):
        with pytest.raises(ModelError, match='is_continuous: .*, expected 4 values, True for rev'):
            replace(arm, is_continuous=wrong)


def motion(*places, times=None, velocities=None):
    """Return a motion of joint_2 through some places, at rest in each of them by default."""
    q = np.tile([0.0, 0.0, 1.0, 1.0], (len(places), 1))
    q[:, 1] = places
    v = np.zeros_like(q)
    v[:, 1] = 0.0 if velocities is None else velocities
    times = np.arange(float(len(places))) if times is None else times
    return Trajectory(times, q, v, np.zeros_like(q))


@pytest.mark.parametrize(
    'good',
    [
        motion(0.05, -0.4),
        motion(0.05),
        motion(0.05, 0.05),
        motion(0.05, 0.03, 0.03, 0.01),
        motion(0.04, -1.0, -2e-9, -1.0),
        motion(-0.5, -1.0),
        motion(1e-5, -0.3),
        # Back again within the limits, before the piece that led it in ends.
        motion(0.01, -0.1, velocities=[-0.3, 0.3]),
    ],
)
def test_a_joint_that_moves_towards_its_limit_only_is_led_in(good):
    assert not_led_in(ARM, good) is None


@pytest.mark.parametrize(
    'bad',
    [
        motion(0.02, 0.03, -0.4),
        motion(0.03, 0.01, 0.02, -0.4),
        motion(0.03, -0.2, 0.01),
        motion(0.02, -0.3, velocities=[0.1, 0.0]),
        # Out again, and back before the piece ends.
        motion(0.02, -0.02, times=[0.0, 1.0], velocities=[-0.2, -0.4]),
        # By less than the points say.
        motion(0.03, 0.02, velocities=[0.0, 0.1]),
    ],
)
def test_a_joint_that_moves_out_again_is_not_led_in(bad):
    assert not_led_in(ARM, bad) == 1


@examples(400)
@given(seed=st.integers(0, 2**32 - 1))
def test_what_counts_as_led_in_is_so_at_any_instant(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    places = HIGH + np.sort(rng.uniform(-0.05, 0.04, n))[::-1]
    places[0] = HIGH + rng.uniform(2e-6, 0.05)
    moved = motion(*places, velocities=rng.choice([0.0, 1.0]) * rng.uniform(-0.1, 0.02, n))
    q, v, _ = (row[:, 1] for row in sample(moved, np.linspace(0.0, moved.duration, 4000)))
    inside = np.flatnonzero(q <= HIGH)
    first = inside[0] if len(inside) > 0 else len(q)
    # How far it moves out before, and where it is after.
    rise = np.maximum(np.diff(q[:first]), 0.0).sum()
    after = q[first:].max(initial=HIGH) - HIGH
    if not_led_in(ARM, moved) is None:
        assert max(rise, after) <= 1e-5
    else:
        assert max(v[:first].max(), after) > -1e-4
