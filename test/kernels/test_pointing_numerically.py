# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Goals of any arm, without a closed form: against plain numpy, and against the closed form."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.world import arm_world, robot_rows
from rrth_planner.kernels import jit
from rrth_planner.kernels.kinematics.ik_projection import measure_aim, project, WORK_ROWS
from rrth_planner.model.arm import ArmModel, pointing_error, tool_pose
from rrth_planner.model.errors import ModelError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.planning.pointing_goals import (
    check_pointing_arm,
    CLOSED_FORM,
    numerical,
    pointing_kernels,
    target_in_mount,
)
from worlds import (
    aiming_candidates,
    compiled_chain,
    edge_touches,
    examples,
    is_goal_free,
    MARGIN,
    QUARTER,
    random_boxes,
    random_chain,
    RAY,
    slide_goal,
    table_1_arm,
)

SEEDS = st.integers(0, 2**32 - 1)
EMPTY = Scene(())


def simple_arm(dh, is_prismatic, lower=-3.0, upper=3.0):
    """Return an arm of the given rows, all its joints with the same limits."""
    dof = len(is_prismatic)
    return ArmModel(
        joint_names=tuple(f'j{i}' for i in range(dof)),
        is_prismatic=is_prismatic,
        dh=np.array(dh, dtype=float),
        bounds=np.array([np.full(dof, lower), np.full(dof, upper)]),
        radii=np.zeros(dof + 1),
        T_base_mount=np.eye(4),
    )


def reachable_target(arm, rng):
    """Return a point of the ray of a random configuration, which may lie anywhere [m]."""
    T = tool_pose(arm, rng.uniform(*arm.bounds))
    return T[:3, 3] + rng.uniform(0.1, 3.0) * T[:3, 2]


def projected(arm, target, q):
    """Return the projection of q onto the goal manifold, and its reach."""
    q = np.array(q, dtype=float)
    local = target_in_mount(arm, PointingGoal(target))
    work = np.full((WORK_ROWS, arm.dof), np.nan)
    return q, project(robot_rows(arm, RAY), arm.bounds, local, q, work)


@examples(250)
@given(seed=SEEDS)
def test_candidates_of_any_arm_aim_within_limits(seed):
    rng = np.random.default_rng(seed)
    arm = random_chain(rng, has_tail=False, fewest=2)
    for target in (reachable_target(arm, rng), rng.uniform(-2.0, 2.0, 3)):
        q_near = rng.uniform(*arm.bounds)
        candidates, reaches = aiming_candidates(numerical(), arm, target, q_near, 16)
        for q, reach in zip(candidates, reaches, strict=True):
            assert ((q >= arm.bounds[0]) & (q <= arm.bounds[1])).all()
            assert pointing_error(arm, q, target) < 1e-10
            T = tool_pose(arm, q)
            # Ahead of the tool, not behind it.
            assert reach > 0.0
            assert np.abs(T[:3, 3] + reach * T[:3, 2] - target).max() < 1e-10
        gaps = np.abs(candidates[:, None] - candidates).max(axis=2)
        assert (gaps[np.triu_indices(len(candidates), 1)] >= 1e-6).all()


def test_what_can_be_reached_is_found():
    rng = np.random.default_rng(41)
    for _ in range(300):
        arm = random_chain(rng, has_tail=False, fewest=2)
        target = reachable_target(arm, rng)
        assert (
            len(aiming_candidates(numerical(), arm, target, rng.uniform(*arm.bounds), 16)[0]) > 0
        )


def test_a_configuration_that_aims_is_the_first_candidate_as_it_is():
    rng = np.random.default_rng(42)
    for _ in range(100):
        arm = random_chain(rng, has_tail=False, fewest=2)
        q_near = rng.uniform(*arm.bounds)
        T = tool_pose(arm, q_near)
        target = T[:3, 3] + 0.7 * T[:3, 2]
        candidates, reaches = aiming_candidates(numerical(), arm, target, q_near, 2)
        assert np.abs(candidates[0] - q_near).max() < 1e-9
        assert reaches[0] == pytest.approx(0.7, abs=1e-9)


def test_slopes_are_the_derivatives_of_the_angle():
    rng = np.random.default_rng(43)
    n_ahead = 0
    for _ in range(100):
        arm = random_chain(rng, has_tail=False, fewest=2)
        robot = robot_rows(arm, RAY)
        q, target = rng.uniform(*arm.bounds), rng.uniform(-2.0, 2.0, 3)
        local = target_in_mount(arm, PointingGoal(target))
        work, spare = np.empty((2, WORK_ROWS, arm.dof))
        angle, distance = measure_aim(robot, local, q, work)
        T = tool_pose(arm, q)
        v = target - T[:3, 3]
        assert distance == pytest.approx(np.linalg.norm(v), abs=1e-12)
        assert np.cos(angle) == pytest.approx(v @ T[:3, 2] / distance, abs=1e-12)
        if not 0.1 < angle < 3.0:
            continue
        n_ahead += 1
        for k in range(arm.dof):
            step = 1e-6 * np.eye(arm.dof)[k]
            rise = measure_aim(robot, local, q + step, spare)[0]
            fall = measure_aim(robot, local, q - step, spare)[0]
            assert -work[3, k] == pytest.approx((rise - fall) / 2e-6, abs=1e-6, rel=1e-4)
    assert n_ahead > 50


def test_goals_in_closed_form_are_where_a_projection_stays():
    rng, arm = np.random.default_rng(44), table_1_arm()
    for _ in range(50):
        target, q_near = rng.uniform(-1.5, 1.5, 3), rng.uniform(*arm.bounds)
        goals, reaches = aiming_candidates(CLOSED_FORM, arm, target, q_near, 8)
        for goal, reach in zip(goals, reaches, strict=True):
            q, again = projected(arm, target, goal)
            assert np.abs(q - goal).max() < 1e-9
            assert again == pytest.approx(reach, abs=1e-9)


def test_the_nearest_goals_are_as_near_as_those_in_closed_form():
    rng, arm = np.random.default_rng(45), table_1_arm()
    world = arm_world(arm, EMPTY, 0.0, RAY)
    excess, excess_slid = [], []
    for _ in range(100):
        target, q_near = rng.uniform(-1.5, 1.5, 3), rng.uniform(*arm.bounds)
        near, slid = [], []
        for kernels in (CLOSED_FORM, numerical()):
            goals, _ = aiming_candidates(kernels, arm, target, q_near, 128)
            path = np.array([q_near, goals[np.argmin(np.linalg.norm(goals - q_near, axis=1))]])
            near.append(np.linalg.norm(path[1] - path[0]))
            slide_goal(kernels, arm, world, target, path, 2, 1e-3)
            slid.append(np.linalg.norm(path[1] - path[0]))
            assert slid[-1] <= near[-1]
        excess.append(near[1] - near[0])
        excess_slid.append(slid[1] - slid[0])
    assert np.mean(excess) < 0.02
    assert np.mean(excess_slid) < 0.01
    assert np.median(np.abs(excess_slid)) < 1e-4


@examples(60)
@given(seed=SEEDS)
def test_sliding_along_the_manifold_of_any_arm_never_lengthens(seed):
    rng = np.random.default_rng(seed)
    arm, scene = compiled_chain(rng, has_tail=False), random_boxes(rng, 2)
    world = arm_world(arm, scene, MARGIN, RAY)
    target, q_start = reachable_target(arm, rng), rng.uniform(*arm.bounds)
    candidates, _ = aiming_candidates(numerical(), arm, target, q_start, 8)
    usable = [
        q
        for q in sorted(candidates, key=lambda q: np.linalg.norm(q - q_start))
        if is_goal_free(arm, scene, MARGIN, q, target) and world.is_edge_valid(q_start, q)
    ]
    for q in usable[:1] + usable[-1:]:
        path = np.full((4, arm.dof), np.nan)
        path[0], path[1] = q_start, q
        before = np.linalg.norm(path[1] - path[0])
        gain = slide_goal(numerical(), arm, world, target, path, 2, 2e-3)
        assert gain >= 0.0
        assert before - np.linalg.norm(path[1] - path[0]) == pytest.approx(gain, abs=1e-12)
        assert np.array_equal(path[0], q_start)
        assert np.isnan(path[2:]).all()
        assert world.is_in_bounds(path[1])
        assert pointing_error(arm, path[1], target) < 1e-10
        assert is_goal_free(arm, scene, MARGIN, path[1], target)
        assert not edge_touches(arm, scene, MARGIN, RAY, path[0], path[1], 5e-3)


def test_a_slide_ends_where_the_manifold_is_square_to_the_edge():
    rng = np.random.default_rng(46)
    n_inside = 0
    for _ in range(90):
        arm = compiled_chain(rng, has_tail=False)
        world = arm_world(arm, EMPTY, 0.0, RAY)
        target, q_start = reachable_target(arm, rng), rng.uniform(*arm.bounds)
        candidates, _ = aiming_candidates(numerical(), arm, target, q_start, 8)
        nearest = min(candidates, key=lambda q: np.linalg.norm(q - q_start))
        path = np.array([q_start, nearest])
        slide_goal(numerical(), arm, world, target, path, 2, 1e-5)
        q = path[1]
        if arm.dof == 2 or (np.minimum(q - arm.bounds[0], arm.bounds[1] - q) < 1e-6).any():
            continue
        n_inside += 1
        work = np.empty((WORK_ROWS, arm.dof))
        measure_aim(world.robot, target_in_mount(arm, PointingGoal(target)), q, work)
        # What of the edge is no combination of the two slopes leads along the manifold.
        across = np.linalg.qr(work[3:5].T)[0]
        edge = q_start - q
        along = edge - across @ (across.T @ edge)
        assert np.linalg.norm(along) < 1e-4
    assert n_inside > 20


def test_a_target_beyond_the_limits_has_no_candidates():
    rng, base = np.random.default_rng(47), table_1_arm()
    arm = ArmModel(
        joint_names=base.joint_names,
        is_prismatic=base.is_prismatic,
        dh=base.dh,
        bounds=np.array([-0.5, -1.5, -0.5, -0.5]) + np.array([[0.0], [1.0]]),
        radii=base.radii,
        T_base_mount=base.T_base_mount,
    )
    T = tool_pose(arm, arm.bounds.mean(axis=0))
    for away in (0.5, 2.0, 50.0):
        # On the backward ray, and beside it.
        for aside in (0.0, 0.1):
            target = T[:3, 3] - away * T[:3, 2] + aside * T[:3, 0]
            q_near = rng.uniform(*arm.bounds)
            assert len(aiming_candidates(numerical(), arm, target, q_near, 64)[0]) == 0


def test_singular_configurations_give_numbers_or_nothing():
    stretched = simple_arm([[0.0, 0.3, 0.0, 0.0]] * 7 + [[QUARTER, 0.0, 0.0, 0.0]], (False,) * 7)
    rolls = simple_arm([[0.0, 0.0, 0.0, 0.1]] * 3 + [[0.0] * 4], (False,) * 3)
    slides = simple_arm([[QUARTER, 0.0, 0.0, 0.0]] * 3 + [[0.0] * 4], (True,) * 3)
    for arm in (stretched, rolls, slides, table_1_arm()):
        for q in (np.zeros(arm.dof), arm.bounds[0], arm.bounds[1], arm.bounds.mean(axis=0)):
            q = np.clip(q, *arm.bounds)
            T = tool_pose(arm, q)
            for along, aside in ((1.0, 0.0), (-1.0, 0.0), (0.0, 0.0), (-1.0, 1e-9), (1.0, 1.0)):
                target = T[:3, 3] + along * T[:3, 2] + aside * T[:3, 1]
                candidates, reaches = aiming_candidates(numerical(), arm, target, q, 16)
                assert np.isfinite(reaches).all()
                for candidate in candidates:
                    assert pointing_error(arm, candidate, target) < 1e-9
                if along == 1.0 and aside == 0.0:
                    assert np.array_equal(candidates[0], q)


def test_wide_limits_bring_the_turns_near_the_start_first():
    # Six joints of two turns each: a draw is near in all of them once in 64.
    dh = [[QUARTER, 0.1, 0.0, 0.2]] * 6 + [[QUARTER, 0.1, 0.0, 0.0]]
    rng, arm = np.random.default_rng(48), simple_arm(dh, (False,) * 6, -6.28, 6.28)
    q_near = rng.uniform(-0.5, 0.5, 6)
    candidates, _ = aiming_candidates(numerical(), arm, np.array([1.0, 0.4, 0.8]), q_near, 64)
    assert (np.abs(candidates - q_near).max(axis=1) < 4.5).mean() > 0.3
    assert (np.abs(candidates) > 4.0).any()


def test_arms_whose_ray_sweeps_a_surface_only_are_rejected():
    pan = [0.0, 0.0, 0.0, 0.2]
    rejected = {
        'one joint': ([pan, [QUARTER, 0.0, 0.0, 0.0]], (False,)),
        'in a plane': (
            [pan, [0.0, 0.3, 0.0, 0.0], [0.0, 0.3, 0.0, 0.0], [QUARTER, 0.0, 0.0, 0.0]],
            (False,) * 3,
        ),
        'rolls': ([pan] * 3 + [[0.0] * 4], (False,) * 3),
        'slide along the ray': ([pan, [QUARTER, 0.0, 0.0, 0.0], [0.0] * 4], (False, True)),
    }
    for dh, is_prismatic in rejected.values():
        with pytest.raises(ModelError, match=r'arm: .* [01] direction\(s\), expected 2'):
            check_pointing_arm(simple_arm(dh, is_prismatic))
    slides = [[0.0, 0.0, 0.0, 0.0], [QUARTER, 0.0, QUARTER, 0.0], [QUARTER, 0.0, 0.0, 0.0]]
    arm = simple_arm(slides, (True, True))
    check_pointing_arm(arm)
    assert pointing_kernels(arm) is numerical()
    rng = np.random.default_rng(49)
    for _ in range(20):
        target = reachable_target(arm, rng)
        (q,), _ = aiming_candidates(numerical(), arm, target, rng.uniform(*arm.bounds), 8)
        assert pointing_error(arm, q, target) < 1e-10


def test_both_pairs_of_kernels_fit_the_seam():
    for kernels in (CLOSED_FORM, numerical()):
        for kernel, seam in (
            (kernels.goal_candidates, jit.CANDIDATES),
            (kernels.slide_goal, jit.SLIDE),
        ):
            assert getattr(kernel, '_numba_type_', seam) == seam
