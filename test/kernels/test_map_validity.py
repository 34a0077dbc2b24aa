# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Edges and points among boxes in any dimension, against numpy that looks at every axis."""

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
from rrth_planner.kernels.collision import map_validity
from rrth_planner.kernels.kinematics import generated_fk

SEEDS = st.integers(0, 2**32 - 1)
DOFS = (2, 3, 4, 6)
# What is nearer to a face than this may be taken to be on either side of it.
DEEP = 1e-6


def random_map(rng, dof):
    """Return lower and upper corners of boxes, and an edge that often passes close to them."""
    n = rng.integers(1, 6)
    lower = rng.uniform(0.0, 8.0, (n, dof))
    upper = lower + rng.uniform(0.5, 6.0, (n, dof))
    q_from, q_to = rng.uniform(-1.0, 11.0, (2, dof))
    if rng.random() < 0.3:
        # Along an axis, as walls of maps ask for.
        q_to = np.where(np.arange(dof) == rng.integers(dof), q_to, q_from)
    return lower, upper, q_from, q_to


def depth(points, lower, upper):
    """Return how deep each point is in the box that holds it deepest, < 0 outside of all."""
    inside = np.minimum(points[:, None] - lower, upper - points[:, None]).min(axis=2)
    return inside.max(axis=1)


def check(kernel, q_from, q_to, resolution, lower, upper):
    """Return what an edge check says."""
    rows = np.hstack([lower, upper])
    return kernel(q_from, q_to, resolution, generated_fk.NO_CHAIN, np.zeros((1, 1)), rows)


@pytest.mark.parametrize('dof', DOFS)
@settings(max_examples=300)
@given(SEEDS)
def test_an_edge_is_free_where_no_point_of_it_is_inside(dof, seed):
    rng = np.random.default_rng(seed)
    lower, upper, q_from, q_to = random_map(rng, dof)
    is_free = check(map_validity.is_edge_free, q_from, q_to, 1.0, lower, upper)
    shares = np.linspace(0.0, 1.0, 4001)[:, None]
    deepest = depth(q_from + shares * (q_to - q_from), lower, upper).max()
    if is_free:
        assert deepest < DEEP
    else:
        # Between two of the points the edge gets no deeper than half a spacing.
        assert deepest > -0.5 * np.abs(q_to - q_from).max() / 4000


@pytest.mark.parametrize('dof', DOFS)
def test_each_axis_alone_can_keep_an_edge_out_of_a_box(dof):
    lower, upper = np.full((1, dof), 4.0), np.full((1, dof), 6.0)
    inside_from, inside_to = np.full(dof, 4.5), np.full(dof, 5.5)
    for kernel in (map_validity.is_edge_free, map_validity.is_edge_free_sampled):
        assert not check(kernel, inside_from, inside_to, 0.01, lower, upper)
        for axis in range(dof):
            for beside in (3.9, 6.1):
                q_from, q_to = inside_from.copy(), inside_to.copy()
                q_from[axis] = q_to[axis] = beside
                assert check(kernel, q_from, q_to, 0.01, lower, upper)
                q_to[axis] = 5.0
                assert not check(kernel, q_from, q_to, 0.01, lower, upper)


@pytest.mark.parametrize('dof', DOFS)
@settings(max_examples=200)
@given(SEEDS, st.floats(0.05, 3.0))
def test_a_sampled_edge_is_free_where_none_of_its_points_is_inside(dof, seed, resolution):
    rng = np.random.default_rng(seed)
    lower, upper, q_from, q_to = random_map(rng, dof)
    n = int(np.linalg.norm(q_to - q_from) / resolution) + 1
    shares = np.arange(1, n + 1)[:, None] / n
    deepest = depth(q_from + shares * (q_to - q_from), lower, upper).max()
    if abs(deepest) < DEEP:
        return
    is_free = check(map_validity.is_edge_free_sampled, q_from, q_to, resolution, lower, upper)
    assert is_free == (deepest < 0.0)


@pytest.mark.parametrize('dof', DOFS)
@settings(max_examples=200)
@given(SEEDS)
def test_the_free_radius_is_the_distance_from_the_nearest_box(dof, seed):
    rng = np.random.default_rng(seed)
    lower, upper, q, _ = random_map(rng, dof)
    rows = np.hstack([lower, upper])
    radius = map_validity.free_radius(q, generated_fk.NO_CHAIN, np.zeros((1, 1)), rows)
    nearest = np.linalg.norm(q - np.clip(q, lower, upper), axis=1).min()
    assert radius == pytest.approx(nearest, abs=1e-12)
