# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Separation from a wearer who moves: the reference checker and the second one."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from rrth_planner.collision import separation_checker
from rrth_planner.collision.distance_library import LIBRARIES
from rrth_planner.collision.reference_checker import (
    bar_ends_at,
    bar_velocities,
    fast_distances,
    fast_parts,
    instants,
    separation_violations,
)
from rrth_planner.collision.separation_checker import SAMPLING_PERIOD
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import ArmModel, bars_of, Capsule
from rrth_planner.model.body_reach import BODY_REACH
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import growth_at, Reach, seen_body, SeparationRules
from rrth_planner.model.trajectory import sample, Trajectory
from sample_motions import any_motion, motion_of
from worlds import capsule_arm, random_boxes, random_chain, table_1_arm

RULES = SeparationRules()
LENGTH, RADIUS, MARGIN = 0.5, 0.03, 0.02


@pytest.fixture(params=LIBRARIES)
def first_violation(request):
    """Give the second checker by each library."""
    pytest.importorskip(request.param)
    return partial(separation_checker.first_separation_violation, library=request.param)


def slowed(body, share):
    """Return a wearer whose parts get a share as far."""
    lines = (body.reach.offsets, body.reach.speeds, body.reach.stated)
    return replace(body, reach=Reach(*(share * numbers for numbers in lines)))


def random_state(rng, arm, n):
    return rng.uniform(*arm.bounds, (n, arm.dof)), rng.uniform(-1.0, 1.0, (n, arm.dof))


def random_arm(rng, kind):
    """Return an arm of thick bars, of capsules, or one that slides; its parts may all meet."""
    if kind == 0:
        return table_1_arm(0.03)
    return capsule_arm(rng) if kind == 1 else random_chain(rng, True)


def test_velocities_are_differences_of_positions():
    rng = np.random.default_rng(0)
    for kind in (0, 1, 2, 2):
        arm = random_arm(rng, kind)
        q, v = random_state(rng, arm, 20)
        ahead, behind = (bar_ends_at(arm, q + h * v, 0.0) for h in (1e-5, -1e-5))
        exact = bar_velocities(arm, q, v)
        np.testing.assert_allclose(exact, (ahead - behind) / 2e-5, atol=1e-8)
        ends, velocities, turns = separation_checker._motion(arm, q, v)
        n_bars = ends.shape[1]
        np.testing.assert_allclose(ends, bar_ends_at(arm, q, 0.0)[:, :n_bars], atol=1e-12)
        np.testing.assert_allclose(velocities, exact[:, :n_bars], atol=1e-12)
        for b, bar in enumerate(bars_of(arm)[:-1]):
            turning = np.where(arm.is_prismatic, 0.0, np.abs(v))[:, : bar.body]
            np.testing.assert_allclose(turns[:, b], turning.sum(axis=1), atol=1e-12)
        assert not bar_velocities(arm, q, 0.0 * v).any()


def test_fast_parts_are_the_places_that_are_fast():
    rng = np.random.default_rng(1)
    velocities = rng.standard_normal((400, 2, 3))
    velocities[:50, 1] = velocities[:50, 0]
    velocities[50:100, 1] = -velocities[50:100, 0]
    velocities[100:150, 0] = 0.0
    velocities[150:160] = 0.0
    slow = rng.uniform(-0.3, 2.0, 400)
    slow[::20] = 0.0
    s = np.linspace(0.0, 1.0, 301)
    speeds = np.linalg.norm(
        (1.0 - s)[:, None] * velocities[:, None, 0] + s[:, None] * velocities[:, None, 1], axis=-1
    )
    excess = speeds - slow[:, None]
    for parts in (fast_parts(velocities, slow), separation_checker._fast_parts(velocities, slow)):
        is_in = (parts[..., 0, None] <= s) & (s <= parts[..., 1, None])
        is_clear = np.abs(excess) > 1e-7
        assert (is_in.any(axis=1) == (excess > 0.0))[is_clear].all()
        assert (parts[150:160, :, 0] > parts[150:160, :, 1])[slow[150:160] >= 0.0].all()
    assert is_in.any(axis=2).all(axis=1).sum() > 20


def test_fast_distances_are_those_of_the_nearest_fast_place():
    rng = np.random.default_rng(2)
    places = np.linspace(0.0, 1.0, 2001)
    n_infinite = n_whole = 0
    for kind in (0, 1, 2, 2):
        arm, scene = random_arm(rng, kind), random_boxes(rng, 2)
        q, v = random_state(rng, arm, 12)
        found = fast_distances(arm, scene, q, v, 0.3, np.full((12, 2), np.inf))
        ends, velocities = bar_ends_at(arm, q, 0.0), bar_velocities(arm, q, v)
        for b, bar in enumerate(bars_of(arm)[:-1]):
            turns = sum(
                abs(v[:, j]) for j in range(bar.body) if not arm.is_prismatic[j]
            ) + np.zeros(12)
            points, moved = (
                x[:, b, None, 0] + places[:, None] * (x[:, b, None, 1] - x[:, b, None, 0])
                for x in (ends, velocities)
            )
            is_fast = np.linalg.norm(moved, axis=-1) + bar.radius * turns[:, None] > 0.3
            for k, box in enumerate(scene.boxes):
                outside = np.abs((points - box.center) @ box.rotation) - 0.5 * box.size
                distances = np.linalg.norm(np.maximum(outside, 0.0), axis=-1) - bar.radius
                expected = np.where(is_fast, distances, np.inf).min(axis=1)
                n_infinite += np.isinf(expected).sum()
                n_whole += is_fast.all(axis=1).sum()
                np.testing.assert_allclose(found[:, b, k], expected, atol=3e-4)
                assert (found[:, b, k] <= expected + 1e-5).all()
    assert n_infinite > 50
    assert n_whole > 50


@cache
def cases(contact_speed):
    """Return random motions, and where each violates at instants of the second checker."""
    rng, found = np.random.default_rng(3), []
    rules = replace(RULES, contact_speed=contact_speed)
    for i in range(12):
        arm = random_arm(rng, i % 3)
        scene = (load_body(), random_boxes(rng, 4))[i % 2]
        body = seen_body(scene, rng.uniform(0.0, 0.1, len(scene.boxes)), rules)
        # Those that see a wearer of full speed for seconds all violate.
        body = slowed(body, rng.choice([0.0, 0.05, 1.0]))
        motion = motion_of(rng, arm)
        every = separation_violations(arm, body, motion, rules, MARGIN, period=SAMPLING_PERIOD)
        times = [violation.time for violation in every]
        assert times == sorted(times)
        shared = {*np.arange(0.0, motion.duration, SAMPLING_PERIOD), motion.duration}
        every = [violation for violation in every if violation.time in shared]
        found.append((arm, body, motion, rules, every))
    return found


def check_agreement(first_violation, arm, body, motion, rules, expected):
    """Check one motion by both at the same instants; return whether it violates."""
    # What is no deeper than the library's rounding only one of them may find.
    deep = [violation for violation in expected if violation.depth > 2e-5]
    found = first_violation(arm, body, motion, rules, MARGIN)
    if found is None:
        assert not deep
        return False
    assert not deep or found.time <= deep[0].time
    names = [bar.name for bar in bars_of(arm)]
    k = [box.name for box in body.scene.boxes].index(found.box)
    depth = growth_at(body, rules, MARGIN, found.time)[k] - found.distance
    there = [violation for violation in expected if violation.time == found.time]
    named = [
        violation.depth
        for violation in there
        if (names[violation.bar], violation.box) == (found.bar, found.box)
    ]
    assert max(named) == pytest.approx(depth, abs=2e-5)
    assert max(violation.depth for violation in there) == pytest.approx(depth, abs=2e-5)
    return True


@pytest.mark.parametrize('contact_speed', [0.0, 0.1, 0.4])
def test_both_agree_about_random_motions(first_violation, contact_speed):
    found = [check_agreement(first_violation, *case) for case in cases(contact_speed)]
    assert sum(found) > 3
    assert contact_speed == 0.0 or sum(found) < len(found)


@cache
def least_cases(contact_speed):
    """Return motions round a wearer who stands still, and where each is nearest to him."""
    rng, arm, found = np.random.default_rng(4), table_1_arm(0.02), []
    rules = replace(RULES, contact_speed=contact_speed, body_error=0.0)
    body = seen_body(load_body(), 0.02, rules)
    body = slowed(body, 0.0)
    while len(found) < 3:
        motion = any_motion(rng)
        times = np.append(np.arange(0.0, motion.duration, SAMPLING_PERIOD), motion.duration)
        q, v, _ = sample(motion, times)
        everywhere = np.full((len(times), len(body.scene.boxes)), np.inf)
        distances = fast_distances(arm, body.scene, q, v, contact_speed, everywhere)
        least = float(distances.min())
        if 0.002 < least < 1.0:
            i, bar, k = np.unravel_index(distances.argmin(), distances.shape)
            inside = separation_violations(arm, body, motion, rules, least + 1e-3)
            outside = separation_violations(
                arm, body, motion, rules, least - 1e-3, period=SAMPLING_PERIOD
            )
            assert max(violation.depth for violation in inside) >= 1e-3 - 1e-9
            assert not outside
            place = bars_of(arm)[bar].name, body.scene.boxes[k].name
            found.append((arm, body, motion, rules, least, times[i], place))
    return found


@pytest.mark.parametrize('contact_speed', [0.0, 0.1])
def test_the_least_distance_of_a_motion_is_found_to_a_millimetre(first_violation, contact_speed):
    for arm, body, motion, rules, least, time, place in least_cases(contact_speed):
        assert first_violation(arm, body, motion, rules, least - 1e-3) is None
        violation = first_violation(arm, body, motion, rules, least + 1e-3)
        assert violation.time <= time
        violation = first_violation(arm, body, motion, rules, least + 1e-5)
        assert violation.time == pytest.approx(time, abs=0.05)
        assert (violation.bar, violation.box) == place
        assert violation.distance == pytest.approx(least, abs=2e-5)


def turning_arm():
    """Return an arm of one joint that turns a bar in the plane, and a ray that has no body."""
    capsule = Capsule(name='bar', link=1, ends=[[0.0] * 3, [LENGTH, 0.0, 0.0]], radius=RADIUS)
    return ArmModel(
        joint_names=('turn',),
        is_prismatic=(False,),
        dh=np.zeros((2, 4)),
        bounds=[[-3.0], [3.0]],
        radii=[-1.0, 0.0],
        T_base_mount=np.eye(4),
        capsules=(capsule,),
    )


def steady_turn(speed, duration=0.4):
    """Return a turn at a steady speed [rad/s], which ends in motion."""
    return Trajectory(
        [0.0, duration], [[0.0], [speed * duration]], [[speed]] * 2, np.zeros((2, 1))
    )


def box_at(center, size, name='hand'):
    return Scene((Box(name, center, size, np.eye(3)),))


def check_planted(first_violation, scene_at, motion, rules, ages):
    """Check that a box a millimetre too near is found, and that one a millimetre away is not."""
    for gap, is_found in ((-1e-3, True), (1e-3, False)):
        body = seen_body(scene_at(gap), ages, rules)
        every = separation_violations(turning_arm(), body, motion, rules, MARGIN)
        violation = first_violation(turning_arm(), body, motion, rules, MARGIN)
        assert bool(every) == is_found
        assert (violation is not None) == is_found
        if is_found:
            assert max(one.depth for one in every) == pytest.approx(1e-3, abs=1e-5)


def test_a_hand_above_that_the_arm_meets_at_the_end_of_its_motion(first_violation):
    # So much nearer than it was seen the hand may be at the end.
    lines = dict(BODY_REACH)['hand']
    growth = MARGIN + 0.01 + min(c + w * (0.4 + 0.01 + 0.05) for c, w in lines)

    def above(gap):
        return box_at((0.0, 0.0, RADIUS + growth + gap + 0.1), (2.0, 2.0, 0.2))

    check_planted(first_violation, above, steady_turn(1.0), RULES, 0.05)


def test_the_slow_part_of_a_bar_may_be_in_a_box(first_violation):
    # A thin post through the axis of the joint: the fast places begin where it is far enough away.
    reach, half = RADIUS + MARGIN + 0.01, 1e-5

    post = box_at((0.0, 0.0, 0.0), (2 * half, 2 * half, 1.0), 'torso')
    for gap, is_found in ((-1e-3, True), (1e-3, False)):
        speed = RULES.contact_speed / (reach + half + gap + RADIUS)
        body, motion = seen_body(post, 0.0, RULES), steady_turn(speed)
        every = separation_violations(turning_arm(), body, motion, RULES, MARGIN)
        violation = first_violation(turning_arm(), body, motion, RULES, MARGIN)
        assert bool(every) == is_found
        assert (violation is not None) == is_found
        if is_found:
            assert violation.distance == pytest.approx(reach - RADIUS - 1e-3, abs=2e-5)
            assert len(every) == len(instants(motion, 1e-3))
    strict = replace(RULES, contact_speed=0.0)
    body = seen_body(post, 0.0, strict)
    slowest = steady_turn(1e-4)
    assert separation_violations(turning_arm(), body, slowest, strict, MARGIN)
    assert first_violation(turning_arm(), body, slowest, strict, MARGIN) is not None


def test_a_motion_slower_than_the_contact_speed_is_always_free(first_violation):
    body = seen_body(box_at((0.2, 0.0, 0.0), (0.5, 0.5, 0.5)), 1.0, RULES)
    speed = RULES.contact_speed / (LENGTH + RADIUS)
    for factor, is_found in ((0.999, False), (1.001, True), (-0.999, False), (-1.001, True)):
        motion = steady_turn(factor * speed)
        every = separation_violations(turning_arm(), body, motion, RULES, MARGIN)
        violation = first_violation(turning_arm(), body, motion, RULES, MARGIN)
        assert bool(every) == is_found
        assert (violation is not None) == is_found


def test_in_the_strict_mode_only_what_rests_may_be_in_a_box(first_violation):
    strict, arm = replace(RULES, contact_speed=0.0), capsule_arm(np.random.default_rng(5))
    q = np.tile(arm.bounds.mean(axis=0) + 0.4, (2, 1))
    q[1, 2] += 0.02
    still = np.zeros_like(q)
    motion, bars = Trajectory([0.0, 1.0], q, still, still), bars_of(arm)[:-1]
    middles = bar_ends_at(arm, q[:1], 0.0)[0].mean(axis=1)
    for b, bar in enumerate(bars):
        body = seen_body(box_at(middles[b], (1e-3,) * 3, 'torso'), 0.0, strict)
        every = separation_violations(arm, body, motion, strict, 0.0)
        # Only the third joint moves; not even rounding makes the links before it fast.
        assert all(bars[violation.bar].body > 2 for violation in every)
        violation = first_violation(arm, body, motion, strict, 0.0)
        assert (violation is not None) == bool(every)
        if bar.body > 2:
            assert b in {violation.bar for violation in every}
        else:
            assert violation is None or violation.bar not in ('part 1', 'part 2')
    around = seen_body(box_at(middles[0], (3.0,) * 3), 1.0, strict)
    for held in (
        Trajectory([0.0], q[:1], still[:1], still[:1]),
        replace(motion, positions=q[[0, 0]]),
    ):
        assert not separation_violations(arm, around, held, strict, MARGIN)
        assert first_violation(arm, around, held, strict, MARGIN) is None


def test_pairs_that_may_meet_and_the_ray_do_not_count(first_violation):
    arm, motion = turning_arm(), steady_turn(1.0)
    body = seen_body(box_at((0.4, 0.0, 0.0), (0.1,) * 3, 'hand/0'), 0.0, RULES)
    for allowed, is_found in (((), True), ((('bar', 'hand'),), False), ((('bar', 'ha'),), True)):
        one = replace(arm, allowed=allowed)
        assert bool(separation_violations(one, body, motion, RULES, MARGIN)) == is_found
        assert (first_violation(one, body, motion, RULES, MARGIN) is not None) == is_found
    # The ray leaves the joint along its axis.
    above = seen_body(box_at((0.0, 0.0, 0.9), (0.1,) * 3, 'torso'), 0.0, RULES)
    assert not separation_violations(arm, above, motion, RULES, MARGIN)
    assert first_violation(arm, above, motion, RULES, MARGIN) is None


def test_the_instants_are_a_grid_and_the_points_and_the_end():
    motion = Trajectory([0.0, 0.0105, 0.02], np.zeros((3, 1)), np.zeros((3, 1)), np.zeros((3, 1)))
    times = instants(motion, 1e-3)
    assert len(times) == 22
    assert times[-1] == motion.duration
    assert np.diff(times).max() <= 1e-3 + 1e-12
