# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where a wearer is expected soon, and whether the next stretch of a motion is free of that."""

from dataclasses import replace

from hypothesis import given, strategies as st
import numpy as np
from rrth_planner.collision.reference_checker import first_contact, frames
from rrth_planner.execution import expected_wearer
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.expected_wearer import AHEAD, expected_scene, is_expected_free, SLOW
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import sample
from worlds import examples, MARGIN, random_boxes, random_motion, RAY, table_1_arm

SEEDS = st.integers(0, 2**32 - 1)
ARM = table_1_arm()


def moved(box, step):
    """Return a box that has gone on by a step [m]."""
    return replace(box, center=box.center + step)


@examples(50)
@given(seed=SEEDS)
def test_parts_go_on_as_they_moved_and_slow_or_new_ones_are_not_expected_elsewhere(seed):
    rng = np.random.default_rng(seed)
    present = [replace(box, name=f'part {k}') for k, box in enumerate(random_boxes(rng, 6).boxes)]
    elapsed = rng.uniform(0.05, 0.25)
    velocities = rng.normal(0.0, 0.5, (len(present), 3))
    velocities[0] = 0.0
    before = [
        moved(box, -elapsed * v) for box, v in zip(present[:-1], velocities[:-1], strict=True)
    ]
    # In any order: parts are known by their names; the last one was not there.
    order = rng.permutation(len(before))
    found = expected_scene(
        Scene(tuple(before[k] for k in order)), Scene(tuple(present)), elapsed
    ).boxes
    wanted = [
        (box, velocity, time)
        for box, velocity in zip(present[:-1], velocities[:-1], strict=True)
        if np.linalg.norm(velocity) > SLOW
        for time in AHEAD
    ]
    assert len(found) == len(wanted)
    for one, (box, velocity, time) in zip(found, wanted, strict=True):
        assert one.name == box.name
        np.testing.assert_allclose(one.center, box.center + time * velocity, atol=1e-9)
        np.testing.assert_array_equal(one.size, box.size)
        np.testing.assert_array_equal(one.rotation, box.rotation)


def test_a_wearer_of_as_many_boxes_as_there_may_be_is_expected_at_fewer_times(monkeypatch):
    monkeypatch.setattr(expected_wearer, 'MAX_BOXES', 12)
    boxes = random_boxes(np.random.default_rng(2), 10).boxes
    named = [replace(box, name=f'part {k}') for k, box in enumerate(boxes)]
    before = Scene(tuple(moved(box, np.array([0.0, 0.1, 0.0])) for box in named))
    found = expected_scene(before, Scene(tuple(named)), 0.1).boxes
    assert len(found) == len(boxes)
    np.testing.assert_allclose(found[0].center, named[0].center - [0.0, AHEAD[-1], 0.0])


def free_of(running, phase, expected):
    return is_expected_free(running, phase, RequiredClearance(ARM, MARGIN, RAY), expected)


def test_the_next_stretch_is_free_as_the_reference_checker_has_it():
    rng, verdicts = np.random.default_rng(3), []
    while len(verdicts) < 300:
        motion = random_motion(rng)
        if motion is None:
            continue
        running = ExecutingMotion(trajectory=motion, start_time=0.0)
        for _ in range(10):
            phase = rng.uniform(0.0, motion.duration)
            expected = random_boxes(rng, 12)
            end = min(phase + AHEAD[-1], motion.duration)
            q, _, _ = sample(motion, np.linspace(phase, end, 60))
            verdicts.append(free_of(running, phase, expected))
            contact = first_contact(ARM, expected, q, RAY, MARGIN)
            # A proof is never optimistic, and gives up only where it is near.
            if verdicts[-1]:
                assert contact is None
            else:
                assert first_contact(ARM, expected, q, RAY, MARGIN + 0.02) is not None
    assert 60 < sum(verdicts) < 240


def test_nothing_expected_and_an_escape_are_free():
    rng = np.random.default_rng(5)
    motion = next(m for m in (random_motion(rng) for _ in range(100)) if m and m.duration > 1.0)
    # In the middle of the ray.
    T = frames(ARM, sample(motion, [0.6])[0])[0, -1]
    hand = Scene((Box('hand', T[:3, 3] + 0.5 * RAY * T[:3, 2], np.full(3, 0.1), np.eye(3)),))
    running = ExecutingMotion(trajectory=motion, start_time=0.0, escape_time=0.5)
    assert free_of(running, 0.4, hand)
    assert not free_of(running, 0.5, hand)
    assert free_of(running, 0.5, Scene(()))
