# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A stop that is found at once is a motion like any other, and as soon as the proven one."""

from dataclasses import replace

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.execution.command import led, rest_at
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.kernels.trajectory.fast_stop import first_rest, first_window
from rrth_planner.kernels.trajectory.lookahead import look_ahead, MOST, S, TIME, time_after
from rrth_planner.kernels.trajectory.stop_search import keeps_limits, line_stop, stop_s
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import (
    MotionLimits,
    piece_coefficients,
    positions_at,
    sample,
    Trajectory,
)
from rrth_planner.timing.braking import brake
from rrth_planner.timing.corner_blends import Blend
from rrth_planner.timing.fast_stop import fast_stop, LATENCY
from rrth_planner.timing.parameterization import limit_ratio, parameterize
from sample_motions import any_motion, foreign_motion, jerks_at, path_distance, planned_motion
from worlds import examples, limits

SEEDS = st.integers(0, 2**32 - 1)
LIMITS = limits()


def table(bounds):
    """Return the rows of limits that kernels take, (3, dof)."""
    return np.stack([bounds.velocity, bounds.acceleration, bounds.jerk])


def check_stop(stop, motion, time, bounds):
    """Check that a stop is one: its begin, its end, its path, its limits."""
    for got, running in zip(
        (stop.positions, stop.velocities, stop.accelerations), sample(motion, [time]), strict=True
    ):
        np.testing.assert_allclose(got[0], running[0], rtol=0.0, atol=1e-9)
    assert not stop.velocities[-1].any()
    assert not stop.accelerations[-1].any()
    assert stop.duration <= motion.duration - time + 2e-9
    ticks = stop.times * 1e9
    assert np.abs(ticks - np.round(ticks)).max() < 1e-3
    # A controller that gets it late finds itself on it.
    late = np.linspace(0.0, min(LATENCY, stop.duration - 1e-7), 20)
    for got, running in zip(sample(stop, late), sample(motion, time + late), strict=True):
        np.testing.assert_allclose(got, running, rtol=1e-5, atol=1e-6)

    times = np.append(np.arange(0.0, stop.duration, 2e-4), stop.duration)
    q, v, a = sample(stop, times)
    assert path_distance(q[::20], motion, time, motion.duration).max() < 1e-4
    phases = np.linspace(time, min(motion.duration, time + stop.duration), 4001)
    gets = np.abs(sample(motion, phases)[0] - stop.positions[-1]).max(axis=1).argmin()
    reached = phases[: gets + 1]
    _, own_v, own_a = sample(motion, reached)
    own = (own_v, own_a, jerks_at(motion, reached))
    found = (v, a, jerks_at(stop, times))
    for values, limit, also in zip(found, table(bounds), own, strict=True):
        allowed = 1.011 * np.maximum(limit, np.abs(also).max(axis=0)) + 1e-9
        assert (np.abs(values) <= allowed).all()


@examples(150)
@given(seed=SEEDS)
def test_a_quick_stop_goes_on_a_little_and_rests_on_the_path_within_limits(seed):
    rng = np.random.default_rng(seed)
    motion = any_motion(rng)
    time = rng.random() * motion.duration
    check_stop(fast_stop(motion, time, LIMITS), motion, time, LIMITS)


@examples(100)
@given(seed=SEEDS)
def test_a_quick_stop_of_any_number_and_kind_of_joints_is_one(seed):
    rng = np.random.default_rng(seed)
    dof = int(rng.integers(1, 8))
    # Radians and metres.
    scale = 10.0 ** rng.uniform(-1.5, 0.5, dof)
    bounds = MotionLimits(velocity=1.5 * scale, acceleration=4.0 * scale, jerk=40.0 * scale)
    q = np.cumsum(scale * rng.standard_normal((3, dof)), axis=0)
    motion = parameterize(Path(q[:2]), (), bounds)
    time = rng.random() * motion.duration
    stop = fast_stop(motion, time, bounds)
    check_stop(stop, motion, time, bounds)
    assert limit_ratio(stop, bounds) <= 1.0026


def later_brake(motion, time):
    """Return how long a motion lasts that goes on for a little and is braked then [s]."""
    later = time + LATENCY
    if later >= motion.duration:
        return motion.duration - time
    return LATENCY + brake(motion, later, LIMITS).duration


@pytest.mark.parametrize('make', [planned_motion, foreign_motion])
def test_a_quick_stop_is_about_as_soon_as_the_proven_one(make):
    rng, ratios = np.random.default_rng(17), []
    for _ in range(60):
        motion = make(rng)
        time = rng.random() * motion.duration
        stop = fast_stop(motion, time, LIMITS)
        ratios.append((stop.duration + 1e-3) / (later_brake(motion, time) + 1e-3))
    assert np.mean(ratios) < 1.01
    assert max(ratios) < 1.2


def test_a_quick_stop_of_an_arm_that_gets_faster_is_soon():
    motion = parameterize(Path([[0.0] * 4, [2.0, -1.0, 0.5, 0.8]]), (), LIMITS)
    # While the jerk is at its limit up, while the acceleration is, and while the jerk falls again.
    for time in np.arange(0.02, 0.6, 0.04):
        stop = fast_stop(motion, time, LIMITS)
        assert stop.duration <= 1.02 * later_brake(motion, time)
        assert limit_ratio(stop, LIMITS) <= 1.0026


def test_a_quick_stop_keeps_to_points_that_are_close_to_where_it_begins():
    motion = planned_motion(np.random.default_rng(4))
    for knot in motion.times[1:-1]:
        for gap in (-LATENCY - 3e-5, -LATENCY, -LATENCY + 3e-5, -3e-5, -3e-6, 0.0):
            time = max(0.0, knot + gap)
            stop = fast_stop(motion, time, LIMITS)
            assert stop.duration <= 1.2 * later_brake(motion, time) + 1e-3
            assert (np.diff(stop.times) > 5e-6).all()


@pytest.mark.parametrize('time', [-1.0, 0.0, 0.003, 0.995, 1.0, 2.0])
def test_near_its_ends_a_motion_is_stopped_too(time):
    motion = parameterize(Path([[0.0] * 4, [1.0, -0.5, 0.3, 0.8]]), (), LIMITS)
    at = time * motion.duration if 0.0 < time <= 1.0 else time
    stop = fast_stop(motion, at, LIMITS)
    assert stop.duration < 0.2
    within = min(max(at, 0.0), motion.duration)
    np.testing.assert_allclose(stop.positions[0], sample(motion, [within])[0][0], atol=1e-12)
    assert not stop.velocities[-1].any()


def test_an_arm_that_stands_still_is_stopped_where_it_is():
    still = np.zeros((1, 4))
    point = Trajectory(times=[0.0], positions=still, velocities=still, accelerations=still)
    assert fast_stop(point, 1.0, LIMITS).positions.tolist() == still.tolist()


def test_a_motion_that_rests_on_its_way_is_followed_no_further():
    q = np.array([[0.0] * 4, [0.5] * 4, [0.5, 0.5, 1.0, 1.0]])
    u = np.diff(q, axis=0) / np.linalg.norm(np.diff(q, axis=0), axis=1)[:, None]
    halt = Blend(corner=q[1], u_in=u[0], u_out=u[1], half_length=0.0)
    motion = parameterize(Path(q), (halt,), LIMITS)
    rest = float(motion.times[~motion.velocities.any(axis=1)][1])
    # Where only the s to that rest is left, that is it.
    stop = fast_stop(motion, rest - 0.05, LIMITS)
    assert stop.duration <= 0.05 + 2e-9
    np.testing.assert_allclose(stop.positions[-1], q[1], atol=1e-9)


def test_points_a_nanosecond_apart_do_no_harm():
    motion = parameterize(Path([[0.0] * 4, [1.0, -0.5, 0.3, 0.8]]), (), LIMITS)
    inner = np.linspace(0.0, motion.duration, 9)[1:-1]
    times = np.sort(np.concatenate([motion.times, inner, inner + 1e-9, inner + 2e-9]))
    q, v, a = sample(motion, times)
    dense = Trajectory(times=times, positions=q, velocities=v, accelerations=a)
    for time in np.concatenate([inner - 1e-9, inner - 0.01, inner + 1e-9, [0.98 * times[-1]]]):
        stop = fast_stop(dense, time, LIMITS)
        assert path_distance(stop.positions, motion, 0.0, motion.duration).max() < 1e-6
        assert not stop.velocities[-1].any()


def derivatives_at(motion, times):
    """Return velocities, accelerations and jerks at some times, (m,) [s] -> (m, 3, dof)."""
    _, v, a = sample(motion, times)
    return np.stack([v, a, jerks_at(motion, times)], axis=1)


def slowed(states, rate, slope, bend):
    """
    Return velocities, accelerations and jerks, (m, 3, dof), of a motion at another rate.

    With the time in the motion s(t) these are q' s', q'' s'^2 + q' s'' and
    q''' s'^3 + 3 q'' s' s'' + q' s'''; the rate is s' [-, 1/s, 1/s^2].
    """
    r, w, u = rate[:, None], slope[:, None], bend[:, None]
    v, a, j = (states[:, k] for k in range(3))
    return np.stack([v * r, a * r**2 + v * w, j * r**3 + 3.0 * a * r * w + v * u], axis=1)


def along_path(states, weights):
    """Return the speed along the path, joints weighed, and its two derivatives, each (m,)."""
    v, a, j = (states[:, k] / weights for k in range(3))
    # At rest the derivatives come out as 0 or immense, never as no number.
    speed = np.maximum(np.sqrt((v * v).sum(axis=-1)), 1e-150)
    slope = (v * a).sum(axis=-1) / speed
    return speed, slope, ((a * a).sum(axis=-1) + (v * j).sum(axis=-1) - slope**2) / speed


@examples(100)
@given(seed=SEEDS)
def test_what_a_kernel_finds_within_limits_is_so_by_plain_numpy(seed):
    rng = np.random.default_rng(seed)
    motion = planned_motion(rng)
    time, rows_of = rng.random() * motion.duration * 0.8, table(LIMITS)
    curves, times = piece_coefficients(motion), motion.times
    rest = times[first_rest(curves, times, time)]
    end = min(rest, time + first_window(curves, times, time, rows_of))
    size = 200 + len(times)
    rows, pieces = np.empty((size + 1, 4)), np.empty(size, np.int64)
    geometry, phases = np.empty((size, 3, 3, 4)), np.empty((3, 5))
    n = look_ahead(curves, times, time, time, end, 0.01, rows_of, rows, pieces, geometry)
    row = int(rng.integers(0, n // 2 + 1))
    s, speed, slope = rows[row, 1:]
    lasts = line_stop(s, speed, slope, *rng.uniform([0.2, 1.0], [1.5, 15.0]), phases)
    if not np.isfinite(lasts):
        return
    holds = keeps_limits(phases, rows, geometry, pieces, row, n, 1.0)
    gets = int(np.searchsorted(rows[: n + 1, S], stop_s(phases)))
    if gets > n:
        assert not holds
        return
    most, worst = np.maximum(rows_of, geometry[gets - 1, MOST]), 0.0
    for begin_way, v0, a0, j, span in phases[:, [1, 2, 3, 4, 0]]:
        t = np.linspace(0.0, span, 200)
        x = begin_way + t * (v0 + t * (0.5 * a0 + t * j / 6.0))
        cells = np.clip(np.searchsorted(rows[: n + 1, S], x, side='right') - 1, 0, n - 1)
        reached = [
            time_after(curves, times, pieces[c], *rows[c : c + 2, TIME], s - rows[c, S], rows_of)
            for c, s in zip(cells, x, strict=True)
        ]
        states = derivatives_at(motion, np.array(reached))
        w, w_slope, w_bend = along_path(states, LIMITS.acceleration)
        rate = (v0 + t * (a0 + 0.5 * t * j)) / w
        rate_slope = (a0 + t * j - w_slope * rate**2) / w
        rate_bend = (j - 3.0 * w_slope * rate * rate_slope - w_bend * rate**3) / w
        values = np.abs(slowed(states, rate, rate_slope, rate_bend))
        worst = max(worst, float((values / most).max()))
    # Between the instants that are looked at it may be a little more.
    assert worst < 1.01 if holds else worst > 0.999


@examples(60)
@given(seed=SEEDS, since=st.floats(0.0, 0.02), is_sharp=st.booleans())
def test_a_stop_that_comes_late_to_a_motion_that_has_just_begun_is_on_it(seed, since, is_sharp):
    motion = planned_motion(np.random.default_rng(seed))
    # The message rests, moves, and stops so long after its begin.
    lead = 0.0275
    planned = ExecutingMotion(trajectory=motion, start_time=1.0)
    whole = led(rest_at(motion, lead), planned).trajectory
    sharp = replace(LIMITS, acceleration=np.full(4, 10.0), jerk=np.full(4, 400.0))
    bounds = sharp if is_sharp else LIMITS
    stop = fast_stop(whole, since, bounds, lead)
    assert stop.duration < lead + 0.1
    # By a cycle of a controller at 200 Hz.
    late = lead + 0.005
    gap = positions_at(whole, [since + late]) - positions_at(stop, [min(late, stop.duration)])
    assert np.abs(gap).max() < 3e-6 + bounds.jerk.max() * 0.005**3 / 6.0
