# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Timed paths: at rest at both ends, on the path, within limits, in whole nanoseconds."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

from benchmarks.motions.path import distances, planned_pieces
from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.reference_checker import quintic_states
from rrth_planner.collision.world import arm_world
from rrth_planner.model.errors import RrthError
from rrth_planner.model.path import Path
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits, piece_coefficients, sample, Trajectory
from rrth_planner.pipeline.time_path import first_proven, in_time
from rrth_planner.timing.corner_blends import Blend, round_corners
from rrth_planner.timing.parameterization import limit_ratio, parameterize
from worlds import examples, limits, table_1_arm

SEEDS = st.integers(0, 2**32 - 1)


def random_limits(rng, dof):
    """Return the limits of a slow or a quick arm, each joint its own."""
    scale = rng.choice([0.1, 1.0, 10.0])
    return MotionLimits(
        velocity=1.5 * scale * rng.uniform(0.5, 2.0, dof),
        acceleration=4.0 * scale * rng.uniform(0.5, 2.0, dof),
        jerk=40.0 * scale * rng.uniform(0.5, 2.0, dof),
    )


def random_path(rng):
    """Return a path of 2 to 8 waypoints with tiny edges, reversals and collinear points."""
    dof, n = int(rng.integers(1, 6)), int(rng.integers(2, 9))
    q = [rng.uniform(-2.0, 2.0, dof)]
    step = rng.standard_normal(dof)
    for _ in range(n - 1):
        kind = rng.integers(0, 4)
        if kind == 0:
            step = -step * rng.uniform(0.2, 2.0)
        elif kind == 1:
            step = step * rng.uniform(0.2, 2.0)
        else:
            step = rng.standard_normal(dof)
            step[0] += 1e-3
        length = rng.choice([1e-6, 1e-4, 1e-2, 0.3, 2.0]) if kind == 2 else 0.5
        step = step * (length / np.linalg.norm(step))
        q.append(q[-1] + step)
    return Path(np.array(q))


def blends_of(path, rng=None):
    """Return blends of any size that fits, some of them stops; without rng stops only."""
    q = path.waypoints
    lengths = np.linalg.norm(np.diff(q, axis=0), axis=1)
    directions = np.diff(q, axis=0) / lengths[:, None]
    return tuple(
        Blend(
            corner=q[i],
            u_in=directions[i - 1],
            u_out=directions[i],
            half_length=0.0
            if rng is None or rng.random() < 0.3
            else float(rng.uniform(0.01, 0.45) * min(lengths[i - 1], lengths[i])),
        )
        for i in range(1, len(q) - 1)
    )


def distance_from(points, path):
    """Return how far points, (n, dof), are from a path [rad]."""
    best = np.full(len(points), np.inf)
    for a, b in zip(path.waypoints[:-1], path.waypoints[1:], strict=True):
        share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1))
    return best


def check_motion(trajectory, path, blends, bounds):
    """Check all that a timed path promises, by the reference checker's own quintics."""
    times, q = trajectory.times, path.waypoints
    assert times[0] == 0.0
    assert (np.diff(times) > 0.0).all()
    assert np.abs(times * 1e9 - np.round(times * 1e9)).max() < 1e-3
    assert (np.diff(np.round(times * 1e9)) >= 1).all()
    assert np.array_equal(trajectory.positions[0], q[0])
    assert np.array_equal(trajectory.positions[-1], q[-1])
    for values in (trajectory.velocities, trajectory.accelerations):
        assert not values[0].any()
        assert not values[-1].any()
    for name, values in derivatives(trajectory).items():
        if name == 'jerk':
            # Of pieces shorter than a tenth of a millisecond rounding makes most of the jerk.
            values = values[np.repeat(np.diff(trajectory.times) > 1e-4, 41)]
        allowed = getattr(bounds, name) * (1.01 if name == 'jerk' else 1.0021)
        assert (np.abs(values) <= allowed + 1e-9).all(), name
    points, _, _ = sample(trajectory, np.linspace(0.0, trajectory.duration, 1500))
    away = distance_from(points, path) > 1e-6
    for blend in blends:
        if blend.half_length > 0.0:
            away &= np.linalg.norm(points - blend.corner, axis=1) > blend.half_length + 1e-6
        elif np.abs(blend.u_out - blend.u_in).max() > 1e-9:
            gap = np.linalg.norm(trajectory.positions - blend.corner, axis=1)
            assert gap.min() < 1e-6
            assert np.abs(trajectory.velocities[np.argmin(gap)]).max() < 1e-2
    assert not away.any()


def exact_jerk(trajectory):
    """Return the greatest jerk of each joint, reckoned in rational numbers, shape (dof,)."""
    nanoseconds = np.round(trajectory.times * 1e9).astype(int).tolist()
    greatest = [0.0] * trajectory.positions.shape[1]
    for k, (begin, end) in enumerate(pairwise(nanoseconds)):
        T = Fraction(end - begin, 10**9)
        for j in range(len(greatest)):
            (p0, p1), (v0, v1), (a0, a1) = (
                [Fraction(float(values[i, j])) for i in (k, k + 1)]
                for values in (
                    trajectory.positions,
                    trajectory.velocities,
                    trajectory.accelerations,
                )
            )
            # The quintic through both ends; its jerk is a parabola.
            p, v, a = p1 - p0 - v0 * T - a0 * T**2 / 2, v1 - v0 - a0 * T, a1 - a0
            c3 = (10 * p - 4 * v * T + a * T**2 / 2) / T**3
            c4 = (-15 * p + 7 * v * T - a * T**2) / T**4
            c5 = (6 * p - 3 * v * T + a * T**2 / 2) / T**5
            instants = [Fraction(0), T]
            if c5:
                instants += [u for u in [-c4 / (5 * c5)] if 0 < u < T]
            jerk = max(abs(6 * c3 + 24 * c4 * u + 60 * c5 * u**2) for u in instants)
            greatest[j] = max(greatest[j], float(jerk))
    return np.array(greatest)


# The first two have edges of a millionth of a radian.
@pytest.mark.parametrize('seed', [198, 305, *range(20)])
def test_jerk_holds_in_the_shortest_piece_in_exact_arithmetic(seed):
    rng = np.random.default_rng(seed)
    path = random_path(rng)
    bounds = random_limits(rng, path.waypoints.shape[1])
    trajectory = parameterize(path, blends_of(path, rng), bounds)
    assert (exact_jerk(trajectory) <= 1.01 * bounds.jerk).all()


def derivatives(trajectory):
    """Return velocity, acceleration and jerk at 41 instants of each piece, (n, dof)."""
    T = np.diff(trajectory.times)[:, None, None]
    c = piece_coefficients(trajectory)
    u = np.linspace(0.0, 1.0, 41)[None, :, None]
    result = {}
    for order, name in enumerate(('velocity', 'acceleration', 'jerk'), start=1):
        value = 0.0
        for power in range(order, 6):
            factor = np.prod(np.arange(power - order + 1, power + 1))
            value = value + factor * c[:, None, power] * u ** (power - order)
        result[name] = (value / T**order).reshape(-1, c.shape[2])
    return result


@examples(250)
@given(seed=SEEDS)
def test_stopping_at_corners_keeps_path_limits_and_rest(seed):
    rng = np.random.default_rng(seed)
    path = random_path(rng)
    bounds, blends = random_limits(rng, path.waypoints.shape[1]), blends_of(path)
    check_motion(parameterize(path, blends, bounds), path, blends, bounds)


@examples(250)
@given(seed=SEEDS)
def test_rounded_corners_keep_path_limits_and_rest(seed):
    rng = np.random.default_rng(seed)
    path = random_path(rng)
    bounds, blends = random_limits(rng, path.waypoints.shape[1]), blends_of(path, rng)
    check_motion(parameterize(path, blends, bounds), path, blends, bounds)


@examples(100)
@given(seed=SEEDS)
def test_stops_take_no_longer_than_the_edges_alone(seed):
    rng = np.random.default_rng(seed)
    path = random_path(rng)
    bounds = random_limits(rng, path.waypoints.shape[1])
    edges = zip(path.waypoints[:-1], path.waypoints[1:], strict=True)
    stops = sum(parameterize(Path(np.stack(edge)), (), bounds).duration for edge in edges)
    assert parameterize(path, blends_of(path), bounds).duration <= stops * 1.0005 + 1e-6


def test_a_motion_with_rounded_corners_is_never_slower_than_with_stops():
    empty = arm_world(table_1_arm(), Scene(()), 0.0, 1.0)
    slower = []
    for seed in range(1000):
        rng = np.random.default_rng(seed)
        steps = rng.standard_normal((rng.integers(3, 8), 4)) * rng.choice([0.02, 0.2, 1.0])
        path = Path(rng.uniform(-1.0, 1.0, 4) + np.cumsum(steps, axis=0))
        choices = (round_corners(path, empty, limits()), blends_of(path))
        rounded = first_proven(in_time(path, choices, limits(), None), empty).duration
        stops = parameterize(path, blends_of(path), limits()).duration
        if rounded > stops * 1.0005 + 1e-6:
            slower.append((round(rounded / stops, 4), seed))
    assert slower == []


@pytest.mark.parametrize('seed', range(25))
def test_the_curve_of_the_quintics_stays_within_a_ten_thousandth_of_lines_and_blends(seed):
    rng = np.random.default_rng(seed)
    steps = rng.standard_normal((rng.integers(2, 6), 4)) * rng.choice([0.02, 0.2, 1.0])
    path = Path(rng.uniform(-1.0, 1.0, 4) + np.cumsum(steps, axis=0))
    blends = blends_of(path, rng)
    trajectory = parameterize(path, blends, limits())
    points, _, _ = sample(trajectory, np.arange(0.0, trajectory.duration, 2e-3))
    pieces = [piece for part in planned_pieces(path, blends) for piece in part]
    assert distances(points, pieces).max() < 1e-4


@examples(60)
@given(seed=SEEDS)
def test_the_reference_checkers_quintics_are_those_that_are_sampled(seed):
    rng = np.random.default_rng(seed)
    path = random_path(rng)
    bounds = limits(path.waypoints.shape[1])
    trajectory = parameterize(path, blends_of(path, rng), bounds)
    # The reference checker solves linear equations in seconds: of short pieces it loses digits.
    if np.diff(trajectory.times).min() < 1e-3:
        return
    grid, q, v, a = quintic_states(trajectory, 0.002)
    for got, expected, tolerance in zip(
        sample(trajectory, grid), (q, v, a), (1e-9, 1e-6, 1e-3), strict=True
    ):
        assert np.abs(got - expected).max() < tolerance
    assert (np.abs(v) <= bounds.velocity * 1.0021).all()
    assert (np.abs(a) <= bounds.acceleration * 1.0021).all()


def test_a_long_edge_takes_the_time_of_its_trapezoid():
    bounds = MotionLimits(velocity=[1.0], acceleration=[2.0], jerk=[20.0])
    trajectory = parameterize(Path([[0.0], [10.0]]), (), bounds)
    # v t = s plus what ramping up and down costs: v / a + a / j.
    assert trajectory.duration == pytest.approx(10.0 + 0.5 + 0.1, abs=1e-6)
    assert limit_ratio(trajectory, bounds) <= 1.0


@pytest.mark.parametrize('gap', [None, 0.0, 1e-12])
def test_a_path_of_no_length_holds_still(gap):
    q = np.array([0.1, -0.2, 0.3, 0.4])
    waypoints = q[None] if gap is None else np.stack([q, q + gap])
    trajectory = parameterize(Path(waypoints), (), limits())
    assert trajectory.duration > 0.0
    positions, velocities, accelerations = sample(trajectory, np.linspace(0.0, 1.0, 50))
    assert (positions == q).all()
    assert not velocities.any()
    assert not accelerations.any()


@examples(100)
@given(seed=SEEDS)
def test_pieces_meet_their_points_and_a_quintic_is_reproduced(seed):
    rng = np.random.default_rng(seed)
    c = rng.uniform(-1.0, 1.0, (6, 3))
    times = np.array([0.0, 0.4, 1.1, 1.5])
    powers = np.arange(6)
    states = [
        np.array(
            [
                (c * scale[:, None] * t ** np.maximum(powers - k, 0)[:, None]).sum(axis=0)
                for t in times
            ]
        )
        for k, scale in enumerate(
            (np.ones(6), powers.astype(float), (powers * (powers - 1)).astype(float))
        )
    ]
    trajectory = Trajectory(
        times=times, positions=states[0], velocities=states[1], accelerations=states[2]
    )
    t = np.linspace(0.0, 1.5, 200)
    q, v, a = sample(trajectory, t)
    expected = sum(c[k] * t[:, None] ** k for k in range(6))
    assert np.abs(q - expected).max() < 1e-12
    for got, at_points in zip(sample(trajectory, times), states, strict=True):
        assert np.abs(got - at_points).max() < 1e-10


def test_before_and_after_the_motion_the_arm_stands_still():
    trajectory = parameterize(Path([[0.0, 0.0], [1.0, 2.0]]), (), limits(2))
    q, v, a = sample(trajectory, [-1.0, trajectory.duration + 1.0])
    assert np.array_equal(q, [[0.0, 0.0], [1.0, 2.0]])
    assert not v.any()
    assert not a.any()


def test_blends_and_limits_of_another_path_are_rejected():
    path = Path(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]))
    bounds = random_limits(np.random.default_rng(0), 2)
    with pytest.raises(RrthError, match='blends: 0, expected one for each of 1 corners'):
        parameterize(path, (), bounds)
    with pytest.raises(RrthError, match='blends: 1, expected one for each of 0 corners'):
        parameterize(Path(np.zeros((1, 2))), blends_of(path), bounds)
    with pytest.raises(RrthError, match=r'path: shape \(3, 2\), expected a value for each of 4'):
        parameterize(path, blends_of(path), limits())


@examples(100)
@given(seed=SEEDS)
def test_a_waypoint_that_is_given_twice_changes_nothing(seed):
    rng = np.random.default_rng(seed)
    q = random_path(rng).waypoints
    bounds, times = random_limits(rng, q.shape[1]), rng.integers(1, 4, len(q))
    once, twice = Path(q), Path(np.repeat(q, times, axis=0))
    wanted = parameterize(once, blends_of(once), bounds)
    blend = Blend(q[0], q[0], q[0], half_length=0.0)
    found = parameterize(twice, (blend,) * max(0, len(twice.waypoints) - 2), bounds)
    np.testing.assert_array_equal(found.times, wanted.times)
    for row, other in zip(found.states, wanted.states, strict=True):
        np.testing.assert_array_equal(row, other)


@examples(100)
@given(seed=SEEDS)
def test_rounding_makes_no_turn_of_a_corner_that_goes_straight_on(seed):
    rng = np.random.default_rng(seed)
    lengths = rng.uniform(0.2, 0.4, 2)
    bounds, durations = random_limits(rng, 2), []
    for _ in range(6):
        # Along one joint, and hardly another way each time.
        q = np.zeros((3, 2))
        q[1:, 0] = np.cumsum(lengths * (1.0 + rng.uniform(-1e-12, 1e-12, 2)))
        # The greatest speed is within the blend.
        (blend,) = blends_of(Path(q))
        blend = replace(blend, half_length=0.45 * float(lengths.min()))
        durations.append(parameterize(Path(q), (blend,), bounds).duration)
    assert np.ptp(durations) < 1e-7
