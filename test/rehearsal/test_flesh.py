# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded people have hands of a size, and are met where their flesh may be."""

import numpy as np
import pytest
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.arm import bars_of
from rrth_planner.model.errors import SceneError
from rrth_planner.rehearsal.contacts import classes_of, distances_to, moving_bars, SLOW
from rrth_planner.rehearsal.rehearsal import recorded_wearer, rehearsed
from rrth_planner.rehearsal.scenario import Recorded, Scenario
from rrth_planner.rehearsal.world import BEGIN
from rrth_planner.wearer.hands import hand_distances, HANDS, LENGTH


def test_a_recorded_person_has_hands_of_the_size_that_is_said():
    person = recorded_wearer(Scenario(recorded=Recorded(hand_size=0.2)))
    usual = recorded_wearer(Scenario(recorded=Recorded()))
    for name, row, other in zip(
        person.names, person.rows_at(BEGIN), usual.rows_at(BEGIN), strict=True
    ):
        if name in HANDS:
            np.testing.assert_allclose(row[3:6], 0.2)
        else:
            np.testing.assert_array_equal(row, other)
    with pytest.raises(SceneError, match='hand_size: 3, expected 0 or'):
        rehearsed(Scenario(seconds=0.1, recorded=Recorded(hand_size=3.0)))


def test_an_arm_meets_the_flesh_of_a_hand_and_not_the_corners_of_its_box():
    arm, q = load_arm(), np.array([[0.1, -0.2, 1.2, 0.4]])
    ends = moving_bars(arm, q, 0.0 * q)[0][0]
    longest = int(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).argmax())
    (begin, end), radius = ends[longest], bars_of(arm)[longest].radius
    way = end - begin
    axis = np.cross(way, [0.3, 0.2, 1.0])
    axis /= np.linalg.norm(axis)
    third = np.cross(axis, way / np.linalg.norm(way))
    frame = np.column_stack([axis, third, np.cross(axis, third)])
    gaps, names = [], ('right hand',)
    for away in (0.1, 0.2, 0.26, 0.4):
        # Beside the middle of a bar, its forearm at an angle.
        center = 0.5 * (begin + end) + away * axis
        row = np.concatenate([center, [2 * LENGTH] * 3, frame.ravel()])
        found = distances_to(arm, q, 0.2 + 0.0 * q, names, row[None, None], 0.1, 1.0, names)
        share = np.linspace(0.0, 1.0, 2001)[:, None]
        points = begin + share * way
        gap = hand_distances(points[None], row[None]).min() - radius
        assert found.whole[0, longest, 0] == pytest.approx(gap, abs=2e-3)
        gaps.append(gap)
        is_met = (classes_of(found)[0, longest, 0] != '') == (gap <= 0.0)
        assert is_met or abs(gap) < 2e-3
    assert gaps[0] <= 0.0 < gaps[-1]
    # At rest nothing is fast.
    near = np.concatenate([0.5 * (begin + end), [2 * LENGTH] * 3, frame.ravel()])
    still = distances_to(arm, q, 1e-3 + 0.0 * q, names, near[None, None], 0.1, 0.0, names)
    assert SLOW in classes_of(still)
