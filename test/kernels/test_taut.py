# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Shortcut paths: never longer, the same ends, every edge proven."""

import numpy as np
import pytest
from rrth_planner.kernels.search.shortcut import LEAST_GAIN, shortcut_forward, shortcut_path
from rrth_planner.kernels.vectors import path_length
from rrth_planner.planning.box_map import BoxMap, map_world
from worlds import (
    edge_touches,
    free_configuration,
    MARGIN,
    raw_paths,
    RAY,
    table_1_arm,
    wearer,
    wearer_world,
)


@pytest.fixture(scope='module')
def raw():
    """Paths as growth leaves them."""
    return raw_paths(wearer_world(), np.random.default_rng(44), 20)


def taut(world, waypoints, spacing=0.01, room=64, enough=LEAST_GAIN):
    path = np.full((room, 4), np.nan)
    path[: len(waypoints)] = waypoints
    n = shortcut_path(world.space, path, len(waypoints), spacing, enough)
    return path[:n]


def test_shortcuts_never_lengthens_and_keeps_both_ends(raw):
    world, arm, scene = wearer_world(), table_1_arm(), wearer()
    for path in raw:
        for spacing in (0.3, 0.01):
            pulled = taut(world, path, spacing)
            before = path_length(path, len(path))
            assert path_length(pulled, len(pulled)) <= before * (1 + 1e-12)
            assert np.array_equal(pulled[0], path[0])
            assert np.array_equal(pulled[-1], path[-1])
            for a, b in zip(pulled[:-1], pulled[1:], strict=True):
                assert not edge_touches(arm, scene, MARGIN, RAY, a, b)
                assert world.is_edge_valid(a, b) or np.linalg.norm(a - b) < 1e-9


def test_shortcutting_a_path_again_gains_next_to_nothing(raw):
    world = wearer_world()
    for path in raw:
        once = taut(world, path)
        again = taut(world, once)
        gain = path_length(once, len(once)) - path_length(again, len(again))
        assert gain <= 2e-3 * path_length(once, len(once))


def test_coarse_shortcuts_are_a_beginning_of_fine_ones(raw):
    world, n_looser = wearer_world(), 0
    for path in raw:
        loose, tight = taut(world, path, enough=0.5), taut(world, path)
        lengths = [path_length(p, len(p)) for p in (path, loose, tight)]
        assert lengths[0] * (1 + 1e-12) >= lengths[1] >= lengths[2] * (1 - 1e-12)
        n_looser += lengths[1] > lengths[2] * (1 + 1e-6)
        # Going on where it stopped ends where fine shortcuts end.
        assert np.array_equal(taut(world, loose), tight)
    assert n_looser > 2


def test_a_detour_through_free_space_is_pulled_straight():
    world = wearer_world()
    rng = np.random.default_rng(45)
    n = 0
    while n < 20:
        q = np.stack([free_configuration(rng, world) for _ in range(3)])
        if all(world.is_edge_valid(q[i], q[j]) for i, j in ((0, 1), (1, 2), (0, 2))):
            assert np.array_equal(taut(world, q), q[[0, 2]])
            n += 1


def test_paths_of_one_or_two_points_are_left_alone():
    world = wearer_world()
    q = np.stack([free_configuration(np.random.default_rng(46), world)] * 2)
    assert np.array_equal(taut(world, q[:1]), q[:1])
    assert np.array_equal(taut(world, q), q)


def test_a_full_buffer_takes_no_further_waypoint(raw):
    world = wearer_world()
    for path in raw:
        assert len(taut(world, path, room=len(path))) <= len(path)


@pytest.mark.parametrize('spacing', [0.3, 0.01, 1e-6])
@pytest.mark.parametrize('width', [1.6, 1e-6])
def test_forward_goes_to_the_last_visible_point_whatever_is_how_thin(spacing, width):
    # Lines from the origin to (t, 4) meet the upper end of the wall, (1.4, 2), at t = 2.8.
    box_map = BoxMap(
        name='wall',
        bounds=[[-1, -1], [9, 9]],
        obstacles=[[[1.4, 0], [1.4 + width, 2]]],
        start=[0, 0],
        goal=[8, 4],
    )
    world = map_world(box_map)
    path = np.array([[0.0, 0.0], [0.0, 4.0], [8.0, 4.0]])
    assert shortcut_forward(world.space, path, 3, spacing) == 3
    assert path[1, 1] == 4.0
    assert 2.8 - spacing <= path[1, 0] <= 2.8 + 1e-5
