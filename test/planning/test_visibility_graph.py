# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The exact shortest path: known lengths, valid paths, and nothing shorter to be found."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.io.map_file import map_from_mapping
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.errors import SceneError
from rrth_planner.planning.box_map import BoxMap
from rrth_planner.planning.visibility_graph import enters, extended_obstacles, shortest_path
from worlds import examples


def packaged(name):
    """Return a map of the package."""
    return map_from_mapping(load_yaml(resource_path(f'config/maps/{name}.yaml')), name)


def length(waypoints):
    """Return the length of a path, shape (n, 2)."""
    return float(np.linalg.norm(np.diff(waypoints, axis=0), axis=1).sum())


def random_map(seed):
    """Return a map of up to seven rectangles, some of them at the border."""
    rng = np.random.default_rng(seed)
    lower = rng.uniform(-10.0, 90.0, (int(rng.integers(0, 8)), 2))
    boxes = np.stack([lower, lower + rng.uniform(3.0, 50.0, lower.shape)], axis=1)
    while True:
        ends = rng.uniform(0.0, 100.0, (2, 2))
        inside = (ends[:, None] > boxes[:, 0]) & (ends[:, None] < boxes[:, 1])
        if not inside.all(axis=2).any():
            bounds = [[0.0, 0.0], [100.0, 100.0]]
            return BoxMap(
                name='random', bounds=bounds, obstacles=boxes, start=ends[0], goal=ends[1]
            )


def grid_length(box_map, n=31):
    """Return the length of the shortest path over points of a grid that see each other, or inf."""
    axis = np.linspace(0.0, 100.0, n)
    nodes = np.vstack(
        [box_map.start, box_map.goal, np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)]
    )
    first, second = np.triu_indices(len(nodes), k=1)
    near = np.linalg.norm(nodes[first] - nodes[second], axis=1) < 4.0 * 100.0 / n
    first, second = first[near], second[near]
    lower, upper = extended_obstacles(box_map).transpose(1, 0, 2)
    # Looked at densely, with no clipping.
    free = np.ones(len(first), dtype=bool)
    for t in np.linspace(0.0, 1.0, 101):
        q = nodes[first] + t * (nodes[second] - nodes[first])
        free &= ~((q[:, None] > lower) & (q[:, None] < upper)).all(axis=2).any(axis=1)
    first, second = first[free], second[free]
    steps = np.linalg.norm(nodes[first] - nodes[second], axis=1)
    costs = np.full(len(nodes), math.inf)
    costs[0] = 0.0
    while True:
        better = costs.copy()
        np.minimum.at(better, second, costs[first] + steps)
        np.minimum.at(better, first, costs[second] + steps)
        if (better == costs).all():
            return costs[1]
        costs = better


@pytest.mark.parametrize(
    ('name', 'exact'), [('c_shape', 113.0711), ('spiral', 158.8383), ('fence', 361.5457)]
)
def test_the_known_lengths_come_back(name, exact):
    found, waypoints = shortest_path(packaged(name))
    assert found == pytest.approx(exact, abs=1e-4)
    assert length(waypoints) == pytest.approx(found, abs=1e-9)


@given(st.integers(0, 2**32 - 1))
@examples(100)
def test_the_path_leads_from_start_to_goal_and_enters_nothing(seed):
    box_map = random_map(seed)
    found, waypoints = shortest_path(box_map)
    if math.isinf(found):
        assert waypoints.shape == (0, 2)
        return
    np.testing.assert_array_equal(waypoints[0], box_map.start)
    np.testing.assert_array_equal(waypoints[-1], box_map.goal)
    assert length(waypoints) == pytest.approx(found, abs=1e-9)
    assert not enters(waypoints[:-1], waypoints[1:], extended_obstacles(box_map)).any()
    assert found >= np.linalg.norm(box_map.goal - box_map.start) - 1e-9


@given(st.integers(0, 2**32 - 1))
@examples(6)
def test_no_path_over_sampled_points_that_see_each_other_is_shorter(seed):
    box_map = random_map(seed)
    # Points that see each other when looked at now and then may cut a corner by a little.
    assert shortest_path(box_map)[0] <= grid_length(box_map) * (1.0 + 1e-3) + 1e-9


@given(st.integers(0, 2**32 - 1))
@examples(50)
def test_the_way_back_is_as_long(seed):
    box_map = random_map(seed)
    back = BoxMap(
        name='back',
        bounds=box_map.bounds,
        obstacles=box_map.obstacles,
        start=box_map.goal,
        goal=box_map.start,
    )
    assert shortest_path(back)[0] == pytest.approx(shortest_path(box_map)[0])


def test_without_walls_the_way_is_straight():
    box_map = BoxMap(
        name='empty', bounds=[[0, 0], [9, 9]], obstacles=[], start=[1, 1], goal=[4, 5]
    )
    found, waypoints = shortest_path(box_map)
    assert found == pytest.approx(5.0)
    assert len(waypoints) == 2


def test_a_wall_from_border_to_border_leaves_no_path():
    box_map = BoxMap(
        name='closed',
        bounds=[[0, 0], [9, 9]],
        obstacles=[[[4, 0], [5, 9]]],
        start=[1, 1],
        goal=[8, 1],
    )
    found, waypoints = shortest_path(box_map)
    assert math.isinf(found)
    assert waypoints.shape == (0, 2)


def test_a_map_that_is_not_in_the_plane_is_rejected():
    box_map = BoxMap(
        name='room', bounds=[[0] * 3, [9] * 3], obstacles=[], start=[1] * 3, goal=[2] * 3
    )
    with pytest.raises(SceneError, match=r'map "room": 3 dimensions, expected 2'):
        shortest_path(box_map)
