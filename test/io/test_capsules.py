# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Capsules enclose every point of a surface, and are few and slim."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.io.urdf.capsules import (
    cost_of,
    enclosed_in,
    enclosing_capsules,
    Enclosure,
    Fit,
    half_of,
    uncovered,
)
from rrth_planner.io.urdf.geometry import box_triangles, cylinder_triangles
from worlds import examples, random_rotation

SEEDS = st.integers(0, 2**32 - 1)


def placed(triangles, rng):
    """Return triangles somewhere else."""
    return triangles @ random_rotation(rng).T + rng.uniform(-0.5, 0.5, 3)


def points_on(triangles, rng, n):
    """Return random points on random triangles, corners and edges among them."""
    shares = rng.dirichlet([0.3, 0.3, 0.3], n)
    return (shares[:, :, None] * triangles[rng.integers(len(triangles), size=n)]).sum(axis=1)


def random_surface(rng):
    """Return triangles: a few bodies anywhere, long and thin or flat, or a heap of triangles."""
    if rng.random() < 0.3:
        return rng.uniform(-0.3, 0.3, (int(rng.integers(1, 40)), 3, 3)) * rng.uniform(0.0, 1.0, 3)
    bodies = []
    for _ in range(rng.integers(1, 4)):
        size = 10.0 ** rng.uniform(-2.5, -0.3, 3)
        body = box_triangles(size) if rng.random() < 0.5 else cylinder_triangles(*size[:2])
        bodies.append(placed(body, rng))
    return np.concatenate(bodies)


def l_shape():
    """Return a bent tube: two bars of 0.05 m, 0.4 and 0.3 m long, at a right angle."""
    long = box_triangles(np.array([0.4, 0.05, 0.05]))
    return np.concatenate(
        [long, box_triangles(np.array([0.05, 0.3, 0.05])) + np.array([0.175, 0.175, 0.0])]
    )


@examples(12)
@given(SEEDS, st.integers(1, 4))
def test_every_point_of_a_surface_is_in_a_capsule(seed, most):
    rng = np.random.default_rng(seed)
    triangles = random_surface(rng)
    found = enclosing_capsules(triangles, Fit(0.01, most))
    assert 1 <= len(found) <= most
    assert len(uncovered(triangles, found)) == 0
    points = points_on(triangles, rng, 2000)
    assert np.any([enclosed_in(points, one) for one in found], axis=0).all()


def slabs_of(triangles, rng, n):
    """Return about n slabs of a surface, cut anywhere along one axis."""
    axis, left, slabs = random_rotation(rng)[0], triangles, []
    heights = np.sort(rng.choice((triangles @ axis).ravel(), n - 1))
    for height in heights:
        slabs.append(half_of(left, axis, height))
        left = half_of(left, -axis, -height)
    return [slab for slab in (*slabs, left) if len(slab)]


@examples(24)
@given(SEEDS)
def test_what_sticks_out_is_told(seed):
    rng = np.random.default_rng(seed)
    triangles = random_surface(rng)
    # How good the cuts are does not matter here, and looking for good ones takes long.
    slabs = slabs_of(triangles, rng, int(rng.integers(1, 5)))
    found = [enclosing_capsules(slab, Fit(0.01, 1))[0] for slab in slabs]
    thinner = [Enclosure(one.ends, 0.9 * one.radius, 0.0) for one in found]
    points = points_on(triangles, rng, 2000)
    is_in = np.any([enclosed_in(points, one) for one in thinner], axis=0)
    if not is_in.all():
        assert len(uncovered(triangles, thinner))
    assert len(uncovered(triangles, [])) == triangles.size // 3


def test_a_gap_between_capsules_is_found_where_all_corners_are_inside():
    triangle = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.01, 0.0]]])
    ends = [Enclosure(np.full((2, 3), x) * [1.0, 0.0, 0.0], 0.45, 0.0) for x in (0.0, 1.0)]
    assert len(uncovered(triangle, ends))
    assert not len(uncovered(triangle, [Enclosure(one.ends, 0.51, 0.0) for one in ends]))


@examples(8)
@given(SEEDS)
def test_a_thin_rod_stays_thin(seed):
    rng = np.random.default_rng(seed)
    radius, length = rng.uniform(0.005, 0.04), rng.uniform(0.2, 0.8)
    rod = placed(cylinder_triangles(radius, length), rng)
    (one,) = enclosing_capsules(rod, Fit(0.0, 1))
    assert radius < one.radius < 1.12 * radius + 1e-3
    exact = np.pi * radius**2 * (length + 4.0 / 3.0 * radius)
    assert cost_of(one) < 1.05 * exact
    assert one.slack < 1.2 * radius
    # Cutting it makes it no slimmer.
    assert len(enclosing_capsules(rod, Fit(0.0, 4))) == 1


@examples(8)
@given(SEEDS)
def test_a_bent_tube_gets_two(seed):
    rng = np.random.default_rng(seed)
    found = enclosing_capsules(placed(l_shape(), rng), Fit(0.02, 4))
    assert len(found) == 2
    assert max(one.radius for one in found) < 0.06
    assert len(enclosing_capsules(l_shape(), Fit(0.02, 1))) == 1


def test_an_arm_offset_at_both_ends_is_not_as_thick_as_it_is_wide():
    tube = box_triangles(np.array([0.06, 0.06, 0.5]))
    ends = [cylinder_triangles(0.05, 0.16)[:, :, [2, 0, 1]] + [0.06, 0.0, z] for z in (-0.2, 0.2)]
    found = enclosing_capsules(np.concatenate([tube, *ends]), Fit(0.02, 4))
    assert 3 <= len(found) <= 4
    assert min(one.radius for one in found) < 0.045
    assert max(one.radius for one in found) < 0.07


def test_a_sphere_of_points_is_a_capsule_without_length():
    directions = np.random.default_rng(0).standard_normal((3000, 3))
    points = 0.1 * directions / np.linalg.norm(directions, axis=1)[:, None]
    (one,) = enclosing_capsules(points.reshape(-1, 3, 3), Fit(0.02, 4))
    assert one.radius < 0.102
    assert np.linalg.norm(one.ends[1] - one.ends[0]) < 0.01
    assert one.slack < 0.01


@pytest.mark.parametrize('points', [np.zeros((1, 3, 3)), np.ones((2, 3, 3)) * [[[1], [2], [3]]]])
def test_a_point_and_a_line_are_capsules_of_no_thickness(points):
    (one,) = enclosing_capsules(points, Fit(0.02, 4))
    assert one.radius <= 2e-6
    assert not len(uncovered(points, [one]))


@examples(60)
@given(SEEDS)
def test_a_cut_keeps_all_that_is_below_and_nothing_above(seed):
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-1.0, 1.0, (10, 3, 3))
    axis, height = random_rotation(rng)[0], rng.uniform(-0.5, 0.5)
    halves = [half_of(triangles, axis, height), half_of(triangles, -axis, -height)]
    assert (halves[0] @ axis <= height + 1e-12).all()
    assert (halves[1] @ axis >= height - 1e-12).all()
    areas = [
        np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum()
        for t in (triangles, *halves)
    ]
    assert areas[0] == pytest.approx(areas[1] + areas[2], rel=1e-12)
