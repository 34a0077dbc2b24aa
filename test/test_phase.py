# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where within its motion an arm is, by what it says."""

import numpy as np
import pytest
from rrth_planner.trajectory import sample, Trajectory
from rrth_planner.underway import RunningMotion


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
    running = RunningMotion(trajectory=motion, start_time=10.0)
    q, v, _ = (values[0] for values in sample(motion, [at]))
    taken = 10.0 + at + late
    phase = running.phase(q, v, taken, taken + 0.004)
    # Within 0.05 ms: with 4 rad/s^2 that is 0.0002 rad/s.
    assert phase == pytest.approx(at + 0.004, abs=5e-5)


def test_an_arm_at_rest_is_where_the_time_says():
    running = RunningMotion(trajectory=_swing(), start_time=10.0)
    assert running.phase(np.zeros(4), np.zeros(4), 10.01, 10.02) == pytest.approx(0.02)
