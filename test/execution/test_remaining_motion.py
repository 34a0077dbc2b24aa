# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A running motion: checks of the remaining motion against a new body, and its stop."""

import functools

from hypothesis import given, strategies as st
import numpy as np
from rrth_planner.collision import reference_checker
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.reference_checker import frames, quintic_states
from rrth_planner.collision.world import arm_world
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.remaining_motion import (
    escapes_by_continuing,
    is_place_free,
    is_remaining_free,
)
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import (
    part_of,
    piece_coefficients,
    sample,
)
from rrth_planner.timing.fast_stop import fast_stop, LATENCY
from rrth_planner.timing.parameterization import limit_ratio
from worlds import (
    dense_touch,
    examples,
    limits,
    MARGIN,
    random_boxes,
    random_motion,
    RAY,
    table_1_arm,
    wearer,
)

SEEDS = st.integers(0, 2**32 - 1)
REQUIRED = RequiredClearance(table_1_arm(), MARGIN, RAY)


def off_the_path(trajectory, q):
    """Return how far points are from the positions of a motion [rad]."""
    path, _, _ = sample(trajectory, np.arange(0.0, trajectory.duration + 2e-4, 2e-4))
    a, b = path[:-1], path[1:]
    step = b - a
    share = np.einsum('nk,mnk->mn', step, q[:, None] - a[None])
    share = np.clip(share / ((step * step).sum(axis=1) + 1e-300), 0.0, 1.0)
    nearest = a[None] + share[:, :, None] * step[None]
    return np.linalg.norm(q[:, None] - nearest, axis=2).min(axis=1)


@examples(25)
@given(seed=SEEDS)
def test_a_fast_stop_begins_as_the_motion_and_rests_on_its_path(seed):
    rng = np.random.default_rng(seed)
    motion = random_motion(rng)
    if motion is None:
        return
    time = rng.uniform(0.0, motion.duration)
    stop = fast_stop(motion, time, limits())
    q, v, a = (values[0] for values in sample(motion, [time]))
    assert np.allclose(stop.positions[0], q, atol=1e-12)
    if len(stop.times) == 1:
        return
    assert np.allclose(stop.velocities[0], v, atol=1e-9)
    assert np.allclose(stop.accelerations[0], a, atol=1e-7)
    assert not stop.velocities[-1].any()
    assert not stop.accelerations[-1].any()
    assert stop.duration <= motion.duration - time + 1e-6
    assert limit_ratio(stop, limits()) <= 1.0026
    # A controller that gets it late finds itself on it.
    late = min(0.9 * LATENCY, stop.duration)
    for mine, its in zip(sample(stop, [late]), sample(motion, [time + late]), strict=True):
        assert np.allclose(mine, its, atol=1e-6)
    grid, q, _, _ = quintic_states(stop, 0.01)
    assert off_the_path(motion, q[::3]).max() < 1e-4


@examples(60)
@given(seed=SEEDS, n_more=st.sampled_from([0, 1, 3, 60]), reach=st.sampled_from([0.0, 2.0]))
def test_the_remaining_motion_is_free_where_the_certificate_says_so(seed, n_more, reach):
    rng = np.random.default_rng(seed)
    motion = random_motion(rng)
    if motion is None:
        return
    arm, phase = table_1_arm(), rng.uniform(-0.1, 1.1) * motion.duration
    scene = Scene((*wearer().boxes, *random_boxes(rng, n_more, spread=3.0, largest=0.2).boxes))
    world = arm_world(arm, scene, MARGIN, RAY)
    is_proven = certify(motion, world, max(phase, 0.0)).is_proven
    running = ExecutingMotion(trajectory=motion, start_time=0.0, target_distance=reach)
    is_free = is_remaining_free(running, phase, REQUIRED, scene)
    assert is_free == (is_proven and world.is_valid(motion.positions[-1], max(reach, RAY)))


@examples(40)
@given(seed=SEEDS)
def test_what_is_called_free_is_free_of_a_body_that_moved(seed):
    rng = np.random.default_rng(seed)
    motion = random_motion(rng)
    if motion is None:
        return
    arm, phase = table_1_arm(), rng.uniform(0.0, 0.9 * motion.duration)
    q, _, _ = sample(motion, [rng.uniform(phase, motion.duration)])
    tool = frames(arm, q)[0, -1]
    where = tool[:3, 3] + rng.uniform(0.0, 0.5) * tool[:3, 2] + rng.normal(0.0, 0.1, 3)
    hand = Box('hand', where, rng.uniform(0.05, 0.2, 3), np.eye(3))
    scene = Scene((*wearer().boxes, hand))
    is_free = is_remaining_free(
        ExecutingMotion(trajectory=motion, start_time=0.0),
        phase,
        REQUIRED,
        scene,
    )
    rest = part_of(motion, phase, motion.duration)
    is_violated = any(
        dense_touch(arm, scene, MARGIN, RAY, curve, 2 + int(width / 5e-4)) >= 0
        for curve, width in zip(piece_coefficients(rest), np.diff(rest.times), strict=True)
    )
    # Free by a hair may be left unproven; a violation must never be called free.
    assert not (is_free and is_violated)
    if not is_violated and not is_free:
        larger = Scene((*wearer().boxes, Box('hand', where, hand.size + 2e-3, np.eye(3))))
        assert any(
            dense_touch(arm, larger, MARGIN, RAY, curve, 2 + int(width / 5e-4)) >= 0
            for curve, width in zip(piece_coefficients(rest), np.diff(rest.times), strict=True)
        )


@examples(25)
@given(seed=SEEDS)
def test_a_reading_locates_the_arm_on_its_motion(seed):
    rng = np.random.default_rng(seed)
    motion = random_motion(rng)
    if motion is None:
        return
    running = ExecutingMotion(trajectory=motion, start_time=100.0)
    time = rng.uniform(0.05, 0.95) * motion.duration
    q, v, _ = (values[0] for values in sample(motion, [time]))
    # By the clock where it fits; else by where the arm is, as when it is played slowly.
    for rate, taken in ((1.0, 100.0 + time), (0.5, 100.0 + 2.0 * time)):
        found = running.phase(q, taken, taken + 0.01)
        if np.linalg.norm(v) > 0.2:
            assert abs(found - (time + rate * 0.01)) < 0.012


def hand_beside(rng, q, gap):
    """Return the wearer with a hand that a bar of an arm at q is so far from [m]."""
    for _ in range(100):
        bars = reference_checker.bars(table_1_arm(), q[None], 0.0)[0]
        a, b = bars[rng.integers(len(bars)), :, :3]
        way = rng.normal(size=3)
        hand = Box(
            'hand',
            a + rng.uniform() * (b - a) + rng.uniform(0.02, 0.3) * way / np.linalg.norm(way),
            np.full(3, rng.uniform(0.02, 0.1)),
            np.eye(3),
        )
        away = reference_checker.least_clearance(table_1_arm(), Scene((hand,)), q[None], RAY)
        if 0.0 < away < gap:
            return Scene((*wearer().boxes, hand))
    return None


def meets(arm, box, q, growth):
    """Return where an arm of thin bars is in contact with a box that is grown so much [m]."""
    bars = reference_checker.bars(arm, q, RAY)
    half = 0.5 * box.size + growth
    return reference_checker.bar_box_contact(bars, box.center, box.rotation, half).any(axis=1)


def growth_to(arm, box, q):
    """Return by how much a box has to grow to be in contact with an arm, up to the margin [m]."""
    low, high = 0.0, MARGIN
    assert meets(arm, box, q[None], high).all()
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if meets(arm, box, q[None], middle).all() else (middle, high)
    return high


def test_a_motion_that_escapes_is_distinguished_from_one_that_does_not():
    rng, counts = np.random.default_rng(5), {True: 0, False: 0}
    arm = table_1_arm()
    for _ in range(60):
        motion = random_motion(rng)
        if motion is None or motion.duration < 0.2:
            continue
        phase = rng.uniform(0.0, 0.8) * motion.duration
        times = np.linspace(phase, motion.duration, 200)
        q, _, _ = sample(motion, times)
        scene = hand_beside(rng, q[0], MARGIN)
        if scene is None:
            continue
        running = ExecutingMotion(trajectory=motion, start_time=0.0)
        assert not is_remaining_free(running, phase, REQUIRED, scene)
        found = escapes_by_continuing(running, phase, REQUIRED, scene)
        counts[found] += 1
        hand = scene.boxes[-1]
        if found:
            # Deep is what a grown box would have to shrink by, on every side.
            assert not meets(arm, hand, q, growth_to(arm, hand, q[0]) - 1e-5).any()
            end = reference_checker.least_clearance(arm, Scene((hand,)), q[-1:], RAY)
            assert end >= MARGIN - 1e-6
        assert not escapes_by_continuing(running, phase, REQUIRED, wearer())
    assert min(counts.values()) >= 5, counts


def test_a_place_is_free_by_the_boxes_of_a_moment_as_by_the_world():
    rng, arm, counts = np.random.default_rng(8), table_1_arm(), {True: 0, False: 0}
    low, high = arm.bounds
    for _ in range(300):
        q, ray = rng.uniform(low, high), rng.uniform(0.0, 1.0)
        found = is_place_free(q, RequiredClearance(arm, MARGIN, ray), wearer())
        assert found == arm_world(arm, wearer(), MARGIN, ray).is_valid(q)
        counts[found] += 1
    assert min(counts.values()) >= 20, counts


@functools.cache
def some_motions():
    """Return a few motions round the wearer."""
    rng = np.random.default_rng(12)
    return [motion for motion in [random_motion(rng) for _ in range(12)] if motion is not None]
