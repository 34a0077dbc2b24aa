# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The last sights of a wearer."""

import numpy as np
import pytest
from rrth_planner.execution.recent_wearer import RecentWearer
from rrth_planner.model.scene import Box, Scene

FAR = Box('far', [-5.0, 0.0, 0.0], [0.1, 0.1, 0.1], np.eye(3))


def sight(place):
    """Return a hand at a place [m], and a part that does not move."""
    return Scene((Box('hand', [-3.0, place, 0.0], [0.1, 0.1, 0.1], np.eye(3)), FAR))


def test_parts_are_expected_where_they_will_be_by_their_last_sights():
    recent = RecentWearer(lambda scene: scene)
    assert not recent.expected(50.0).boxes
    for k in range(10):
        now = 50.0 + 0.025 * k
        recent.saw(sight(1.5 * 0.025 * k), now)
        # Two sights right after each other do not give a speed.
        assert bool(recent.expected(now).boxes) == (k >= 4)
    found = recent.expected(now).boxes
    assert [box.name for box in found] == ['hand'] * 3
    steps = [box.center[1] - 1.5 * 0.225 for box in found]
    np.testing.assert_allclose(steps, (0.15, 0.3, 0.45), rtol=1e-6)
    # Where it is by now nobody knows.
    assert not recent.expected(now + 0.3).boxes


@pytest.mark.parametrize('rate', [120, 240, 1000, 3000])
def test_parts_are_expected_however_often_sights_come(rate):
    recent = RecentWearer(lambda scene: scene)
    for k in range(rate // 2):
        now, place = 50.0 + k / rate, 1.5 * k / rate
        recent.saw(sight(place), now)
    steps = [box.center[1] - place for box in recent.expected(now).boxes]
    np.testing.assert_allclose(steps, (0.15, 0.3, 0.45), rtol=1e-6)
    assert recent.is_moving(now)
    # Nor does he move who was not seen to, lately.
    assert not recent.is_moving(now + 0.3)


@pytest.mark.parametrize(('step', 'moves'), [(0.0, False), (0.009, False), (0.011, True)])
def test_noise_of_a_tracker_is_no_motion(step, moves):
    recent = RecentWearer(lambda scene: scene)
    for k in range(12):
        recent.saw(sight(step * (k % 2)), 50.0 + k / 60)
    assert recent.is_moving(50.0 + 11 / 60) == moves
