# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Kinematics against numpy, the reference checker and roboticstoolbox."""

from dataclasses import replace
import itertools
from unittest import mock

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision import bar_pairs
from rrth_planner.collision.bar_pairs import pairs_of
from rrth_planner.collision.reference_checker import bar_ends_at, frames
from rrth_planner.collision.world import arm_world, robot_rows
from rrth_planner.kernels.kinematics.generated_fk import chain_source
from rrth_planner.kernels.kinematics.trigonometry import sine_cosine
from rrth_planner.kernels.layout import STRIDE
from rrth_planner.model.arm import (
    bars_of,
    forward_kinematics,
    mount_bars,
    pointing_error,
    tool_pose,
)
from rrth_planner.model.scene import Scene
from worlds import (
    capsule_arm,
    compiled_chain,
    examples,
    kernel_bars,
    oracle_bars,
    random_chain,
    table_1_arm,
    wearer_world,
)

SEEDS = st.integers(0, 2**32 - 1)


def test_sine_and_cosine_are_numpys_to_the_last_bits():
    rng = np.random.default_rng(1)
    angles = np.concatenate(
        [
            rng.uniform(-1e4, 1e4, 20000),
            rng.uniform(-7.0, 7.0, 20000),
            np.arange(-400, 400) * (0.25 * np.pi),
            [0.0, -0.0, 1e-300, 1e-9],
        ]
    )
    got = np.array([sine_cosine(x) for x in angles])
    assert np.abs(got[:, 0] - np.sin(angles)).max() <= 2e-15
    assert np.abs(got[:, 1] - np.cos(angles)).max() <= 2e-15


def test_bars_of_the_paper_arm_are_those_of_the_reference_checker():
    rng = np.random.default_rng(2)
    arm, world = table_1_arm(), wearer_world()
    q = rng.uniform(*(1.2 * arm.bounds), (10000, arm.dof))
    expected = oracle_bars(arm, q, 1.7)
    got = np.array([kernel_bars(arm, world, row, 1.7) for row in q])
    assert np.abs(got - expected).max() < 1e-13


def some_pairs_allowed(rng, dof):
    """Return an arm of capsules that has few pairs, some or many, and so some of the frames."""
    arm, share = capsule_arm(rng, dof), rng.choice([0.0, 0.5, 0.9])
    names = sorted({bar.name for bar in (*bars_of(arm), *mount_bars(arm))})
    pairs = itertools.combinations(names, 2)
    return replace(arm, allowed=tuple(pair for pair in pairs if rng.random() < share))


@examples(150)
@given(seed=SEEDS, has_tail=st.booleans())
def test_the_chain_written_for_any_arm_is_the_reference_checkers(seed, has_tail):
    rng = np.random.default_rng(seed)
    arm = random_chain(rng, has_tail) if seed % 3 else some_pairs_allowed(rng, 3 + seed % 5)
    # All pairs count that are not allowed, also those that never collide or always do.
    with mock.patch.multiple(bar_pairs, N_TRIED=1, MOST_CELLS=0, SLACK=-np.inf):
        rows = robot_rows(arm, 0.8)
    # The same lines, interpreted: to compile them for each arm would take minutes.
    text = chain_source(rows).replace('scratch.floats', 'np.empty')
    lines = [line for line in text.splitlines() if not line.startswith(('@', 'from'))]
    space = {'np': np, 'sine_cosine': sine_cosine}
    exec('\n'.join(lines), space)
    n, n_parts = len(bars_of(arm)), len(bars_of(arm)) + len(mount_bars(arm))
    stride = int(rows[arm.dof + 1, STRIDE])
    points = np.full(stride + 4, np.nan)
    for q in rng.uniform(*arm.bounds, (5, arm.dof)):
        assert space['chain'](q, 0.8, points, 2) == n
        got = points[2 : 2 + 8 * n_parts].reshape(n_parts, 2, 4)
        ends = got[:, :, :3] @ arm.T_base_mount[:3, :3].T + arm.T_base_mount[:3, 3]
        assert np.abs(ends - bar_ends_at(arm, q[None], 0.8)[0]).max() < 1e-12
        radii = [bar.radius for bar in (*bars_of(arm), *mount_bars(arm))]
        assert np.array_equal(got[:, 1, 3], radii)
        # The frames of the links that pairs are seen from, one after the other.
        placed = points[2 + 8 * n_parts : -2].reshape(-1, 4, 3)
        bodies = sorted({pair.body for pair in pairs_of(arm) if pair.body > 0})
        assert len(placed) == len(bodies)
        inverse = np.linalg.inv(arm.T_base_mount)
        for frame, body in zip(placed, bodies, strict=True):
            T = inverse @ frames(arm, q[None])[0, body - 1]
            assert np.abs(frame[0] - T[:3, 3]).max() < 1e-12
            assert np.abs(frame[1:].T - T[:3, :3]).max() < 1e-12
        assert np.isnan(points[:2]).all()
        assert np.isnan(points[-2:]).all()


@examples(60)
@given(seed=SEEDS, has_tail=st.booleans())
def test_bars_of_any_compiled_chain_are_those_of_the_reference_checker(seed, has_tail):
    rng = np.random.default_rng(seed)
    arm = compiled_chain(rng, has_tail)
    world = arm_world(arm, Scene(()), 0.0, 0.8)
    for q in rng.uniform(*arm.bounds, (5, arm.dof)):
        got = kernel_bars(arm, world, q, 0.8)
        assert np.abs(got - oracle_bars(arm, q, 0.8)[0]).max() < 1e-12
        # Bars hang together, and only the ray knows how long it is.
        assert np.array_equal(got[1:, 0], got[:-1, 1])
        longer = kernel_bars(arm, world, q, 3.0)
        assert np.array_equal(longer[:-1], got[:-1])
        assert abs(np.linalg.norm(longer[-1, 1] - longer[-1, 0]) - 3.0) < 1e-12


@examples(100)
@given(seed=SEEDS, has_tail=st.booleans())
def test_forward_kinematics_is_the_reference_checkers(seed, has_tail):
    rng = np.random.default_rng(seed)
    arm = random_chain(rng, has_tail)
    q = rng.uniform(*arm.bounds)
    poses = forward_kinematics(arm, q)
    assert np.abs(poses - frames(arm, q[None])[0]).max() < 1e-12
    assert np.abs(poses[:, :3, :3] @ poses[:, :3, :3].mT - np.eye(3)).max() < 1e-12
    assert np.array_equal(tool_pose(arm, q), poses[-1])


@examples(60)
@given(seed=SEEDS)
def test_forward_kinematics_is_roboticstoolboxs(seed):
    rtb = pytest.importorskip('roboticstoolbox')
    rng = np.random.default_rng(seed)
    arm = random_chain(rng, has_tail=bool(seed % 2))
    links = [
        rtb.PrismaticMDH(alpha=alpha, a=a, theta=offset, offset=d)
        if slides
        else rtb.RevoluteMDH(alpha=alpha, a=a, offset=offset, d=d)
        for (alpha, a, offset, d), slides in zip(arm.dh[:-1], arm.is_prismatic, strict=True)
    ]
    # The tool's row is one more link that is never moved.
    alpha, a, offset, d = arm.dh[-1]
    links.append(rtb.RevoluteMDH(alpha=alpha, a=a, offset=offset, d=d))
    robot = rtb.DHRobot(links)
    q = rng.uniform(*arm.bounds)
    expected = arm.T_base_mount @ robot.fkine(np.append(q, 0.0)).A
    assert np.abs(tool_pose(arm, q) - expected).max() < 1e-12


def test_pointing_error_is_the_distance_of_the_target_from_the_ray():
    arm = table_1_arm()
    q = np.array([0.3, -0.9, 0.4, 1.1])
    T = tool_pose(arm, q)
    on_ray = T[:3, 3] + 2.0 * T[:3, 2]
    assert pointing_error(arm, q, on_ray) < 1e-14
    assert pointing_error(arm, q, on_ray + 0.01 * T[:3, 0]) == pytest.approx(0.01)
    # Behind the tool it is the distance from the tool, not from the line.
    assert pointing_error(arm, q, T[:3, 3] - 0.5 * T[:3, 2]) == pytest.approx(0.5)
