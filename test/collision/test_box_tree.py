# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The tree of boxes: every box in one lane, every bound round its boxes, and none of them lost."""

import itertools

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.box_tree import grown_groups, pack_boxes
from rrth_planner.collision.reference_checker import bar_box_contact, bars
from rrth_planner.collision.world import arm_world
from rrth_planner.kernels.layout import BOX_ALLOWED, BOX_HALF, BOX_OFFSET, BOX_ROWS, LANES
from rrth_planner.model.errors import SceneError
from rrth_planner.model.scene import Scene
from worlds import (
    edge_touches,
    examples,
    MARGIN,
    random_boxes,
    random_rotation,
    RAY,
    table_1_arm,
)

CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
SEEDS = st.integers(0, 2**32 - 1)


def random_rows(rng, n):
    """Return the numbers of n boxes, turned anyhow or all alike."""
    rows = np.zeros((BOX_ROWS, n))
    common = random_rotation(rng)
    is_common = rng.random() < 0.3
    for i in range(n):
        axes = common if is_common else random_rotation(rng)
        rows[:BOX_OFFSET, i] = axes.ravel()
        rows[BOX_OFFSET:BOX_HALF, i] = -axes @ rng.uniform(-2.0, 2.0, 3)
        rows[BOX_HALF:BOX_ALLOWED, i] = rng.uniform(0.01, 0.4, 3)
    return rows


def lanes_of(groups):
    """Return the numbers of each lane, (n_groups, 8, 15)."""
    return groups.reshape(len(groups), BOX_ROWS, LANES).transpose(0, 2, 1)


def corners_of(box):
    """Return the corners of a box, (8, 3) [m]."""
    axes, offset = box[:BOX_OFFSET].reshape(3, 3), box[BOX_OFFSET:BOX_HALF]
    return (CORNERS * box[BOX_HALF:BOX_ALLOWED] - offset) @ axes


def holds(bound, points):
    """Return whether a bound holds all points (n, 3)."""
    axes, offset = bound[:BOX_OFFSET].reshape(3, 3), bound[BOX_OFFSET:BOX_HALF]
    return bool((np.abs(points @ axes.T + offset) <= bound[BOX_HALF:BOX_ALLOWED]).all())


def boxes_below(lanes, g):
    """Return the boxes in and below a group."""
    if LANES * g + 1 >= len(lanes):
        return [box for box in lanes[g] if box[BOX_HALF] > 0.0]
    return [box for lane in range(LANES) for box in boxes_below(lanes, LANES * g + lane + 1)]


def check_bounds(groups):
    """Check that each lane of an inner group bounds what is below it; return how many do."""
    lanes, n = lanes_of(groups), 0
    for g in range((len(groups) - 1) // LANES):
        for lane in range(LANES):
            below = boxes_below(lanes, LANES * g + lane + 1)
            if not below:
                assert np.isneginf(lanes[g, lane, BOX_HALF:BOX_ALLOWED]).all()
                continue
            assert holds(lanes[g, lane], np.concatenate([corners_of(box) for box in below]))
            n += 1
    return n


@examples(60)
@given(seed=SEEDS, n=st.sampled_from([0, 1, 2, 7, 8, 9, 10, 17, 63, 64, 65, 100, 300, 512, 513]))
def test_every_box_is_in_exactly_one_lane_below_its_bounds(seed, n):
    rows = random_rows(np.random.default_rng(seed), n)
    groups, places = pack_boxes(rows)
    # A full tree: 1, 9, 73, ... groups.
    n_levels = 1 + max(0, int(np.ceil(np.log(max(n, 1)) / np.log(LANES) - 1e-9)) - 1)
    assert len(groups) == sum(LANES**level for level in range(n_levels))
    leaves = lanes_of(groups)[(len(groups) - 1) // LANES :].reshape(-1, BOX_ROWS)
    assert len(set(places.tolist())) == n
    assert np.array_equal(leaves[places], rows.T)
    empty = np.delete(leaves, places, axis=0)
    assert np.isneginf(empty[:, BOX_HALF:BOX_ALLOWED]).all()
    assert np.isfinite(empty[:, :BOX_HALF]).all()
    n_bounds = check_bounds(groups)
    assert n_bounds >= (np.ceil(n / LANES) if n > LANES else 0)


def test_bounds_are_no_larger_than_a_few_boxes_need():
    rng = np.random.default_rng(1)
    # Two heaps far from each other share no bound of the lowest inner level.
    rows = random_rows(rng, 64)
    axes = rows[:BOX_OFFSET].T.reshape(-1, 3, 3)
    rows[BOX_OFFSET:BOX_HALF, 32:] -= axes[32:, :, 0].T * 50.0
    lanes = lanes_of(pack_boxes(rows)[0])
    assert lanes[0, :, BOX_HALF:BOX_ALLOWED].max() < 10.0


@examples(40)
@given(seed=SEEDS, n=st.sampled_from([3, 8, 9, 64, 65, 200]), by=st.floats(-0.009, 0.5))
def test_grown_groups_hold_the_grown_boxes(seed, n, by):
    rows = random_rows(np.random.default_rng(seed), n)
    groups, places = pack_boxes(rows)
    before = groups.copy()
    grown = grown_groups(groups, by)
    assert np.array_equal(groups, before)
    leaves = lanes_of(grown)[(len(grown) - 1) // LANES :].reshape(-1, BOX_ROWS)
    assert np.array_equal(leaves[places, :BOX_HALF], rows[:BOX_HALF].T)
    assert np.allclose(
        leaves[places, BOX_HALF:BOX_ALLOWED],
        rows[BOX_HALF:BOX_ALLOWED].T + by,
        rtol=0.0,
        atol=1e-15,
    )
    assert np.isneginf(np.delete(leaves, places, axis=0)[:, BOX_HALF:BOX_ALLOWED]).all()
    check_bounds(grown)


def test_a_box_that_would_vanish_is_rejected():
    groups, _ = pack_boxes(random_rows(np.random.default_rng(2), 70))
    with pytest.raises(SceneError, match=r'growth: -0.5, expected .* size > 0 \[m\]'):
        grown_groups(groups, -0.5)


@pytest.mark.parametrize('n', [9, 64, 65, 300])
def test_many_boxes_collide_as_by_the_reference_checker_and_as_one_by_one(n):
    rng, arm = np.random.default_rng(n), table_1_arm(radius=0.01)
    scene = random_boxes(rng, n, spread=1.5, largest=3.0 * (4.0 * n) ** -0.5)
    world = arm_world(arm, scene, MARGIN, RAY)
    alone = [arm_world(arm, Scene((box,)), MARGIN, RAY) for box in scene.boxes]
    q = rng.uniform(*arm.bounds, (300, 4))
    ends, touched = bars(arm, q, RAY), np.zeros((len(q), n), dtype=bool)
    for j, box in enumerate(scene.boxes):
        half = 0.5 * box.size + MARGIN + arm.radii[0]
        touched[:, j] = bar_box_contact(ends, box.center, box.rotation, half).any(axis=1)
    is_free = np.array([world.is_valid(row) for row in q])
    assert np.array_equal(is_free, ~touched.any(axis=1))
    assert 30 < is_free.sum() < 290
    for row, flags in zip(q[:60], touched, strict=False):
        assert [not one.is_valid(row) for one in alone] == flags.tolist()
        together = world.clearances(row)
        apart = np.concatenate([one.clearances(row) for one in alone], axis=1)
        assert np.array_equal(together, apart)
    n_free = n_undecided = 0
    for a in q[is_free][:60]:
        b = np.clip(a + 0.2 * rng.standard_normal(4), *arm.bounds)
        is_certified = world.is_edge_valid(a, b)
        by_each = all(one.is_edge_valid(a, b) for one in alone)
        # Together they may use up what a proof has room for.
        assert by_each or not is_certified
        assert not (is_certified and edge_touches(arm, scene, MARGIN, RAY, a, b, 2e-3))
        n_free += is_certified
        n_undecided += by_each and not is_certified
    assert n_free > 10
    assert n_undecided <= 1
