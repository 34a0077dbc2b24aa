# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Reach and curvature bounds are never below what the arm really does."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.certificate import derivative_bounds
from rrth_planner.collision.reference_checker import frames
from rrth_planner.collision.world import arm_world
from rrth_planner.kernels.collision.arm_validity import curvature_bounds
from rrth_planner.model.arm import bar_ends, bar_names, bars_of, Capsule
from rrth_planner.model.reach import reach_table
from rrth_planner.model.scene import Scene
from worlds import (
    bezier_quintic,
    capsule_arm,
    compiled_chain,
    examples,
    line,
    oracle_bars,
    random_chain,
    seeded_capsule_arm,
    table_1_arm,
)

SEEDS = st.integers(0, 2**32 - 1)


def axis_distances(arm, q, ray):
    """Return how far bar ends are from joint axes, (n, n_bars, 2, dof) [m]; 0 where not moved."""
    T, ends = frames(arm, q), oracle_bars(arm, q, ray)
    distances = np.zeros((len(q), ends.shape[1], 2, arm.dof))
    for k, bar in enumerate(bars_of(arm)):
        for side in range(2):
            for j in range(arm.dof):
                if isinstance(bar.source, Capsule):
                    is_moved = bar.body > j
                else:
                    row, end = bar.source
                    # `a` begins where the `d` before it ends, and ends where the next one begins.
                    at = row - 1 if end == 'a' and side == 0 else row
                    is_moved = at > j or (at == j and (end == 'd') == (side == 1))
                if is_moved:
                    away = np.cross(T[:, j, :3, 2], ends[:, k, side] - T[:, j, :3, 3])
                    distances[:, k, side, j] = np.linalg.norm(away, axis=1)
    return distances


@examples(150)
@given(seed=SEEDS, has_tail=st.booleans())
def test_no_point_is_further_from_a_joint_axis_than_its_reach(seed, has_tail):
    rng = np.random.default_rng(seed)
    arm = random_chain(rng, has_tail) if seed % 2 else capsule_arm(rng, 2 + seed % 6)
    q = rng.uniform(*arm.bounds, (300, arm.dof))
    at_stops = rng.random(q.shape) < 0.2
    q = np.where(at_stops, np.where(rng.random(q.shape) < 0.5, *arm.bounds), q)
    greatest = axis_distances(arm, q, 0.9).max(axis=0)
    table = reach_table(arm, 0.9)[: len(bars_of(arm))]
    revolute = ~np.array(arm.is_prismatic)
    assert (greatest <= table + 1e-12)[..., revolute].all()


def test_the_reach_of_the_paper_arm_is_attained_within_two_percent():
    rng = np.random.default_rng(5)
    arm = table_1_arm()
    greatest = axis_distances(arm, rng.uniform(*arm.bounds, (100000, 4)), 1.0).max(axis=0)
    table = reach_table(arm, 1.0)
    assert (greatest >= 0.98 * table).all()
    assert (greatest <= table + 1e-12).all()


def second_differences(arm, curve, ray, u, h):
    """Return the norms of second differences of bar ends along a polynomial motion."""
    at = np.concatenate([u - h, u, u + h])
    q = sum(c * at[:, None] ** power for power, c in enumerate(curve))
    before, now, after = np.split(oracle_bars(arm, q, ray), 3)
    return np.linalg.norm(before - 2 * now + after, axis=-1) / h**2


def bows_of(arm, speed, bend, ray):
    world = arm_world(arm, Scene(()), 0.0, ray)
    bows = np.full(2 * len(world.bar_names), np.nan)
    curvature_bounds(world.robot, len(world.bar_names), speed, bend, bows)
    return bows.reshape(-1, 2)


@examples(150)
@given(seed=SEEDS, has_tail=st.booleans())
def test_straight_motions_bend_no_more_than_bounded(seed, has_tail):
    rng = np.random.default_rng(seed)
    arm = compiled_chain(rng, has_tail)
    if seed % 4 == 0:
        arm = seeded_capsule_arm(0)
    for _ in range(3):
        curve = line(*rng.uniform(*arm.bounds, (2, arm.dof)))
        # At times a single joint moves, alone its bound is the sharpest.
        curve[1] *= rng.random(arm.dof) < rng.choice([1.0, 0.4])
        bows = bows_of(arm, np.abs(curve[1]), np.zeros(arm.dof), 0.9)
        seen = second_differences(arm, curve, 0.9, np.linspace(0.01, 0.99, 80), 1e-3)
        assert (seen <= bows + 1e-8).all()


@examples(150)
@given(seed=SEEDS, has_tail=st.booleans())
def test_quintic_motions_bend_no_more_than_bounded(seed, has_tail):
    rng = np.random.default_rng(seed)
    arm = compiled_chain(rng, has_tail) if seed % 4 else seeded_capsule_arm(0)
    curve = bezier_quintic(rng.uniform(*arm.bounds, (6, arm.dof)))
    speed, bend = derivative_bounds(curve[None])
    bows = bows_of(arm, speed[0], bend[0], 0.9)
    seen = second_differences(arm, curve, 0.9, np.linspace(0.01, 0.99, 200), 1e-3)
    assert (seen <= bows + 1e-7).all()


def test_curvature_of_a_single_turning_joint_is_attained():
    arm = table_1_arm()
    speed = np.array([0.0, 0.0, 0.0, 2.0])
    bows = bows_of(arm, speed, np.zeros(4), 1.0)
    # The ray, square to the last axis, turns at 2 rad.
    assert bows[-1, 1] == pytest.approx(4.0 * 1.0)


def test_every_bar_has_a_name_and_the_mount_is_none():
    arm = table_1_arm()
    assert bar_names(arm) == ('link 3', 'link 4', 'pointing ray')
    assert bar_ends(arm) == ((2, 'd'), (3, 'd'), (4, 'd'))
