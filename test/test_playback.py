# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The kinematic arm follows, brakes along its path, and takes only what fits."""

from itertools import pairwise

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
from rrth_planner.acceptance import accept, PlaybackRules
from rrth_planner.errors import MessageError, OptionsError
from rrth_planner.playback import Playback, standing, stop
from rrth_planner.resources import load_arm
from rrth_planner.trajectory import sample, Trajectory

ARM = load_arm()
FOLDED = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])
MAX_ACCELERATION = np.full(4, 4.0)
STILL = [0.0] * 4


def rules(**changes):
    """Return the default rules with changes."""
    given_rules = {
        'start_tolerance': 0.01,
        'time_scale': 1.0,
        'max_velocity': [1.5] * 4,
        'max_acceleration': [4.0] * 4,
    }
    return PlaybackRules(**(given_rules | changes))


def motion(*waypoints, duration):
    """Return a motion that rests at each waypoint, (dof,) [rad], after equal durations [s]."""
    still = np.zeros((len(waypoints), 4))
    return Trajectory(
        times=duration * np.arange(len(waypoints)),
        positions=waypoints,
        velocities=still,
        accelerations=still,
    )


def taken(playback, trajectory, time=0.0, **changes):
    """Return the playback after a motion that begins now."""
    return accept(playback, trajectory, ARM, rules(**changes), start_time=time, time=time)


def test_a_standing_arm_stands_still_at_any_time():
    q, v, a = standing(FOLDED).states_at([0.0, 1.0, 1e9])
    assert (q == FOLDED).all()
    assert not v.any()
    assert not a.any()


@pytest.mark.parametrize('scale', [1.0, 0.5, 0.1])
def test_a_motion_is_followed_exactly_and_slowed_down_by_the_time_scale(scale):
    move = motion(FOLDED, FOLDED - 0.4, duration=2.0)
    playback = taken(standing(FOLDED), move, 3.0, time_scale=scale)
    times = np.linspace(0.0, 2.0, 50)
    q, v, a = sample(move, times)
    played = playback.states_at(3.0 + times / scale)
    for one, other in zip(played, (q, v * scale, a * scale**2), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    assert playback.end_time == pytest.approx(3.0 + 2.0 / scale)


def test_a_motion_may_begin_later():
    playback = accept(
        standing(FOLDED),
        motion(FOLDED, FOLDED - 0.3, duration=1.0),
        ARM,
        rules(),
        start_time=5.0,
        time=2.0,
    )
    assert (playback.state_at(4.9)[0] == FOLDED).all()
    np.testing.assert_allclose(playback.state_at(6.0)[0], FOLDED - 0.3)


def test_a_motion_replaces_the_running_one_from_its_present_state():
    running = taken(standing(FOLDED), motion(FOLDED, FOLDED - 0.5, duration=2.0))
    q, v, a = running.state_at(0.8)
    turned = Trajectory(
        times=[0.0, 1.5],
        positions=[q, FOLDED],
        velocities=[v, STILL],
        accelerations=[a, STILL],
    )
    replaced = taken(running, turned, 0.8)
    for one, other in zip(replaced.state_at(0.8), (q, v, a), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    np.testing.assert_allclose(replaced.state_at(2.3)[0], FOLDED, atol=1e-12)


@pytest.mark.parametrize(
    ('move', 'words'),
    [
        (motion(FOLDED + 0.011, FOLDED - 0.3, duration=2.0), 'begins at position'),
        (
            Trajectory(
                times=[0.0, 2.0],
                positions=[FOLDED, FOLDED - 0.3],
                velocities=[[-0.2] * 4, STILL],
                accelerations=[STILL, STILL],
            ),
            'begins at velocity',
        ),
        (motion(FOLDED, FOLDED + [0.0, 0.4, 0.0, 0.0], duration=2.0), 'joint_2: position'),
        (
            # Both points are within the limits of joint 2, the curve between them is not.
            Trajectory(
                times=[0.0, 2.0, 4.0],
                positions=[FOLDED, FOLDED + [0.0, 0.34, 0.0, 0.0], FOLDED],
                velocities=[STILL, [0.0, 0.3, 0.0, 0.0], STILL],
                accelerations=[STILL] * 3,
            ),
            'joint_2: position',
        ),
        (motion(FOLDED, FOLDED + [2.0, 0.0, 0.0, 0.0], duration=2.0), 'joint_1: velocity'),
        (motion(FOLDED, FOLDED + [0.0, 0.0, 0.0, 0.5], duration=0.7), 'joint_4: acceleration'),
    ],
)
def test_a_motion_that_does_not_fit_is_refused(move, words):
    with pytest.raises(MessageError, match=words):
        taken(standing(FOLDED), move)


@pytest.mark.parametrize('size', [1e200, 1e306, 1e308])
def test_numbers_that_overflow_are_refused_without_a_warning(size, recwarn):
    move = Trajectory(
        times=[0.0, 1.0, 2.0],
        positions=[FOLDED, FOLDED, FOLDED],
        velocities=[STILL, [size, -size, size, 0.0], STILL],
        accelerations=[STILL, [-size] * 4, STILL],
    )
    with pytest.raises(MessageError) as refusal:
        taken(standing(FOLDED), move)
    assert len(str(refusal.value)) < 200
    assert not recwarn.list


def test_a_motion_that_ends_more_than_an_hour_ahead_is_refused():
    move = motion(FOLDED, FOLDED - 0.3, duration=10.0)
    accept(standing(FOLDED), move, ARM, rules(), start_time=3589.0, time=0.0)
    with pytest.raises(MessageError, match=r'ends in 3601 s, expected an end within 3600 s'):
        accept(standing(FOLDED), move, ARM, rules(), start_time=3591.0, time=0.0)


def test_slow_motion_is_held_to_limits_as_it_is_played():
    fast = motion(FOLDED, FOLDED + [2.0, 0.0, 0.0, 0.0], duration=2.0)
    assert taken(standing(FOLDED), fast, time_scale=0.5).end_time == pytest.approx(4.0)


@pytest.mark.parametrize(
    'bad',
    [
        {'time_scale': 0.0},
        {'time_scale': 1.1},
        {'start_tolerance': 0.0},
        {'start_tolerance': np.nan},
        {'max_velocity': [1.0, 0.0, 1.0, 1.0]},
        {'max_acceleration': [np.nan] * 4},
    ],
)
def test_rules_out_of_range_are_refused_by_name(bad):
    with pytest.raises(OptionsError, match=next(iter(bad))):
        rules(**bad)


@settings(max_examples=30, deadline=None)
@given(
    corners=st.lists(
        st.tuples(
            st.floats(-3.0, 3.0), st.floats(-3.0, 0.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)
        ),
        min_size=1,
        max_size=3,
    ),
    when=st.floats(0.0, 1.0),
    scale=st.sampled_from([1.0, 0.7, 0.2]),
)
def test_a_stop_keeps_to_path_and_limits_and_is_never_later_than_the_end(corners, when, scale):
    steps = [np.abs(np.subtract(b, a)).max() for a, b in pairwise([FOLDED, *corners])]
    duration = max(0.1, *(max(s * 1.875 / 1.5, np.sqrt(s * 5.774 / 4.0)) for s in steps))
    move = motion(FOLDED, *corners, duration=duration)
    playback = Playback(trajectory=move, start_time=1.0, time_scale=scale)
    time = 1.0 + when * move.duration / scale
    stopped = stop(playback, MAX_ACCELERATION, time)

    assert stopped.end_time <= playback.end_time + 1e-9
    np.testing.assert_array_equal(stopped.state_at(time)[0], playback.state_at(time)[0])
    instants = np.linspace(time, stopped.end_time + 0.1, 4001)
    q, v, a = stopped.states_at(instants)
    assert np.abs(a).max() <= 4.0 * (1.0 + 1e-3)
    assert np.abs(v).max() <= 1.5 * (1.0 + 1e-3)
    assert np.abs(v[-1]).max() < 1e-12
    # Velocities are those of the positions, accelerations those of the velocities.
    step = instants[1] - instants[0]
    np.testing.assert_allclose(np.diff(q, axis=0) / step, 0.5 * (v[1:] + v[:-1]), atol=5e-3)
    np.testing.assert_allclose(np.diff(v, axis=0) / step, 0.5 * (a[1:] + a[:-1]), atol=0.3)
    # Each position is between two neighbouring ones of the path.
    path = sample(move, np.linspace(0.0, move.duration, 4001))[0]
    gaps = np.abs(q[::200, None] - path[None]).max(axis=2).min(axis=1)
    assert gaps.max() <= 1.5 * move.duration / 4000


def test_a_stop_in_full_motion_takes_effect_soon():
    playback = Playback(
        trajectory=motion(FOLDED, FOLDED - [0.0, 2.4, 0.0, 0.0], duration=3.2),
        start_time=0.0,
        time_scale=1.0,
    )
    stopped = stop(playback, MAX_ACCELERATION, 1.0)
    assert stopped.end_time < 1.9
    assert stopped.state_at(10.0)[0][1] > FOLDED[1] - 1.6


def test_a_stop_at_rest_or_twice_changes_nothing():
    still = standing(FOLDED)
    assert stop(still, MAX_ACCELERATION, 4.0) is still
    running = taken(still, motion(FOLDED, FOLDED - 0.5, duration=2.0))
    once = stop(running, MAX_ACCELERATION, 0.9)
    assert stop(once, MAX_ACCELERATION, 1.0) is once
    assert stop(running, MAX_ACCELERATION, 2.1) is running


def test_a_stop_before_the_motion_begins_drops_it():
    waiting = Playback(
        trajectory=motion(FOLDED, FOLDED - 0.5, duration=2.0), start_time=5.0, time_scale=1.0
    )
    assert (stop(waiting, MAX_ACCELERATION, 4.0).state_at(9.0)[0] == FOLDED).all()
