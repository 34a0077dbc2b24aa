# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Bounds of polynomials hold between any two samples, and what is outside is found."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.model.bernstein import first_outside, to_bernstein
from worlds import examples

SEEDS = st.integers(0, 2**32 - 1)
U = np.linspace(0.0, 1.0, 2001)


def values(powers, u=U):
    """Return polynomials, lowest power first, (degree + 1, m), at instants, (n, m)."""
    return np.polynomial.polynomial.polyval(u, powers).T


@pytest.mark.parametrize('degree', [3, 5, 14])
def test_the_first_and_last_coefficients_are_values(degree):
    powers = np.random.default_rng(degree).uniform(-1.0, 1.0, (degree + 1, 20))
    control = to_bernstein(degree) @ powers
    np.testing.assert_allclose(control[[0, -1]], values(powers, np.array([0.0, 1.0])), atol=1e-12)


@examples(300)
@given(seed=SEEDS)
def test_a_place_outside_is_found_where_there_is_one(seed):
    rng = np.random.default_rng(seed)
    degree = int(rng.integers(1, 8))
    powers = rng.uniform(-1.0, 1.0, (degree + 1, 6)) * rng.choice(
        [1.0, 1e-3, 1e3], (degree + 1, 1)
    )
    at = values(powers)
    low, high = at.min(axis=0), at.max(axis=0)
    # Down to a millionth of its range beyond the samples, or short of them.
    room = rng.choice([0.1, 1e-3, 1e-5]) * (high - low + 1e-12)
    control = to_bernstein(degree) @ powers
    assert first_outside(control, low - room, high + room) is None
    tight = rng.integers(6)
    high_of_one = high + room
    high_of_one[tight] = high[tight] - room[tight]
    found = first_outside(control, low - room, high_of_one)
    assert found is not None
    which, u, value = found
    assert which == tight
    assert value > high_of_one[tight]
    assert values(powers, np.array([u]))[0, which] == pytest.approx(value, rel=1e-6, abs=1e-6)


def test_a_curve_between_good_ends_is_looked_at():
    # A bulge of 1.0001 between samples that are 1e-3 apart would be missed at 33 of them.
    control = to_bernstein(2) @ np.array([[0.0], [4.0004], [-4.0004]])
    found = first_outside(control, np.array([-1.0]), np.array([1.0]))
    assert found is not None
    assert found[1] == pytest.approx(0.5, abs=0.02)
    assert first_outside(control, np.array([-1.0]), np.array([1.0002])) is None


def test_a_curve_that_only_touches_ends_the_search():
    control = to_bernstein(2) @ np.array([[0.0], [3.0], [-3.0]])
    top = 0.75
    assert first_outside(control, np.array([-1.0]), np.array([top + 1e-9])) is None
    found = first_outside(control, np.array([-1.0]), np.array([top - 1e-9]))
    assert found is not None
    assert found[2] == pytest.approx(top)


@pytest.mark.parametrize('bad', [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize('where', [0, 1, 3])
def test_what_is_no_number_is_outside(bad, where):
    control = np.zeros((4, 3))
    control[where, 1] = bad
    with np.errstate(all='ignore'):
        found = first_outside(control, np.full(3, -1.0), np.full(3, 1.0))
    assert found is not None
    assert found[0] == 1
