# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The compiled answers about motions: those of `model.trajectory`, to the bit."""

import numpy as np
import pytest
from rrth_planner.model.curves import curves_of, motion_through, part, state_at, states_at
from rrth_planner.model.errors import RrthError
from rrth_planner.model.trajectory import (
    motion_through as plain_motion_through,
    part_of,
    piece_coefficients,
    sample,
    state_at as plain_state_at,
    Trajectory,
)


def motions(n_motions):
    """Yield motions of one to thirty points, some of them very near to each other, and draws."""
    rng = np.random.default_rng(5)
    for k in range(n_motions):
        n, dof = int(rng.integers(1, 31)), int(rng.integers(2, 8))
        steps = rng.uniform(1e-6 if k % 3 == 0 else 0.01, 0.05, n - 1)
        times = np.concatenate([[0.0], np.cumsum(steps)])
        yield Trajectory(times, *rng.standard_normal((3, n, dof))), rng


def is_same(one, other):
    """Return whether two motions have the same numbers."""
    arrays = zip((one.times, *one.states), (other.times, *other.states), strict=True)
    return all(a.tobytes() == b.tobytes() for a, b in arrays)


def test_polynomials_and_states_are_those_of_numpy():
    for motion, rng in motions(300):
        if len(motion.times) > 1:
            # A processor that multiplies and adds in two steps rounds twice.
            found, expected = curves_of(motion), piece_coefficients(motion)
            assert np.abs(found - expected).max() <= 1e-13
        times = np.sort(rng.uniform(-0.2, 1.2, 9) * motion.duration)
        expected = sample(motion, times)
        assert np.allclose(states_at(motion, times), expected, rtol=1e-12, atol=1e-12)
        for time in (*times[:3].tolist(), float(rng.choice(motion.times))):
            states = [values[0] for values in sample(motion, [time])]
            assert np.array_equal(plain_state_at(motion, time), states)
            assert np.allclose(state_at(motion, time), states, rtol=1e-12, atol=1e-9)


def test_a_part_is_that_of_the_plain_function():
    for motion, rng in motions(300):
        ends = rng.uniform(-0.2, 1.2, 2) * motion.duration
        if rng.random() < 0.5:
            ends[0] = rng.choice(motion.times) + rng.uniform(-2e-5, 2e-5)
        found, expected = part(motion, *ends), part_of(motion, *ends)
        assert np.array_equal(found.times, expected.times)
        for one, other in zip(found.states, expected.states, strict=True):
            assert np.allclose(one, other, rtol=1e-12, atol=1e-9)
            assert not one.flags.writeable


@pytest.mark.parametrize('through', [motion_through, plain_motion_through])
def test_points_that_are_no_motion_are_rejected_with_the_sentence_of_a_trajectory(through):
    rng = np.random.default_rng(6)
    times, states = np.array([0.0, 0.1, 0.3]), rng.standard_normal((3, 3, 4))
    assert is_same(through(times.copy(), states.copy()), Trajectory(times, *states))
    for at, value in (((0, 1, 2), 2e4), ((1, 0, 0), np.nan), ((2, 2, 3), np.inf)):
        bad = states.copy()
        bad[at] = value
        with pytest.raises(RrthError, match='positions|velocities|accelerations'):
            through(times.copy(), bad)
    for bad in ([0.0, 0.1, 0.1], [0.1, 0.2, 0.3], [0.0, 0.1, np.nan], [0.0, 0.1, np.inf]):
        with pytest.raises(RrthError, match='times'):
            through(np.array(bad), states.copy())
