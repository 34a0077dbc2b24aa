# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Stops along the path hold every limit at every instant, whatever the motion is."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.execution.playback import Playback, stop
from rrth_planner.model.errors import RrthError
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import jerks_at, MotionLimits, sample, Trajectory
from rrth_planner.timing.parameterization import parameterize
from rrth_planner.timing.proven_stop import holds
from rrth_planner.timing.running import Running
from rrth_planner.timing.time_law import RateProfile
from sample_motions import any_motion, planned_motion
from worlds import examples, limits

SEEDS = st.integers(0, 2**32 - 1)
LIMITS = limits()


def allowed(playback, begin, end):
    """Return limits, or what the motion does between two of its times if more, (3, dof)."""
    grid = playback.trajectory.times
    inner = grid[(grid > begin) & (grid < end)]
    phases = np.union1d(np.linspace(begin, end, 4001), np.concatenate([inner, inner - 1e-12]))
    _, v, a = sample(playback.trajectory, phases)
    own = (v, a, jerks_at(playback.trajectory, phases))
    base = (LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk)
    return np.array(
        [
            np.maximum(limit, np.abs(values).max(axis=0) * playback.time_scale**k)
            for k, (limit, values) in enumerate(zip(base, own, strict=True), start=1)
        ]
    )


@examples(400)
@given(seed=SEEDS)
def test_a_stop_of_any_motion_holds_every_limit(seed):
    rng = np.random.default_rng(seed)
    trajectory, scale = any_motion(rng), float(rng.choice([1.0, 0.7, 0.1]))
    playback = Playback(trajectory=trajectory, start_time=2.0, time_scale=scale)
    time = 2.0 + rng.random() * trajectory.duration / scale
    stopped = stop(playback, LIMITS, time)
    for before, after in zip(playback.state_at(time), stopped.state_at(time), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-12, atol=1e-12)
    assert stopped.end_time <= playback.end_time + 1e-9

    times = np.linspace(time, stopped.end_time + 0.01, 5000)
    q, v, a = stopped.states_at(times)
    step = times[1] - times[0]
    phases, rates, _ = stopped.phase(times)
    assert (rates >= -1e-12).all()
    most = allowed(playback, phases[0], min(phases[-1], trajectory.duration)) * (1.0 + 1e-5)
    assert (np.abs(v) <= most[0] + 1e-9).all()
    assert (np.abs(a) <= most[1] + 1e-9).all()
    # Between samples too: none of them changes faster than the next one allows.
    assert (np.abs(np.diff(q, axis=0)) <= most[0] * step + 1e-9).all()
    assert (np.abs(np.diff(v, axis=0)) <= most[1] * step + 1e-9).all()
    assert (np.abs(np.diff(a, axis=0)) <= most[2] * step + 1e-7).all()
    # Velocities are those of the positions, accelerations those of the velocities.
    np.testing.assert_allclose(
        np.diff(q, axis=0) / step, 0.5 * (v[1:] + v[:-1]), atol=most[2].max() * step**2 + 1e-7
    )
    np.testing.assert_allclose(
        np.diff(v, axis=0) / step, 0.5 * (a[1:] + a[:-1]), atol=most[2].max() * step + 1e-7
    )
    assert not v[-1].any()
    assert not a[-1].any()
    # The path: each state is the motion's at its phase, up to where it stands still.
    phases = np.minimum(phases, stopped.trajectory.duration)
    np.testing.assert_allclose(q, sample(trajectory, phases)[0], rtol=0.0, atol=1e-12)
    again = stop(stopped, LIMITS, 0.5 * (time + stopped.end_time))
    assert again.end_time <= stopped.end_time
    assert stopped.brake is None or again is stopped


@pytest.mark.parametrize('at', [0.3, 0.8, 1.3])
def test_a_stop_on_a_line_takes_hardly_longer_than_the_least_time(at):
    q = np.array([[0.0] * 4, [0.0, 2.4, 0.0, 0.0]])
    playback = Playback(
        trajectory=parameterize(Path(q), (), LIMITS), start_time=0.0, time_scale=1.0
    )
    _, v, a = (x[1] for x in playback.state_at(at))
    peak = min(4.0, np.sqrt(40.0 * v + 0.5 * a * a))
    least = (a + peak) / 40.0 + peak / 40.0 + max(0.0, (v + a * a / 80.0 - peak**2 / 40.0) / peak)
    assert stop(playback, LIMITS, at).end_time - at <= 1.06 * least


def test_a_stop_saves_time_in_most_motions():
    rng = np.random.default_rng(7)
    kept = []
    for _ in range(60):
        trajectory = planned_motion(rng)
        if trajectory.duration < 1.0:
            continue
        playback = Playback(trajectory=trajectory, start_time=0.0, time_scale=1.0)
        time = 0.3 * trajectory.duration
        kept.append((stop(playback, LIMITS, time).end_time - time) / (0.7 * trajectory.duration))
    assert np.median(kept) < 0.6


@pytest.mark.parametrize(
    ('stretch', 'is_held'),
    # Within all limits; jerk alone is too great; acceleration too.
    [(0.5, True), (0.14, False), (0.1, False)],
)
def test_what_breaks_a_limit_is_not_proven(stretch, is_held):
    slow = MotionLimits(velocity=np.full(4, 0.4), acceleration=np.full(4, 4.0), jerk=LIMITS.jerk)
    trajectory = parameterize(Path([[0.0] * 4, [2.0, 0.0, 0.0, 0.0]]), (), slow)
    running = Running(trajectory=trajectory, phase=1.0, scale=1.0)
    profile = RateProfile(
        times=stretch * np.array([0.0, 0.5, 1.0, 2.0]),
        bends=np.array([[-2.4, 0.0], [0.0, -2.4], [2.4, 0.0]]) / stretch**2,
    )
    assert holds(running, profile, LIMITS) is is_held


def test_a_motion_of_dense_points_is_stopped_as_one_of_few():
    few = parameterize(Path([[0.0] * 4, [2.0, -1.0, 0.5, 0.0]]), (), LIMITS)
    times = np.append(np.arange(0.0, few.duration, 0.004), few.duration)
    q, v, a = sample(few, times)
    dense = Trajectory(times=times, positions=q, velocities=v, accelerations=a)
    ends = [
        stop(Playback(trajectory=t, start_time=0.0, time_scale=1.0), LIMITS, 0.7).end_time
        for t in (few, dense)
    ]
    assert ends[1] == pytest.approx(ends[0], rel=0.1)


@pytest.mark.parametrize(
    ('times', 'bends'),
    [
        ([0.0], np.empty((0, 2))),
        ([0.0, 1.0, 1.0], [[-2.0, -2.0], [2.0, 2.0]]),
        ([0.0, 1.0, 2.0], [[-0.5, -0.5], [0.5, 0.5]]),
        ([0.0, 1.0], [[-2.0, -2.0]]),
        ([0.0, 1.0, 2.0], [[-1.0, np.nan], [1.0, 1.0]]),
        ([0.1, 1.0, 2.1], [[-1.0, -1.0], [1.0, 1.0]]),
        ([0.0, 1.0, 2.0], [[-1.0, -1.0]]),
    ],
)
def test_a_rate_that_does_not_end_is_refused(times, bends):
    with pytest.raises(RrthError, match='expected'):
        RateProfile(times=times, bends=bends)


def test_a_rate_is_the_integral_of_its_bend():
    # With a jump of the bend.
    profile = RateProfile(times=[0.0, 0.5, 1.0, 2.0], bends=[[-2.4, 0.0], [0.0, -2.4], [2.4, 0.0]])
    times = np.linspace(-0.5, 2.5, 30001)
    way, rate, slope, bend = profile.at(times)
    step = times[1] - times[0]
    for upper, lower in ((way, rate), (rate, slope), (slope, bend)):
        middle = 0.5 * (lower[1:] + lower[:-1])
        is_smooth = np.abs(np.diff(bend)) < 0.01
        np.testing.assert_allclose(
            (np.diff(upper) / step)[is_smooth], middle[is_smooth], atol=1e-6
        )
    assert profile.is_forward
    assert (rate[times <= 0.0] == 1.0).all()
    assert (rate[times >= 2.0] == 0.0).all()
    assert way[times >= 2.0].max() == way[times >= 2.0].min() == profile.ways[-1]
    np.testing.assert_allclose(profile.times_of(profile.at(np.array([0.3, 1.7]))[0]), [0.3, 1.7])
    assert len(profile.times_of(np.array([-1.0, 0.0, profile.ways[-1], 9.0]))) == 0
