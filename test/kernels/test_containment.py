# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How far boxes get out of earlier ones, by kernels, by plain numpy and by brute force."""

import numpy as np
import pytest
from rrth_planner.collision.reference_checker import protrusions
from rrth_planner.execution.kept_sights import sight_of
from rrth_planner.kernels.collision.containment import excesses, MEASURED, protrusion, SIGHT
from rrth_planner.kernels.layout import ROTATION, SIZE
from rrth_planner.model.body_reach import KNOWN_FOR
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import reach_at, reach_of, SeparationRules
from worlds import random_rotation

RULES = SeparationRules()
NAMES = ('torso', 'head', 'left hand', 'shin', 'hat')


def random_boxes(rng, n, spread):
    """Return boxes of any shape, (n, 15)."""
    rows = np.empty((n, 15))
    rows[:, :SIZE] = rng.uniform(-spread, spread, (n, 3))
    rows[:, SIZE:ROTATION] = rng.uniform(0.02, 0.5, (n, 3))
    rows[:, ROTATION:] = [random_rotation(rng).ravel() for _ in range(n)]
    return rows


def distance_from(row, points):
    """Return how far points are from a box, (k, 3) -> (k,) [m], by the nearest place in it."""
    local = (points - row[:SIZE]) @ row[ROTATION:].reshape(3, 3)
    nearest = np.clip(local, -0.5 * row[SIZE:ROTATION], 0.5 * row[SIZE:ROTATION])
    return np.linalg.norm(local - nearest, axis=1)


@pytest.mark.parametrize('spread', [0.02, 0.3, 2.0])
def test_no_point_of_a_box_is_further_out_of_an_earlier_one(spread):
    rng = np.random.default_rng(int(100 * spread))
    before, after = random_boxes(rng, 200, spread), random_boxes(rng, 200, spread)
    ways = protrusions(before, after)
    shares = np.array(np.meshgrid(*[np.linspace(-0.5, 0.5, 9)] * 3)).reshape(3, -1).T
    for one, other, way in zip(before, after, ways, strict=True):
        assert protrusion(one, other) == pytest.approx(way, abs=1e-14)
        places = (shares * other[SIZE:ROTATION]) @ other[ROTATION:].reshape(3, 3).T
        found = distance_from(one, other[:SIZE] + places)
        # Corners are among these places.
        assert found.max() == pytest.approx(way, abs=1e-12)


def test_a_translation_counts_in_full_and_a_turn_within_the_box_not_at_all():
    rng = np.random.default_rng(0)
    for row in random_boxes(rng, 50, 1.0):
        shift = rng.standard_normal(3) * rng.choice([1e-3, 0.1, 3.0])
        moved = row.copy()
        moved[:SIZE] += shift
        assert protrusion(row, moved) == pytest.approx(np.linalg.norm(shift), rel=1e-9)
        assert protrusion(row, row) < 1e-12
        # A square bar that rolls by a quarter, or any part of that: only its edges get out.
        row[SIZE + 1] = row[SIZE + 2]
        for angle, least in ((0.5 * np.pi, 0.0), (0.25 * np.pi, (np.sqrt(0.5) - 0.5))):
            turn = rotation_matrix(np.array([np.sin(angle / 2), 0.0, 0.0, np.cos(angle / 2)]))
            rolled = row.copy()
            rolled[ROTATION:] = (row[ROTATION:].reshape(3, 3) @ turn).ravel()
            expected = least * row[SIZE + 1]
            assert protrusion(row, rolled) == pytest.approx(expected, abs=1e-12)
        # A smaller box within it is not out of it.
        smaller = row.copy()
        smaller[SIZE:ROTATION] *= 0.5
        smaller[:SIZE] += 0.2 * row[ROTATION:].reshape(3, 3) @ row[SIZE:ROTATION]
        assert protrusion(row, smaller) == 0.0
        assert protrusion(smaller, row) > 0.0


def test_what_is_not_a_number_is_far():
    row = Box('hand', [0.0] * 3, [0.1] * 3, np.eye(3)).numbers
    for k in range(15):
        bad = row.copy()
        bad[k] = np.nan
        assert not protrusion(row, bad) <= 1e9
        assert not protrusion(bad, row) <= 1e9


def excesses_of(earlier, now, within):
    """Return what the kernel finds, (m,) [m]."""
    reach, found = reach_of(NAMES, RULES), np.empty(len(NAMES))
    lines = reach.offsets, reach.speeds, reach.stated
    excesses(earlier, now, *lines, KNOWN_FOR, 2e-3, within, found)
    return found


@pytest.mark.parametrize('pace', [0.05, 0.5, 3.0, 20.0])
def test_of_all_sights_the_greatest_excess_counts(pace):
    rng, n_out = np.random.default_rng(int(10 * pace)), 0
    reach = reach_of(NAMES, RULES)
    for _ in range(40):
        n = int(rng.integers(1, 60))
        times = np.sort(rng.uniform(0.0, rng.choice([0.1, 1.0, 4.0]), n + 1))
        # They walk at random, turn, and some were not seen anew.
        boxes = random_boxes(rng, len(NAMES), 0.3)
        sights = np.empty((n + 1, len(NAMES), SIGHT))
        for i in range(n + 1):
            boxes = boxes.copy()
            boxes[:, :SIZE] += pace * np.sqrt(1.0 / n) * rng.standard_normal((len(NAMES), 3)) * 0.1
            if rng.random() < 0.3:
                boxes[:, ROTATION:] = [random_rotation(rng).ravel() for _ in NAMES]
            sights[i, :, :MEASURED], sights[i, :, MEASURED] = boxes, times[i]
            if i:
                sights[i][rng.random(len(NAMES)) < 0.1] = sights[i - 1, 0]
        earlier, now = sights[:-1], sights[-1]
        elapsed = now[:, MEASURED] - earlier[:, :, MEASURED]
        ways = protrusions(earlier[..., :MEASURED], now[None, :, :MEASURED])
        wanted = ways - reach_at(reach, np.maximum(elapsed, 0.0)) - 0.02
        wanted = np.where(elapsed > 2e-3, wanted, 0.0).max(axis=0, initial=0.0)
        found = excesses_of(earlier, now, 0.02)
        assert found == pytest.approx(wanted, abs=1e-12)
        n_out += int((wanted > 0.0).sum())
    # A torso does not move at all.
    assert n_out > 20


def test_without_an_earlier_sight_nothing_is_out():
    scene = Scene(tuple(Box(n, [0.0] * 3, [0.1] * 3, np.eye(3)) for n in NAMES))
    now = sight_of(scene, np.zeros(len(NAMES)))
    assert (excesses_of(np.empty((0, len(NAMES), SIGHT)), now, 0.02) == 0.0).all()
    # Nor where a part was not there before, or is no newer.
    unknown = now.copy()
    unknown[:, MEASURED] = np.inf
    unknown[:, :SIZE] = 9.0
    assert (excesses_of(np.array([unknown, now]), now, 0.02) == 0.0).all()
