# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The proof of separation is sound and tight, by two checkers that share nothing with it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from rrth_planner.collision.distance_library import LIBRARIES
from rrth_planner.collision.reference_checker import fast_distances, separation_violations
from rrth_planner.collision.separation import first_unproven, permitted_ahead
from rrth_planner.collision.separation_checker import first_separation_violation
from rrth_planner.io.wearer_file import load_body
from rrth_planner.kernels.collision.separation import fast_part, within_distance
from rrth_planner.model.arm import ArmModel, bars_of, Capsule
from rrth_planner.model.body_reach import KNOWN_FOR
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import (
    growth_at,
    Reach,
    seen_body,
    Separation,
    SeparationRules,
)
from rrth_planner.model.trajectory import MotionLimits, part_of, sample, Trajectory
from sample_motions import motion_of
from worlds import random_boxes, random_chain, random_rotation, seeded_capsule_arm, table_1_arm

RULES = SeparationRules()
LENGTH, RADIUS = 0.5, 0.03
SPEEDS = (0.0, 0.05, 0.1, 0.5)
# Pairs that are further apart than this do not matter to what these tests ask [m].
NEAR = 0.25
# Spacings of the instants that are looked at, the next finer one round the least of them [s].
SPACINGS = (0.04, 0.004, 4e-4, 2e-5)


@cache
def arms():
    """Return arms of thick bars, of capsules on a mount, and some that slide: few to compile."""
    chains = [random_chain(np.random.default_rng(seed), True) for seed in (1, 29)]
    assert all(any(arm.is_prismatic) and arm.radii.any() for arm in chains)
    return (table_1_arm(0.03), seeded_capsule_arm(0), *chains)


def random_reach(rng, m, share):
    """Return the reach of boxes by random lines, of which several are the least in turn."""
    n = rng.integers(1, 5)
    offsets = np.sort(rng.uniform(0.0, 0.5, (m, n)), axis=1)
    offsets[:, 0] = 0.0
    # The first is the steepest, the last may even be level.
    speeds = np.sort(rng.uniform(0.0, 4.0, (m, n)), axis=1)[:, ::-1]
    speeds[rng.random(m) < 0.2, -1] = 0.0
    return Reach(share * offsets, share * speeds, share * rng.uniform(0.0, 2.0, m))


def steady_reach(m, speed):
    """Return the reach of boxes of one greatest speed [m/s]."""
    return Reach(np.zeros((m, 1)), np.full((m, 1), speed), np.full(m, speed))


def margins_at(arm, body, motion, rules, times):
    """Return the greatest margin that the reference checker lets pass at some times, (n,) [m]."""
    q, v, _ = sample(motion, times)
    growths = np.array([growth_at(body, rules, 0.0, time) for time in times])
    distances = fast_distances(arm, body.scene, q, v, rules.contact_speed, growths + NEAR)
    return (distances - growths[:, None]).min(axis=(1, 2))


def greatest_margin(arm, body, motion, rules, begin=0.0):
    """Return the greatest margin that passes after a time, and the instant that is nearest."""
    least, low, high = np.inf, begin, motion.duration
    for spacing in SPACINGS:
        times = np.append(np.arange(low, high, spacing), high)
        found = margins_at(arm, body, motion, rules, times)
        if found.min() < least:
            least, place = float(found.min()), float(times[found.argmin()])
        if not 0.0 < least < NEAR:
            break
        low, high = max(begin, place - spacing), min(motion.duration, place + spacing)
    return (least, place) if least < NEAR else (np.inf, motion.duration)


@cache
def cases(contact_speed):
    """Return random motions of any arm near boxes, and the greatest margin that they keep."""
    rng, found = np.random.default_rng(int(1000 * contact_speed) + 5), []
    while len(found) < 10:
        arm = arms()[len(found) % len(arms())]
        rules = replace(
            RULES,
            contact_speed=contact_speed,
            body_error=rng.choice([0.0, 0.01]),
            controller_delay=rng.choice([0.0, 0.01]),
        )
        scene = load_body() if rng.random() < 0.2 else random_boxes(rng, 2, 1.0, 0.3)
        body = seen_body(scene, rng.uniform(0.0, 0.3, len(scene.boxes)), rules)
        # At full speed all meet within a second.
        share = rng.choice([0.0, 0.05, 0.3])
        body = replace(body, reach=random_reach(rng, len(scene.boxes), share))
        motion = motion_of(rng, arm)
        if motion.duration < 2.5:
            margin, time = greatest_margin(arm, body, motion, rules)
            if 2e-3 < margin < NEAR:
                found.append((arm, body, motion, rules, margin, time))
    return found


@pytest.mark.parametrize('contact_speed', SPEEDS)
def test_nothing_is_proven_that_comes_a_hundredth_of_a_millimetre_too_near(contact_speed):
    for arm, body, motion, rules, margin, time in cases(contact_speed):
        blocked = first_unproven(motion, 0.0, arm, body, rules, margin + 1e-5)
        assert blocked is not None
        # Up to there it is proven.
        assert blocked.time <= time


@pytest.mark.parametrize('library', LIBRARIES)
def test_what_is_proven_has_no_violation_by_a_distance_library(library):
    pytest.importorskip(library)
    n_proven = 0
    for contact_speed in SPEEDS:
        for arm, body, motion, rules, margin, _ in cases(contact_speed)[::2]:
            if first_unproven(motion, 0.0, arm, body, rules, margin - 1e-3) is None:
                n_proven += 1
                near = margin - 1e-3
                assert not first_separation_violation(arm, body, motion, rules, near, library)
    assert n_proven > 15


@pytest.mark.parametrize('contact_speed', SPEEDS)
def test_a_box_a_millimetre_further_away_than_the_least_distance_is_proven(contact_speed):
    lacks = []
    for arm, body, motion, rules, margin, _ in cases(contact_speed):
        for lack in (2e-4, 1e-3, np.inf):
            if first_unproven(motion, 0.0, arm, body, rules, margin - min(lack, margin)) is None:
                break
        lacks.append(lack)
    assert np.mean(np.array(lacks) <= 2e-4) >= 0.7
    # Along a bar the speed is bounded by a straight line: more of it may count as fast, by
    # centimetres where its ends move to different sides.
    assert max(lacks) <= 1e-3 or contact_speed > 0.0


@pytest.mark.parametrize('contact_speed', [0.0, 0.1])
def test_motions_anywhere_near_a_wearer_are_blocked_no_later_than_they_violate(contact_speed):
    rng, n_proven, n_blocked = np.random.default_rng(2), 0, 0
    for i in range(16):
        arm = arms()[i % len(arms())]
        rules = replace(RULES, contact_speed=contact_speed)
        scene = load_body() if rng.random() < 0.5 else random_boxes(rng, 3)
        body = seen_body(scene, rng.uniform(0.0, 0.3, len(scene.boxes)), rules)
        if rng.random() < 0.7:
            share = rng.choice([0.0, 0.1, 1.0])
            body = replace(body, reach=random_reach(rng, len(scene.boxes), share))
        motion = motion_of(rng, arm)
        blocked = first_unproven(motion, 0.0, arm, body, rules, 0.02)
        every = separation_violations(arm, body, motion, rules, 0.02, period=0.01)
        if blocked is None:
            n_proven += 1
            assert not every
            continue
        n_blocked += 1
        assert blocked.bar in [bar.name for bar in bars_of(arm)[:-1]]
        assert blocked.box in [box.name for box in scene.boxes]
        assert 0.0 <= blocked.time <= (every[0].time if every else motion.duration)
    assert n_proven > 0
    assert n_blocked > 5


def test_the_bar_and_the_box_that_are_named_are_the_ones_too_near():
    n_named = 0
    for arm, body, motion, rules, margin, _ in cases(0.0):
        blocked = first_unproven(motion, 0.0, arm, body, rules, margin + 1e-3)
        times = blocked.time + np.linspace(0.0, 2e-4, 5)
        q, v, _ = sample(motion, np.minimum(times, motion.duration))
        growths = np.array([growth_at(body, rules, margin + 1e-3, time) for time in times])
        distances = fast_distances(arm, body.scene, q, v, 0.0, growths + 1.0)
        lacks = (distances - growths[:, None]).min(axis=0)
        bars = [b for b, bar in enumerate(bars_of(arm)[:-1]) if bar.name == blocked.bar]
        boxes = [k for k, box in enumerate(body.scene.boxes) if box.name == blocked.box]
        assert lacks[np.ix_(bars, boxes)].min() < 5e-4
        n_named += (lacks > 1e-2).any()
    assert n_named > 5


@pytest.mark.parametrize('contact_speed', [0.0, 0.1])
def test_only_what_comes_after_the_beginning_counts(contact_speed):
    rng, n_later = np.random.default_rng(3), 0
    for arm, body, motion, rules, margin, time in cases(contact_speed):
        for begin in (rng.random() * time, min(time + 0.05, motion.duration)):
            least, place = greatest_margin(arm, body, motion, rules, begin)
            blocked = first_unproven(motion, begin, arm, body, rules, least + 1e-5)
            if least < np.inf:
                assert blocked is not None
                assert begin - 1e-12 <= blocked.time <= place
            if contact_speed == 0.0:
                within = min(least - 1e-3, NEAR)
                assert first_unproven(motion, begin, arm, body, rules, within) is None
            n_later += least > margin + 2e-3
        for begin in (motion.duration, motion.duration + 1.0):
            assert first_unproven(motion, begin, arm, body, rules, 10.0) is None
        for begin in (-1.0, 0.0, np.nextafter(0.0, 1.0)):
            assert first_unproven(motion, begin, arm, body, rules, margin + 1e-5) is not None
    assert n_later > 3


@pytest.mark.parametrize('contact_speed', [0.0, 0.1])
def test_what_is_proven_stays_so_for_a_body_seen_later_and_for_the_rest_of_the_motion(
    contact_speed,
):
    rng, n_proven = np.random.default_rng(4), 0
    for arm, body, motion, rules, margin, _ in cases(contact_speed):
        proven = margin - 1e-3
        if first_unproven(motion, 0.0, arm, body, rules, proven) is not None:
            continue
        n_proven += 1
        for share in (0.9, 0.3, 0.0):
            later = replace(body, ages=share * body.ages)
            assert first_unproven(motion, 0.0, arm, later, rules, proven) is None
        for begin in rng.uniform(0.0, motion.duration, 4):
            # An interval is proven to 0.1 mm, and these are others.
            assert first_unproven(motion, begin, arm, body, rules, proven - 2e-4) is None
            rest = part_of(motion, begin, motion.duration)
            older = replace(body, ages=body.ages + begin)
            assert first_unproven(rest, 0.0, arm, older, rules, proven - 2e-4) is None
    assert n_proven > 6


def test_a_body_seen_longer_ago_is_no_nearer_than_its_speed_permits():
    for arm, body, motion, rules, margin, _ in cases(0.0):
        reach = steady_reach(len(body.ages), 0.2)
        moving = replace(body, reach=reach, ages=0.0 * body.ages)
        base = replace(rules, controller_delay=0.0)
        margin, _ = greatest_margin(arm, moving, motion, base)
        if not 0.0 < margin < NEAR:
            continue
        # So long ago it may have come by just that much.
        for extra, is_proven in ((-1e-3, True), (1e-5, False)):
            age = max(0.0, (margin + extra) / 0.2)
            older = replace(moving, ages=np.full(len(body.ages), age))
            late = replace(base, controller_delay=age)
            assert (first_unproven(motion, 0.0, arm, older, base, 0.0) is None) == is_proven
            assert (first_unproven(motion, 0.0, arm, moving, late, 0.0) is None) == is_proven


@pytest.mark.parametrize('contact_speed', [0.0, 0.1])
def test_what_is_proven_by_lines_is_so_at_random_instants(contact_speed):
    rng, n_instants = np.random.default_rng(9), 0
    rules = replace(RULES, contact_speed=contact_speed)
    for i in range(120):
        arm = arms()[i % len(arms())]
        scene, motion = random_boxes(rng, 3, 1.5, 0.3), motion_of(rng, arm)
        ages = rng.uniform(0.0, rng.choice([0.1, 3.0]), len(scene.boxes))
        reach = random_reach(rng, len(ages), rng.choice([0.1, 0.3, 1.0]))
        body = replace(seen_body(scene, ages, rules), reach=reach)
        if first_unproven(motion, 0.0, arm, body, rules, 0.02) is not None:
            continue
        times = rng.uniform(0.0, motion.duration, 400)
        q, v, _ = sample(motion, times)
        # By the words of the definition.
        elapsed = (times[:, None] + rules.controller_delay + ages)[..., None]
        growths = (reach.offsets + reach.speeds * elapsed).min(axis=-1)
        beyond = elapsed[..., 0] > KNOWN_FOR
        growths = np.where(beyond, np.maximum(growths, reach.stated * elapsed[..., 0]), growths)
        growths += 0.02 + rules.body_error
        assert (fast_distances(arm, scene, q, v, contact_speed, growths) >= growths[:, None]).all()
        n_instants += len(times)
    assert n_instants > 4000


def test_lines_beside_each_other_prove_and_permit_what_any_of_them_does():
    rng, n_proven, n_permitted = np.random.default_rng(8), 0, 0
    limits = MotionLimits([1.5] * 4, [4.0] * 4, [40.0] * 4)
    for _ in range(40):
        arm = table_1_arm(0.03)
        settings = Separation(
            arm=arm, rules=RULES, limits=limits, stop_limits=limits, stretch=0.02, margin=0.02
        )
        scene, motion = random_boxes(rng, 2, 1.2, 0.2), motion_of(rng, arm)
        reach = random_reach(rng, len(scene.boxes), 0.3)
        body = replace(seen_body(scene, rng.uniform(0.0, 0.1, 2), RULES), reach=reach)
        places = np.linspace(0.0, motion.duration, 20)
        is_proven = first_unproven(motion, 0.0, arm, body, RULES, 0.02) is None
        rates = permitted_ahead(motion, places, 15, body, settings, 0.02)[:, 0]
        n = reach.offsets.shape[1]
        alone = [
            replace(body, reach=Reach(reach.offsets[:, [k]], reach.speeds[:, [k]], reach.stated))
            for k in range(n)
        ]
        for one in alone:
            is_one_proven = first_unproven(motion, 0.0, arm, one, RULES, 0.02) is None
            assert is_proven or not is_one_proven
            own = permitted_ahead(motion, places, 15, one, settings, 0.02)[:, 0]
            assert (rates >= own).all()
            n_permitted += int((rates > own + 0.1).any())
            n_proven += is_proven and not is_one_proven
    assert n_proven > 3
    assert n_permitted > 10


@pytest.mark.parametrize('age', [0.0, 0.1, 0.5])
def test_until_when_a_bar_is_out_of_reach_is_when_the_least_line_gets_there(age):
    # At 0.3 m/s its tip needs 0.2 s to stop: it may be so fast where a hand needs longer.
    limits = MotionLimits([2.0], [2.0], [1e4])
    motion = steady_motion(1.0)
    settings = Separation(
        arm=turning_arm(), rules=RULES, limits=limits, stop_limits=limits, stretch=0.0, margin=0.0
    )
    low = 0.0
    for gap in np.linspace(0.05, 3.0, 60):
        scene = box_at((0.0, 0.0, RADIUS + gap + 1.0), (9.0, 9.0, 2.0))
        body = seen_body(scene, age, RULES)
        rate = permitted_ahead(motion, np.linspace(0.0, 0.3, 11), 1, body, settings, 0.0)[0, 0]
        # A place s of the bar has stopped by then: w s = v_c.
        stops = np.linspace(0.0, 2.0, 4001)
        growths = np.array([growth_at(body, RULES, 0.0, time)[0] for time in stops])
        latest = stops[growths < gap].max(initial=0.0)
        fastest = RULES.contact_speed / (LENGTH + RADIUS)
        permitted = min(1.0, fastest + limits.acceleration[0] * latest)
        # By steps of the search and of instants.
        assert rate == pytest.approx(permitted, abs=0.15)
        assert rate >= low
        low = rate
    assert low == 1.0


def turning_arm(T_base_mount=None, allowed=()):
    """Return an arm of one joint that turns a bar round the z axis of its mount."""
    ends = [[0.0] * 3, [LENGTH, 0.0, 0.0]]
    capsule = Capsule(name='bar', link=1, ends=ends, radius=RADIUS)
    return ArmModel(
        joint_names=('turn',),
        is_prismatic=(False,),
        dh=np.zeros((2, 4)),
        bounds=[[-3.0], [3.0]],
        radii=[-1.0, 0.0],
        T_base_mount=np.eye(4) if T_base_mount is None else T_base_mount,
        capsules=(capsule,),
        allowed=allowed,
    )


def sliding_arm():
    """Return an arm that slides a tube along z, 0.2 m long where it begins."""
    return ArmModel(
        joint_names=('slide',),
        is_prismatic=(True,),
        dh=[[0.0, 0.0, 0.0, 0.2], [0.0] * 4],
        bounds=[[-1.0], [3.0]],
        radii=[RADIUS, 0.0],
        T_base_mount=np.eye(4),
    )


def steady_motion(speed, duration=0.4):
    """Return a motion of one joint at a steady speed, which ends in motion."""
    return Trajectory(
        [0.0, duration], [[0.0], [speed * duration]], [[speed]] * 2, np.zeros((2, 1))
    )


def box_at(center, size, name='hand', rotation=None):
    return Scene((Box(name, center, size, np.eye(3) if rotation is None else rotation),))


def test_a_bar_that_turns_below_a_plate_is_proven_up_to_its_distance():
    rng = np.random.default_rng(6)
    for _ in range(10):
        # The same arm and plate, placed anywhere and turned.
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = random_rotation(rng), rng.uniform(-1.0, 1.0, 3)
        age, margin = rng.uniform(0.0, 0.3), rng.uniform(0.0, 0.05)
        hand = seen_body(box_at((0.0, 0.0, 0.0), (1.0,) * 3), age, RULES)
        growth = growth_at(hand, RULES, margin, 0.4)[0]
        for gap, is_proven in ((-1e-5, False), (2e-4, True)):
            at = T[:3, 3] + T[:3, 2] * (RADIUS + growth + gap + 0.1)
            body = seen_body(box_at(at, (2.0, 2.0, 0.2), rotation=T[:3, :3]), age, RULES)
            blocked = first_unproven(steady_motion(1.0), 0.0, turning_arm(T), body, RULES, margin)
            assert (blocked is None) == is_proven
            assert is_proven or (blocked.bar, blocked.box) == ('bar', 'hand')
            # The instant at which it has grown enough is the last one.
            assert is_proven or 0.399 < blocked.time <= 0.4


def test_no_slower_motion_than_the_contact_speed_is_blocked_and_any_faster_one_is():
    around = seen_body(box_at((LENGTH, 0.0, 0.0), (0.02,) * 3), 0.0, RULES)
    for sign in (-1.0, 1.0):
        # The flesh at the tip of the bar.
        speed = sign * RULES.contact_speed / (LENGTH + RADIUS)
        slow, fast = steady_motion(0.9999 * speed), steady_motion(1.0001 * speed)
        assert first_unproven(slow, 0.0, turning_arm(), around, RULES, 0.0) is None
        assert first_unproven(fast, 0.0, turning_arm(), around, RULES, 0.0) is not None
        body = seen_body(box_at((0.0, 0.0, 0.2), (0.2,) * 3), 0.0, RULES)
        # What slides counts once for the bar that gets longer, and once for what is in it.
        slide = steady_motion(0.4999 * sign * RULES.contact_speed)
        assert first_unproven(slide, 0.0, sliding_arm(), body, RULES, 0.0) is None
        slide = steady_motion(1.0001 * sign * RULES.contact_speed)
        assert first_unproven(slide, 0.0, sliding_arm(), body, RULES, 0.0) is not None


def test_within_reach_of_a_box_no_place_of_the_arm_is_permitted_more_than_the_contact_speed():
    for arm, size, fastest in (
        (turning_arm(), 2.0 * LENGTH, LENGTH + RADIUS),
        # What slides counts once for the bar that gets longer, and once for what is in it.
        (sliding_arm(), 2.0, 2.0),
    ):
        limits = MotionLimits([1.0], [4.0], [40.0])
        settings = Separation(
            arm=arm, rules=RULES, limits=limits, stop_limits=limits, stretch=0.024, margin=0.0
        )
        body = seen_body(box_at((0.0, 0.0, 0.0), (size,) * 3), 0.0, RULES)
        for speed in (0.2, -1.0):
            motion = steady_motion(speed)
            rates = permitted_ahead(motion, np.linspace(0.0, 0.3, 11), 5, body, settings, 0.0)[
                :, 0
            ]
            permitted = RULES.contact_speed / (abs(speed) * fastest)
            assert (rates <= permitted).all()
            assert (rates >= permitted - 0.02).all()


def test_the_slow_part_of_a_bar_may_be_in_a_box():
    # A thin post through the axis of the joint: the fast places begin where it is far enough away.
    reach, half = RADIUS + 0.02 + 0.01, 1e-5
    post = box_at((0.0, 0.0, 0.0), (2 * half, 2 * half, 1.0), 'torso')
    for gap, is_proven in ((-1e-4, False), (1e-3, True)):
        speed = RULES.contact_speed / (reach + half + gap + RADIUS)
        body, motion = seen_body(post, 0.3, RULES), steady_motion(speed)
        blocked = first_unproven(motion, 0.0, turning_arm(), body, RULES, 0.02)
        assert (blocked is None) == is_proven
    # The same from the other end of the bar.
    strict = replace(RULES, contact_speed=0.0)
    body = seen_body(post, 0.0, strict)
    for speed in (1e-6, -1e-6, 0.0):
        blocked = first_unproven(steady_motion(speed), 0.0, turning_arm(), body, strict, 0.0)
        assert (blocked is None) == (speed == 0.0)


def test_where_an_arm_starts_from_rest_it_is_blocked_as_soon_as_it_is_too_fast():
    # Half a turn per second squared; the flesh at the tip is at 0.1 m/s when it turns at 0.19/s.
    motion = Trajectory([0.0, 1.0], [[0.0], [0.25]], [[0.0], [0.5]], [[0.5], [0.5]])
    around = seen_body(box_at((0.3, 0.2, 0.0), (2.0,) * 3), 0.0, RULES)
    blocked = first_unproven(motion, 0.0, turning_arm(), around, RULES, 0.0)
    assert blocked.time == pytest.approx(0.2 / (LENGTH + RADIUS), abs=2e-4)
    blocked = first_unproven(motion, 0.9, turning_arm(), around, RULES, 0.0)
    assert blocked.time == pytest.approx(0.9, abs=1e-9)


def test_a_body_without_boxes_and_an_arm_at_rest_are_proven():
    rng = np.random.default_rng(7)
    for arm in arms():
        strict = replace(RULES, contact_speed=0.0)
        motion = motion_of(rng, arm)
        nobody = seen_body(Scene(()), 0.0, strict)
        assert first_unproven(motion, 0.0, arm, nobody, strict, 1e3) is None
        around = seen_body(box_at(arm.T_base_mount[:3, 3], (9.0,) * 3), 1.0, strict)
        still = np.zeros_like(motion.positions)
        single = Trajectory([0.0], motion.positions[:1], still[:1], still[:1])
        assert first_unproven(single, 0.0, arm, around, strict, 0.1) is None
        held = Trajectory([0.0, 1.0], motion.positions[[0, 0]], still[:2], still[:2])
        # Bounds of a motion at rest allow for rounding, which strictly is a motion.
        assert first_unproven(held, 0.0, arm, around, RULES, 0.1) is None
        assert first_unproven(motion, 0.0, arm, around, strict, 0.1) is not None


def test_pairs_that_may_meet_and_the_ray_do_not_count():
    motion = steady_motion(1.0)
    body = seen_body(box_at((0.4, 0.0, 0.0), (0.1,) * 3, 'hand/0'), 0.0, RULES)
    for allowed, is_proven in (
        ((), False),
        ((('bar', 'hand'),), True),
        ((('bar', 'ha'),), False),
        ((('bar', 'ha'), ('bar', 'hand')), True),
    ):
        arm = turning_arm(allowed=allowed)
        assert (first_unproven(motion, 0.0, arm, body, RULES, 0.0) is None) == is_proven
    two = Scene((*body.scene.boxes, Box('other', (0.4, 0.0, 0.0), (0.1,) * 3, np.eye(3))))
    arm = turning_arm(allowed=(('bar', 'hand'),))
    blocked = first_unproven(motion, 0.0, arm, seen_body(two, 0.0, RULES), RULES, 0.0)
    assert blocked.box == 'other'
    above = seen_body(box_at((0.0, 0.0, 0.9), (0.1,) * 3, 'torso'), 0.0, RULES)
    assert first_unproven(motion, 0.0, turning_arm(), above, RULES, 0.0) is None


def test_what_is_not_a_number_is_never_proven():
    # Finite numbers whose pieces are not: the differences of them overflow.
    arm = table_1_arm(0.02)
    body = seen_body(load_body(), 0.0, RULES)
    q, still = np.array([[0.0, -1.0, 1.5, 1.5], [0.1, -1.0, 1.5, 1.5]]), np.zeros((2, 4))
    for huge in (1e150, 1e200, 1e300, 1.7e308):
        for T in (1e-3, 1.0, 10.0):
            for v, a in ((huge, 0.0), (0.0, huge), (huge, -huge)):
                motion = Trajectory([0.0, T], q, still + [[v] * 4, [-v] * 4], still + a)
                with np.errstate(all='ignore'):
                    assert first_unproven(motion, 0.0, arm, body, RULES, 0.0) is not None
    rows = np.zeros((16, 1))
    rows[[0, 4, 8]], rows[12:15] = 1.0, 0.1
    for places in ([0, 1, 2], [4, 5, 6], [0, 1, 2, 4, 5, 6]):
        points = np.full(8, 5.0)
        assert within_distance(points, 0, 0.0, 1.0, 0.1, rows, 0) > 0.1
        points[places] = np.nan
        assert not within_distance(points, 0, 0.0, 1.0, 0.1, rows, 0) > 0.1
    points = np.full(8, 5.0)
    assert not within_distance(points, 0, 0.0, 1.0, np.nan, rows, 0) > np.nan
    assert not within_distance(points, 0, np.nan, 1.0, 0.1, rows, 0) > 0.1
    share = np.empty(2)
    for speeds in ((np.nan, 0.0), (0.0, np.nan), (np.nan, np.nan)):
        assert fast_part(*speeds, 0.1, share)
    assert fast_part(0.0, 0.0, np.nan, share)
