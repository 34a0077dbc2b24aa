# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Draws: evenly in bounds and ellipsoids, at every scale round an end."""

import numpy as np
import pytest
from rrth_planner.kernels.search.random import random_state
from rrth_planner.kernels.search.sampling import (
    draw_ball,
    draw_informed,
    draw_near,
    draw_uniform,
    NEAREST,
)


def state(seed):
    """Return random bits for the kernels."""
    return random_state(np.random.default_rng(seed))


def test_uniform_draws_fill_the_bounds_evenly():
    rng = state(49)
    bounds = np.array([[-1.0, 2.0, -3.0], [1.0, 2.5, 0.0]])
    q = np.empty((8000, 3))
    for row in q:
        draw_uniform(bounds, rng, row)
    share = (q - bounds[0]) / (bounds[1] - bounds[0])
    assert ((share >= 0.0) & (share <= 1.0)).all()
    for k in range(3):
        assert kolmogorov(share[:, k]) < 1.95 / np.sqrt(len(q))


def kolmogorov(values):
    """Return the greatest gap between a sample and the uniform distribution."""
    x, n = np.sort(values), len(values)
    steps = np.arange(1, n + 1) / n
    return max((steps - x).max(), (x - steps + 1.0 / n).max())


@pytest.mark.parametrize('dof', [2, 3, 4, 6])
def test_informed_draws_fill_the_ellipsoid_evenly(dof):
    rng, bits = np.random.default_rng(50 + dof), state(50 + dof)
    q_start, q_goal = rng.uniform(-1, 1, (2, dof))
    focal = np.linalg.norm(q_goal - q_start)
    best = 1.3 * focal
    bounds = np.stack([np.full(dof, -20.0), np.full(dof, 20.0)])
    q = np.empty((8000, dof))
    for row in q:
        assert draw_informed(bounds, q_start, q_goal, best, bits, row)
    detour = np.linalg.norm(q - q_start, axis=1) + np.linalg.norm(q - q_goal, axis=1)
    assert (detour <= best * (1 + 1e-12)).all()
    # Back to the unit ball: along the line of the foci, and square to it.
    e = (q_goal - q_start) / focal
    local = q - 0.5 * (q_start + q_goal)
    along = local @ e
    square = local - along[:, None] * e
    minor = 0.5 * np.sqrt(best**2 - focal**2)
    unit = np.concatenate([(along / (0.5 * best))[:, None], square / minor], axis=1)
    radius = np.linalg.norm(unit, axis=1)
    assert kolmogorov(radius**dof) < 1.95 / np.sqrt(len(q))
    directions = unit / radius[:, None]
    assert np.abs(directions.mean(axis=0)).max() < 0.05
    # No direction is preferred: the second moments are those of a sphere.
    assert abs((directions[:, 0] ** 2).mean() - 1.0 / dof) < 0.02


def test_informed_draws_stay_within_the_bounds_and_say_when_nothing_can_be_better():
    rng = state(57)
    bounds = np.array([[-0.2, -0.2], [1.2, 0.05]])
    q_start, q_goal, q = np.zeros(2), np.array([1.0, 0.0]), np.empty(2)
    n_drawn = 0
    for _ in range(2000):
        # In a narrow strip all its tries may fail.
        if draw_informed(bounds, q_start, q_goal, 1.5, rng, q):
            n_drawn += 1
            assert (q >= bounds[0]).all()
            assert (q <= bounds[1]).all()
            assert np.linalg.norm(q - q_start) + np.linalg.norm(q - q_goal) <= 1.5 + 1e-12
    assert n_drawn > 1900
    assert not draw_informed(bounds, q_start, q_goal, 1.0, rng, q)
    assert not draw_informed(bounds, q_start, q_goal, 0.5, rng, q)
    assert not draw_informed(bounds, q_start, q_start, 0.5, rng, q)
    outside = np.array([[5.0, 5.0], [6.0, 6.0]])
    assert not draw_informed(outside, q_start, q_goal, 1.5, rng, q)


def test_draws_from_a_ball_fill_it_evenly_and_end_at_the_bounds():
    rng, centre = state(60), np.array([0.3, -0.2, 0.5])
    wide = np.array([[-9.0] * 3, [9.0] * 3])
    q = np.empty((8000, 3))
    for row in q:
        draw_ball(centre, 0.7, wide, rng, row)
    offsets = q - centre
    radius = np.linalg.norm(offsets, axis=1) / 0.7
    assert radius.max() <= 1.0 + 1e-12
    assert kolmogorov(radius**3) < 1.95 / np.sqrt(len(q))
    assert np.abs((offsets / radius[:, None]).mean(axis=0)).max() < 0.05
    tight = np.stack([centre - 0.1, centre + 0.2])
    for row in q[:1000]:
        draw_ball(centre, 0.7, tight, rng, row)
        assert ((row >= tight[0]) & (row <= tight[1])).all()


@pytest.mark.parametrize('dof', [2, 4, 6])
def test_draws_near_an_end_are_at_every_scale_in_every_direction(dof):
    rng, bits = np.random.default_rng(61 + dof), state(61 + dof)
    q_end, q_far = rng.uniform(-1, 1, (2, dof))
    bounds = np.stack([np.full(dof, -20.0), np.full(dof, 20.0)])
    q = np.empty((8000, dof))
    for row in q:
        assert draw_near(q_end, q_far, np.inf, bounds, bits, row)
    offsets = q - q_end
    radius = np.linalg.norm(offsets, axis=1)
    # The logarithm of the distance is even, from a tenth of the way on.
    share = np.log(radius / np.linalg.norm(q_far - q_end)) / np.log(NEAREST)
    assert ((share >= -1e-12) & (share <= 1.0 + 1e-12)).all()
    assert kolmogorov(share) < 1.95 / np.sqrt(len(q))
    directions = offsets / radius[:, None]
    assert np.abs(directions.mean(axis=0)).max() < 0.05
    assert np.abs((directions**2).mean(axis=0) - 1.0 / dof).max() < 0.02


def test_draws_near_an_end_are_within_bounds_and_where_a_shorter_path_can_lead():
    bits = state(68)
    q_end, q_far, q = np.zeros(3), np.array([1.0, 0.0, 0.0]), np.empty(3)
    bounds = np.array([[-0.1, -0.5, -0.2], [1.0, 0.5, 0.02]])
    n_drawn = 0
    for _ in range(2000):
        if draw_near(q_end, q_far, 1.3, bounds, bits, q):
            n_drawn += 1
            assert ((q >= bounds[0]) & (q <= bounds[1])).all()
            assert np.linalg.norm(q - q_end) + np.linalg.norm(q - q_far) < 1.3
    assert n_drawn > 1000
    # Nothing is nearer than a straight line, and nothing is outside.
    assert not any(draw_near(q_end, q_far, 1.0, bounds, bits, q) for _ in range(50))
    outside = np.array([[5.0] * 3, [6.0] * 3])
    assert not any(draw_near(q_end, q_far, np.inf, outside, bits, q) for _ in range(50))
