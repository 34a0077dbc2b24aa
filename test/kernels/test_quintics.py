# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Quintics from points, by plain numpy."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.kernels.trajectory.quintics import bound, fit, larger, peaks
from rrth_planner.model.bernstein import to_bernstein
from rrth_planner.model.errors import RrthError
from rrth_planner.model.trajectory import piece_coefficients, Trajectory
from worlds import examples

SEEDS = st.integers(0, 2**32 - 1)
# Rows: position, velocity and acceleration at u = 0, then at u = 1, of the powers of u.
ENDS = np.array(
    [
        [1, 0, 0, 0, 0, 0],
        [0, 1, 0, 0, 0, 0],
        [0, 0, 2, 0, 0, 0],
        [1, 1, 1, 1, 1, 1],
        [0, 1, 2, 3, 4, 5],
        [0, 0, 2, 6, 12, 20],
    ]
)


def points(rng, n=5, dof=3):
    times = np.append(0.0, np.cumsum(rng.uniform(0.05, 0.8, n - 1)))
    return times, *rng.normal(size=(3, n, dof))


@examples(200)
@given(seed=SEEDS, dof=st.integers(1, 7))
def test_each_piece_fits_its_ends(seed, dof):
    times, q, v, a = points(np.random.default_rng(seed), dof=dof)
    curves = np.empty((4, 6, dof))
    fit(times, q, v, a, curves)
    T = np.diff(times)[:, None]
    ends = [q[:-1], v[:-1] * T, a[:-1] * T**2, q[1:], v[1:] * T, a[1:] * T**2]
    assert np.allclose(curves, np.linalg.solve(ENDS, np.stack(ends, axis=1)), atol=1e-12)
    assert np.allclose(curves, piece_coefficients(trajectory((times, q, v, a))), atol=1e-13)


@examples(200)
@given(seed=SEEDS, size=st.floats(-6, 3))
def test_bounds_are_the_largest_bernstein_coefficients(seed, size):
    curves = np.random.default_rng(seed).normal(size=(3, 6, 4)) * 10.0**size
    quartic, cubic = to_bernstein(4), to_bernstein(3)
    speeds, bends = np.empty((2, 3, 4))
    bound(curves, quartic, cubic, speeds, bends)
    first = curves[:, 1:] * np.arange(1, 6)[:, None]
    second = first[:, 1:] * np.arange(1, 5)[:, None]
    for found, matrix, values in ((speeds, quartic, first), (bends, cubic, second)):
        wanted = np.abs(matrix @ values).max(axis=1)
        assert np.allclose(found, wanted, rtol=1e-9)
        assert (found > wanted * (1.0 + 5e-13)).all()


@examples(200)
@given(seed=SEEDS, n_instants=st.integers(2, 33))
def test_peaks_are_those_of_plain_numpy_and_bound_every_instant(seed, n_instants):
    times, *state = points(np.random.default_rng(seed))
    curves, T = piece_coefficients(trajectory((times, *state))), np.diff(times)[:, None]
    found = np.empty((3, 3))
    peaks(curves, times, n_instants, found)

    def derivative(order, u):
        c = curves
        for _ in range(order):
            c = c[:, 1:] * np.arange(1, c.shape[1])[:, None]
        return u[:, None] ** np.arange(c.shape[1]) @ c

    instants, many = np.linspace(0.0, 1.0, n_instants), np.linspace(0.0, 1.0, 501)
    for order, most in enumerate(found, start=1):
        sampled = np.abs(derivative(order, instants)).max(axis=1)
        # Largest at the ends of [0, 1]: of the sum of the magnitudes of all terms.
        c = np.abs(curves)
        for _ in range(order + 2):
            c = c[:, 1:] * np.arange(1, c.shape[1])[:, None]
        between = c.sum(axis=1) / 8 / (n_instants - 1) ** 2
        wanted = ((sampled + between) / T**order).max(axis=0)
        assert np.allclose(most, wanted, rtol=1e-9)
        seen = (np.abs(derivative(order, many)).max(axis=1) / T**order).max(axis=0)
        assert (seen <= most * (1 + 1e-9)).all()


def test_a_peak_that_is_no_number_is_none():
    times, q, v, a = points(np.random.default_rng(0))
    curves = piece_coefficients(trajectory((times, q, v, a))).copy()
    curves[1, 2, 0] = np.nan
    found = np.empty((3, 3))
    peaks(curves, times, 33, found)
    assert np.isnan(found[:2, 0]).all()
    assert np.isfinite(found[:, 1:]).all()


@pytest.mark.parametrize('power', range(1, 6))
def test_what_is_no_number_has_no_bound(power):
    curves = np.ones((1, 6, 1))
    curves[0, power] = np.nan
    speeds, bends = np.empty((2, 1, 1))
    bound(curves, to_bernstein(4), to_bernstein(3), speeds, bends)
    assert np.isnan(speeds).all()
    assert np.isnan(bends).all() == (power > 1)


def test_the_larger_of_two_numbers_is_none_where_one_is_none():
    assert larger(1.0, 2.0) == larger(2.0, 1.0) == 2.0
    assert np.isnan([larger(np.nan, 1.0), larger(1.0, np.nan)]).all()


@pytest.mark.parametrize('bad', [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize('field', range(4))
@pytest.mark.parametrize('row', [0, 2, 4])
def test_points_are_finite(bad, field, row):
    given = points(np.random.default_rng(row))
    trajectory(given)
    given[field][(row,) + (1,) * (field > 0)] = bad
    rejected(given)


@pytest.mark.parametrize(
    'times', [[0.1, 1.0, 2.0], [0.0, 1.0, 1.0], [0.0, 2.0, 1.0], [0.0, 0.0, 1.0]]
)
def test_times_increase_from_0(times):
    given = (np.array(times), *np.zeros((3, 3, 2)))
    rejected(given)


def trajectory(given):
    names = ('times', 'positions', 'velocities', 'accelerations')
    return Trajectory(**dict(zip(names, given, strict=True)))


def rejected(given):
    with pytest.raises(RrthError):
        trajectory(given)


def test_no_points_are_none():
    rejected((np.empty(0), *np.empty((3, 0, 2))))
