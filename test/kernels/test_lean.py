# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Elastic band: paths never longer than by shortcuts, the same ends, every edge proven."""

from dataclasses import replace

import numpy as np
import pytest
from rrth_planner.collision.world import arm_world
from rrth_planner.kernels.search.elastic_band import MAX_CORNERS, shorten
from rrth_planner.kernels.search.shortcut import LEAST_GAIN, shortcut_path
from worlds import (
    blocked_pair,
    compiled_chain,
    edge_touches,
    free_configuration,
    MARGIN,
    random_boxes,
    raw_paths,
    RAY,
    table_1_arm,
    wearer,
)

SPACING, ROUNDS = 0.05, 30


def shortened(world, waypoints, kernel, *how, room=64):
    """Return a path as a kernel shortens it."""
    path = np.full((room, waypoints.shape[1]), np.nan)
    path[: len(waypoints)] = waypoints
    if kernel is shortcut_path:
        n = shortcut_path(world.space, path, len(waypoints), SPACING, LEAST_GAIN)
    else:
        n = shorten(world.space, path, len(waypoints), np.array([SPACING, *how, LEAST_GAIN]))
    return path[:n]


def length(waypoints):
    return np.linalg.norm(np.diff(waypoints, axis=0), axis=1).sum()


def check_shorter(arm, scene, world, raw):
    """Check the elastic band of a path; return its relative gain over shortcuts."""
    taut = shortened(world, raw, shortcut_path)
    band = shortened(world, raw, shorten, ROUNDS)
    assert length(band) <= length(taut) * (1 + 1e-12)
    assert np.array_equal(band[0], raw[0])
    assert np.array_equal(band[-1], raw[-1])
    for a, b in zip(band[:-1], band[1:], strict=True):
        # Also within limits.
        assert world.is_edge_valid(a, b) or np.linalg.norm(a - b) < 1e-9
        assert not edge_touches(arm, scene, MARGIN, RAY, a, b)
    return 1.0 - length(band) / length(taut)


@pytest.fixture(scope='module')
def raw():
    """Paths of the paper's arm round the standing wearer, as growth leaves them."""
    world = arm_world(table_1_arm(), wearer(), MARGIN, RAY)
    return world, raw_paths(world, np.random.default_rng(91), 30)


def test_the_band_never_lengthens_and_every_edge_is_proven(raw):
    world, paths = raw
    gains = [check_shorter(table_1_arm(), wearer(), world, path) for path in paths]
    assert np.mean(gains) > 0.005
    assert np.mean(np.array(gains) > 1e-4) > 0.5


def test_the_band_never_lengthens_a_path_of_any_arm():
    rng, gains, seen = np.random.default_rng(92), [], set()
    while len(gains) < 24:
        arm = compiled_chain(rng, len(gains) % 2 == 0)
        scene = random_boxes(rng, int(rng.integers(2, 12)), spread=1.2)
        world = arm_world(arm, scene, MARGIN, RAY)
        if not has_blocked_pairs(world, rng):
            continue
        for path in raw_paths(world, rng, 1):
            gains.append(check_shorter(arm, scene, world, path))
        seen.add(arm.dof)
    assert {3, 4, 5, 6} <= seen
    assert np.mean(np.array(gains) > 1e-4) > 0.3


def has_blocked_pairs(world, rng):
    """Return whether an arm has room to move, and something in its way."""
    q = rng.uniform(*world.bounds, (200, world.bounds.shape[1]))
    free = [row for row in q if world.is_valid(row)]
    pairs = zip(free[::2], free[1::2], strict=False)
    return len(free) > 40 and sum(not world.is_edge_valid(a, b) for a, b in pairs) > 5


def test_the_band_stays_within_limits_that_a_shorter_path_would_pass(raw):
    world, paths = raw
    n_outside = n_shorter = 0
    for path in paths:
        taut = shortened(world, path, shortcut_path)
        narrow = replace(
            world, bounds=np.stack([taut.min(axis=0) - 1e-3, taut.max(axis=0) + 1e-3])
        )
        held = shortened(narrow, taut, shorten, ROUNDS)
        assert length(held) <= length(taut) * (1 + 1e-12)
        for a, b in zip(held[:-1], held[1:], strict=True):
            assert narrow.is_in_bounds(a)
            assert narrow.is_in_bounds(b)
            assert narrow.is_edge_valid(a, b) or np.linalg.norm(a - b) < 1e-9
        freely = shortened(world, taut, shorten, ROUNDS)
        if not all(narrow.is_in_bounds(q) for q in freely):
            n_outside += 1
            n_shorter += length(held) < length(taut) * (1 - 1e-5)
    assert n_outside >= 2
    assert n_shorter >= 1


def test_without_rounds_a_path_gets_shortcuts_only(raw):
    world, paths = raw
    for path in paths:
        taut = shortened(world, path, shortcut_path)
        assert np.array_equal(shortened(world, path, shorten, 0), taut)


def test_the_band_of_the_same_path_is_the_same_every_time(raw):
    world, paths = raw
    for path in paths[:6]:
        once, again = (shortened(world, path, shorten, ROUNDS) for _ in range(2))
        assert once.tobytes() == again.tobytes()


def test_paths_of_one_or_two_points_are_left_alone(raw):
    world, _ = raw
    q = np.stack([free_configuration(np.random.default_rng(93), world)] * 2)
    assert np.array_equal(shortened(world, q[:1], shorten, ROUNDS), q[:1])
    assert np.array_equal(shortened(world, q, shorten, ROUNDS), q)


def test_a_full_buffer_takes_no_further_waypoint(raw):
    world, paths = raw
    for path in paths:
        band = shortened(world, path, shorten, ROUNDS, room=len(path))
        assert len(band) <= len(path)
        assert length(band) <= length(path) * (1 + 1e-12)


def test_a_path_of_more_corners_than_there_is_room_for_is_still_shortened(raw):
    world, paths = raw
    rng = np.random.default_rng(94)
    n_long = 0
    for path in paths:
        # Points along the edges leave the path as it is.
        steps = np.sort(rng.uniform(0.0, len(path) - 1.0, 3 * MAX_CORNERS))
        dense = np.stack(
            [np.interp(steps, np.arange(len(path)), path[:, k]) for k in range(4)], axis=1
        )
        dense[0], dense[-1] = path[0], path[-1]
        edges = zip(dense[:-1], dense[1:], strict=True)
        if not all(world.is_edge_valid(a, b) for a, b in edges):
            continue
        n_long += 1
        band = shortened(world, dense, shorten, ROUNDS, room=128)
        assert length(band) <= length(dense) * (1 + 1e-12)
        for a, b in zip(band[:-1], band[1:], strict=True):
            assert world.is_edge_valid(a, b) or np.linalg.norm(a - b) < 1e-9
    assert n_long > 5


def test_pairs_for_these_tests_are_blocked():
    world, rng = arm_world(table_1_arm(), wearer(), MARGIN, RAY), np.random.default_rng(95)
    for _ in range(10):
        a, b = blocked_pair(rng, world)
        assert edge_touches(table_1_arm(), wearer(), MARGIN + 2e-9, RAY, a, b, 2e-4)
