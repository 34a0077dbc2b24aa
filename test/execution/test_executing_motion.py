# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Localization of an arm within its motion, by its readings."""

import numpy as np
import pytest
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.model.trajectory import sample, Trajectory


def _swing():
    still = np.zeros((2, 4))
    return Trajectory(
        times=[0.0, 1.0],
        positions=[np.zeros(4), [0.4, -0.3, 0.2, 0.1]],
        velocities=still,
        accelerations=still,
    )


@pytest.mark.parametrize('late', [-0.001, 0.0, 0.001, 0.003])
@pytest.mark.parametrize('at', [0.1, 0.3, 0.5, 0.8])
def test_an_arm_that_began_late_is_found_where_it_is(late, at):
    motion = _swing()
    running = ExecutingMotion(trajectory=motion, start_time=10.0)
    q, _, _ = (values[0] for values in sample(motion, [at]))
    taken = 10.0 + at + late
    phase = running.phase(q, taken, taken + 0.004)
    # Within 0.05 ms: with 4 rad/s^2 that is 0.0002 rad/s.
    assert phase == pytest.approx(at + 0.004, abs=5e-5)


def test_an_arm_at_rest_is_where_the_time_says():
    running = ExecutingMotion(trajectory=_swing(), start_time=10.0)
    assert running.phase(np.zeros(4), 10.01, 10.02) == pytest.approx(0.02)


@pytest.mark.parametrize('late', [0.03, 0.2, 0.4])
@pytest.mark.parametrize('beside', [0.0, 0.01, 0.05])
def test_an_arm_that_lags_or_sags_is_where_it_is_nearest_to(late, beside):
    motion = _swing()
    running = ExecutingMotion(trajectory=motion, start_time=10.0)
    q = sample(motion, [0.5])[0][0] + beside * np.array([0.6, 0.8, 0.0, 0.0])
    phase = running.phase(q, 10.5 + late, 10.5 + late)
    path = sample(motion, np.linspace(0.0, 1.0, 20001))[0]
    nearest = np.linalg.norm(path - q, axis=1).argmin() / 20000
    assert phase == pytest.approx(nearest, abs=3e-3)


def test_an_arm_that_is_elsewhere_is_nowhere_on_its_motion():
    running = ExecutingMotion(trajectory=_swing(), start_time=10.0)
    assert running.phase(np.array([0.2, 0.2, 0.0, 0.0]), 10.5, 10.5) is None
    assert running.phase(np.full(4, np.nan), 10.5, 10.5) is None
    # It may still be moving there.
    assert running.phase(np.array([0.2, 0.2, 0.0, 0.0]), 9.8, 9.9) == pytest.approx(-0.1)


def _two_swings():
    """Return a motion that rests at 1 s, in its middle."""
    still = np.zeros((3, 4))
    corner = [0.4, -0.3, 0.2, 0.1]
    return Trajectory(
        times=[0.0, 1.0, 2.0],
        positions=[np.zeros(4), corner, [0.1, -0.3, 0.4, 0.1]],
        velocities=still,
        accelerations=still,
    )


@pytest.mark.parametrize(
    ('at', 'has_missed_stop'),
    [(0.4, True), (0.99, True), (1.01, True), (1.98, False), (2.0, False)],
)
def test_an_arm_is_on_time_where_its_motion_is(at, has_missed_stop):
    motion = _two_swings()
    running = ExecutingMotion(trajectory=motion, start_time=10.0)
    q, v, _ = (values[0] for values in sample(motion, [at]))
    assert running.is_on_time(q, v, 10.0 + at)
    assert not running.is_on_time(q + [0.0, 0.001, 0.0, 0.0], v, 10.0 + at)
    assert not running.is_on_time(q, v + [0.0, 0.02, 0.0, 0.0], 10.0 + at)
    assert not running.is_on_time(q, np.full(4, np.nan), 10.0 + at)
    assert running.will_move(10.0 + at, 0.05) == has_missed_stop


def test_an_arm_that_never_began_is_not_on_time():
    running = ExecutingMotion(trajectory=_two_swings(), start_time=10.0)
    for since in (-0.1, 0.0, 0.02, 0.049, 0.06, 0.5, 1.0, 3.0):
        assert not running.is_on_time(np.zeros(4), np.zeros(4), 10.0 + since)
