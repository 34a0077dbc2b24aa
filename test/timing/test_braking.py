# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Braking as a motion: from the very state, along the path, within limits, and proven or not."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.reference_checker import quintic_states
from rrth_planner.collision.world import arm_world
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.path import Path
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import piece_coefficients, sample, Trajectory
from rrth_planner.pipeline.time_path import first_proven, in_time
from rrth_planner.timing.braking import brake, certify_braking
from rrth_planner.timing.corner_blends import round_corners
from rrth_planner.timing.parameterization import parameterize
from sample_motions import any_motion, jerks_at, path_distance
from worlds import (
    dense_touch,
    examples,
    free_configuration,
    limits,
    MARGIN,
    RAY,
    table_1_arm,
    wearer_world,
)

SEEDS = st.integers(0, 2**32 - 1)
LIMITS = limits()
ARM = table_1_arm()


@examples(150)
@given(seed=SEEDS)
def test_a_brake_begins_at_the_running_state_and_holds_path_and_limits(seed):
    rng = np.random.default_rng(seed)
    trajectory = any_motion(rng)
    time = rng.random() * trajectory.duration
    braked = brake(trajectory, time, LIMITS)
    # Beside a point of the trajectory by the piece that follows, whose jerk is another one.
    near = np.abs(trajectory.times - time).min() < 1e-5
    for got, running, gap in zip(
        (braked.positions, braked.velocities, braked.accelerations),
        sample(trajectory, [time]),
        (1e-13, 1e-8, 2e-3),
        strict=True,
    ):
        assert np.abs(got[0] - running[0]).max() <= gap * near
    assert not braked.velocities[-1].any()
    assert not braked.accelerations[-1].any()
    assert braked.duration <= trajectory.duration - time + 2e-9
    ticks = braked.times * 1e9
    assert np.abs(ticks - np.round(ticks)).max() < 1e-3

    times = np.append(np.arange(0.0, braked.duration, 2e-4), braked.duration)
    q, v, a = sample(braked, times)
    assert path_distance(q[::20], trajectory, time, trajectory.duration).max() < 1e-4
    reached = np.linspace(time, trajectory.duration, 4001)
    _, own_v, own_a = sample(trajectory, reached)
    own = (own_v, own_a, jerks_at(trajectory, reached))
    most = (LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk)
    for values, limit, also in zip((v, a, jerks_at(braked, times)), most, own, strict=True):
        allowed = 1.01 * np.maximum(limit, np.abs(also).max(axis=0)) + 1e-9
        assert (np.abs(values) <= allowed).all()


@pytest.mark.parametrize('time', [-1.0, 0.0, 2.0, 5.0])
def test_at_rest_there_is_nothing_to_brake(time):
    trajectory = parameterize(Path([[0.0] * 4, [0.4] * 4]), (), LIMITS)
    braked = brake(trajectory, min(time, trajectory.duration), LIMITS)
    assert len(braked.times) == 1
    assert not braked.velocities.any()
    expected = trajectory.positions[0 if time <= 0.0 else -1]
    np.testing.assert_allclose(braked.positions[0], expected, atol=1e-12)


def test_the_reference_checker_runs_a_brake_as_it_is_sampled():
    trajectory = parameterize(Path([[0.0] * 4, [1.0, -0.5, 0.3, 0.8]]), (), LIMITS)
    braked = brake(trajectory, 0.5, LIMITS)
    grid, *states = quintic_states(braked, 0.001)
    for got, expected in zip(sample(braked, grid), states, strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-6)


def proven_motion(rng, world):
    """Return a certified motion in a world, with a rounded corner where there is room."""
    q = np.stack([free_configuration(rng, world) for _ in range(3)])
    path = Path(q)
    return first_proven(in_time(path, (round_corners(path, world, LIMITS),), LIMITS, None), world)


def test_braking_of_a_certified_motion_is_certified():
    rng, world = np.random.default_rng(91), wearer_world()
    n_motions = 0
    while n_motions < 15:
        trajectory = proven_motion(rng, world)
        if trajectory is None:
            continue
        n_motions += 1
        for time in rng.uniform(0.0, trajectory.duration, 8):
            certificate = certify_braking(trajectory, time, world, LIMITS)
            assert certificate.is_proven, (n_motions, time, certificate)


def random_brake(rng):
    """Return a motion in an empty world, when it brakes, and how."""
    empty = arm_world(ARM, Scene(()), 0.0, 0.0)
    path = Path(rng.uniform(*ARM.bounds, (2, 4)))
    trajectory = first_proven(in_time(path, ((),), LIMITS, None), empty)
    time = rng.uniform(0.05, 0.6) * trajectory.duration
    return trajectory, time, brake(trajectory, time, LIMITS)


def box_at_the_tool(q):
    """Return a box round the tool of an arm, and the world with it."""
    scene = Scene((Box('in the way', tool_pose(ARM, q)[:3, 3], np.full(3, 0.02), np.eye(3)),))
    return scene, arm_world(ARM, scene, 0.0, 0.0)


@examples(60)
@given(seed=SEEDS)
def test_braking_before_a_box_within_the_braking_distance_is_not_certified(seed):
    trajectory, time, braked = random_brake(np.random.default_rng(seed))
    # Before the arm stands still, and where it would.
    for share in (0.6, 1.0):
        _, world = box_at_the_tool(sample(braked, [share * braked.duration])[0][0])
        certificate = certify_braking(trajectory, time, world, LIMITS)
        assert not certificate.is_proven
        assert certificate.is_violated


def check_box_beyond(rng):
    """Check that braking before a box further on is certified; return whether there is room."""
    trajectory, time, braked = random_brake(rng)
    later = sample(trajectory, np.linspace(time, trajectory.duration, 400))[0]
    ahead = later[np.abs(later - braked.positions[-1]).max(axis=1).argmin() :: 10]
    for q in ahead:
        scene, world = box_at_the_tool(q)
        pieces = piece_coefficients(braked)
        # The first box that no part of the arm meets on its way to rest, by the reference checker.
        if all(dense_touch(ARM, scene, 1e-3, 0.0, c, 200) < 0 for c in pieces):
            assert certify_braking(trajectory, time, world, LIMITS).is_proven
            assert not certify(trajectory, world).is_proven
            return True
    return False


@examples(60)
@given(seed=SEEDS)
def test_braking_before_a_box_beyond_the_braking_distance_is_certified(seed):
    check_box_beyond(np.random.default_rng(seed))


def test_most_motions_have_room_for_a_box_beyond_the_braking_distance():
    rng = np.random.default_rng(93)
    assert sum(check_box_beyond(rng) for _ in range(20)) > 14


def test_a_moved_wearer_is_seen():
    rng, world = np.random.default_rng(92), wearer_world()
    trajectory = None
    while trajectory is None:
        trajectory = proven_motion(rng, world)
    time = 0.4 * trajectory.duration
    assert certify_braking(trajectory, time, world, LIMITS).is_proven
    hand = tool_pose(ARM, brake(trajectory, time, LIMITS).positions[-1])[:3, 3]
    scene = Scene((Box('hand', hand, np.full(3, 0.08), np.eye(3)),))
    certificate = certify_braking(trajectory, time, arm_world(ARM, scene, MARGIN, RAY), LIMITS)
    assert not certificate.is_proven


def test_a_brake_has_few_points():
    trajectory = parameterize(Path([[0.0] * 4, [2.0, -0.5, 0.3, 0.8]]), (), LIMITS)
    assert len(brake(trajectory, 0.8, LIMITS).times) <= 64


def test_a_trajectory_of_one_point_is_braked_as_it_is():
    still = np.zeros((1, 4))
    point = Trajectory(times=[0.0], positions=still, velocities=still, accelerations=still)
    assert brake(point, 1.0, LIMITS).positions.tolist() == still.tolist()
