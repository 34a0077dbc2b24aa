# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Bars against boxes: the kernels, clipping, golden section and python-fcl say the same."""

from itertools import product

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.box_tree import pack_boxes
from rrth_planner.collision.reference_checker import bar_box_contact
from rrth_planner.kernels.collision.bar_box import bar_box_distance, contact_lanes, open_lanes
from rrth_planner.kernels.layout import BOX_ALLOWED, BOX_HALF, BOX_OFFSET, BOX_ROWS, LANES
from worlds import examples, random_rotation

SEEDS = st.integers(0, 2**32 - 1)


def packed(center, rotation, half):
    """Return one box as a group of the kernels."""
    rows = np.zeros((BOX_ROWS, 1))
    rows[:BOX_OFFSET, 0] = rotation.T.ravel()
    rows[BOX_OFFSET:BOX_HALF, 0] = -rotation.T @ center
    rows[BOX_HALF:BOX_ALLOWED, 0] = half
    return pack_boxes(rows)[0]


def touches(a, b, radius, boxes):
    """Return whether the bar a-b touches any box of the only group."""
    return contact_lanes(np.array([*a, 0.0, *b, radius]), 0, boxes, 0) != 0


def is_open(points, bow_start, bow_end, radius, boxes):
    """Return whether the hull of a bar, points (2, 6), is not proven apart from the only box."""
    rows = np.zeros((4, 4))
    rows[:, :3] = points.reshape(4, 3)
    rows[1::2, 3] = radius
    return open_lanes(rows.ravel(), 0, 8, bow_start, bow_end, boxes, 0) != 0


def kernel_distance(a, b, center, rotation, half):
    """Return the signed distance of the bar a-b from a box."""
    start, end = rotation.T @ (a - center), rotation.T @ (b - center)
    return bar_box_distance(start, end - start, np.array(half))


def golden_distance(a, b, center, rotation, half):
    """Return the distance of bars (n, 3) from boxes by golden section, and the nearest points."""
    start = np.einsum('nji,nj->ni', rotation, a - center)
    step = np.einsum('nji,nj->ni', rotation, b - a)

    def distance(t):
        return np.linalg.norm(np.maximum(np.abs(start + t[:, None] * step) - half, 0.0), axis=1)

    low, high = np.zeros(len(a)), np.ones(len(a))
    golden = 0.5 * (np.sqrt(5.0) - 1.0)
    for _ in range(60):
        left, right = high - golden * (high - low), low + golden * (high - low)
        is_left = distance(left) <= distance(right)
        low, high = np.where(is_left, low, left), np.where(is_left, right, high)
    t = 0.5 * (low + high)
    local = start + t[:, None] * step
    gap = local - np.clip(local, -half, half)
    return distance(t), np.einsum('nij,nj->ni', rotation, gap)


@pytest.fixture(scope='module')
def cases():
    """Ten thousand bars and boxes, a third of them moved until they all but graze."""
    rng = np.random.default_rng(3)
    n = 10000
    a, b = rng.uniform(-1, 1, (n, 3)), rng.uniform(-1, 1, (n, 3))
    b[::7] = a[::7]
    center = rng.uniform(-0.6, 0.6, (n, 3))
    rotation = np.array([random_rotation(rng) for _ in range(n)])
    half = rng.uniform(0.02, 0.5, (n, 3))
    for k, i in enumerate(range(1, n, 9)):
        b[i] = a[i] + rotation[i][:, k % 3] * rng.uniform(0.1, 1.0)
    distance, gap = golden_distance(a, b, center, rotation, half)
    is_moved = (distance > 1e-3) & (np.arange(n) % 3 == 0)
    goal = rng.choice([-1e-5, -1e-7, 1e-7, 1e-5], n)
    move = np.where(is_moved, 1.0 - goal / np.maximum(distance, 1e-3), 0.0)[:, None] * gap
    a, b = a - move, b - move
    return a, b, center, rotation, half


def test_contact_is_that_of_clipping(cases):
    distance, _ = golden_distance(*cases)
    n_grazing = n_touching = 0
    for k, (a, b, center, rotation, half) in enumerate(zip(*cases, strict=True)):
        signed = kernel_distance(a, b, center, rotation, half)
        if abs(signed) < 1e-9:
            continue
        got = touches(a, b, 0.0, packed(center, rotation, half))
        assert got == bar_box_contact(np.stack([a, b]), center, rotation, half), k
        assert got == (signed < 0.0), k
        n_touching += got
        n_grazing += abs(signed) < 2e-5
    assert n_touching > 2000
    assert n_grazing > 500


def test_a_radius_grows_the_box(cases):
    for a, b, center, rotation, half in list(zip(*cases, strict=True))[:2000]:
        boxes, fat = packed(center, rotation, half), packed(center, rotation, half + 0.07)
        assert touches(a, b, 0.07, boxes) == touches(a, b, 0.0, fat)


def test_each_lane_is_checked_as_if_it_were_alone(cases):
    n = LANES - 1
    a, b, center, rotation, half = (part[:60] for part in cases)
    groups = [packed(c, r, h) for c, r, h in zip(center, rotation, half, strict=True)]
    for p, q in zip(a, b, strict=True):
        for first in range(0, 60 - n, n):
            together = np.full((BOX_ROWS, LANES), -np.inf)
            for lane, group in enumerate(groups[first : first + n]):
                together[:, lane] = group.reshape(BOX_ROWS, LANES)[:, 0]
            alone = [touches(p, q, 0.0, group) for group in groups[first : first + n]]
            together[:BOX_HALF, n:] = together[BOX_ALLOWED:] = 0.0
            points = np.array([*p, 0.0, *q, 0.0])
            bits = contact_lanes(points, 0, together.reshape(1, -1), 0)
            assert [bool(bits >> lane & 1) for lane in range(LANES)] == [*alone, False]


def test_a_bar_is_as_far_from_a_box_from_either_of_its_ends():
    rng = np.random.default_rng(6)
    for _ in range(5000):
        a, b = rng.uniform(-1, 1, (2, 3))
        box = (np.zeros(3), np.eye(3), rng.uniform(0.02, 0.8, 3))
        assert kernel_distance(a, b, *box) == pytest.approx(kernel_distance(b, a, *box), abs=1e-12)


def test_a_bar_right_through_a_box_has_no_positive_distance():
    # The zero of the slope is at the far face, where rounding leaves 3e-17 m.
    start, step = np.array([-0.5, -0.2, -0.5]), np.array([1.4, 0.9, 0.0])
    assert bar_box_distance(start, step, np.array([0.2, 0.6, 0.7])) < -0.1


def test_distance_is_that_of_golden_section(cases):
    expected, _ = golden_distance(*cases)
    got = np.array([kernel_distance(*case) for case in zip(*cases, strict=True)])
    assert np.abs(np.maximum(got, 0.0) - expected).max() < 1e-9
    assert (got[expected > 1e-9] > 0.0).all()


def test_contact_and_distance_are_those_of_fcl(cases):
    fcl = pytest.importorskip('fcl')
    thin = 1e-6
    errors = []
    for a, b, center, rotation, half in zip(*cases, strict=True):
        signed = kernel_distance(a, b, center, rotation, half)
        axis = b - a
        length = np.linalg.norm(axis)
        z = axis / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
        x /= np.linalg.norm(x)
        bar = fcl.CollisionObject(
            fcl.Capsule(thin, length),
            fcl.Transform(np.stack([x, np.cross(z, x), z], axis=1), 0.5 * (a + b)),
        )
        box = fcl.CollisionObject(fcl.Box(*(2 * half)), fcl.Transform(rotation, center))
        if abs(signed) > 8e-6:
            assert (fcl.collide(bar, box) > 0) == (signed < 0.0)
        if signed > 8e-6:
            errors.append(fcl.distance(bar, box) + thin - signed)
    # Golden section agrees in every case; fcl stops early in a few, and then says too much.
    assert min(errors) > -5e-6
    assert np.mean(np.array(errors) < 5e-6) > 0.999


def test_inside_the_distance_is_the_depth_of_penetration(cases):
    rng = np.random.default_rng(4)
    n_inside = 0
    for a, b, center, rotation, half in list(zip(*cases, strict=True))[:3000]:
        depth = -kernel_distance(a, b, center, rotation, half)
        if depth < 1e-4:
            continue
        n_inside += 1
        local = (b - a) @ rotation
        axes = [*np.eye(3), *(np.cross(local, axis) for axis in np.eye(3))]
        axes = np.array([axis / np.linalg.norm(axis) for axis in axes if axis.any()])
        axes = np.concatenate([axes, -axes]) @ rotation.T
        ends = np.stack([a, b])
        out = ends + (depth + 1e-9) * axes[:, None]
        assert not bar_box_contact(out, center, rotation, half).all()
        others = rng.standard_normal((60, 3))
        others /= np.linalg.norm(others, axis=1)[:, None]
        less = ends + (depth - 1e-9) * np.concatenate([axes, others])[:, None]
        assert bar_box_contact(less, center, rotation, half).all()
    assert n_inside > 250


@examples(300)
@given(seed=SEEDS, size=st.floats(1e-9, 2.0))
def test_distance_is_lipschitz_in_translation(seed, size):
    rng = np.random.default_rng(seed)
    a, b, center = rng.uniform(-1, 1, (3, 3))
    rotation, half = random_rotation(rng), rng.uniform(0.02, 0.8, 3)
    move = rng.standard_normal(3)
    move *= size / np.linalg.norm(move)
    before = kernel_distance(a, b, center, rotation, half)
    after = kernel_distance(a + move, b + move, center, rotation, half)
    assert abs(after - before) <= size + 1e-12


@examples(300)
@given(seed=SEEDS)
def test_a_rigid_motion_of_bar_and_box_changes_nothing(seed):
    rng = np.random.default_rng(seed)
    a, b, center, shift = rng.uniform(-1, 1, (4, 3))
    rotation, half, R = random_rotation(rng), rng.uniform(0.02, 0.8, 3), random_rotation(rng)
    before = kernel_distance(a, b, center, rotation, half)
    moved = (R @ a + shift, R @ b + shift, R @ center + shift, R @ rotation, half)
    assert kernel_distance(*moved) == pytest.approx(before, abs=1e-12)
    if abs(before) > 1e-9:
        got = touches(moved[0], moved[1], 0.0, packed(*moved[2:]))
        assert got == (before < 0.0)


@pytest.mark.parametrize(
    ('a', 'b', 'expected'),
    [
        ((2, 0, 0), (2, 0, 0), 1.0),
        ((0, 0, 0), (0, 0, 0), -1.0),
        ((2, -3, 0), (2, 3, 0), 1.0),
        ((2, -3, 4), (2, 3, 4), np.hypot(1.0, 1.0)),
        ((-5, 0, 0), (5, 0, 0), -2.0),
        ((0, 0, -9), (0, 0, 9), -1.0),
        ((0, 0, 2), (0, 0, 9), -1.0),
        ((0, 0, 5), (0, 0, 9), 2.0),
        ((0.9, -9, 0), (0.9, 9, 0), -0.1),
        # Past the upright edge at (1, 2).
        ((0, 4, 0), (4, 0, 0), np.sqrt(0.5)),
        ((2, 3, 4), (3, 4, 5), np.sqrt(3.0)),
    ],
)
def test_distance_of_bars_along_faces_and_edges_is_known(a, b, expected):
    a, b = np.array(a, float), np.array(b, float)
    half = np.array([1.0, 2.0, 3.0])
    got = kernel_distance(a, b, np.zeros(3), np.eye(3), half)
    assert got == pytest.approx(expected, abs=1e-12)
    assert touches(a, b, 0.0, packed(np.zeros(3), np.eye(3), half)) == (expected < 0)


@pytest.mark.parametrize(
    ('axis', 'along', 'is_long'),
    [case for case in product(range(3), range(3), (False, True)) if case[0] != case[1]],
)
def test_a_bar_in_the_plane_of_a_face_touches_and_a_hair_outside_does_not(axis, along, is_long):
    half = np.array([0.5, 0.25, 1.0])
    boxes = packed(np.zeros(3), np.eye(3), half)
    a, b = np.zeros(3), np.zeros(3)
    a[axis] = b[axis] = half[axis]
    a[along], b[along] = (-4.0, 4.0) if is_long else (0.0, 0.125)
    assert touches(a, b, 0.0, boxes)
    assert kernel_distance(a, b, np.zeros(3), np.eye(3), half) == 0.0
    a[axis] = b[axis] = half[axis] + 1e-12
    assert not touches(a, b, 0.0, boxes)
    # In the plane of the face, beside it.
    a[axis] = b[axis] = half[axis]
    a[along], b[along] = half[along] + 0.125, half[along] + 1.0
    assert not touches(a, b, 0.0, boxes)
    got = kernel_distance(a, b, np.zeros(3), np.eye(3), half)
    assert got == pytest.approx(0.125, abs=1e-15)


def test_a_number_that_is_none_counts_as_contact():
    boxes = packed(np.full(3, 9.0), np.eye(3), np.ones(3))
    for k in range(6):
        ends = np.zeros(6)
        ends[k] = np.nan
        assert touches(ends[:3], ends[3:], 0.0, boxes)
    # Of the rotation one axis may still prove that the bar is apart.
    for row in range(BOX_OFFSET, BOX_ALLOWED):
        close = packed(np.zeros(3), np.eye(3), np.ones(3))
        close[0, LANES * row] = np.nan
        assert touches(np.zeros(3), [0.5, 0.1, 0.1], 0.0, close)


@examples(400)
@given(seed=SEEDS)
def test_a_hull_that_is_apart_contains_no_bar_that_collides(seed):
    rng = np.random.default_rng(seed)
    center, rotation = rng.uniform(-0.5, 0.5, 3), random_rotation(rng)
    half = rng.uniform(0.05, 0.4, 3)
    boxes = packed(center, rotation, half)
    radius = 0.03 * (seed % 2)
    for _ in range(10):
        points = rng.uniform(-1, 1, (2, 6))
        points[1] = points[0] + rng.choice([0.01, 0.1, 1.0]) * rng.uniform(-1, 1, 6)
        bows = rng.choice([0.0, 0.01, 0.1], 2)
        if is_open(points, *bows, radius, boxes):
            continue
        share = rng.random((40, 1, 1))
        share[:3] = [[[0.0]], [[1.0]], [[0.5]]]
        ends = ((1 - share) * points[0] + share * points[1]).reshape(-1, 2, 3)
        stray = rng.standard_normal((40, 2, 3))
        stray /= np.linalg.norm(stray, axis=2)[..., None]
        ends += stray * bows[:, None]
        assert not bar_box_contact(ends, center, rotation, half + radius).any()


def test_a_hull_well_away_is_seen_to_be_apart():
    boxes = packed(np.zeros(3), np.eye(3), np.full(3, 0.5))
    points = np.array([[1.0, -2.0, 0.0, 1.0, 2.0, 0.0], [1.2, -2.0, 0.1, 1.1, 2.0, 0.2]])
    assert not is_open(points, 0.1, 0.1, 0.1, boxes)
    assert is_open(points, 0.6, 0.1, 0.0, boxes)
    assert is_open(points, 0.1, 0.6, 0.0, boxes)
    assert is_open(points, 0.1, 0.1, 0.6, boxes)
