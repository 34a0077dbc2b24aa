# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Random numbers of a plan: a state of four words that kernels draw from, seeded by numpy."""

import math

from numba import config
from numba.core.types import float64, uint64
import numpy as np
from rrth_planner.kernels.jit import kernel, RNG

# Shifts and masks as words, or the compiler would go on in floating point.
S11, S17, S23, S41 = np.uint64(11), np.uint64(17), np.uint64(23), np.uint64(41)
S19, S45 = np.uint64(19), np.uint64(45)
UNIT = 2.0**-53


def random_state(rng):
    """
    Return the state of a generator of the kernels, seeded from a numpy Generator.

    Handing the Generator itself to a kernel takes longer (8 to 30 us) than most plans draw.
    """
    return rng.bit_generator.random_raw(4)


@kernel(uint64(RNG))
def next_word(rng):
    """Return 64 random bits (xoshiro256++, Blackman and Vigna 2021)."""
    a, b, c, d = rng[0], rng[1], rng[2], rng[3]
    total = a + d
    word = ((total << S23) | (total >> S41)) + a
    c ^= a
    d ^= b
    rng[1], rng[0] = b ^ c, a ^ d
    rng[2], rng[3] = c ^ (b << S17), (d << S45) | (d >> S19)
    return word


@kernel(float64(RNG))
def uniform(rng):
    """Return a number from 0 to 1, 1 excluded."""
    return UNIT * float64(next_word(rng) >> S11)


@kernel(float64(RNG))
def normal(rng):
    """Return a standard normal number (Box and Muller 1958)."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(rng)))
    return radius * math.cos(2.0 * math.pi * uniform(rng))


if config.DISABLE_JIT:
    # Interpreted, numpy warns of the overflow that the words live by.
    np.seterr(over='ignore')
