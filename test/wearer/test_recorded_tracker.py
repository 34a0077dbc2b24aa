# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A simulated tracker measures what was recorded, with the faults that are asked for."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.model.errors import OptionsError
from rrth_planner.wearer.recorded_person import posture_at, RecordedPerson
from rrth_planner.wearer.tracker import measurement, newest_number, publishing_time, Tracker

PERSON = RecordedPerson(
    names=('a', 'b'),
    rate=10.0,
    positions=np.random.default_rng(1).normal(size=(8, 2, 3)),
    rotations=np.tile(np.eye(3), (8, 2, 1, 1)),
)


@pytest.mark.parametrize('rate', [0.0, 0.5, 2.0])
def test_without_faults_every_measurement_is_the_posture_of_its_time(rate):
    tracker = Tracker(fps=40.0, rate=rate)
    for number in range(90):
        measured = measurement(tracker, PERSON, number)
        expected = posture_at(PERSON, rate * number / 40.0)
        np.testing.assert_array_equal(measured.positions, expected.positions)
        np.testing.assert_array_equal(measured.rotations, expected.rotations)


def test_the_given_share_is_dropped_and_the_same_again():
    tracker = Tracker(drop=0.3, seed=5)
    dropped = [measurement(tracker, PERSON, k) is None for k in range(2000)]
    assert 0.26 < np.mean(dropped) < 0.34
    # In any order, and each for itself.
    again = [measurement(tracker, PERSON, k) is None for k in reversed(range(2000))]
    assert again[::-1] == dropped
    other = Tracker(drop=0.3, seed=6)
    assert [measurement(other, PERSON, k) is None for k in range(2000)] != dropped


def test_noise_has_the_given_deviation_in_each_coordinate():
    tracker = Tracker(noise=0.02, seed=1)
    clean = Tracker()
    errors = np.array(
        [
            measurement(tracker, PERSON, k).positions - measurement(clean, PERSON, k).positions
            for k in range(3000)
        ]
    )
    np.testing.assert_allclose(errors.std(axis=0), 0.02, rtol=0.1)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=0.002)
    # Neither the points nor the coordinates share theirs.
    correlation = np.corrcoef(errors.reshape(len(errors), -1).T) - np.eye(6)
    assert np.abs(correlation).max() < 0.1


@given(
    st.sampled_from([1.0, 24.0, 30.0, 60.0, 120.0]),
    st.sampled_from([0.0, 0.1, 1 / 3, 2.0]),
    st.integers(0, 10**6),
    st.floats(0.01, 0.99),
)
def test_a_measurement_is_published_once_its_latency_has_passed(fps, latency, number, part):
    tracker = Tracker(fps=fps, latency=latency)
    due = publishing_time(tracker, number)
    assert due == pytest.approx(number / fps + latency)
    assert newest_number(tracker, due) == number
    assert newest_number(tracker, due + part / fps) == number
    assert newest_number(tracker, due - part / fps) == number - 1
    assert newest_number(tracker, 0.99 * latency - 1e-6) == -1


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        ({'fps': 0.0}, r'fps: 0.0, expected a number > 0 \[1/s\]'),
        ({'fps': float('nan')}, 'fps: nan'),
        ({'rate': -1.0}, 'rate: -1.0, expected a number >= 0'),
        ({'latency': float('inf')}, r'latency: inf, expected a time >= 0 \[s\]'),
        ({'drop': 1.0}, 'drop: 1.0, expected a share from 0 to below 1'),
        ({'noise': -0.1}, r'noise: -0.1, expected a length >= 0 \[m\]'),
        ({'seed': -1}, 'seed: -1, expected a whole number >= 0'),
    ],
)
def test_options_outside_their_range_are_rejected(options, words):
    with pytest.raises(OptionsError, match=words):
        Tracker(**options)
