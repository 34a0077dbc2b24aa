# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Speeds along rounded paths against toppra and ruckig."""

from dataclasses import replace
from itertools import pairwise

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.world import arm_world
from rrth_planner.kernels.trajectory import speed_profile, timed_path
from rrth_planner.model.path import Path
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.timing.corner_blends import round_corners
from rrth_planner.timing.parameterization import parameterize
from ruckig import InputParameter, Result, Ruckig, Trajectory as Profile
from worlds import examples, limits, table_1_arm

SEEDS = st.integers(0, 2**32 - 1)
EMPTY = arm_world(table_1_arm(), Scene(()), 0.0, 1.0)


@examples(300)
@given(seed=SEEDS)
def test_a_stretch_takes_as_long_as_ruckigs_profile(seed):
    rng = np.random.default_rng(seed)
    top, a_max, j_max = 10.0 ** rng.uniform(-1.0, 1.0, 3) * [1.0, 3.0, 30.0]
    v_from = rng.choice([0.0, rng.uniform(0.0, top)])
    least = 10.0 ** rng.uniform(-3.0, 1.0)
    v_to = speed_profile.reachable_speed(v_from, least, rng.uniform(v_from, top), a_max, j_max)
    length = least * rng.choice([1.01, 1.1, 3.0])
    if rng.random() < 0.5:
        v_from, v_to = v_to, v_from
    request = InputParameter(1)
    request.current_position, request.target_position = [0.0], [length]
    request.current_velocity, request.target_velocity = [v_from], [v_to]
    request.current_acceleration, request.target_acceleration = [0.0], [0.0]
    request.max_velocity, request.max_acceleration = [top * (1 + 1e-9)], [a_max]
    request.max_jerk = [j_max]
    profile = Profile(1)
    assert Ruckig(1).calculate(request, profile) in (Result.Working, Result.Finished)
    phases = np.empty((7, 2))
    cell = np.array([length, top, a_max, j_max])
    n = speed_profile.cell_phases(v_from, v_to, cell, phases)
    assert phases[:n, 0].sum() == pytest.approx(profile.duration, rel=1e-5, abs=1e-6)


def rounded_path(rng, empty):
    """Return a path of three to six waypoints and its blends."""
    steps = rng.standard_normal((rng.integers(3, 7), 4)) * rng.uniform(0.1, 0.6)
    path = Path(rng.uniform(-1.0, 1.0, 4) + np.cumsum(steps, axis=0))
    return path, round_corners(path, empty, limits())


def test_without_a_limit_of_jerk_the_time_is_that_of_toppra():
    toppra = pytest.importorskip('toppra')
    toppra.setup_logging('ERROR')
    from toppra import algorithm, constraint, interpolator

    bounds = MotionLimits(
        velocity=limits().velocity, acceleration=limits().acceleration, jerk=np.full(4, 1e6)
    )
    box = [np.stack([-x, x], axis=1) for x in (bounds.velocity, bounds.acceleration)]
    ratios = []
    for seed in range(40):
        path, blends = rounded_path(np.random.default_rng(seed), EMPTY)
        stretches = list(pieces_of(path, blends))
        begins = np.cumsum([0.0, *(width for *_, width in stretches)])

        class Rounded(interpolator.AbstractGeometricPath):
            """The rounded path by its length."""

            def __call__(self, ways, order=0, stretches=stretches, begins=begins):
                rows = np.searchsorted(begins[1:-1], np.atleast_1d(ways), side='right')
                return np.array(
                    [
                        curve(stretches[i], s - begins[i], order)
                        for i, s in zip(rows, np.atleast_1d(ways), strict=True)
                    ]
                )

            dof = 4
            path_interval = np.array([0.0, begins[-1]])
            waypoints = None

        grid = np.unique(np.concatenate([np.linspace(a, b, 50) for a, b in pairwise(begins)]))
        solver = algorithm.TOPPRA(
            [
                constraint.JointVelocityConstraint(box[0]),
                constraint.JointAccelerationConstraint(
                    box[1], discretization_scheme=constraint.DiscretizationType.Interpolation
                ),
            ],
            Rounded(),
            gridpoints=grid,
            parametrizer='ParametrizeConstAccel',
        )
        _, pace, _ = solver.compute_parameterization(0.0, 0.0)
        best = np.sum(2.0 * np.diff(grid) / (pace[1:] + pace[:-1]))
        ratios.append(parameterize(path, blends, bounds).duration / best)
    # The grid of the reference checker costs it a little.
    assert min(ratios) > 0.99
    assert np.mean(ratios) < 1.03


@examples(60)
@given(seed=SEEDS)
def test_every_point_is_on_the_path_and_moves_along_it(seed):
    rng = np.random.default_rng(seed)
    path, blends = rounded_path(rng, EMPTY)
    blends = tuple(
        replace(blend, half_length=blend.half_length * rng.choice([0.0, 0.3, 1.0]))
        for blend in blends
    )
    trajectory = parameterize(path, blends, limits())
    nearest = np.full(len(trajectory.times), np.inf)
    for piece in pieces_of(path, blends):
        ways = np.linspace(0.0, piece[-1], 200)
        places = np.array([curve(piece, s, 0) for s in ways])
        for i, (q, v) in enumerate(zip(trajectory.positions, trajectory.velocities, strict=True)):
            s = ways[np.linalg.norm(places - q, axis=1).argmin()]
            for _ in range(6):
                # Newton's method for the foot of the perpendicular.
                gap, ahead = q - curve(piece, s, 0), curve(piece, s, 1)
                slope = ahead @ ahead - gap @ curve(piece, s, 2)
                s = np.clip(s + gap @ ahead / slope, 0.0, piece[-1])
            ahead = curve(piece, s, 1)
            across = v - v @ ahead / (ahead @ ahead) * ahead
            gap = np.linalg.norm(q - curve(piece, s, 0))
            nearest[i] = min(nearest[i], max(gap, np.linalg.norm(across)))
    assert nearest.max() < 1e-8


@examples(200)
@given(seed=SEEDS, n=st.integers(2, 60))
def test_close_points_are_merged_and_the_others_move_along_their_own_motion(seed, n):
    rng = np.random.default_rng(seed)
    steps = 10.0 ** rng.uniform(-8.0, -1.0, n - 1)
    times, states = np.append(0.0, np.cumsum(steps)), rng.normal(size=(3, n, 2))
    states[1:, -1] = 0.0
    before, given_states = times.copy(), states.copy()
    m = timed_path.merge(times, states, n)
    found = times[:m]
    assert found[0] == 0.0
    assert (np.diff(found) > 0.0).all()
    # But for the last one, which always stays.
    assert (np.diff(found)[:-1] >= timed_path.CLOSEST - 1e-9).all()
    assert np.abs(found * 1e9 - np.round(found * 1e9)).max() < 1e-6
    kept = np.abs(before[:, None] - found).argmin(axis=0)
    assert kept[0] == 0
    assert kept[-1] == n - 1
    assert m == n or (steps < timed_path.CLOSEST).any()
    p, v, a = given_states[:, kept]
    dt = np.where(np.arange(m) == m - 1, 0.0, found - before[kept])[:, None]
    assert np.abs(dt).max() <= 0.51e-9
    for row, wanted in enumerate((p + dt * v + 0.5 * dt**2 * a, v + dt * a, a)):
        assert np.allclose(states[row, :m], wanted, rtol=1e-12, atol=1e-14)


def test_there_is_room_for_the_points_of_the_longest_motion_of_a_path():
    rng, most = np.random.default_rng(3), 0.0
    for _ in range(200):
        path, blends = rounded_path(rng, EMPTY)
        room = timed_path.most_points(len(path.waypoints))
        times, states = np.empty(room + 1), np.empty((3, room + 1, 4))
        times[-1] = 7.0
        halves = np.array([0.0, *(blend.half_length for blend in blends), 0.0])
        n = timed_path.timed_points(
            path.waypoints, halves, np.stack(limits().rows), 0.0, times[:-1], states[:, :-1].copy()
        )
        assert 0 < n <= room
        assert times[-1] == 7.0
        most = max(most, n / room)
    # Phases without duration have no points.
    assert most > 0.1


def pieces_of(path, blends):
    """Yield origin, direction, turn and length of straight stretches and blends in turn."""
    q = path.waypoints
    edges = np.diff(q, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    u = edges / lengths[:, None]
    cuts = [0.0, *(blend.half_length for blend in blends), 0.0]
    for i, length in enumerate(lengths):
        yield q[i] + cuts[i] * u[i], u[i], np.zeros(4), length - cuts[i] - cuts[i + 1]
        if cuts[i + 1] > 0.0:
            d = cuts[i + 1]
            yield q[i + 1] - d * u[i], u[i], u[i + 1] - u[i], 2.0 * d


def curve(piece, s, order):
    """Return a derivative of a piece by its length, at a way into it."""
    origin, u, turn, width = piece
    x = s / width
    if order == 0:
        return origin + u * s + turn * width * (x**3 - 0.5 * x**4)
    if order == 1:
        return u + turn * (3.0 * x**2 - 2.0 * x**3)
    return turn * 6.0 * x * (1.0 - x) / width
