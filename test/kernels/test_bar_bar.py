# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm against itself: exact at a configuration, proven along a motion."""

from dataclasses import replace
import functools
import itertools

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.bar_pairs import pairs_of
from rrth_planner.collision.certificate import derivative_bounds
from rrth_planner.collision.penetration import box_depths
from rrth_planner.collision.reference_checker import bar_distances, bar_ends_at
from rrth_planner.collision.world import arm_world
from rrth_planner.kernels.collision.arm_validity import prove_curve
from rrth_planner.kernels.collision.bar_bar import segment_gap
from rrth_planner.model.arm import bar_names, bars_of, Capsule, mount_bars
from rrth_planner.model.scene import Scene
from worlds import (
    bezier_quintic,
    examples,
    random_boxes,
    seeded_capsule_arm,
    self_distances,
    table_1_arm,
    wearer,
)

SEEDS = st.integers(0, 2**32 - 1)
RAY = 0.4
ARMS = (0, 2, 3)


def test_the_least_distance_of_pairs_is_that_of_all_pairs():
    for k in ARMS:
        arm = seeded_capsule_arm(k)
        q = np.random.default_rng(300 + k).uniform(*arm.bounds, (200, arm.dof))
        ends = bar_ends_at(arm, q, RAY)
        radii = [bar.radius for bar in (*bars_of(arm), *mount_bars(arm))]
        every = [
            bar_distances(ends[:, pair.inner], ends[:, pair.outer])
            - radii[pair.inner]
            - radii[pair.outer]
            for pair in pairs_of(arm)
        ]
        assert np.array_equal(self_distances(arm, q, RAY), np.min(every, axis=0))


@examples(300)
@given(seed=SEEDS, is_parallel=st.booleans(), n_points=st.integers(0, 2))
def test_the_gap_of_two_lines_is_the_reference_checkers(seed, is_parallel, n_points):
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-1.0, 1.0, (2, 2, 3))
    if is_parallel:
        ends[1, 1] = ends[1, 0] + rng.uniform(-2.0, 2.0) * (ends[0, 1] - ends[0, 0])
    for k in range(n_points):
        ends[k, 1] = ends[k, 0]
    rows = np.zeros((2, 8))
    rows[:, :3], rows[:, 4:7] = ends[:, 0], ends[:, 1]
    gap = np.empty(3)
    square = segment_gap(rows[0], 0, rows[1], 0, gap)
    expected = bar_distances(ends[:1], ends[1:])[0]
    assert np.sqrt(square) == pytest.approx(expected, abs=1e-7)
    assert np.linalg.norm(gap) == pytest.approx(np.sqrt(square), abs=1e-12)


@pytest.mark.parametrize('k', ARMS)
def test_a_configuration_is_valid_where_no_pair_touches(k):
    arm, rng = seeded_capsule_arm(k), np.random.default_rng(k)
    world = arm_world(arm, Scene(()), 0.0, RAY)
    q = rng.uniform(*arm.bounds, (1000, arm.dof))
    least = self_distances(arm, q, RAY)
    valid = np.array([world.is_valid(row) for row in q])
    assert np.array_equal(valid, least > 1e-9)
    assert 0.02 < np.mean(valid) < 0.98
    names = {world.colliding_bars(row) for row in q[~valid]}
    assert None not in names
    known = {*bar_names(arm), *(bar.name for bar in mount_bars(arm))}
    assert all(set(pair) <= known for pair in names)
    assert all(world.colliding_bars(row) is None for row in q[valid])


@pytest.mark.parametrize('k', ARMS)
def test_no_accepted_edge_touches_itself_and_those_that_keep_apart_are_accepted(k):
    arm, rng = seeded_capsule_arm(k), np.random.default_rng(100 + k)
    world = arm_world(arm, Scene(()), 0.0, RAY)
    n_accepted = n_apart = 0
    for _ in range(40):
        q_from = rng.uniform(*arm.bounds)
        q_to = q_from + rng.choice([0.3, 1.0, 3.0]) * rng.normal(size=arm.dof) / np.sqrt(arm.dof)
        q_to = np.clip(q_to, *arm.bounds)
        is_free = world.is_edge_valid(q_from, q_to)
        n = int(np.linalg.norm(q_to - q_from) / 1e-2) + 2
        q = q_from + np.linspace(0.0, 1.0, n)[:, None] * (q_to - q_from)
        least = self_distances(arm, q, RAY)
        if is_free:
            n_accepted += 1
            assert least.min() > 0.0
        elif least[[0, -1]].min() > 0.0 and least.min() > 2e-3:
            raise AssertionError(f'an edge that keeps {least.min()} m apart is not proven')
        n_apart += bool(least.min() > 2e-3)
    assert n_accepted >= 0.98 * n_apart > 8


@pytest.mark.parametrize('k', ARMS)
def test_no_proven_curve_touches_itself(k):
    arm, rng = seeded_capsule_arm(k), np.random.default_rng(200 + k)
    world, n_proven = arm_world(arm, Scene(()), 0.0, RAY), 0
    for _ in range(25):
        middle = rng.uniform(*arm.bounds)
        curve = bezier_quintic(middle + 0.5 * rng.normal(size=(6, arm.dof)))
        speed, bend = derivative_bounds(curve[None])
        surroundings = (world.chain, world.robot, world.obstacles)
        if prove_curve(curve, speed[0], bend[0], 2e-5, *surroundings) != 1:
            continue
        n_proven += 1
        u = np.linspace(0.0, 1.0, 300)[:, None]
        q = sum(c * u**power for power, c in enumerate(curve))
        assert self_distances(arm, q, RAY).min() > 0.0
    assert n_proven > 3


@examples(6)
@given(seed=SEEDS)
def test_pairs_left_out_never_collide_or_always_do(seed):
    rng = np.random.default_rng(seed)
    arm = seeded_capsule_arm(ARMS[rng.integers(len(ARMS))])
    bars, kept = (*bars_of(arm), *mount_bars(arm)), {(p.inner, p.outer) for p in pairs_of(arm)}
    q = rng.uniform(*arm.bounds, (400, arm.dof))
    ends = bar_ends_at(arm, q, RAY)
    for i, one in enumerate(bars):
        for j in range(i + 1, len(bars)):
            between = abs(one.body - bars[j].body)
            if between < 2 or {(i, j), (j, i)} & kept:
                continue
            gaps = bar_distances(ends[:, i], ends[:, j]) - one.radius - bars[j].radius
            assert (gaps > 0.0).all() or (gaps <= 1e-6).mean() > 0.97


def test_the_arm_of_the_paper_cannot_touch_itself():
    assert pairs_of(table_1_arm()) == ()


def test_pairs_that_may_touch_are_no_pairs():
    arm = seeded_capsule_arm(0)
    names = {bar.name for bar in (*bars_of(arm), *mount_bars(arm))}
    allowed = tuple((one, other) for one in names for other in names)
    assert pairs_of(replace(arm, allowed=allowed)) == ()
    assert len(pairs_of(replace(arm, allowed=allowed[:0]))) > 5


def test_a_bar_that_may_touch_a_box_ignores_that_box_and_nothing_else():
    arm, rng = table_1_arm(0.03), np.random.default_rng(4)
    # Its shoulder is in the head.
    upper = Capsule(name='shoulder', link=2, ends=np.zeros((2, 3)), radius=0.16)
    plain = replace(arm, capsules=(upper,))
    allowed = replace(plain, allowed=(('shoulder', 'head'),))
    scene = wearer()
    worlds = [arm_world(a, scene, 0.02, RAY) for a in (arm, plain, allowed)]
    others = Scene(tuple(box for box in scene.boxes if box.name != 'head'))
    alone = arm_world(replace(arm, capsules=(upper,)), others, 0.02, RAY)
    q = rng.uniform(*arm.bounds, (1500, arm.dof))
    bare, every, some, rest = (
        np.array([world.is_valid(row) for row in q]) for world in (*worlds, alone)
    )
    assert not every.any()
    # The other bars avoid the head, and the shoulder all other boxes.
    assert np.array_equal(some, bare & rest)
    assert some.any()
    for a, b in zip(q[:-1], q[1:], strict=True):
        one, other, third = (w.is_edge_valid(a, b) for w in (worlds[2], worlds[0], alone))
        assert one == (other and third)
    assert np.isinf(worlds[2].clearances(q[0])).sum() == 1


@examples(25)
@given(seed=SEEDS)
def test_any_of_many_bars_may_meet_any_of_many_boxes(seed):
    arm, rng = many_bars(), np.random.default_rng(seed)
    # In two levels of groups.
    scene = random_boxes(rng, 12)
    bars, boxes = bar_names(arm), [box.name for box in scene.boxes]
    may_meet = rng.random((len(bars), len(boxes))) < rng.choice([0.1, 0.9])
    named = tuple((bars[k], boxes[j]) for k, j in np.argwhere(may_meet))
    every = arm_world(arm, scene, 0.0, RAY)
    some = arm_world(replace(arm, allowed=arm.allowed + named), scene, 0.0, RAY)
    for q in rng.uniform(*arm.bounds, (10, arm.dof)):
        expected = np.where(may_meet, np.inf, every.clearances(q))
        assert np.array_equal(some.clearances(q), expected)
        depths = np.where(may_meet, -np.inf, box_depths(every, q))
        assert np.array_equal(box_depths(some, q), depths)
        assert some.is_valid(q) == (depths < 0.0).all()
        assert some.is_edge_valid(q, q + 1e-9) == some.is_valid(q)


def test_boxes_and_the_arm_itself_are_both_avoided():
    arm, rng = seeded_capsule_arm(1), np.random.default_rng(9)
    scene = random_boxes(rng, 12, spread=0.8)
    both, boxes = arm_world(arm, scene, 0.01, RAY), arm_world(arm, Scene(()), 0.0, RAY)
    free = replace(arm, allowed=tuple((a, b) for a in names_of(arm) for b in names_of(arm)))
    alone = arm_world(free, scene, 0.01, RAY)
    for q in rng.uniform(*arm.bounds, (500, arm.dof)):
        assert both.is_valid(q) == (boxes.is_valid(q) and alone.is_valid(q))


@functools.cache
def many_bars():
    """Return an arm of more bars than one number of a box has room for."""
    rng = np.random.default_rng(0)
    links = np.arange(40) % 4 + 1
    capsules = tuple(
        Capsule(name=f'part {k}', link=int(link), ends=ends, radius=0.02)
        for k, (link, ends) in enumerate(
            zip(links, rng.uniform(-0.2, 0.2, (40, 2, 3)), strict=True)
        )
    )
    arm = replace(table_1_arm(), capsules=capsules)
    return replace(arm, allowed=tuple(itertools.combinations(names_of(arm), 2)))


def names_of(arm):
    return sorted({bar.name for bar in (*bars_of(arm), *mount_bars(arm))})
