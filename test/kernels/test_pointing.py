# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Aiming in closed form, and sliding the goal along its manifold."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.world import arm_world, robot_rows
from rrth_planner.kernels.kinematics.pan_tilt_ik import aim, unwrap
from rrth_planner.model.arm import forward_kinematics, pointing_error, tool_pose
from rrth_planner.model.goal import PointingGoal
from rrth_planner.planning.pointing_goals import (
    check_pointing_arm,
    CLOSED_FORM,
    numerical,
    pointing_kernels,
    target_in_mount,
)
from worlds import (
    aiming_candidates,
    edge_touches,
    examples,
    free_configuration,
    is_goal_free,
    MARGIN,
    random_chain,
    RAY,
    slide_goal,
    table_1_arm,
    wearer,
)

SEEDS = st.integers(0, 2**32 - 1)
TURN = 2.0 * np.pi


def aimed(arm, target, q_near, branch, free):
    """Return the completed configuration and its reach."""
    q = np.full(arm.dof, np.nan)
    q[:-2] = free
    local = target_in_mount(arm, PointingGoal(target))
    return q, aim(robot_rows(arm, RAY), arm.bounds, local, q_near, branch, q)


def check_aims(arm, seed, n):
    """Check n random targets; return how many candidates aim, and how many differ by branch."""
    rng = np.random.default_rng(seed)
    n_aiming = n_pairs = 0
    for _ in range(n):
        target = rng.uniform(-2.0, 2.0, 3)
        q_near, free = rng.uniform(*arm.bounds), rng.uniform(*arm.bounds)[:-2]
        found = []
        for branch in range(2):
            q, reach = aimed(arm, target, q_near, branch, free)
            assert np.array_equal(q[:-2], free)
            if reach < 0.0:
                assert reach == -1.0
                continue
            assert ((q >= arm.bounds[0]) & (q <= arm.bounds[1])).all()
            T = tool_pose(arm, q)
            assert np.abs(T[:3, 3] + reach * T[:3, 2] - target).max() < 1e-9
            assert pointing_error(arm, q, target) < 1e-9
            found.append(q)
        n_aiming += len(found)
        if len(found) == 2:
            gap = (found[0] - found[1] + np.pi) % TURN - np.pi
            assert np.abs(gap).max() > 1e-3
            n_pairs += 1
    return n_aiming, n_pairs


def test_both_branches_of_the_paper_arm_meet_the_target():
    n_aiming, n_pairs = check_aims(table_1_arm(), 31, 1000)
    assert n_aiming > 1900
    assert n_pairs > 900


@examples(150)
@given(seed=SEEDS)
def test_any_pan_and_tilt_tail_meets_the_target(seed):
    arm = random_chain(np.random.default_rng(seed), has_tail=True)
    assert pointing_kernels(arm) is CLOSED_FORM
    check_pointing_arm(arm)
    check_aims(arm, seed, 10)


@pytest.mark.parametrize('tilt', [1.0, -1.0])
@pytest.mark.parametrize('ray', [1.0, -1.0])
def test_all_four_hands_of_a_tail_are_aimed(tilt, ray):
    base = table_1_arm()
    dh = base.dh.copy()
    dh[-2, 0], dh[-1, 0] = tilt * np.pi / 2, ray * np.pi / 2
    arm = type(base)(
        joint_names=base.joint_names,
        is_prismatic=base.is_prismatic,
        dh=dh,
        bounds=base.bounds,
        radii=base.radii,
        T_base_mount=base.T_base_mount,
    )
    assert check_aims(arm, 32, 200)[1] > 150


def test_a_configuration_that_aims_is_found_again_by_one_of_the_branches():
    rng = np.random.default_rng(33)
    arm = table_1_arm()
    for q in rng.uniform(*arm.bounds, (300, 4)):
        T = tool_pose(arm, q)
        target = T[:3, 3] + 1.3 * T[:3, 2]
        gaps = []
        for branch in range(2):
            again, reach = aimed(arm, target, q, branch, q[:-2])
            if reach >= 0.0:
                gaps.append(np.abs(again - q).max())
        assert min(gaps) < 1e-9


def test_a_target_on_the_pan_axis_is_rejected():
    arm = table_1_arm()
    q = np.array([0.2, -0.7, 0.0, 0.0])
    # The pan axis is that of link 3; the ray passes it at 38 mm.
    pose = forward_kinematics(arm, q)[2]
    for beside, is_met in ((0.0, False), (0.0379, False), (0.0381, True)):
        target = pose[:3, 3] + 0.8 * pose[:3, 2] + beside * pose[:3, 0]
        _, reach = aimed(arm, target, q, 0, q[:-2])
        assert (reach >= 0.0) == is_met


@examples(400)
@given(
    angle=st.floats(-50.0, 50.0),
    lower=st.floats(-7.0, 3.0),
    width=st.floats(0.01, 14.0),
    share=st.floats(0.0, 1.0),
)
def test_unwrap_gives_the_nearest_equal_angle_within_limits(angle, lower, width, share):
    upper = lower + width
    near = lower + share * width
    got = unwrap(angle, near, lower, upper)
    candidates = angle + TURN * np.arange(-20, 21)
    inside = candidates[(candidates >= lower + 1e-9) & (candidates <= upper - 1e-9)]
    if np.isnan(got):
        assert len(inside) == 0
        return
    assert lower <= got <= upper
    turns = (got - angle) / TURN
    assert abs(turns - round(turns)) < 1e-9
    if len(inside):
        assert abs(got - near) <= np.abs(inside - near).min() + 1e-9


def test_only_arms_with_a_pan_and_tilt_tail_aim_in_closed_form():
    base = table_1_arm()

    def changed(row, column, value):
        dh = base.dh.copy()
        dh[row, column] = value
        return type(base)(
            joint_names=base.joint_names,
            is_prismatic=base.is_prismatic,
            dh=dh,
            bounds=base.bounds,
            radii=base.radii,
            T_base_mount=base.T_base_mount,
        )

    assert pointing_kernels(base) is CLOSED_FORM
    for row, column, value in ((-1, 0, 1.5), (-2, 0, 1.5), (-1, 1, 0.01), (-2, 1, 0.01)):
        assert pointing_kernels(changed(row, column, value)) is numerical()


@examples(60)
@given(seed=SEEDS, has_tail=st.booleans(), n_draws=st.integers(1, 60))
def test_candidates_aim_and_those_within_a_distance_are_those_of_all(seed, has_tail, n_draws):
    rng = np.random.default_rng(seed)
    arm = random_chain(rng, has_tail)
    kernels = pointing_kernels(arm)
    target, q_near = rng.uniform(-1.5, 1.5, 3), rng.uniform(*arm.bounds)
    candidates, reaches = aiming_candidates(kernels, arm, target, q_near, n_draws)
    for q, reach in zip(candidates, reaches, strict=True):
        assert ((q >= arm.bounds[0]) & (q <= arm.bounds[1])).all()
        T = tool_pose(arm, q)
        assert np.abs(T[:3, 3] + reach * T[:3, 2] - target).max() < 1e-9
    # No farther than asked for, and nothing nearer left out.
    lengths = np.linalg.norm(candidates - q_near, axis=1)
    longest = np.median(lengths) + 1e-9 if len(lengths) else 1.0
    near, near_reaches = aiming_candidates(kernels, arm, target, q_near, n_draws, longest)
    is_near = lengths <= longest
    assert np.array_equal(near, candidates[is_near])
    assert np.array_equal(near_reaches, reaches[is_near])


@pytest.mark.parametrize('kernels', [CLOSED_FORM, numerical()], ids=['closed form', 'numerical'])
def test_sliding_never_lengthens_and_the_goal_stays_an_aim(kernels):
    arm, scene = table_1_arm(), wearer()
    world = arm_world(arm, scene, MARGIN, RAY)
    rng = np.random.default_rng(35)
    n_slid = 0
    for _ in range(150):
        target = rng.uniform(-1.5, 1.5, 3)
        q_start = free_configuration(rng, world)
        candidates, _ = aiming_candidates(kernels, arm, target, q_start, 32)
        usable = [
            q
            for q in candidates
            if is_goal_free(arm, scene, MARGIN, q, target) and world.is_edge_valid(q_start, q)
        ]
        if not usable:
            continue
        path = np.full((8, 4), np.nan)
        path[0] = q_start
        path[1] = max(usable, key=lambda q: np.linalg.norm(q - path[0]))
        before = np.linalg.norm(path[1] - path[0])
        gain = slide_goal(kernels, arm, world, target, path, 2, 2e-3)
        after = np.linalg.norm(path[1] - path[0])
        assert gain >= 0.0
        assert before - after == pytest.approx(gain, abs=1e-12)
        assert np.array_equal(path[0], q_start)
        assert np.isnan(path[2:]).all()
        assert world.is_in_bounds(path[1])
        assert pointing_error(arm, path[1], target) < 1e-9
        assert is_goal_free(arm, scene, MARGIN, path[1], target)
        assert not edge_touches(arm, scene, MARGIN, RAY, path[0], path[1])
        n_slid += gain > 0.0
    assert n_slid > 50
