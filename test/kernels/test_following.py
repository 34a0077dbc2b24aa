# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How far an arm has come: what the curve itself says, and NaN for an arm that is elsewhere."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.kernels.following import state_at, time_on
from rrth_planner.trajectory import piece_coefficients, sample, Trajectory
from worlds import examples

SAME, SLOW, LATEST = 2e-3, 0.05, 0.05


def random_motion(rng, n=5, dof=4):
    """Return a motion from rest to rest through points anywhere."""
    v, a = rng.normal(size=(2, n, dof))
    v[[0, -1]] = a[[0, -1]] = 0.0
    times = np.append(0.0, np.cumsum(rng.uniform(0.05, 0.8, n - 1)))
    return Trajectory(
        times=times, positions=rng.normal(size=(n, dof)), velocities=v, accelerations=a
    )


@examples(100)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(-0.2, 1.2))
def test_the_state_is_that_of_the_samples(seed, share):
    motion = random_motion(np.random.default_rng(seed))
    time = share * motion.duration
    position, velocity = np.empty((2, 4))
    state_at(piece_coefficients(motion), motion.times, time, position, velocity)
    q, v, _ = sample(motion, [time])
    assert np.allclose(position, q[0], rtol=0.0, atol=1e-12)
    assert np.allclose(velocity, v[0], rtol=0.0, atol=1e-9)


@examples(100)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.1, 0.9), late=st.floats(-2e-4, 2e-4))
def test_an_arm_that_is_late_is_found_where_it_is(seed, share, late):
    motion = random_motion(np.random.default_rng(seed))
    time = share * motion.duration
    q, v, a = (row[0] for row in sample(motion, [time]))
    found = time_on(piece_coefficients(motion), motion.times, time + late, q, SAME, SLOW, LATEST)
    if np.abs(v).max() * abs(late) > SAME:
        return
    if np.abs(v).max() > 2 * SLOW + np.abs(a).max() * abs(late):
        assert found == pytest.approx(time, abs=1e-5 + 0.05 * abs(late))
    else:
        assert abs(found - time - late) <= LATEST


@pytest.mark.parametrize('joint', range(4))
def test_an_arm_that_is_elsewhere_is_on_no_motion(joint):
    motion = random_motion(np.random.default_rng(8))
    q = sample(motion, [0.5])[0][0]
    for off, is_there in ((0.9 * SAME, True), (1.1 * SAME, False), (np.nan, False)):
        moved = q.copy()
        moved[joint] += off
        found = time_on(piece_coefficients(motion), motion.times, 0.5, moved, SAME, SLOW, LATEST)
        assert np.isfinite(found) == is_there
