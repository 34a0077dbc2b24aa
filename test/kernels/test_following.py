# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How far an arm has come: what the curve itself says, and NaN for an arm that is elsewhere."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.kernels.trajectory.quintics import state_at, time_on
from rrth_planner.model.trajectory import piece_coefficients, sample, Trajectory
from worlds import examples

SAME, SLOW, LATEST = 2e-3, 0.05, 0.05
# More than the pieces of `random_motion` have, mostly [rad/s^3].
JERK = 2e3


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


@examples(200)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.1, 0.9), late=st.floats(-5e-3, 5e-3))
def test_an_arm_that_is_late_is_found_where_it_is(seed, share, late):
    motion = random_motion(np.random.default_rng(seed))
    time = share * motion.duration
    q, v, a = (row[0] for row in sample(motion, [time]))
    found = time_on(piece_coefficients(motion), motion.times, time + late, q, SAME, SLOW, LATEST)
    if np.isfinite(found):
        assert abs(found - time - late) <= LATEST
        assert np.abs(sample(motion, [found])[0][0] - q).max() <= SAME + 1e-9
    # Where the motion hardly bends within that time there is no excuse.
    pace = np.linalg.norm(v)
    bend = max(np.linalg.norm(a), JERK * abs(late)) * abs(late)
    if np.abs(v).max() > 4 * SLOW and 20 * bend < pace:
        assert found == pytest.approx(time, abs=1e-6 + 1e-3 * abs(late))


@pytest.mark.parametrize('joint', range(4))
def test_an_arm_that_is_elsewhere_is_on_no_motion(joint):
    motion = random_motion(np.random.default_rng(8))
    q, v, _ = (row[0] for row in sample(motion, [0.5]))
    # Sideways: an offset along the motion is an arm that is late.
    aside = np.eye(4)[joint] - v * v[joint] / (v @ v)
    aside /= np.abs(aside).max()
    for off, is_there in ((0.9 * SAME, True), (1.1 * SAME, False), (np.nan, False)):
        moved = q + off * aside
        found = time_on(piece_coefficients(motion), motion.times, 0.5, moved, SAME, SLOW, LATEST)
        assert np.isfinite(found) == is_there


def test_an_arm_that_has_not_begun_is_no_later_than_that():
    motion = random_motion(np.random.default_rng(3))
    curves, start = piece_coefficients(motion), motion.positions[0]
    assert np.isnan(time_on(curves, motion.times, 0.4, start, SAME, SLOW, LATEST))
