# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The kinematic arm executes motions, stops along its path, and accepts only what fits."""

from contextlib import redirect_stdout
from io import StringIO
import json
import os
import pathlib
import subprocess
import sys

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.execution.playback import accept, Playback, PlaybackRules, standing, stop
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.errors import MessageError, OptionsError
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import part_of, sample, Trajectory
from rrth_planner.timing.fast_stop import fast_stop
from rrth_planner.timing.parameterization import parameterize, peaks
from sample_motions import any_motion, path_distance
from worlds import examples, limits

ARM = load_arm()
FOLDED = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])
LIMITS = limits()
STILL = [0.0] * 4


def rules(**changes):
    """Return the default rules with changes."""
    given_rules = {'start_tolerance': 0.01, 'time_scale': 1.0, 'limits': LIMITS}
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


def states_at(playback, times):
    """Return positions, velocities and accelerations at some times [s], each (m, dof)."""
    return [np.array(rows) for rows in zip(*map(playback.state_at, times), strict=True)]


def test_a_standing_arm_stands_still_at_any_time():
    q, v, a = states_at(standing(FOLDED), [0.0, 1.0, 1e9])
    assert (q == FOLDED).all()
    assert not v.any()
    assert not a.any()


@pytest.mark.parametrize('scale', [1.0, 0.5, 0.1])
def test_a_motion_is_executed_exactly_and_slowed_down_by_the_time_scale(scale):
    move = motion(FOLDED, FOLDED - 0.4, duration=2.0)
    playback = taken(standing(FOLDED), move, 3.0, time_scale=scale)
    times = np.linspace(0.0, 2.0, 50)
    q, v, a = sample(move, times)
    played = states_at(playback, 3.0 + times / scale)
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
    replaced = taken(running, turn_from(running.state_at(0.8), FOLDED, 1.5), 0.8)
    for one, other in zip(replaced.state_at(0.8), running.state_at(0.8), strict=True):
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
        # Exceeded by so little, and so shortly, that no 64 samples of the piece show it: 1.0101
        # times the velocity at 1.0 s, 1.0102 times the acceleration 0.4226 s from either end.
        (motion(FOLDED, FOLDED + [1.61616, 0.0, 0.0, 0.0], duration=2.0), 'joint_1: velocity 1.5'),
        (
            motion(FOLDED, FOLDED - [0.0, 0.0, 0.0, 0.69997], duration=1.0),
            'joint_4: acceleration -4.0|joint_4: acceleration 4.0',
        ),
    ],
)
def test_a_motion_that_does_not_fit_is_rejected(move, words):
    with pytest.raises(MessageError, match=words):
        taken(standing(FOLDED), move)


# joint_2 beyond its upper limit, which is 0 rad.
BEYOND = FOLDED + [0.0, 0.36, 0.0, 0.0]


@pytest.mark.parametrize('by', [1e-5, 0.01, 0.05])
@pytest.mark.parametrize(('joint', 'side'), [(1, 1.0), (1, -1.0), (3, 1.0)])
def test_a_joint_that_begins_a_little_beyond_its_limit_may_move_towards_it(by, joint, side):
    q = FOLDED.copy()
    q[joint] = ARM.bounds[int(side > 0.0), joint] + side * by
    there = q.copy()
    there[joint] -= side * 0.3
    playback = taken(standing(q), motion(q, there, duration=2.0))
    np.testing.assert_allclose(playback.state_at(2.0)[0], there, atol=1e-12)
    # It may rest there, and stop before it is within its limits.
    stopped = stop(playback, LIMITS, 0.1)
    assert (stopped.state_at(1.0)[0] != there).any()
    taken(standing(q), motion(q, duration=1.0))


@pytest.mark.parametrize(
    ('move', 'words'),
    [
        (motion(BEYOND, BEYOND + [0.0, 0.01, 0.0, 0.0], duration=1.0), 'joint_2: position 0.02'),
        (
            motion(BEYOND, FOLDED, BEYOND - [0.0, 0.005, 0.0, 0.0], duration=1.0),
            'joint_2: the motion begins beyond a limit, at 0.01, and moves not only towards it',
        ),
        (
            motion(BEYOND, BEYOND - [0.0, 0.006, 0.0, 0.0], BEYOND, FOLDED, duration=1.0),
            'joint_2: the motion begins beyond a limit',
        ),
        (
            motion(BEYOND + [0.0, 0.041, 0.0, 0.0], FOLDED, duration=1.0),
            r'joint_2: position 0.051 at 0 s, expected -3.14159 to 1e-06 \[rad\]',
        ),
        # The other joints stay within theirs.
        (motion(BEYOND, FOLDED + [0.0, 0.0, 1.58, 0.0], duration=3.0), 'joint_3: position'),
    ],
)
def test_beyond_its_limit_a_joint_moves_nowhere_else(move, words):
    with pytest.raises(MessageError, match=words):
        taken(standing(move.positions[0]), move)


@pytest.mark.parametrize('size', [1e200, 1e306, 1e308])
def test_numbers_that_overflow_are_rejected_without_a_warning(size, recwarn):
    move = Trajectory(
        times=[0.0, 1.0, 2.0],
        positions=[FOLDED, FOLDED, FOLDED],
        velocities=[STILL, [size, -size, size, 0.0], STILL],
        accelerations=[STILL, [-size] * 4, STILL],
    )
    with pytest.raises(MessageError) as rejection:
        taken(standing(FOLDED), move)
    assert len(str(rejection.value)) < 200
    assert not recwarn.list


def test_a_motion_that_ends_more_than_an_hour_ahead_is_rejected():
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
        {'start_tolerance': np.inf},
        {'time_scale': np.nan},
    ],
)
def test_rules_out_of_range_are_rejected_by_name(bad):
    with pytest.raises(OptionsError, match=next(iter(bad))):
        rules(**bad)


def test_a_stop_in_full_motion_takes_effect_soon():
    playback = Playback(
        trajectory=motion(FOLDED, FOLDED - [0.0, 2.4, 0.0, 0.0], duration=3.2),
        start_time=0.0,
        time_scale=1.0,
    )
    stopped = stop(playback, LIMITS, 1.0)
    assert stopped.end_time < 1.9
    assert stopped.state_at(10.0)[0][1] > FOLDED[1] - 1.6


@examples(200)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_stop_of_any_motion_at_any_pace_stays_on_its_path_and_holds_limits(seed):
    rng = np.random.default_rng(seed)
    trajectory, scale = any_motion(rng), float(rng.choice([1.0, 0.7, 0.1]))
    playback = Playback(trajectory=trajectory, start_time=2.0, time_scale=scale)
    time = 2.0 + rng.random() * trajectory.duration / scale
    stopped = stop(playback, LIMITS, time)
    for before, after in zip(playback.state_at(time), stopped.state_at(time), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-9, atol=1e-9)
    assert stopped.end_time <= playback.end_time + 1e-8
    # The state at a time is that of the trajectory, at the time that has passed by its pace.
    times = np.linspace(time, stopped.end_time, 200)
    q, v, a = sample(stopped.trajectory, stopped.time_scale * (times - stopped.start_time))
    v, a = v * stopped.time_scale, a * stopped.time_scale**2
    for rows, states in zip((q, v, a), states_at(stopped, times[::40]), strict=True):
        np.testing.assert_array_equal(rows[::40], states)
    phase = (time - 2.0) * scale
    assert path_distance(q, trajectory, phase, trajectory.duration).max() <= 1.001e-4
    # By the clock, what the motion itself does included.
    rest = part_of(trajectory, phase, trajectory.duration)
    if len(rest.times) > 1:
        own = [peak * scale**k for k, peak in enumerate(peaks(rest), start=1)]
        for values, limit, most in zip(
            (v, a), (LIMITS.velocity, LIMITS.acceleration), own, strict=False
        ):
            assert (np.abs(values) <= 1.01 * np.maximum(limit, most) + 1e-9).all()
    last = stopped.state_at(stopped.end_time + 1.0)
    assert not last[1].any()
    assert not last[2].any()


STOP = """
import json
from rrth_planner.execution.playback import Playback, stop
from rrth_planner.model.trajectory import Trajectory
from worlds import limits
rest = [0.0] * 4
move = Trajectory(
    times=[0.0, 2.0], positions=[rest, [1.0, 0.5, 0.2, 0.0]],
    velocities=[rest, rest], accelerations=[rest, rest],
)
stopped = stop(Playback(trajectory=move, start_time=0.0, time_scale=0.7), limits(), 1.1).trajectory
print(json.dumps([stopped.times.tolist(), stopped.positions.tolist()]))
"""


def test_a_stop_needs_no_compiler(capfd):
    with redirect_stdout(StringIO()) as written:
        exec(STOP, {})
    assert not capfd.readouterr().err
    root = pathlib.Path(__file__).parents[2]
    paths = os.pathsep.join([str(root), str(root / 'test'), os.environ.get('PYTHONPATH', '')])
    done = subprocess.run(
        [sys.executable, '-c', STOP],
        env={**os.environ, 'PYTHONPATH': paths, 'NUMBA_DISABLE_JIT': '1'},
        capture_output=True,
        text=True,
        check=True,
    )
    assert not done.stderr
    compiled, plain = json.loads(written.getvalue()), json.loads(done.stdout)
    for one, other in zip(compiled, plain, strict=True):
        np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-9)


def test_a_stop_at_rest_or_twice_changes_nothing():
    still = standing(FOLDED)
    assert stop(still, LIMITS, 4.0) is still
    running = taken(still, motion(FOLDED, FOLDED - 0.5, duration=2.0))
    once = stop(running, LIMITS, 0.9)
    assert stop(once, LIMITS, 1.0) is once
    assert stop(running, LIMITS, 2.1) is running


def test_a_stop_before_the_motion_begins_drops_it():
    waiting = Playback(
        trajectory=motion(FOLDED, FOLDED - 0.5, duration=2.0), start_time=5.0, time_scale=1.0
    )
    assert (stop(waiting, LIMITS, 4.0).state_at(9.0)[0] == FOLDED).all()


def test_limits_hold_between_any_samples_and_jerk_is_the_planners_choice():
    # The velocity's bulge of 1.5e-5 above the limit lasts 4 ms of 2 s.
    top = 1.5 * 1.01 * 2.0 / 1.875
    for size, is_taken in ((top * (1 - 1e-6), True), (top * (1 + 1e-6), False)):
        move = motion(FOLDED, FOLDED - [size, 0.0, 0.0, 0.0], duration=2.0)
        if is_taken:
            taken(standing(FOLDED), move)
        else:
            with pytest.raises(MessageError, match='joint_1: velocity -1.515'):
                taken(standing(FOLDED), move)
    # Up to 0.3 rad/s^2 within 1 ms: 300 rad/s^3.
    q, v = FOLDED + 0.3 * 1e-6 / 6.0, np.full(4, 0.3 * 1e-3 / 2.0)
    jerky = Trajectory(
        times=[0.0, 1e-3, 2.0],
        positions=[FOLDED, q, FOLDED],
        velocities=[STILL, v, STILL],
        accelerations=[STILL, [0.3] * 4, STILL],
    )
    assert taken(standing(FOLDED), jerky).end_time == 2.0


def test_a_single_point_is_held_if_the_arm_is_there():
    assert taken(standing(FOLDED), motion(FOLDED, duration=1.0)).state_at(9.0)[0] is not None
    with pytest.raises(MessageError, match='begins at position'):
        taken(standing(FOLDED), motion(FOLDED - 0.1, duration=1.0))


def turn_from(state, q_goal, duration):
    """Return a motion from a moving state to rest."""
    q, v, a = state
    return Trajectory(
        times=[0.0, duration],
        positions=[q, q_goal],
        velocities=[v, STILL],
        accelerations=[a, STILL],
    )


@pytest.mark.parametrize(
    ('off', 'words'),
    [
        ((0.009, 0.0), None),
        ((0.0, 0.009), None),
        ((0.011, 0.0), 'begins at position'),
        ((0.0, 0.011), 'begins at velocity'),
    ],
)
def test_in_mid_motion_only_a_motion_from_the_present_state_is_accepted(off, words):
    running = taken(standing(FOLDED), motion(FOLDED, FOLDED - 0.5, duration=2.0))
    q, v, a = running.state_at(0.8)
    turned = turn_from((q + off[0], v + off[1], a), FOLDED, 2.5)
    if words is None:
        assert taken(running, turned, 0.8).trajectory is turned
        return
    with pytest.raises(MessageError, match=words):
        taken(running, turned, 0.8)
    # What was rejected is nowhere: the running motion is a value of its own.
    assert (running.state_at(2.0)[0] == FOLDED - 0.5).all()


def test_in_slow_motion_a_motion_from_the_present_state_is_as_slow_as_the_one_it_replaces():
    running = taken(standing(FOLDED), motion(FOLDED, FOLDED - 0.5, duration=2.0), time_scale=0.5)
    q, v, a = running.state_at(1.6)
    # The new motion is scaled too, so it is to be given as it would be at full rate.
    turned = turn_from((q, v / 0.5, a / 0.25), FOLDED, 2.5)
    replaced = taken(running, turned, 1.6, time_scale=0.5)
    for one, other in zip(replaced.state_at(1.6), (q, v, a), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    with pytest.raises(MessageError, match='begins at velocity'):
        taken(running, turn_from((q, v, a), FOLDED, 2.5), 1.6, time_scale=0.5)


@pytest.mark.parametrize(('before', 'after'), [(0.5, 1.0), (1.0, 0.5), (0.2, 0.7)])
def test_a_stop_is_taken_at_the_pace_of_the_motion_whatever_the_time_scale_is_by_then(
    before, after
):
    move = motion(FOLDED, FOLDED - 0.8, duration=2.0)
    running = taken(standing(FOLDED), move, time_scale=before)
    phase = 0.9
    stopping = fast_stop(move, phase, LIMITS)
    now = phase / before
    stopped = taken(running, stopping, now, time_scale=after)
    assert stopped.time_scale == before
    for one, other in zip(stopped.state_at(now), running.state_at(now), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)
    assert np.abs(stopped.state_at(stopped.end_time)[1]).max() < 1e-12
    # From rest on it counts.
    later = stopped.end_time + 1.0
    q = stopped.state_at(later)[0]
    back = taken(stopped, motion(q, FOLDED, duration=2.0), later, time_scale=after)
    assert back.end_time == pytest.approx(later + 2.0 / after)


def test_a_stopping_arm_accepts_a_motion_from_its_present_state():
    running = taken(standing(FOLDED), motion(FOLDED, FOLDED - 1.0, duration=2.5))
    stopped = stop(running, LIMITS, 1.0)
    replaced = taken(stopped, turn_from(stopped.state_at(1.1), FOLDED, 2.5), 1.1)
    for one, other in zip(replaced.state_at(1.1), stopped.state_at(1.1), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    again = stop(replaced, LIMITS, 1.6)
    assert again.end_time < replaced.end_time


def test_an_hour_of_motions_replaced_stopped_and_scaled_does_not_drift():
    rng, now, n_motions, n_stops, n_turns = np.random.default_rng(5), 0.0, 0, 0, 0
    playback = standing(FOLDED)
    low, high = ARM.bounds + np.array([[0.3], [-0.3]])
    while now < 3600.0:
        q, v, a = playback.state_at(now)
        assert not v.any()
        q_goal = np.clip(q + rng.uniform(-1.5, 1.5, 4), low, high)
        move = parameterize(Path(np.stack([q, q_goal])), (), LIMITS)
        scale = float(rng.choice([1.0, 1.0, 0.5]))
        playback = taken(playback, move, now, time_scale=scale)
        n_motions += 1
        kind = rng.integers(0, 4)
        at = now + rng.uniform(0.2, 0.8) * (playback.end_time - now)
        if kind == 0:
            before = playback.state_at(at)
            playback = stop(playback, LIMITS, at)
            for one, other in zip(playback.state_at(at), before, strict=True):
                np.testing.assert_allclose(one, other, atol=1e-9)
            n_stops += 1
        elif kind == 1:
            state = playback.state_at(at)
            turned = turn_from(state, q, 6.0)
            try:
                playback = taken(playback, turned, at)
            except MessageError:
                # It swings out of the bounds: the running motion continues.
                pass
            else:
                n_turns += 1
        # Each state lies on the motion, at the time that has passed.
        times = np.sort(rng.uniform(playback.start_time, playback.end_time, 4))
        passed = playback.time_scale * (times - playback.start_time)
        expected = sample(playback.trajectory, passed)[0]
        np.testing.assert_allclose(states_at(playback, times)[0], expected, atol=1e-9)
        now = playback.end_time + rng.uniform(0.01, 0.5)
        q_end, v_end, a_end = playback.state_at(now)
        assert not v_end.any()
        assert not a_end.any()
        np.testing.assert_allclose(q_end, playback.trajectory.positions[-1], atol=1e-9)
    assert n_motions > 1000
    assert min(n_stops, n_turns) > 100


def test_until_the_handover_the_arm_continues_its_motion():
    running = taken(standing(FOLDED), motion(FOLDED, FOLDED - 0.5, duration=2.0))
    back = turn_from(running.state_at(0.8), FOLDED, 1.5)
    accepted = accept(running, back, ARM, rules(), start_time=0.8, time=0.6)
    times = np.linspace(0.6, 0.79, 20)
    for one, other in zip(states_at(accepted, times), states_at(running, times), strict=True):
        np.testing.assert_array_equal(one, other)
    times = np.linspace(0.8, 2.3, 20)
    for one, other in zip(states_at(accepted, times), sample(back, times - 0.8), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    # Where the arm will be counts, not where it is.
    with pytest.raises(MessageError, match='the motion begins at position'):
        accept(running, back, ARM, rules(), start_time=0.75, time=0.6)


def test_a_motion_that_has_not_begun_never_does_when_another_comes():
    running = taken(standing(FOLDED), motion(FOLDED, FOLDED - 0.5, duration=2.0))
    accepted = running
    for start in (1.9, 1.95, 1.8):
        q, v, a = running.state_at(start)
        held = turn_from((q, v, a), q + 0.2 * v, 0.5)
        accepted = accept(accepted, held, ARM, rules(), start_time=start, time=1.0)
        assert accepted.before is running
        np.testing.assert_array_equal(accepted.state_at(1.5)[0], running.state_at(1.5)[0])
        np.testing.assert_allclose(accepted.state_at(start + 0.5)[0], q + 0.2 * v)
    # From one that has begun there is a handover, too.
    stay = turn_from(accepted.state_at(2.0), accepted.state_at(2.0)[0], 1.0)
    last = accept(accepted, stay, ARM, rules(), start_time=2.0, time=1.95)
    assert last.before.trajectory is accepted.trajectory
    assert last.before.before is None


def test_a_stop_before_the_handover_stops_the_running_motion():
    running = taken(standing(FOLDED), motion(FOLDED, FOLDED - 0.5, duration=2.0))
    back = turn_from(running.state_at(1.2), FOLDED, 1.5)
    accepted = accept(running, back, ARM, rules(), start_time=1.2, time=0.8)
    times = np.linspace(0.9, 3.0, 40)
    expected = states_at(stop(running, LIMITS, 0.9), times)
    stopped = stop(accepted, LIMITS, 0.9)
    for one, other in zip(states_at(stopped, times), expected, strict=True):
        np.testing.assert_array_equal(one, other)
