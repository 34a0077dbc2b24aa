# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Random numbers of the kernels: the published generator, evenly and normally distributed."""

import numpy as np
from rrth_planner.kernels.search.random import next_word, normal, random_state, uniform

WORD = 2**64 - 1


def reference_words(state, n):
    """Return n words of xoshiro256++ (Blackman and Vigna 2021), in whole numbers of Python."""
    s = [int(word) for word in state]

    def rotated(x, k):
        return ((x << k) | (x >> (64 - k))) & WORD

    words = []
    for _ in range(n):
        words.append((rotated((s[0] + s[3]) & WORD, 23) + s[0]) & WORD)
        t = (s[1] << 17) & WORD
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = rotated(s[3], 45)
    return words


def state(seed):
    return random_state(np.random.default_rng(seed))


def test_words_are_those_of_the_published_generator():
    for seed in range(5):
        bits = state(seed)
        assert bits.dtype == np.uint64
        expected = reference_words(bits, 500)
        assert [int(next_word(bits)) for _ in range(500)] == expected
    # Its authors' example: the state 1, 2, 3, 4.
    bits = np.array([1, 2, 3, 4], dtype=np.uint64)
    assert [int(next_word(bits)) for _ in range(3)] == [41943041, 58720359, 3588806011781223]


def test_the_same_seed_gives_the_same_stream_and_another_seed_another():
    streams = [[uniform(bits) for _ in range(50)] for bits in map(state, (3, 3, 4))]
    assert streams[0] == streams[1]
    assert not set(streams[0]) & set(streams[2])
    # Seeding from one generator twice gives two streams.
    rng = np.random.default_rng(3)
    first, second = random_state(rng), random_state(rng)
    assert not np.array_equal(first, second)


def test_uniform_numbers_fill_the_unit_interval_evenly():
    bits, n = state(5), 40000
    x = np.array([uniform(bits) for _ in range(n)])
    assert (x >= 0.0).all()
    assert (x < 1.0).all()
    counts = np.histogram(x, 100, (0.0, 1.0))[0]
    # Chi-squared with 99 degrees of freedom exceeds 149 once in a thousand times.
    assert ((counts - n / 100) ** 2).sum() / (n / 100) < 149.0
    for lag in (1, 2, 7):
        assert abs(np.corrcoef(x[:-lag], x[lag:])[0, 1]) < 4.0 / np.sqrt(n)
    # All 53 bits of the fraction are used.
    ones = [(np.floor(x * 2.0**k) % 2).mean() for k in range(1, 54)]
    assert np.abs(np.array(ones) - 0.5).max() < 4.0 * 0.5 / np.sqrt(n)


def test_normal_numbers_have_the_moments_of_the_normal_distribution():
    bits, n = state(6), 40000
    x = np.array([normal(bits) for _ in range(n)])
    assert np.isfinite(x).all()
    for power, moment, spread in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)):
        assert abs((x**power).mean() - moment) < 4.0 * np.sqrt(spread / n)
    assert abs((np.abs(x) < 1.0).mean() - 0.6827) < 0.01
    assert abs(np.corrcoef(x[:-1], x[1:])[0, 1]) < 4.0 / np.sqrt(n)
