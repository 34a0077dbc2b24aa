# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The judge of timed motions finds what is planted, and passes what is right."""

from dataclasses import replace
import os

import pytest

pytest.importorskip('fcl')

from benchmarks.common.controller_curve import curve_of, derivative, greatest_jerk, instants
from benchmarks.common.fcl_checker import least_distance
from benchmarks.common.queries import wearer
from benchmarks.motions.path import distances, planned_pieces
from benchmarks.motions.verdict import verdict
import numpy as np
from rrth_planner.collision import reference_checker
from rrth_planner.model.path import Path
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import MotionLimits, sample, Trajectory
from rrth_planner.timing.corner_blends import Blend
from rrth_planner.timing.parameterization import parameterize
from worlds import limits, table_1_arm

MARGIN, RAY = 0.02, 1.0
NOWHERE = Scene((Box('far', [50.0, 0.0, 0.0], [1.0, 1.0, 1.0], np.eye(3)),))
CORNERS = np.array(
    [[0.0, -0.3, 1.5, 1.5], [0.6, 0.2, 1.2, 1.0], [1.4, -0.1, 1.6, 0.4], [1.5, 0.8, 1.0, 0.2]]
)


def blends_of(waypoints, *half_lengths):
    """Return blends of these half lengths at the inner waypoints."""
    edges = np.diff(waypoints, axis=0)
    u = edges / np.linalg.norm(edges, axis=1)[:, None]
    return tuple(
        Blend(corner=waypoints[i + 1], u_in=u[i], u_out=u[i + 1], half_length=half_length)
        for i, half_length in enumerate(half_lengths)
    )


def straight(scale=1.0):
    """Return a straight motion that reaches all the limits of a joint, and those limits."""
    bound = MotionLimits(
        velocity=scale * limits().velocity,
        acceleration=scale * limits().acceleration,
        jerk=scale * limits().jerk,
    )
    path = Path([[-1.2, -0.5, 0.2, 0.1], [1.2, -0.3, 0.5, 0.2]])
    return parameterize(path, (), bound), limits()


def random_trajectory(rng):
    """Return points that nothing keeps smooth or slow."""
    n = int(rng.integers(2, 12))
    times = np.round(np.concatenate([[0.0], np.cumsum(rng.uniform(0.003, 0.6, n - 1))]), 9)
    p, v, a = (scale * rng.standard_normal((n, 4)) for scale in (1.0, 1.5, 4.0))
    return Trajectory(times=times, positions=p, velocities=v, accelerations=a)


def judged(trajectory, bound, scene=NOWHERE, reach=RAY):
    """Return the verdict with the arm of Table 1."""
    return verdict(
        table_1_arm(), scene, trajectory, bound, margin=MARGIN, ray_length=RAY, reach=reach
    )


@pytest.mark.parametrize('seed', range(20))
def test_the_curve_of_the_judge_is_that_of_the_package(seed):
    trajectory = random_trajectory(np.random.default_rng(seed))
    curve = curve_of(trajectory)
    places = instants(curve)
    assert (np.diff(places.times) > -1e-12).all()
    assert np.diff(places.times).max() <= 2e-4 + 1e-9
    # Between the points: there the judge looks from either side.
    is_inside = (places.since > 1e-9) & (np.diff(curve.times)[places.pieces] - places.since > 1e-9)
    for order, theirs in enumerate(sample(trajectory, places.times)):
        ours = derivative(curve, places, order)
        scale = 1.0 + np.abs(theirs).max()
        assert np.abs(ours - theirs)[is_inside].max() < 1e-7 * scale


def test_jerk_is_the_slope_of_acceleration_and_greatest_where_it_is():
    trajectory = random_trajectory(np.random.default_rng(3))
    curve = curve_of(trajectory)
    places = instants(curve, 1e-5)
    jerk, acceleration = derivative(curve, places, 3), derivative(curve, places, 2)
    steps = np.diff(places.times)
    same = (np.diff(places.pieces) == 0) & (steps > 5e-6)
    slope = (np.diff(acceleration, axis=0)[same] / steps[same, None]).max()
    assert slope == pytest.approx(jerk.max(), rel=0.02)
    greatest = greatest_jerk(curve)
    assert (greatest >= np.abs(jerk).max(axis=0) * (1 - 1e-12)).all()
    assert greatest == pytest.approx(np.abs(jerk).max(axis=0), rel=0.01)


def test_a_right_motion_is_passed():
    trajectory, bound = straight()
    found = judged(trajectory, bound)
    assert (found.contact, found.is_at_rest, found.is_increasing) == ('', True, True)
    for ratio in (found.velocity_ratio, found.acceleration_ratio, found.jerk_ratio):
        assert ratio == pytest.approx(1.0, abs=2e-3)
    assert found.beyond_range == 0.0
    assert found.n_points == len(trajectory.times)


def test_a_planted_excess_of_two_percent_is_found():
    found = judged(*straight(1.02))
    for ratio in (found.velocity_ratio, found.acceleration_ratio, found.jerk_ratio):
        assert ratio == pytest.approx(1.02, abs=2e-3)


@pytest.mark.parametrize('gap, is_colliding', [(0.005, True), (0.025, False)])
def test_a_planted_collision_is_found_by_the_margin(gap, is_colliding):
    arm, (trajectory, bound) = table_1_arm(), straight()
    q = sample(trajectory, [0.37 * trajectory.duration])[0]
    # A small box beside the middle of the ray, square to it and to the way it moves.
    now = reference_checker.bars(arm, q, RAY)[0, -1]
    ahead = sample(trajectory, [0.37 * trajectory.duration + 1e-3])[0]
    later = reference_checker.bars(arm, ahead, RAY)[0, -1]
    along, moved = now[1] - now[0], later.mean(axis=0) - now.mean(axis=0)
    beside = np.cross(along, moved)
    beside /= np.linalg.norm(beside)
    half, radius = 0.002, float(arm.radii[-1])
    axes = np.stack([along / np.linalg.norm(along), np.cross(beside, along), beside], axis=1)
    axes[:, 1] /= np.linalg.norm(axes[:, 1])
    center = now.mean(axis=0) + (radius + gap + half) * beside
    scene = Scene((Box('planted', center, [2 * half] * 3, axes),))
    found = judged(trajectory, bound, scene)
    if is_colliding:
        assert 'planted' in found.contact
        places = instants(curve_of(trajectory), 1e-3)
        q = derivative(curve_of(trajectory), places, 0)
        assert least_distance(arm, scene, q, RAY, MARGIN) < MARGIN - 0.01
    else:
        assert found.contact == ''


def test_the_ray_is_judged_out_to_the_target_at_the_end_only():
    arm, (trajectory, bound) = table_1_arm(), straight()
    tip, far = reference_checker.bars(arm, trajectory.positions[-1:], 3.0)[0, -1]
    scene = Scene((Box('beyond', far, [0.02] * 3, np.eye(3)),))
    assert np.linalg.norm(far - tip) == pytest.approx(3.0)
    assert judged(trajectory, bound, scene, reach=2.5).contact == ''
    assert 'beyond' in judged(trajectory, bound, scene, reach=3.5).contact


@pytest.mark.parametrize('end', [0, -1])
@pytest.mark.parametrize('name', ['velocities', 'accelerations'])
def test_an_end_that_is_not_at_rest_is_found(name, end):
    trajectory, bound = straight()
    values = np.array(getattr(trajectory, name))
    values[end, 1] = 1e-12
    assert not judged(replace(trajectory, **{name: values}), bound).is_at_rest


def test_times_that_are_the_same_nanosecond_are_found():
    trajectory, bound = straight()
    times = np.array(trajectory.times)
    times[2] = times[1] + 1e-10
    found = judged(replace(trajectory, times=times), bound)
    assert not found.is_increasing
    assert found.jerk_ratio == np.inf


def test_distances_from_the_rounded_path_are_those_of_a_dense_look():
    path, blends = Path(CORNERS), blends_of(CORNERS, 0.2, 0.0)
    parts = planned_pieces(path, blends)
    assert [len(part) for part in parts] == [3, 1]
    pieces = [piece for part in parts for piece in part]
    n = 4000
    dense = np.concatenate([piece.at(np.linspace(0.0, 1.0, n + 1)) for piece in pieces])
    rng = np.random.default_rng(0)
    points = dense[rng.integers(0, len(dense), 200)] + 1e-3 * rng.standard_normal((200, 4))
    nearest = np.linalg.norm(points[:, None] - dense, axis=2).min(axis=1)
    # By Pythagoras: the nearest of the dense points is beside the foot.
    lacking = nearest**2 - distances(points, pieces) ** 2
    assert lacking.min() > -1e-15 and lacking.max() < max(p.width / n for p in pieces) ** 2
    assert distances(dense, pieces).max() < 1e-9
    # A rounded corner is off the waypoint.
    assert distances(CORNERS[1:2], pieces)[0] > 0.01
    assert distances(CORNERS[2:3], pieces)[0] < 1e-12


def test_python_fcl_agrees_with_the_oracle_about_distances():
    arm, scene, rng = table_1_arm(), wearer(), np.random.default_rng(5)
    n_near = 0
    places = rng.uniform(*arm.bounds, (400, 4))
    for q, exact in zip(
        places, reference_checker.clearances(arm, scene, places, RAY), strict=True
    ):
        found = least_distance(arm, scene, q[None], RAY, MARGIN)
        if 1e-4 < exact < MARGIN:
            n_near += 1
            assert found == pytest.approx(exact, abs=1e-5)
        elif exact > MARGIN:
            assert found > MARGIN - 1e-5
    assert n_near > 3


def test_toppra_times_a_straight_line_as_the_textbook_does():
    pytest.importorskip('toppra')
    from benchmarks.motions import toppra_peer as peer

    path, bound = Path([[0.0] * 4, [2.0, 0.5, 0.5, 0.5]]), limits()
    way, speed, acceleration = 2.0, 1.5, 4.0
    expected = way / speed + speed / acceleration
    assert peer.optimal_duration(path, (), bound) == pytest.approx(expected, rel=1e-6)


def test_toppra_stops_where_a_corner_is_not_rounded():
    pytest.importorskip('toppra')
    from benchmarks.motions import toppra_peer as peer

    path, bound = Path(CORNERS), limits()
    edges = [peer.optimal_duration(Path(CORNERS[i : i + 2]), (), bound) for i in range(3)]
    stops = peer.optimal_duration(path, blends_of(CORNERS, 0.0, 0.0), bound)
    assert stops == pytest.approx(sum(edges), rel=1e-9)
    rounded = blends_of(CORNERS, 0.2, 0.15)
    fastest = peer.optimal_duration(path, rounded, bound)
    assert fastest < 0.95 * stops
    # The grid is fine enough.
    assert peer.optimal_duration(path, rounded, bound, 3) == pytest.approx(fastest, rel=1e-4)
    free = replace(bound, jerk=np.full(4, 1e6))
    assert parameterize(path, rounded, free).duration > (1 - 1e-4) * fastest


def test_the_command_names_what_is_missing(capsys):
    from benchmarks.motions.__main__ import main

    assert main([], lambda name: None if name == 'toppra' else name) == 2
    assert capsys.readouterr().err.startswith('toppra: not installed')


@pytest.mark.slow
def test_a_short_run_writes_the_report_and_pictures(tmp_path, capsys, monkeypatch):
    for name in ('pyarrow', 'tqdm', 'matplotlib', 'toppra'):
        pytest.importorskip(name)
    from benchmarks.motions.__main__ import main
    from benchmarks.motions.rows import read_motions
    from benchmarks.motions.table import FAULTS

    # One process besides this one judges so few motions before another one has begun.
    monkeypatch.setattr(os, 'cpu_count', lambda: 1)
    data = tmp_path / 'rows.parquet'
    where = ['--output', str(tmp_path), '--data', str(data)]
    assert main(['--queries', '2', '--bent', '1', *where]) == 0
    text = (tmp_path / 'motions.md').read_text(encoding='utf-8')
    assert 'Written by `python -m benchmarks.motions --queries 2 --bent 1`; do not edit.' in text
    assert (tmp_path / 'images' / 'motions' / 'toppra.png').stat().st_size > 10_000
    rows = read_motions(data)
    assert [row['is_sought'] for row in rows[:2]] == [False] * 2
    # Queries go on until there are enough motions with corners; none of those is left out.
    assert all(row['is_sought'] for row in rows[2:])
    assert sum(row['is_solved'] and row['n_corners'] > 0 for row in rows) >= 1
    assert all(row['n_corners'] > 0 or not row['is_solved'] for row in rows[2:])
    assert not [row['contact'] for row in rows if row['contact']]
    # A row that breaks everything is listed, and the report can be written again without planning.
    from benchmarks.motions.rows import write_motions

    broken = next(row for row in rows if row['is_solved'])
    broken |= {'contact': 'bar 3', 'jerk_ratio': 1.02, 'is_at_rest': False, 'deviation': 2e-4}
    broken |= {'fcl_distance': 0.01, 'is_at_ends': False, 'is_increasing': False}
    write_motions(data, rows)
    assert main(['--report-only', *where]) == 0
    text = (tmp_path / 'motions.md').read_text(encoding='utf-8')
    for name in set(FAULTS) - {'not certified'}:
        assert name in text
    assert '**no**' in capsys.readouterr().out
