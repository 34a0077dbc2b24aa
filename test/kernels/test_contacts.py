# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Contacts of an edge with boxes: gaps, their gradients, and none that is overlooked."""

import numpy as np
import pytest
from rrth_planner.collision.box_tree import pack_boxes
from rrth_planner.collision.world import arm_world
from rrth_planner.kernels.collision.bar_box import bar_box_distance
from rrth_planner.kernels.collision.edge_contacts import (
    bar_gaps,
    CLOSE,
    edge_contacts,
    GAP,
    GRADIENT,
    MULTIPLIER,
    SHARE,
    SPACING,
)
from rrth_planner.kernels.layout import BOX_ALLOWED, BOX_HALF, BOX_OFFSET, BOX_ROWS, LANES
from rrth_planner.model.scene import Scene
from worlds import (
    compiled_chain,
    free_configuration,
    kernel_bars,
    MARGIN,
    random_boxes,
    random_rotation,
    RAY,
    table_1_arm,
    wearer,
)


def kernel_gap(a, b, radius, center, rotation, half):
    """Return the gap between the bar a-b and a box."""
    rows = np.zeros((BOX_ROWS, 1))
    rows[:BOX_OFFSET, 0] = rotation.T.ravel()
    rows[BOX_OFFSET:BOX_HALF, 0] = -rotation.T @ center
    rows[BOX_HALF:BOX_ALLOWED, 0] = half
    gaps = np.empty(LANES)
    bar_gaps(np.array([*a, 0.0, *b, radius]), 0, pack_boxes(rows)[0], 0, gaps)
    # Lanes that hold no box are never close.
    assert not (gaps[1:] < CLOSE).any()
    return gaps[0]


def distance(a, b, center, rotation, half):
    """Return the signed distance of the bar a-b from a box."""
    start, end = rotation.T @ (a - center), rotation.T @ (b - center)
    return bar_box_distance(start, end - start, half)


def numpy_gaps(ends, radii, boxes):
    """Return the greatest gap over the separating axes of bars (n, 2, 3) and boxes, (n, m)."""
    center, rotation, half = (np.array(part) for part in zip(*boxes, strict=True))
    # Ends in the axes of each box, (n, m, 2, 3), and the axes to look along, (n, m, 6, 3).
    local = np.einsum('mji,nemj->nmei', rotation, np.asarray(ends)[:, :, None] - center)
    axes = np.empty((*local.shape[:2], 6, 3))
    axes[:, :, :3] = np.eye(3)
    axes[:, :, 3:] = np.cross(local[:, :, 1] - local[:, :, 0], np.eye(3)[:, None, None]).transpose(
        1, 2, 0, 3
    )
    at = np.einsum('nmei,nmai->nmae', local, axes)
    grown = half + np.asarray(radii)[:, None, None]
    reach = np.einsum('nmi,nmai->nma', grown, np.abs(axes))
    norm = np.linalg.norm(axes, axis=3)
    apart = np.maximum(at.min(axis=3), -at.max(axis=3)) - reach
    return np.where(norm > 1e-9, apart / np.maximum(norm, 1e-9), -np.inf).max(axis=2)


def random_box(rng):
    return rng.uniform(-0.5, 0.5, 3), random_rotation(rng), rng.uniform(0.02, 0.5, 3)


def test_gaps_are_never_more_than_the_distance_and_the_depth_in_contact():
    rng = np.random.default_rng(71)
    n_touching = n_less = 0
    for _ in range(4000):
        a, b = rng.uniform(-1, 1, (2, 3))
        center, rotation, half = random_box(rng)
        radius = rng.choice([0.0, 0.05])
        gap = kernel_gap(a, b, radius, center, rotation, half)
        signed = distance(a, b, center, rotation, half + radius)
        assert gap <= signed + 1e-9
        assert gap == pytest.approx(
            numpy_gaps([(a, b)], [radius], [(center, rotation, half)])[0, 0], abs=1e-9
        )
        if signed < 0.0:
            n_touching += 1
            assert gap == pytest.approx(signed, abs=1e-9)
        n_less += gap < signed - 1e-6
    assert n_touching > 400
    # Where a corner of the box, or an end of the bar beside an edge, is nearest.
    assert n_less > 400


def test_gaps_are_the_distance_where_a_face_or_an_edge_is_nearest():
    rng = np.random.default_rng(72)
    for _ in range(1500):
        center, rotation, half = random_box(rng)
        d, side = rng.uniform(1e-4, 0.5), np.array(rng.choice([-1.0, 1.0], 3))
        k = int(rng.integers(3))
        # Above a face, one end nearer than the other.
        p = rng.uniform(-1.0, 1.0, 3) * half
        p[k] = half[k] + d
        q = p + rng.uniform(-1.0, 1.0, 3)
        q[k] = p[k] + rng.uniform(0.0, 1.0)
        # Across an edge: the bar lies in a plane that touches the box nowhere else.
        share = rng.uniform(0.1, 0.9) * 0.5 * np.pi
        normal = np.zeros(3)
        normal[[k, (k + 1) % 3]] = np.cos(share), np.sin(share)
        on_edge = half.copy()
        on_edge[(k + 2) % 3] *= rng.uniform(-1.0, 1.0)
        along = np.zeros(3)
        along[(k + 2) % 3] = 1.0
        u = np.cross(normal, along) + rng.uniform(-2.0, 2.0) * along
        middle = on_edge + d * normal
        cases = [(p, q), (middle - rng.uniform(0.1, 1.0) * u, middle + rng.uniform(0.1, 1.0) * u)]
        for first, last in cases:
            a, b = (center + rotation @ (side * end) for end in (first, last))
            assert distance(a, b, center, rotation, half) == pytest.approx(d, abs=1e-9)
            assert kernel_gap(a, b, 0.0, center, rotation, half) == pytest.approx(d, abs=1e-9)


def cases():
    """Return arms with few and many boxes round them."""
    rng = np.random.default_rng(73)
    made = [(table_1_arm(), wearer()), (table_1_arm(0.02), random_boxes(rng, 30, 1.2, 0.25))]
    while len(made) < 8:
        arm = compiled_chain(rng, len(made) % 2 == 0)
        made.append((arm, random_boxes(rng, 9 + 3 * len(made), spread=1.0)))
    return made


def gaps_at(arm, scene, world, q):
    """Return the gaps of all bars and boxes by numpy, (n_bars, m)."""
    points = np.empty(world.stride)
    world.chain(q, RAY, points, 0)
    boxes = [(box.center, box.rotation, 0.5 * box.size + MARGIN) for box in scene.boxes]
    return numpy_gaps(
        kernel_bars(arm, world, q, RAY), points[7 : 8 * len(world.bar_names) : 8], boxes
    )


@pytest.mark.parametrize('case', range(8))
def test_the_close_pairs_of_an_edge_are_found_with_their_slopes(case):
    arm, scene = cases()[case]
    world, rng = arm_world(arm, scene, MARGIN, RAY), np.random.default_rng(74 + case)
    contacts, n_contacts, n_kinks = np.empty((400, GRADIENT + arm.dof)), 0, 0
    for _ in range(60):
        q_from = free_configuration(rng, world)
        step = rng.standard_normal(arm.dof)
        step *= rng.choice([0.1, 0.6, 1.5]) / np.linalg.norm(step)
        q_to = np.clip(q_from + step, *arm.bounds)
        seam = (world.chain, world.robot, world.obstacles, contacts)
        contacts[:] = np.nan
        n = edge_contacts(q_from, q_to, *seam)
        assert n < len(contacts)
        found = contacts[:n].copy()
        assert ((found[:, SHARE] >= 0.0) & (found[:, SHARE] <= 1.0)).all()
        assert (found[:, GAP] < CLOSE + 1e-3).all()
        # Whoever reads it before the constraint was applied reads no force.
        assert (found[:, MULTIPLIER] == 0.0).all()
        matched = []
        for row in found:
            q = q_from + row[SHARE] * (q_to - q_from)
            gaps = gaps_at(arm, scene, world, q)
            pairs = np.argwhere(np.abs(gaps - row[GAP]) < 1e-8)
            assert len(pairs) > 0
            slopes = np.empty((arm.dof, *gaps.shape))
            for k in range(arm.dof):
                h = 1e-6 * np.eye(arm.dof)[k]
                ahead, behind = (
                    gaps_at(arm, scene, world, q + h),
                    gaps_at(arm, scene, world, q - h),
                )
                slopes[k] = (ahead - behind) / 2e-6
            errors = [np.abs(slopes[:, i, j] - row[GRADIENT:]).max() for i, j in pairs]
            # Two separating axes may be as good as each other there.
            n_kinks += min(errors) > 1e-4
            matched.append((row[SHARE], row[GAP], {tuple(pair) for pair in pairs}))
        n_contacts += n
        # Whatever is close at one of the looks, and no closer at its neighbours, is found. At the
        # ends of the edge the golden section stops half a hundredth of the spacing short.
        n_looks = int(np.linalg.norm(q_to - q_from) / SPACING) + 2
        shares = np.linspace(0.0, 1.0, n_looks)
        looks = np.array(
            [gaps_at(arm, scene, world, q_from + s * (q_to - q_from)) for s in shares]
        )
        around = np.pad(looks, ((1, 1), (0, 0), (0, 0)), constant_values=np.inf)
        is_least = (looks < around[:-2]) & (looks < around[2:]) & (looks < CLOSE - 1e-9)
        for look, i, j in np.argwhere(is_least):
            assert any(
                abs(share - shares[look]) <= shares[1] + 1e-9
                and gap <= looks[look, i, j] + 5e-4
                and (i, j) in pairs
                for share, gap, pairs in matched
            )
    assert n_contacts > 20
    assert n_kinks <= 0.05 * n_contacts


def test_an_edge_far_from_every_box_has_no_contacts():
    arm = table_1_arm()
    far = Scene(tuple(random_boxes(np.random.default_rng(75), 20).boxes))
    world = arm_world(arm, Scene(()), MARGIN, RAY)
    contacts = np.empty((10, GRADIENT + 4))
    q = np.array([0.1, -0.5, 0.2, 0.3])
    assert edge_contacts(q, q + 0.5, world.chain, world.robot, world.obstacles, contacts) == 0
    # Where the room ends, the rest is left out.
    crowd = arm_world(arm, far, MARGIN, RAY)
    few = np.full((3, GRADIENT + 4), np.nan)
    n = edge_contacts(q, q + 1.5, crowd.chain, crowd.robot, crowd.obstacles, few[:2])
    assert n <= 2
    assert np.isnan(few[2:]).all()
