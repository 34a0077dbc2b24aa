# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What was published beside a wearer who moves is judged from outside, and faults are found."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('fcl')

from rrth_planner.collision.motion_inspection import UnsafeMotionError
from rrth_planner.collision.separation_inspection import inspect_separation, Sights
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import SeparationRules
from rrth_planner.model.trajectory import sample
import sample_motions

ARM, RULES, MARGIN, PERIOD = load_arm(), SeparationRules(), 0.02, 1.0 / 60.0
MOTION = sample_motions.planned_motion(np.random.default_rng(0))
# The motion begins then [s]; bodies come before that, and until it has ended.
BEGIN = 3.0
TIMES = np.arange(0.0, BEGIN + MOTION.duration + 0.1, PERIOD)
# Of the arm, while what was seen before the motion still counts [s].
STATES = np.arange(0.0, 1.2, 0.01)
Q, V, _ = sample(MOTION, STATES)
# In the way of the tool where that is fast, and far from all of the arm [m].
FASTEST = int(np.argmax(np.abs(V).max(axis=1)))
NEAR, FAR = tool_pose(ARM, Q[FASTEST])[:3, 3], np.array([0.0, 0.0, 9.0])


def sights_of(place):
    """Return sights of a hand, by its places, (n, 3) or (3,) [m]."""
    places = np.broadcast_to(place, (len(TIMES), 3))
    boxes = (Box('hand', p, [0.1, 0.1, 0.1], np.eye(3)) for p in places)
    return Sights(TIMES, tuple(Scene((box,)) for box in boxes))


def inspected(sights, motions=((BEGIN, BEGIN, MOTION),), q=Q, v=V):
    """Return the inspection of an arm that executed the motion."""
    return inspect_separation(ARM, RULES, MARGIN, sights, motions, BEGIN + STATES, q, v)


def test_an_arm_that_is_far_from_the_wearer_keeps_separate():
    found = inspected(sights_of(FAR))
    assert (found.n_commitments, found.n_instants) == (1, len(STATES))
    assert found.n_frames == len(TIMES) - 1
    assert not any((found.n_unknown, found.n_excused, found.n_contacts, found.n_further))


def test_a_commitment_that_the_wearer_could_reach_is_found():
    with pytest.raises(UnsafeMotionError, match=r'mm too near to hand \d'):
        inspected(sights_of(NEAR), q=np.tile(Q[0], (len(Q), 1)), v=0.0 * V)


def test_a_commitment_that_does_not_end_at_rest_is_found():
    end = np.array(MOTION.velocities)
    end[-1, 0] = 0.01
    with pytest.raises(UnsafeMotionError, match='a commitment ends at 1.00e-02'):
        inspected(sights_of(FAR), [(BEGIN, BEGIN, replace(MOTION, velocities=end))])


def test_a_commitment_without_any_body_before_it_is_found():
    with pytest.raises(UnsafeMotionError, match='before there is a body'):
        inspected(sights_of(FAR), [(-1.0, -1.0, MOTION)])


def test_where_no_body_comes_any_more_the_last_one_counts():
    late = TIMES[-1] + 1.0
    assert inspected(sights_of(FAR), [(late, late, MOTION)]).n_excused == 0
    # It may be anywhere by then, but so may have been one that was not received.
    assert inspected(sights_of(FAR / 3.0), [(late, late, MOTION)]).n_unknown == 1


def test_a_fast_part_of_the_arm_in_a_box_is_found_and_a_slow_one_is_not():
    sights = sights_of(NEAR)
    with pytest.raises(UnsafeMotionError, match=r'faster than 0\.1 m/s in contact with hand'):
        inspected(sights, [])
    assert inspected(sights, [], v=1e-3 * V).n_contacts == 0


def test_a_part_that_got_further_than_assumed_is_counted():
    # It jumps into the way before the commitment begins.
    sights = sights_of(np.where((TIMES > BEGIN - 0.5)[:, None], NEAR, FAR))
    found = inspected(sights)
    # For a second it is further from some body than it could be.
    assert (found.n_further, found.n_excused) == (60, 1)
    assert 0 < found.n_contacts < len(STATES)
    # Long before, that is no excuse.
    sights = sights_of(np.where((TIMES > BEGIN - 2.5)[:, None], NEAR, FAR))
    with pytest.raises(UnsafeMotionError, match='too near to hand'):
        inspected(sights)


def test_a_commitment_may_be_of_a_body_before_the_newest_one():
    # That may have been on its way to the planner still.
    found = inspected(sights_of(np.where((TIMES > BEGIN - 0.02)[:, None], NEAR, FAR)))
    assert (found.n_excused, found.n_unknown, found.n_further) == (0, 0, 60)


def test_a_commitment_that_begins_before_its_publication_may_be_of_a_body_between():
    sights = sights_of(np.where((TIMES < BEGIN + 0.01)[:, None], NEAR, FAR))
    still = np.tile(Q[0], (len(Q), 1))
    published = TIMES[TIMES >= BEGIN + 0.01][0]
    late = inspected(sights, [(published, BEGIN, MOTION)], q=still, v=0.0 * V)
    assert (late.n_commitments, late.n_unknown) == (1, 0)
    with pytest.raises(UnsafeMotionError, match='mm too near to hand'):
        inspected(sights, [(BEGIN, BEGIN, MOTION)], q=still, v=0.0 * V)


def test_nothing_is_known_where_a_body_may_be_missing():
    sights = sights_of(NEAR)
    kept = np.abs(TIMES - (BEGIN - 0.1)) > 0.6 * PERIOD
    few = Sights(TIMES[kept], tuple(s for s, k in zip(sights.scenes, kept, strict=True) if k))
    found = inspected(few, q=np.tile(Q[0], (len(Q), 1)), v=0.0 * V)
    assert found.n_unknown == 1
