# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Rest is told from motion behind noisy and coarse encoders."""

import numpy as np
import pytest
from rrth_planner.execution.standstill import mean_motion, WINDOW

REST, SLOW, COUNT, RATES = 0.01, 0.02, 2.0 * np.pi / 4096, (50, 100, 500)


def _moves(q, rate):
    """Return whether the last readings of an arm, (n, dof) [rad], are of one that moves."""
    n = 1 + round(WINDOW * rate)
    times = 1e3 + np.arange(n) / rate
    return bool((np.abs(mean_motion(times, q[-n:], REST)[1]) > REST).any())


def _in_counts(q):
    return COUNT * np.round(q / COUNT)


@pytest.mark.parametrize('rate', RATES)
def test_an_encoder_between_two_counts_is_at_rest_and_slow_motion_never_is(rate):
    rng = np.random.default_rng(rate)
    n = 1 + round(WINDOW * rate)
    for _ in range(300):
        # However it flickers.
        flicker = COUNT * (rng.random((n, 4)) < rng.random(4))
        assert not _moves(flicker, rate)
        way = SLOW * (np.arange(n) / rate)[:, None] + rng.uniform(0.0, COUNT)
        assert _moves(_in_counts(way), rate)


@pytest.mark.parametrize('sigma', [1e-4, 1e-3])
@pytest.mark.parametrize('rate', RATES)
def test_of_noise_one_look_in_hundreds_is_wrong_at_most(rate, sigma):
    rng = np.random.default_rng(rate)
    n, looks = 1 + round(WINDOW * rate), 1500
    noise = sigma * rng.standard_normal((looks, n, 4))
    way = SLOW * (np.arange(n) / rate)[:, None] * [1.0, 0.0, 0.0, 0.0]
    assert sum(_moves(q, rate) for q in noise) <= 8
    assert sum(not _moves(q + way, rate) for q in noise) <= 8


def test_a_fine_encoder_is_judged_at_once():
    rate = 100
    since = np.arange(31) / rate - 0.27
    # It begins to move, or comes to rest, 30 ms before the last reading.
    assert _moves(SLOW * np.maximum(since, 0.0)[:, None], rate)
    assert not _moves(SLOW * np.minimum(since, 0.0)[:, None], rate)


def test_where_an_arm_rests_is_a_mean_and_equal_readings_are_their_own():
    rng = np.random.default_rng(1)
    q = np.array([0.1, -0.7, 1.3])
    times = np.arange(31) / 100
    found = [
        mean_motion(times, q + 1e-3 * rng.standard_normal((31, 3)), REST)[0] for _ in range(400)
    ]
    assert np.std(found, axis=0).max() < 0.25e-3
    assert np.abs(np.mean(found, axis=0) - q).max() < 1e-4
    assert (mean_motion(times, np.tile(q, (31, 1)), REST)[0] == q).all()
