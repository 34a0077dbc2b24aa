# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""python-fcl and coal agree with the kernels and with the reference checker."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from rrth_planner.collision import second_checker
from rrth_planner.collision.bar_pairs import pair_names, pairs_of
from rrth_planner.collision.distance_library import LIBRARIES, library_of
from rrth_planner.collision.world import arm_world
from rrth_planner.model.arm import bars_of, mount_bars, tool_pose
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import sample, Trajectory
from worlds import (
    compiled_chain,
    dense_touch,
    free_configuration,
    longest_ways,
    oracle_bars,
    random_boxes,
    seeded_capsule_arm,
    self_distances,
    table_1_arm,
    varied_body,
    wearer,
)


@pytest.fixture(params=LIBRARIES)
def checker(request):
    """Give the functions of the second checker by each library."""
    pytest.importorskip(request.param)
    required = partial(RequiredClearance, library=request.param)

    def nearest(arm, scene, q, ray):
        return second_checker.nearest(required(arm, 0.0, ray), scene, q)

    def first_violation(arm, scene, trajectory, margin, ray, reach):
        return second_checker.first_violation(required(arm, margin, ray), scene, trajectory, reach)

    return SimpleNamespace(
        nearest=nearest, first_violation=first_violation, library=library_of(request.param)
    )


def straight(q_from, q_to, duration=1.0):
    """Return the motion from rest to rest along a line: one quintic."""
    still = np.zeros((2, len(q_from)))
    return Trajectory(
        times=[0.0, duration],
        positions=np.stack([q_from, q_to]),
        velocities=still,
        accelerations=still,
    )


def check_nearest(checker, arm, scene, rng, n):
    world = arm_world(arm, scene, 0.0, 1.0)
    n_apart = 0
    for q in rng.uniform(*arm.bounds, (n, arm.dof)):
        distances = world.clearances(q)
        violation = checker.nearest(arm, scene, q, 1.0)
        least = distances.min()
        if least > 1e-4:
            n_apart += 1
            assert violation.distance == pytest.approx(least, abs=5e-6)
            # Both offsets of a row have the same name.
            rows = [name == violation.bar for name in world.bar_names]
            named = distances[rows, world.box_names.index(violation.box)].min()
            assert named == pytest.approx(least, abs=1e-5)
        elif least < -1e-4:
            assert violation.distance < 1e-5
    return n_apart


def test_nearest_is_the_kernels_least_clearance(checker):
    rng = np.random.default_rng(21)
    arm = table_1_arm()
    assert check_nearest(checker, arm, wearer(), rng, 400) > 200
    for _ in range(4):
        assert check_nearest(checker, arm, varied_body(rng), rng, 150) > 50


def test_nearest_of_thick_and_sliding_chains_is_the_kernels(checker):
    rng = np.random.default_rng(22)
    n_apart = 0
    for i in range(15):
        n_apart += check_nearest(
            checker, compiled_chain(rng, i % 2 == 0), random_boxes(rng, 3), rng, 30
        )
    assert n_apart > 100


def test_contacts_deeper_than_a_millimetre_are_found(checker):
    rng = np.random.default_rng(23)
    arm = table_1_arm()
    n_touching = n_free = 0
    for i in range(60):
        scene = wearer() if i % 2 else varied_body(rng)
        world = arm_world(arm, scene, 0.02, 1.0)
        q_from, q_to = free_configuration(rng, world), free_configuration(rng, world)
        trajectory = straight(q_from, q_to)
        dense, _, _ = sample(trajectory, np.linspace(0.0, 1.0, 4001))
        curve = np.stack([q_from, q_to - q_from])
        violation = checker.first_violation(arm, scene, trajectory, 0.02, 1.0, 1.0)
        # Round corners: what the grown boxes touch only at their edges may pass the margin.
        if world.clearances(np.ascontiguousarray(dense[::8])).min() < -0.0125:
            assert violation is not None
            n_touching += 1
        if dense_touch(arm, scene, 0.02, 1.0, curve, 8000) < 0:
            assert violation is None
            n_free += 1
        if violation is not None:
            q, _, _ = sample(trajectory, [violation.time])
            bar, box = world.bar_names.index(violation.bar), world.box_names.index(violation.box)
            own = arm_world(arm, scene, 0.0, 1.0).clearances(q[0])
            assert own[bar, box] < 0.02 + 1e-5
            earlier = dense[: int(violation.time * 4000) - 8 : 8]
            bare = arm_world(arm, scene, 0.0, 1.0)
            assert bare.clearances(np.ascontiguousarray(earlier)).min() > 0.019
    assert n_touching > 8
    assert n_free > 10


def wiggle(rng, arm, scale):
    """Return a motion whose joints turn back and forth: quintics through random states."""
    n = int(rng.integers(3, 6))
    times = np.cumsum(rng.uniform(0.02, 0.3, n))
    states = rng.standard_normal((3, n, arm.dof)) * scale
    middle = rng.uniform(*arm.bounds)
    return Trajectory(
        times=times - times[0],
        positions=middle + 0.1 * states[0],
        velocities=states[1],
        accelerations=10.0 * states[2],
    )


def every_millisecond(trajectory):
    """Return the instants that the checker may look at, and the joint positions there."""
    n = int(np.ceil(trajectory.duration / second_checker.GRID_PERIOD))
    times = np.linspace(0.0, trajectory.duration, n + 1)
    return times, sample(trajectory, times)[0]


def next_instant(ways, k, room):
    """Return the first instant after k until which a point of the arm may move that far [m]."""
    # By less than it, for rounding of the library.
    return max(k + 1, int(np.searchsorted(ways, ways[k] + room - 1e-5)))


def first_touch_by_brute_force(checker, arm, scene, trajectory, margin, ray):
    """
    Return the time of the first millisecond at which the library finds less, or None.

    Those within which no point of the arm can come as near are left out.
    """
    times, q = every_millisecond(trajectory)
    ways, least, k = longest_ways(arm, q, ray), margin - second_checker.TOLERANCE, 0
    while k < len(q):
        distance = checker.nearest(arm, scene, q[k], ray).distance
        if distance < least:
            return times[k]
        k = next_instant(ways, k, distance - least)
    return None


def least_by_brute_force(checker, arm, scene, trajectory, ray):
    """
    Return the least distance that the library finds at any millisecond; < 0: some contact.

    Those at which no point of the arm can be nearer than elsewhere are left out.
    """
    _, q = every_millisecond(trajectory)
    ways = longest_ways(arm, q, ray)
    # A first idea.
    least = min(checker.nearest(arm, scene, one, ray).distance for one in q[::25])
    k = 0
    while k < len(q) and least >= 0.0:
        distance = checker.nearest(arm, scene, q[k], ray).distance
        least = min(least, distance)
        k = next_instant(ways, k, distance - least)
    return least


def test_no_point_of_an_arm_moves_further_than_its_longest_way():
    rng = np.random.default_rng(27)
    shares = []
    for i in range(40):
        arm = compiled_chain(rng, i % 2 == 0) if i % 4 else table_1_arm()
        _, q = every_millisecond(wiggle(rng, arm, rng.choice([0.3, 1.0, 3.0])))
        ends, ways = oracle_bars(arm, q, 0.5), longest_ways(arm, q, 0.5)
        for k in range(0, len(q), 20):
            moved = np.linalg.norm(ends - ends[k], axis=-1).max(axis=(1, 2))
            longest = np.abs(ways - ways[k])
            assert (moved <= longest + 1e-9).all()
            shares.append((moved / np.maximum(longest, 1e-9)).max())
    assert max(shares) > 0.5


def test_the_first_violation_is_that_of_a_check_every_millisecond(checker):
    rng = np.random.default_rng(24)
    n_touching = n_free = 0
    for i in range(120):
        is_paper = i % 3 > 0
        arm = table_1_arm() if is_paper else compiled_chain(rng, i % 2 == 0)
        scene = varied_body(rng) if is_paper else random_boxes(rng, 3)
        for _ in range(3):
            scale = rng.choice([0.3, 1.0, 3.0])
            trajectory = wiggle(rng, arm, scale)
            start, _, _ = sample(trajectory, [0.0])
            if checker.nearest(arm, scene, start[0], 0.5).distance < 0.02:
                continue
            # Touching by as little as can be, and not touching by as little, too.
            margin = rng.choice([0.0, 0.02, 0.1])
            expected = first_touch_by_brute_force(checker, arm, scene, trajectory, margin, 0.5)
            violation = checker.first_violation(arm, scene, trajectory, margin, 0.5, 0.5)
            assert (violation and violation.time) == expected
            n_touching += expected is not None
            n_free += expected is None
    assert n_touching > 40
    assert n_free > 40


def test_a_violation_of_one_instant_is_found(checker):
    rng = np.random.default_rng(25)
    arm, n_found = table_1_arm(), 0
    for _ in range(40):
        scene = varied_body(rng)
        trajectory = wiggle(rng, arm, 1.0)
        least = least_by_brute_force(checker, arm, scene, trajectory, 1.0)
        if least < 0.0:
            continue
        n_found += 1
        margin = least + 2 * second_checker.TOLERANCE
        violation = checker.first_violation(arm, scene, trajectory, margin, 1.0, 1.0)
        assert violation is not None
        assert violation.distance == pytest.approx(least, abs=2 * second_checker.TOLERANCE)
        assert checker.first_violation(arm, scene, trajectory, least, 1.0, 1.0) is None
    assert n_found > 10


def plate_beside(arm, q, gap):
    """Return a plate square to the ray's side, `gap` [m] away from it at q."""
    T = tool_pose(arm, q)
    center = T[:3, 3] + 0.5 * T[:3, 2] + (gap + 0.05) * T[:3, 0]
    return Scene((Box('plate', center, (0.1, 0.2, 0.4), T[:3, :3]),))


def test_the_margin_is_respected_to_the_hundredth_of_a_millimetre(checker):
    arm = table_1_arm()
    q = np.array([0.3, -1.2, 0.4, 0.7])
    hold = straight(q, q)
    for gap in (0.01, 0.02, 0.05):
        scene = plate_beside(arm, q, gap)
        assert checker.first_violation(arm, scene, hold, gap - 1e-5, 1.0, 0.5) is None
        violation = checker.first_violation(arm, scene, hold, gap + 1e-5, 1.0, 0.5)
        assert violation is not None
        assert (violation.time, violation.bar, violation.box) == (0.0, 'pointing ray', 'plate')
        assert violation.distance == pytest.approx(gap, abs=5e-6)


def test_a_line_in_a_box_violates_a_margin_of_nothing(checker):
    arm = table_1_arm()
    q = np.array([0.3, -1.2, 0.4, 0.7])
    hold = straight(q, q)
    assert checker.first_violation(arm, plate_beside(arm, q, 1e-5), hold, 0.0, 1.0, 0.5) is None
    for depth in (1e-5, 1e-3, 0.05):
        scene = plate_beside(arm, q, -depth)
        violation = checker.first_violation(arm, scene, hold, 0.0, 1.0, 0.5)
        assert violation is not None, depth
        assert (violation.bar, violation.box) == ('pointing ray', 'plate')


def test_a_box_crossed_in_a_few_milliseconds_is_not_jumped_over(checker):
    arm = table_1_arm()
    q_from, q_to = np.array([-1.5, -0.8, 0.0, 0.5]), np.array([1.5, -0.8, 0.0, 0.5])
    T = tool_pose(arm, np.array([0.31, -0.8, 0.0, 0.5]))
    thin = Scene((Box('blade', T[:3, 3] + 0.9 * T[:3, 2], (0.002,) * 3, np.eye(3)),))
    for duration in (0.3, 1.0, 5.0):
        violation = checker.first_violation(
            arm, thin, straight(q_from, q_to, duration), 0.02, 1.0, 1.0
        )
        assert violation is not None
        assert violation.box == 'blade'


def test_only_at_the_end_the_ray_counts_out_to_the_target(checker):
    arm = table_1_arm()
    q_from, q_to = np.array([-0.5, -0.8, 0.0, 0.5]), np.array([0.5, -0.8, 0.0, 0.5])

    def far_box(q):
        T = tool_pose(arm, q)
        return Scene((Box('far', T[:3, 3] + 1.8 * T[:3, 2], (0.1,) * 3, np.eye(3)),))

    trajectory = straight(q_from, q_to)
    assert checker.first_violation(arm, far_box(q_to), trajectory, 0.02, 1.0, 1.5) is None
    violation = checker.first_violation(arm, far_box(q_to), trajectory, 0.02, 1.0, 2.0)
    assert violation is not None
    assert violation.time == trajectory.duration
    middle = 0.5 * (q_from + q_to)
    assert checker.first_violation(arm, far_box(middle), trajectory, 0.02, 1.0, 2.0) is None


def test_nothing_collides_where_there_is_nothing(checker):
    arm = table_1_arm()
    trajectory = straight(np.array([-0.5, -0.8, 0.0, 0.5]), np.array([0.5, -0.8, 0.0, 0.5]))
    assert checker.first_violation(arm, Scene(()), trajectory, 0.02, 1.0, 1.0) is None


def test_objects_of_the_library_are_used_again(checker, monkeypatch):
    rng = np.random.default_rng(26)
    arm = table_1_arm()
    bodies = [random_boxes(rng, 1 + i) for i in range(12)]
    q_from, q_to = np.array([-1.5, -0.8, 0.0, 0.5]), np.array([1.5, -1.6, 0.6, 0.5])
    made, library = [], checker.library._module
    new = library.CollisionObject

    def counted(*arguments):
        made.append(arguments)
        return new(*arguments)

    def look():
        motion = straight(q_from, q_to)
        violations = [
            checker.first_violation(arm, body, motion, 0.05, 1.0, 1.5) for body in bodies
        ]
        return [
            violation and (violation.time, violation.distance, violation.bar, violation.box)
            for violation in violations
        ]

    before = look()
    monkeypatch.setattr(library, 'CollisionObject', counted)
    assert look() == before
    # Each that is deleted would leave some bytes behind.
    assert not made
    assert any(before)
    assert not all(before)


@pytest.mark.parametrize('seed', [0, 2])
def test_capsules_are_as_far_from_boxes_as_by_the_kernels(checker, seed):
    arm = seeded_capsule_arm(seed)
    names = sorted({bar.name for bar in (*bars_of(arm), *mount_bars(arm))})
    rng = np.random.default_rng(30 + seed)
    allowed = replace(arm, allowed=((names[1], 'box_0'), (names[-2], 'box_1')))
    for one in (arm, allowed):
        assert check_nearest(checker, one, random_boxes(rng, 3), rng, 60) > 20


@pytest.mark.parametrize('seed', [0, 2, 3])
def test_an_arm_that_touches_itself_is_found_and_one_that_does_not_is_free(checker, seed):
    arm, rng = seeded_capsule_arm(seed), np.random.default_rng(40 + seed)
    nothing, n_free, n_touching = Scene(()), 0, 0
    pairs = {frozenset(pair_names(arm, pair)) for pair in pairs_of(arm)}
    for _ in range(40):
        q_from = rng.uniform(*arm.bounds)
        q_to = np.clip(q_from + 0.6 * rng.standard_normal(arm.dof), *arm.bounds)
        trajectory = straight(q_from, q_to)
        dense, _, _ = sample(trajectory, np.linspace(0.0, 1.0, 201))
        least = self_distances(arm, dense, 0.4).min()
        violation = checker.first_violation(arm, nothing, trajectory, 0.02, 0.4, 0.4)
        if least > 1e-4:
            n_free += 1
            assert violation is None or least < 5e-3
        elif least < -1e-3:
            n_touching += 1
            assert violation is not None
            assert violation.is_of_arm
            assert violation.distance < 0.0
            assert frozenset((violation.bar, violation.box)) in pairs
            assert 'box' not in violation.other
    assert n_free > 3
    assert n_touching > 3
