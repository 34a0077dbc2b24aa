# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The goals of a target: all that are free up to the first straight one, nearest first."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.world import arm_world
from rrth_planner.model.arm import pointing_error, tool_pose
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.planning.pointing_goals import (
    goal_configurations,
    MOST_GOALS,
    pointing_kernels,
    spreading_ratios,
    target_in_mount,
)
from worlds import (
    compiled_chain,
    edge_touches,
    examples,
    free_configuration,
    is_goal_free,
    MARGIN,
    random_boxes,
    RAY,
    table_1_arm,
    varied_body,
    wearer,
)

SEEDS = st.integers(0, 2**32 - 1)


def every_candidate(arm, target, q_near, n_draws):
    """Return the configurations of all draws that aim, nearest first, each of them once."""
    kernels = pointing_kernels(arm)
    candidates, reaches = np.empty((2 * n_draws, arm.dof)), np.empty(2 * n_draws)
    world = arm_world(arm, Scene(()), 0.0, RAY)
    n = kernels.goal_candidates(
        world.robot,
        world.bounds,
        target_in_mount(arm, PointingGoal(target)),
        q_near,
        spreading_ratios(arm.dof - kernels.n_solved),
        0,
        n_draws,
        np.inf,
        candidates,
        reaches,
    )
    return once(sorted(candidates[:n], key=lambda q: np.linalg.norm(q - q_near)))


def once(candidates):
    """Return the candidates without those that are found twice."""
    kept = []
    for q in candidates:
        if not any(np.abs(q - other).max() < 1e-5 for other in kept[-8:]):
            kept.append(q)
    return kept


def goals_by_brute_force(arm, scene, world, target, q_near, n_draws):
    """Return the free ones of all candidates up to the first straight one, and the others."""
    free, touching = [], []
    for q in every_candidate(arm, target, q_near, n_draws):
        if not is_goal_free(arm, scene, MARGIN, q, target):
            touching.append(q)
            continue
        free.append(q)
        if world.edge_check(
            q_near, q, world.resolution, world.chain, world.robot, world.obstacles
        ):
            return free, touching, True
    return free, touching, False


def check_goals(arm, scene, rng, n_draws):
    """Check the goals of a random target; return how many, and whether the last is straight."""
    world = arm_world(arm, scene, MARGIN, RAY)
    q_near = free_configuration(rng, world)
    target = rng.uniform(-1.5, 1.5, 3)
    found = goal_configurations(arm, PointingGoal(target), world, q_near, n_draws)
    lengths = np.linalg.norm(found.q_goals - q_near, axis=1)
    assert (np.diff(lengths) >= 0.0).all()
    for q in found.q_goals:
        assert world.is_in_bounds(q)
        assert pointing_error(arm, q, target) < 1e-9
        assert is_goal_free(arm, scene, MARGIN, q, target)
    for q, reach in zip(found.q_blocked, found.blocked_reaches, strict=True):
        assert pointing_error(arm, q, target) < 1e-9
        assert reach == pytest.approx(np.linalg.norm(target - tool_pose(arm, q)[:3, 3]))
        assert not is_goal_free(arm, scene, MARGIN, q, target)
    free, touching, is_straight = goals_by_brute_force(arm, scene, world, target, q_near, n_draws)
    assert found.n_bent == len(found.q_goals) - is_straight
    assert found.n_aiming >= len(found.q_goals) + len(found.q_blocked)
    for got, expected in ((found.q_goals, free), (found.q_blocked, touching)):
        got = once(got)
        assert len(got) == len(expected)
        assert not got or np.abs(np.array(got) - expected).max() < 1e-5
    for q in found.q_goals[: found.n_bent]:
        assert not world.is_edge_valid(q_near, q)
    for q in found.q_goals[found.n_bent :]:
        assert world.is_edge_valid(q_near, q)
        assert not edge_touches(arm, scene, MARGIN, RAY, q_near, q)
    return len(found.q_goals), is_straight


def test_goals_round_a_body_are_those_of_brute_force():
    rng = np.random.default_rng(34)
    found = [
        check_goals(table_1_arm(), wearer() if i % 2 else varied_body(rng), rng, n_draws)
        for i, n_draws in enumerate([1, 2] * 40 + [24, 25, 64] + [128] * 45)
    ]
    n_goals, is_straight = np.array(found).T
    assert n_goals.sum() > 100
    assert n_goals.max() > 10
    assert 50 < is_straight.sum() < len(found) - 3


@examples(40)
@given(seed=SEEDS, has_tail=st.booleans())
def test_goals_of_any_arm_are_those_of_brute_force(seed, has_tail):
    rng = np.random.default_rng(seed)
    arm = compiled_chain(rng, has_tail)
    world_rng = np.random.default_rng(seed)
    scene = random_boxes(world_rng, 3, spread=1.2)
    if not any(arm_world(arm, scene, MARGIN, RAY).is_valid(q) for q in draws(arm)):
        return
    check_goals(arm, scene, rng, 32)


def draws(arm):
    """Return some configurations of an arm."""
    return np.random.default_rng(0).uniform(*arm.bounds, (300, arm.dof))


def test_a_configuration_that_aims_already_is_the_only_goal():
    arm, scene, rng = table_1_arm(), wearer(), np.random.default_rng(36)
    world = arm_world(arm, scene, MARGIN, RAY)
    n_kept = 0
    while n_kept < 20:
        q = free_configuration(rng, world)
        T = tool_pose(arm, q)
        target = T[:3, 3] + 0.8 * T[:3, 2]
        goals = goal_configurations(arm, PointingGoal(target), world, q, 128)
        # One of the two branches of the first draw is the configuration itself.
        assert np.abs(goals.q_goals[0] - q).max() < 1e-9
        assert len(goals.q_goals) == 1
        assert goals.n_bent == 0
        n_kept += 1


def test_no_more_goals_are_kept_than_there_is_room_for():
    # From a start that touches no edge is free.
    arm, scene, rng = table_1_arm(), wearer(), np.random.default_rng(37)
    world = arm_world(arm, scene, MARGIN, RAY)
    q_near = rng.uniform(*world.bounds)
    while world.is_valid(q_near):
        q_near = rng.uniform(*world.bounds)
    goals = goal_configurations(arm, PointingGoal([1.2, 0.4, 0.3]), world, q_near, 2000)
    assert len(goals.q_goals) == goals.n_bent == MOST_GOALS
    assert (np.diff(np.linalg.norm(goals.q_goals - q_near, axis=1)) >= 0.0).all()
