# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A wearer who leaned into the arm: it comes out by a short way, and never goes in deeper."""

from collections import Counter
from dataclasses import replace
from functools import lru_cache
import itertools
import re

from hypothesis import given, strategies
import numpy as np
import pytest
from rrth_planner.collision.distance_library import LIBRARIES
from rrth_planner.collision.penetration import (
    box_depths,
    escape_depths,
    half_widths,
    leads_out,
    N_INTERVALS,
    relaxed,
)
from rrth_planner.collision.reference_checker import bar_box_contact, first_contact
from rrth_planner.collision.violation import Violation
from rrth_planner.collision.world import arm_world, grown
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.remaining_motion import escapes_by_continuing, is_remaining_free
from rrth_planner.model.arm import bar_ends
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.path import Path
from rrth_planner.model.required_clearance import RequiredClearance  # noqa: E402
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import MotionState, positions_at, sample, StartState
from rrth_planner.pipeline.plan_path import SPARE_CLEARANCES
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.timing.parameterization import parameterize
from worlds import (
    examples,
    FOLDED,
    free_configuration,
    limits,
    MARGIN,
    oracle_bars,
    random_rotation,
    RAY,
    table_1_arm,
    varied_body,
    wearer,
    wearer_world,
)

pytest.importorskip('fcl')
from rrth_planner.collision import second_checker, trajectory_validation  # noqa: E402
from rrth_planner.pipeline import plan_motion  # noqa: E402

ESCAPE_DEPTH, TARGET = 0.05, [1.5, 0.0, 0.3]
OPTIONS = RRTHOptions(club_attempts=0, improve_time=1000.0, time_limit=1000.0, max_samples=3000)
SEEDS = strategies.integers(0, 2**31)
FREE = 1.0
# A hand, a forearm, a head and a torso [m].
SIZES = (0.2, 0.1, 0.1), (0.3, 0.1, 0.1), (0.26, 0.24, 0.3), (0.3, 0.46, 0.6)
# Bars of an arm, the pointing ray being the last one.
ARM, BARS, POINTING = slice(None), slice(-1), slice(-1, None)
BODIES = [wearer(), *(varied_body(np.random.default_rng(k)) for k in range(5))]


def ask(arm, scene, q_start, *, target=TARGET, escape_depth=ESCAPE_DEPTH, margin=MARGIN, **more):
    return plan_motion.plan_motion(
        arm,
        scene,
        q_start,
        PointingGoal(target),
        limits(),
        OPTIONS,
        margin=margin,
        ray_guard_length=RAY,
        seed=1,
        escape_depth=escape_depth,
        **more,
    )


def collides(arm, box, q, growth, part=ARM, first=0):
    """
    Return at which instants q, (n, dof), from the first on, the reference has a part in a box.

    growth: how much larger the box is, at all instants, or (n,); or of one instant, n of them [m].
    """
    ends = ends_at(arm, np.ascontiguousarray(q).tobytes(), len(q))[first:, part]
    return any_in(arm, box, ends, np.reshape(growth, -1), part)


def any_in(arm, box, ends, growth, part):
    """Return where a part, given by its ends, (..., n_bars, 2, 3), is in a grown box, (...)."""
    radii = np.array([arm.radii[row] for row, _ in bar_ends(arm)][part])
    halves = 0.5 * box.size + growth[..., None, None] + radii[:, None]
    return bar_box_contact(ends, box.center, box.rotation, halves).any(axis=-1)


@lru_cache(maxsize=64)
def ends_at(arm, data, n):
    """Return the ends of all bars at n configurations, given by their bytes."""
    return oracle_bars(arm, np.frombuffer(data).reshape(n, -1), RAY)


def reference_depth(arm, box, q, part=ARM):
    """Return by how much the grown box would have to be smaller to be clear of q, (dof,) [m]."""
    return reference_depths(arm, box, q[None], part)[0]


def reference_depths(arm, box, q, part=ARM):
    """Return the depths of a part of the arm in a box at n instants q, (n, dof) -> (n,) [m]."""
    # For all instants and all ends of 32 intervals at once; to 4e-11 m in the end.
    ends = ends_at(arm, np.ascontiguousarray(q).tobytes(), len(q))[:, None, part]
    low, high = np.full(len(q), -0.5 * box.size.min()), np.full(len(q), FREE)
    is_free = ~any_in(arm, box, ends, high[:, None], part)[:, 0]
    for _ in range(7):
        growths = np.linspace(low, high, 33, axis=1)
        first = any_in(arm, box, ends, growths, part).argmax(axis=1)[:, None]
        low = np.take_along_axis(growths, np.maximum(first - 1, 0), axis=1)[:, 0]
        high = np.take_along_axis(growths, first, axis=1)[:, 0]
    return np.where(is_free, MARGIN - FREE, MARGIN - high)


def leaned(arm, scene, q, rng, depth, part):
    """Return the scene with one box pushed into a part of the arm so deep, or None."""
    index = int(rng.integers(len(scene.boxes)))
    box = scene.boxes[index]
    bar = oracle_bars(arm, q[None], RAY)[0, part][rng.choice([0, -1])]
    towards = bar[0] + rng.uniform(0.2, 1.0) * (bar[1] - bar[0]) - box.center
    low, high = 0.0, 1.0

    def is_deeper(share):
        pushed = replace(box, center=box.center + share * towards)
        return collides(arm, pushed, q[None], MARGIN - depth, part)[0]

    if is_deeper(low) or not is_deeper(high):
        return None
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if is_deeper(middle) else (middle, high)
    boxes = list(scene.boxes)
    boxes[index] = replace(box, center=box.center + low * towards)
    return Scene(tuple(boxes))


def is_shoulder_covered(arm, scene):
    """Return whether a box covers the beginning of the first bar, which no joint moves."""
    shoulder = oracle_bars(arm, FOLDED[None], RAY)[0, 0, :1]
    return any(
        bar_box_contact(
            np.repeat(shoulder, 2, axis=0),
            box.center,
            box.rotation,
            0.5 * box.size + MARGIN + 0.01 + arm.radii[0],
        )
        for box in scene.boxes
    )


def leaned_case(seed, low, high, part=ARM):
    """Return arm, wearer, start and reference depths of a part, the deepest within bounds."""
    rng = np.random.default_rng(seed)
    while True:
        arm = table_1_arm(rng.choice([0.0, 0.02]))
        scene = BODIES[int(rng.integers(len(BODIES)))]
        world = arm_world(arm, scene, MARGIN, RAY)
        q = free_configuration(rng, world)
        found = leaned(arm, scene, q, rng, rng.uniform(low, high), part)
        if found is None or is_shoulder_covered(arm, found):
            continue
        depths = np.array([reference_depth(arm, box, q, part) for box in found.boxes])
        if depths.max() < high:
            return arm, found, q, depths


@examples(40)
@given(SEEDS)
def test_depths_are_those_of_the_reference(seed):
    rng = np.random.default_rng(seed)
    arm = table_1_arm(rng.choice([0.0, 0.02]))
    scene = BODIES[int(rng.integers(len(BODIES)))]
    world = arm_world(arm, scene, MARGIN, RAY)
    q = rng.uniform(*world.bounds)
    depths = box_depths(world, q).max(axis=0)
    for box, depth in zip(scene.boxes, depths, strict=True):
        expected = reference_depth(arm, box, q)
        if MARGIN - FREE < expected < 0.5 * box.size.min() + MARGIN - 1e-6:
            assert depth == pytest.approx(expected, abs=1e-7)
    assert world.is_valid(q) == (depths.max() < 0.0)
    assert relaxed(world, np.maximum(depths, 0.0) + 1e-7).is_valid(q)
    if (depths < half_widths(world)).all():
        assert not relaxed(world, np.maximum(depths - 1e-7, -FREE)).is_valid(q)
    for part, found in zip((BARS, POINTING), escape_depths(world, q), strict=True):
        for box, depth in zip(scene.boxes, found, strict=True):
            expected = reference_depth(arm, box, q, part)
            if MARGIN - FREE < expected < 0.5 * box.size.min() + MARGIN - 1e-6:
                assert depth == pytest.approx(expected, abs=1e-7)


def escape_said(sentence):
    """Return the boxes that a sentence says the bars are in, the deepest first, and the ray."""
    escape = re.search(r', escape (.*)', sentence)[1].partition(';')[0]
    of_bars, _, of_ray = escape.partition('of the pointing ray')
    return [re.findall(r'box "(\w+)"', part) for part in (of_bars, of_ray)]


@examples(50)
@given(SEEDS)
def test_an_arm_that_the_wearer_leaned_into_comes_out_and_stays_out(seed):
    arm, scene, q_start, depths = leaned_case(seed, 1e-4, ESCAPE_DEPTH)
    plan = ask(arm, scene, q_start)
    is_in = depths > 0.0
    if plan.status is not PlanStatus.SOLVED:
        assert plan.trajectory is None
        if plan.status is PlanStatus.START_IN_COLLISION:
            assert 'no straight escape is proven free' in plan.sentence
        return
    n_solved.append(seed)
    trajectory, out = plan.trajectory, plan.escape_time
    assert np.array_equal(trajectory.positions[0], q_start)
    assert np.array_equal(plan.path.waypoints[0], q_start)
    assert out in trajectory.times
    said = escape_said(plan.sentence)
    for part, k in ((BARS, 0), (POINTING, 1)):
        inside = {box.name: reference_depth(arm, box, q_start, part) for box in scene.boxes}
        assert set(said[k]) == {name for name, depth in inside.items() if depth > -1e-5}
        if part is BARS and said[k]:
            assert said[k][0] == max(inside, key=inside.get)
            depth = re.search(
                r'penetration depth (\d\.\d+) m at (?:link|pointing)', plan.sentence
            )[1]
            assert float(depth) == pytest.approx(max(inside.values()), abs=1e-3)
    assert plan.clearance >= MARGIN - 1e-6
    times = np.union1d(np.arange(0.0, trajectory.duration, 1e-3), [out, trajectory.duration])
    q, v, _ = sample(trajectory, times)
    assert (np.abs(v) <= limits().velocity * 1.001).all()
    looks = np.linspace(0.0, out, N_INTERVALS + 1)
    for box, is_entered in zip(scene.boxes, is_in, strict=True):
        is_hit = collides(arm, box, q, MARGIN)
        assert not is_hit[times >= out].any()
        if not is_entered:
            assert not is_hit.any()
            continue
        # In, then out for good; and from each interval on no deeper than where that begins.
        assert not (np.diff(is_hit.astype(int)) > 0).any()
        here = positions_at(trajectory, looks)
        of_bars, of_ray = (reference_depths(arm, box, here, part) for part in (BARS, POINTING))
        for k, first in enumerate(np.searchsorted(times, looks)):
            # A ray that is deeper is in the wearer already, and the bars come out first.
            for part, depth, is_held in (
                (ARM, max(of_bars[k], of_ray[k]), of_ray[k] <= MARGIN),
                (BARS, of_bars[k], True),
            ):
                less = MARGIN - max(0.0, depth) - 2e-6
                assert not (is_held and collides(arm, box, q, less, part, first).any())


n_solved: list[int] = []


def test_most_arms_come_out():
    assert len(n_solved) >= 45


def test_an_arm_whose_shoulder_is_covered_has_no_escape():
    arm = table_1_arm()
    shoulder = oracle_bars(arm, FOLDED[None], RAY)[0, 0, 0]
    center = shoulder - [0.0, 0.05, 0.0]
    hand = Box('hand', center, [0.1, 0.1 - 2 * MARGIN + 0.02, 0.1], np.eye(3))
    plan = ask(arm, Scene((hand,)), FOLDED)
    assert plan.status is PlanStatus.START_IN_COLLISION
    assert 'no straight escape is proven free' in plan.sentence


@examples(15)
@given(SEEDS)
def test_deeper_is_rejected_with_part_box_and_depth(seed):
    arm, scene, q_start, depths = leaned_case(seed, ESCAPE_DEPTH + 1e-4, 0.06, BARS)
    plan = ask(arm, scene, q_start)
    assert plan.status is PlanStatus.START_IN_COLLISION
    world = arm_world(arm, scene, MARGIN, RAY)
    bar = next(name for name in world.bar_names if plan.sentence.startswith(name))
    box = scene.boxes[int(np.argmax(depths))]
    assert f'm inside box "{box.name}": ' in plan.sentence
    assert 'expected less than 0.05 m (escape_depth)' in plan.sentence
    depth = float(
        re.search(r'penetration depth (\d\.\d+) m including the margin', plan.sentence)[1]
    )
    assert depth == pytest.approx(depths.max(), abs=1e-3)
    inside = float(re.search(r'is (\d\.\d+) m inside', plan.sentence)[1])
    assert inside == pytest.approx(depths.max() - MARGIN, abs=1e-3)
    # Of that bar, the box so much smaller is just clear.
    k = world.bar_names.index(bar)
    ends = oracle_bars(arm, q_start[None], RAY)[0, k]
    for more, is_hit in ((1e-4, False), (-1e-4, True)):
        half = 0.5 * box.size + MARGIN - depths.max() - more + arm.radii[0]
        assert bar_box_contact(ends, box.center, box.rotation, half) == is_hit
    # One that may be that deep escapes, or is rejected since there is no escape.
    plan = ask(arm, scene, q_start, escape_depth=0.1)
    assert 'escape_depth' not in plan.sentence


def entered_case(seed):
    """Return arm, wearer, world and start of an arm with only its ray in a box, at any depth."""
    rng = np.random.default_rng(seed)
    while True:
        arm = table_1_arm(rng.choice([0.0, 0.02]))
        scene = BODIES[int(rng.integers(len(BODIES)))]
        q = free_configuration(rng, arm_world(arm, scene, MARGIN, RAY))
        tool, tip = oracle_bars(arm, q[None], RAY)[0, -1]
        size, rotation = np.array(SIZES[int(rng.integers(len(SIZES)))]), random_rotation(rng)
        # A place on the ray is that of a random point of the box, which has the ray in it.
        center = tool + rng.uniform(0.1, 0.9) * (tip - tool)
        center = center - rotation @ (rng.uniform(-0.5, 0.5, 3) * (size + 2.0 * MARGIN))
        scene = Scene((*scene.boxes, Box('entered', center, size, rotation)))
        hits = [collides(arm, box, q[None], MARGIN, BARS)[0] for box in scene.boxes]
        world = arm_world(arm, scene, MARGIN, RAY)
        if not np.any(hits) and not world.is_valid(q) and not is_shoulder_covered(arm, scene):
            return arm, scene, world, q


def entry_faults(arm, scene, q):
    """
    Return what is wrong with an escape, densely sampled: q (n, dof); the ray alone is in boxes.

    By the reference: `bars` or `ray` in a box that they are not in at first or any more, or the
    ray, within the margin of a box, `deeper` than before.
    """
    faults = set()
    for box in scene.boxes:
        if collides(arm, box, q, MARGIN, BARS).any():
            faults.add('bars')
        is_hit = collides(arm, box, q, MARGIN, POINTING)
        if (np.diff(is_hit.astype(int)) > 0).any() or is_hit[-1]:
            faults.add('ray')
        looks = np.flatnonzero(is_hit)
        if len(looks):
            looks = np.flatnonzero(is_hit & ~collides(arm, box, q, 0.0, POINTING))[::8]
        if not len(looks):
            continue
        for at, depth in zip(looks, reference_depths(arm, box, q[looks], POINTING), strict=True):
            if collides(arm, box, q, MARGIN - depth - 2e-6, POINTING, at).any():
                faults.add('deeper')
    return faults


@examples(40)
@given(SEEDS)
def test_a_ray_comes_out_of_a_box_from_any_depth(seed):
    arm, scene, world, q_start = entered_case(seed)
    # Into the next box, or round the wearer, not all of them can.
    plan = ask(arm, scene, q_start)
    if plan.status is PlanStatus.START_IN_COLLISION:
        assert 'no straight escape is proven free' in plan.sentence
        return
    n_rays_out.append(seed)
    if plan.status is not PlanStatus.SOLVED:
        return
    of_bars, of_ray = escape_said(plan.sentence)
    assert of_bars == []
    assert 'entered' in of_ray
    trajectory, out = plan.trajectory, plan.escape_time
    q = positions_at(trajectory, np.union1d(np.arange(0.0, out, 1e-3), [out]))
    assert entry_faults(arm, scene, q) == set()
    assert plan.clearance >= MARGIN - 1e-6
    later = positions_at(trajectory, np.linspace(out, trajectory.duration, 300))
    assert first_contact(arm, scene, later, RAY, MARGIN - 1e-6) is None


n_rays_out: list[int] = []


def test_nearly_all_rays_come_out():
    assert len(n_rays_out) >= 39


@examples(30)
@given(SEEDS)
def test_no_motion_is_proven_to_take_a_ray_out_that_does_not(seed):
    arm, scene, world, q_start = entered_case(seed)
    rng = np.random.default_rng(seed)
    for _ in range(8):
        way = rng.normal(size=4)
        way *= rng.uniform(0.1, 0.8) / np.linalg.norm(way)
        if not world.is_in_bounds(q_start + way):
            continue
        trajectory = parameterize(Path(np.stack([q_start, q_start + way])), (), limits())
        q = positions_at(trajectory, np.arange(0.0, trajectory.duration, 2e-3))
        is_out = leads_out(trajectory, world, MARGIN, trajectory.duration)
        violation = second_opinion(arm, scene, world, trajectory)
        faults = entry_faults(arm, scene, np.vstack([q, trajectory.positions[-1:]]))
        n_verdicts[is_out, violation is None, not faults] += 1
        if is_out:
            assert faults == set()
            assert violation is None
        if 'bars' in faults:
            # For python-fcl a bar is round, which takes off the corners of the grown box.
            less = MARGIN - 3e-3 - (1.0 - 3.0**-0.5) * arm.radii[0]
            is_hit = [collides(arm, box, q, less, BARS).any() for box in scene.boxes]
            assert violation is not None or not any(is_hit)


n_verdicts: Counter[tuple[bool, bool, bool]] = Counter()


def test_both_checkers_find_good_and_bad_escapes_of_a_ray():
    assert n_verdicts[True, True, True] >= 15, n_verdicts
    assert n_verdicts[False, False, False] >= 5, n_verdicts
    # What is good is mostly proven: the depths at the ends of intervals are the rest.
    assert n_verdicts[False, True, True] <= 0.1 * n_verdicts[True, True, True], n_verdicts


def test_a_ray_in_a_box_counts_for_nothing_beside_a_bar_in_one():
    arm, scene = pressed(0.03, bar=0)
    tool, tip = oracle_bars(arm, FOLDED[None], RAY)[0, -1]
    deep = Box('deep', 0.5 * (tool + tip), [0.2, 0.2, 0.2], np.eye(3))
    both = Scene((*scene.boxes, deep))
    plan = ask(arm, both, FOLDED)
    assert plan.status is PlanStatus.SOLVED, plan.sentence
    assert escape_said(plan.sentence) == [['hand'], ['deep']]
    assert 'escape from box "hand", penetration depth 0.0300 m at link 3' in plan.sentence
    plan = ask(arm, both, FOLDED, escape_depth=0.02)
    assert plan.status is PlanStatus.START_IN_COLLISION
    assert plan.sentence.startswith('link 3 is 0.0100 m inside box "hand"')
    # The ray alone is no matter of depth; but an arm that never escapes does not.
    plan = ask(arm, Scene((*wearer().boxes, deep)), FOLDED, escape_depth=1e-3)
    assert plan.status is PlanStatus.SOLVED, plan.sentence
    plan = ask(arm, Scene((*wearer().boxes, deep)), FOLDED, escape_depth=0.0)
    assert plan.status is PlanStatus.START_IN_COLLISION
    assert plan.sentence.startswith('pointing ray is')


def pressed(depth=0.03, bar=-1):
    """Return the wearer with a plate pressed against a bar of the folded arm, or its ray."""
    arm = table_1_arm()
    tip = oracle_bars(arm, FOLDED[None], RAY)[0, bar]
    along = (tip[1] - tip[0]) / np.linalg.norm(tip[1] - tip[0])
    side = np.cross(along, [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    rotation = np.stack([np.cross(side, along), side, along], axis=1)
    size = np.array([0.1, 0.1, 0.1])
    center = tip.mean(axis=0) - (0.5 * size[1] + MARGIN - depth) * side
    return arm, Scene((*wearer().boxes, Box('hand', center, size, rotation)))


@pytest.mark.parametrize('seed', [None, 4, 7, 8])
def test_no_shorter_escape_is_found_by_trying_many(seed):
    if seed is None:
        (arm, scene), q_start = pressed(), FOLDED
    else:
        arm, scene, q_start, _ = leaned_case(seed, 0.01, 0.045)
    plan = ask(arm, scene, q_start)
    way = plan.path.waypoints[1] - q_start
    roomy = grown(arm_world(arm, scene, MARGIN, RAY), SPARE_CLEARANCES[0])
    assert roomy.is_valid(q_start + way)
    rng, length = np.random.default_rng(0), np.linalg.norm(way)
    aside = rng.normal(size=(3000, 4)) * np.repeat([0.1, 0.3, 3.0], 1000)[:, None]
    tries = way / length + aside
    tries *= 0.98 * length / np.linalg.norm(tries, axis=1)[:, None]
    ends = np.clip(q_start + tries, *roomy.bounds)
    assert not any(roomy.is_valid(q_end) for q_end in ends)


def test_an_arm_that_moves_is_not_led_out():
    arm, scene = pressed()
    assert ask(arm, scene, FOLDED).status is PlanStatus.SOLVED
    still = np.zeros(4)
    state = MotionState(positions=FOLDED, velocities=still + 0.1, accelerations=still)
    plan = ask(arm, scene, FOLDED, moving=StartState(state=state))
    assert plan.status is PlanStatus.START_IN_COLLISION
    assert (
        'pointing ray is 0.0100 m inside box "hand": penetration depth 0.0300 m' in plan.sentence
    )
    assert 'at rest' in plan.sentence


def test_an_arm_beyond_its_limits_is_not_led_out():
    arm, scene = pressed()
    q = np.array([0.0, 0.1, FOLDED[2], FOLDED[3]])
    assert ask(arm, scene, q).status is PlanStatus.START_OUT_OF_BOUNDS


def closed(bar):
    """Return the wearer with a hand closed round a bar of the folded arm, or its ray."""
    arm, scene = pressed(bar=bar)
    hand = scene.boxes[-1]
    others = [
        replace(hand, name=f'finger_{i}', center=tip)
        for i, tip in enumerate(
            hand.center + offset @ hand.rotation.T
            for offset in np.array([[0.0, 0.14, 0.0], [0.08, 0.07, 0.0], [-0.08, 0.07, 0.0]])
        )
    ]
    return arm, Scene((*scene.boxes, *others))


def test_a_hand_that_is_closed_round_the_arm_is_rejected():
    plan = ask(*closed(bar=0), FOLDED)
    assert plan.status is PlanStatus.START_IN_COLLISION
    assert 'no straight escape is proven free' in plan.sentence
    assert '"hand"' in plan.sentence or '"finger_' in plan.sentence


def beside_sheet(thickness, gap):
    """Return an arm, and a wearer whose badge of a thickness is that far beside a bar [m]."""
    arm, scene = pressed(bar=0)
    hand = scene.boxes[-1]
    begin, end = oracle_bars(arm, FOLDED[None], RAY)[0, 0]
    size = np.array([0.05, thickness, 0.05])
    center = 0.2 * begin + 0.8 * end - (0.5 * thickness + gap) * hand.rotation[:, 1]
    return arm, Scene((*scene.boxes[:-1], Box('badge', center, size, hand.rotation)))


@pytest.mark.parametrize('library', LIBRARIES)
@pytest.mark.parametrize(
    ('thickness', 'gap', 'most'),
    [
        # Thinner than twice a millimetre, only from some way off.
        (1e-7, 0.0, 0.019),
        (1e-7, 5e-4, 0.019),
        (1e-7, 1.1e-3, None),
        (1e-3, 0.0, 0.0195),
        (1e-3, 4e-4, 0.0195),
        (1e-3, 6e-4, None),
        (1e-3, 0.015, None),
        (3e-3, 0.0, None),
        # Nearer to the middle than a millimetre, and beyond.
        (3e-3, -1e-3, 0.0205),
        (3e-3, -2.5e-3, 0.0205),
        (0.03, -0.0139, None),
        (0.03, -0.0141, 0.034),
    ],
)
def test_an_arm_escapes_from_a_thin_box_while_its_side_is_known(thickness, gap, most, library):
    pytest.importorskip(library)
    arm, scene = beside_sheet(thickness, gap)
    plan = ask(arm, scene, FOLDED, second_checker=library)
    if most is None:
        assert plan.status is PlanStatus.SOLVED, plan.sentence
        assert escape_said(plan.sentence)[0] == ['badge']
        q = positions_at(plan.trajectory, np.arange(0.0, plan.escape_time, 1e-3))
        assert not collides(arm, scene.boxes[-1], q, gap - 2e-6, BARS).any()
        return
    assert plan.status is PlanStatus.START_IN_COLLISION
    assert 'box "badge": penetration depth ' in plan.sentence
    assert f'expected less than {most:.4f} m: near the middle of a box' in plan.sentence
    # Nor is a motion proven that goes on away from it.
    world = arm_world(arm, scene, MARGIN, RAY)
    clear = ask(*beside_sheet(thickness, 2e-3), FOLDED).trajectory
    assert not leads_out(clear, world, MARGIN, clear.duration)
    assert second_opinion(arm, scene, world, clear) is not None


@pytest.mark.parametrize('library', LIBRARIES)
def test_thin_boxes_that_an_arm_is_not_in_do_not_keep_it_from_escaping(library):
    pytest.importorskip(library)
    arm, scene = pressed(MARGIN + 0.005, bar=0)
    badges = [
        Box(f'badge_{i}', [1.0, 1.0, 0.1 * i], np.full(3, size), np.eye(3))
        for i, size in enumerate((1e-7, 1e-4, 1.9e-3))
    ]
    plan = ask(arm, Scene((*scene.boxes, *badges)), FOLDED, margin=0.0, second_checker=library)
    assert plan.status is PlanStatus.SOLVED, plan.sentence
    assert escape_said(plan.sentence)[0] == ['hand']


def test_a_hand_that_is_closed_round_the_ray_holds_nothing():
    plan = ask(*closed(bar=-1), FOLDED)
    assert plan.status is PlanStatus.SOLVED, plan.sentence
    # Out through the hand, since the ray has no body; into no finger.
    assert escape_said(plan.sentence) == [[], ['hand']]


def test_the_same_seed_leads_out_the_same_way():
    arm, scene = pressed()
    one, other = ask(arm, scene, FOLDED), ask(arm, scene, FOLDED)
    assert one.trajectory.positions.tobytes() == other.trajectory.positions.tobytes()
    assert one.trajectory.times.tobytes() == other.trajectory.times.tobytes()


def test_a_cancelled_request_leads_nowhere():
    arm, scene = pressed()
    plan = ask(arm, scene, FOLDED, should_stop=lambda: True)
    assert plan.status is PlanStatus.CANCELLED


@pytest.mark.parametrize('after', [5, 20])
def test_a_search_for_an_escape_is_cancelled(after):
    arm = table_1_arm()
    shoulder = oracle_bars(arm, FOLDED[None], RAY)[0, 0, 0]
    hand = Box('hand', shoulder - [0.0, 0.05, 0.0], [0.1, 0.08, 0.1], np.eye(3))
    polls = []
    plan = ask(arm, Scene((hand,)), FOLDED, should_stop=lambda: polls.append(None))
    assert plan.status is PlanStatus.START_IN_COLLISION
    # In all directions of the search.
    assert len(polls) > 100
    n_polls = itertools.count()
    plan = ask(arm, Scene((hand,)), FOLDED, should_stop=lambda: next(n_polls) >= after)
    assert plan.status is PlanStatus.CANCELLED
    assert next(n_polls) < after + 8


def test_a_target_in_the_wearer_is_rejected_wherever_the_arm_is():
    arm, scene = pressed()
    plan = ask(arm, scene, FOLDED, target=[0.0, 0.0, 0.0])
    assert plan.status is PlanStatus.GOAL_IN_COLLISION


def second_opinion(arm, scene, world, trajectory):
    depths = escape_depths(world, trajectory.positions[0])
    return second_checker.first_escape_violation(
        RequiredClearance(arm, MARGIN, RAY), scene, depths, trajectory, trajectory.duration
    )


def test_an_escape_with_a_violation_by_python_fcl_is_rejected(monkeypatch):
    arm, scene = pressed()
    touch = Violation(0.001, 0.005, 'pointing ray', 'hand')
    monkeypatch.setattr(trajectory_validation, 'first_escape_violation', lambda *_: touch)
    plan = ask(arm, scene, FOLDED)
    assert plan.status is PlanStatus.NOT_CERTIFIED
    assert plan.trajectory is None
    assert plan.disagreement.violation == touch
    assert 'at 0.001 s, during the escape, expected no penetration deeper' in plan.sentence


def test_a_way_that_goes_deeper_or_into_another_box_is_not_proven():
    arm, scene = pressed(bar=0)
    world = arm_world(arm, scene, MARGIN, RAY)
    plan = ask(arm, scene, FOLDED)
    way = plan.path.waypoints[1] - FOLDED
    verdicts = {}
    for share in (1.0, -0.2, 0.5):
        q = FOLDED + share * way
        trajectory = parameterize(Path(np.stack([FOLDED, q])), (), limits())
        end = trajectory.duration
        violation = second_opinion(arm, scene, world, trajectory)
        verdicts[share] = leads_out(trajectory, world, MARGIN, end), violation
    assert verdicts[1.0] == (True, None)
    is_out, violation = verdicts[-0.2]
    assert not is_out
    assert (violation.bar, violation.box) == ('link 3', 'hand')
    # Half way it is no deeper but not out.
    assert verdicts[0.5] == (False, None)
    # A plate in the way, which the arm does not reach yet.
    middle = oracle_bars(arm, (FOLDED + 0.8 * way)[None], RAY)[0, -1]
    plate = Box('plate', middle[0] + 0.9 * (middle[1] - middle[0]), [1e-3] * 3, np.eye(3))
    blocked = Scene((*scene.boxes, plate))
    q = FOLDED + way
    trajectory = parameterize(Path(np.stack([FOLDED, q])), (), limits())
    if first_contact(arm, Scene((plate,)), FOLDED[None], RAY, MARGIN) is None:
        world = arm_world(arm, blocked, MARGIN, RAY)
        assert not leads_out(trajectory, world, MARGIN, trajectory.duration)
        violation = second_opinion(arm, blocked, world, trajectory)
        assert violation.box == 'plate'


def test_a_running_escape_is_free_until_the_wearer_comes_nearer():
    arm, scene = pressed()
    plan = ask(arm, scene, FOLDED)
    running = ExecutingMotion(
        trajectory=plan.trajectory,
        start_time=0.0,
        target_distance=plan.target_distance,
        escape_time=plan.escape_time,
    )
    required = RequiredClearance(arm, MARGIN, RAY)
    for phase in np.linspace(0.0, plan.trajectory.duration, 12):
        assert is_remaining_free(running, phase, required, scene)
    assert not is_remaining_free(replace(running, escape_time=0.0), 0.0, required, scene)
    # The hand follows the arm further than it goes.
    hand = scene.boxes[-1]
    near = replace(hand, center=hand.center + 0.04 * hand.rotation[:, 1])
    followed = Scene((*scene.boxes[:-1], near))
    assert not is_remaining_free(running, 0.5 * plan.escape_time, required, followed)


@examples(15)
@given(SEEDS)
def test_an_escape_goes_on_where_the_wearer_moves_in_the_ray(seed):
    arm, scene, _, q_start = entered_case(seed)
    plan = ask(arm, scene, q_start)
    if plan.status is not PlanStatus.SOLVED:
        return
    trajectory, rng = plan.trajectory, np.random.default_rng(seed)
    running = ExecutingMotion(
        trajectory=trajectory,
        start_time=0.0,
        target_distance=plan.target_distance,
        escape_time=plan.escape_time,
    )
    required = RequiredClearance(arm, MARGIN, RAY)
    for _ in range(6):
        phase, moved = rng.uniform(0.0, plan.escape_time), rng.normal(size=3)
        box = scene.boxes[-1]
        box = replace(box, center=box.center + 0.01 * moved / np.linalg.norm(moved))
        now = Scene((*scene.boxes[:-1], box))
        is_free = is_remaining_free(running, phase, required, now)
        goes_on = is_free or escapes_by_continuing(running, phase, required, now)
        n_moved[goes_on] += 1
        n_moved['without proof'] += not is_free
        if not goes_on:
            continue
        q = positions_at(trajectory, np.linspace(phase, trajectory.duration, 400))
        assert first_contact(arm, now, q[-1:], plan.target_distance, MARGIN - 1e-6) is None
        for box in now.boxes:
            assert not collides(arm, box, q, MARGIN - 1e-6, BARS).any()
            depth = max(0.0, reference_depth(arm, box, q[0], POINTING))
            if depth < 0.5 * box.size.min() + MARGIN - 1e-5:
                assert not collides(arm, box, q, MARGIN - depth - 3e-6, POINTING).any()


n_moved: Counter[bool | str] = Counter()


def test_most_escapes_go_on_where_the_wearer_moves_in_the_ray():
    assert n_moved['without proof'] >= 5
    assert n_moved[True] >= 0.9 * (n_moved[True] + n_moved[False])


def test_a_hand_that_comes_into_the_way_of_a_bar_is_no_reason_to_go_on():
    arm, scene = pressed()
    plan = ask(arm, scene, FOLDED)
    running = ExecutingMotion(
        trajectory=plan.trajectory, start_time=0.0, escape_time=plan.escape_time
    )
    required = RequiredClearance(arm, MARGIN, RAY)
    later = positions_at(plan.trajectory, [0.7 * plan.trajectory.duration])
    for bar, size, goes_on in ((0, 0.02, False), (-1, 1e-3, True)):
        ends = oracle_bars(arm, later, RAY)[0, bar]
        box = Box('late', ends.mean(axis=0), np.full(3, size), np.eye(3))
        if goes_on:
            # In the ray now, instead of later.
            box = replace(box, center=oracle_bars(arm, FOLDED[None], RAY)[0, -1].mean(axis=0))
        now = Scene((*scene.boxes, box))
        assert not is_remaining_free(replace(running, escape_time=0.0), 0.0, required, now)
        assert escapes_by_continuing(running, 0.0, required, now) == goes_on


def test_an_empty_world_has_no_depth():
    world = arm_world(table_1_arm(), Scene(()), MARGIN, RAY)
    assert box_depths(world, FOLDED).shape == (3, 0)
    assert box_depths(wearer_world(), FOLDED).shape == (3, 8)
