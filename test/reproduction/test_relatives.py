# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Growth in a potential field, A* and PRM: what their trees and paths are, against references."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.io.map_file import load_map
from rrth_planner.model.errors import OptionsError, SceneError
from rrth_planner.planning.box_map import BoxMap, map_problem
from rrth_planner.planning.options import RRTOptions
from rrth_planner.planning.visibility_graph import enters, extended_obstacles, shortest_path
from rrth_planner.reproduction.experiments import RELATIVES
from rrth_planner.reproduction.problems import exact_length, load_problem
from rrth_planner.reproduction.relatives.dubins_path import DubinsOptions
from rrth_planner.reproduction.relatives.lattice import lattice, LatticeOptions, OCTILE_RATIO
from rrth_planner.reproduction.relatives.potential_field import force, PotentialFieldOptions
from rrth_planner.reproduction.relatives.roadmap import RoadmapOptions
from rrth_planner.reproduction.relatives.search import find_path
from worlds import examples

SEEDS = st.integers(0, 2**32 - 1)
MAPS = ('c_shape', 'spiral', 'fence', 'c_shape_near')


def random_map(seed, most=7):
    """Return a map of some rectangles, some of them at the border."""
    rng = np.random.default_rng(seed)
    lower = rng.uniform(-5.0, 45.0, (int(rng.integers(0, most + 1)), 2))
    boxes = np.stack([lower, lower + rng.uniform(2.0, 25.0, lower.shape)], axis=1)
    while True:
        ends = rng.uniform(0.0, 50.0, (2, 2))
        if not ((ends[:, None] > boxes[:, 0]) & (ends[:, None] < boxes[:, 1])).all(axis=2).any():
            bounds = [[0.0, 0.0], [50.0, 50.0]]
            return BoxMap(
                name='random', bounds=bounds, obstacles=boxes, start=ends[0], goal=ends[1]
            )


def found_on(box_map, options, seed=0):
    """Return what a relative finds on a map."""
    return find_path(map_problem(box_map), options, np.random.default_rng(seed))


def lattice_length(box_map, spacing):
    """Return the shortest length over all free edges of the lattice, or inf (Bellman and Ford)."""
    low, high = box_map.bounds
    shift = (box_map.start - low) % spacing
    axes = [np.arange(a + s, b + 1e-9, spacing) for a, b, s in zip(low, high, shift, strict=True)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    nodes = np.vstack([box_map.goal, grid])
    first, second = np.triu_indices(len(nodes), k=1)
    near = np.abs(nodes[first] - nodes[second]).max(axis=1) < spacing + 1e-6
    first, second = first[near], second[near]
    free = ~enters(nodes[first], nodes[second], extended_obstacles(box_map))
    first, second = first[free], second[free]
    steps = np.linalg.norm(nodes[first] - nodes[second], axis=1)
    costs = np.where(np.linalg.norm(nodes - box_map.start, axis=1) < 1e-6, 0.0, math.inf)
    while True:
        better = costs.copy()
        np.minimum.at(better, second, costs[first] + steps)
        np.minimum.at(better, first, costs[second] + steps)
        if (better == costs).all():
            return float(costs[0])
        costs = better


@given(SEEDS, st.sampled_from([2.0, 3.7, 5.0]))
@examples(60)
def test_a_star_finds_the_shortest_path_of_its_lattice_or_that_there_is_none(seed, spacing):
    box_map = random_map(seed)
    result = found_on(box_map, LatticeOptions(spacing=spacing))
    expected = lattice_length(box_map, spacing)
    if math.isinf(expected):
        assert result.path is None
        return
    assert result.path.length == pytest.approx(expected, rel=1e-9)
    assert result.path.length >= shortest_path(box_map)[0] - 1e-6
    q = result.path.waypoints
    np.testing.assert_array_equal(q[[0, -1]], [box_map.start, box_map.goal])
    assert not enters(q[:-1], q[1:], extended_obstacles(box_map)).any()


@given(SEEDS)
@examples(30)
def test_without_walls_a_lattice_costs_up_to_its_factor_however_fine(seed):
    box_map = random_map(seed, most=0)
    exact = float(np.linalg.norm(box_map.goal - box_map.start))
    for spacing in (4.0, 2.0, 1.0):
        length = found_on(box_map, LatticeOptions(spacing=spacing)).path.length
        # The last edge leads to the goal, wherever in its cell that is.
        assert exact - 1e-9 <= length <= OCTILE_RATIO * exact + spacing


def test_the_factor_of_a_lattice_is_reached_between_its_directions():
    steps = np.array([12, 5]) * 3.0
    far = BoxMap(name='far', bounds=[[0, 0], [50, 50]], obstacles=[], start=[1, 1], goal=1 + steps)
    length = found_on(far, LatticeOptions(spacing=1.0)).path.length
    assert length / np.linalg.norm(steps) == pytest.approx(OCTILE_RATIO, rel=1e-3)


def test_the_points_of_a_lattice_are_those_within_the_bounds_but_the_start():
    bounds = np.array([[0.0, 0.0], [1.0, 0.9]])
    points = lattice(np.array([0.3, 0.3]), bounds, 0.1)
    assert points.shape == (11 * 10 - 1, 2)
    assert (points >= -1e-9).all()
    assert (points <= bounds[1] + 1e-9).all()


def test_a_roadmap_of_more_draws_is_nearer_to_the_shortest_path():
    for name in MAPS:
        medians = []
        for n in (100, 400, 1600):
            lengths = []
            for seed in range(7):
                result = find_path(
                    load_problem(name).problem,
                    RoadmapOptions(n_samples=n),
                    np.random.default_rng(seed),
                )
                assert result.n_samples == n
                if result.path is None:
                    lengths.append(math.inf)
                    continue
                assert load_problem(name).is_path_valid(result.path.waypoints)
                lengths.append(result.path.length)
            medians.append(np.median(lengths) / exact_length(name))
        assert min(medians) >= 1.0 - 1e-9
        assert medians[0] > medians[1] > medians[2]
        assert medians[2] < 1.06


@given(SEEDS)
@examples(20)
def test_a_roadmap_that_joins_everything_finds_the_shortest_path_over_its_draws(seed):
    box_map = random_map(seed)
    options = RoadmapOptions(n_samples=30, radius_factor=100.0)
    result = found_on(box_map, options, seed)
    draws = np.random.default_rng(seed).uniform(*box_map.bounds, (30, 2))
    boxes = extended_obstacles(box_map)
    inside = ((draws[:, None] > boxes[:, 0]) & (draws[:, None] < boxes[:, 1])).all(axis=2)
    nodes = np.vstack([box_map.start, box_map.goal, draws[~inside.any(axis=1)]])
    n = len(nodes)
    costs = np.full((n, n), math.inf)
    for i in range(n):
        free = ~enters(np.repeat(nodes[i : i + 1], n, axis=0), nodes, boxes)
        costs[i, free] = np.linalg.norm(nodes - nodes[i], axis=1)[free]
    # Floyd and Warshall.
    for k in range(n):
        costs = np.minimum(costs, costs[:, k : k + 1] + costs[k])
    length = math.inf if result.path is None else result.path.length
    assert length == pytest.approx(costs[0, 1])


@pytest.mark.parametrize('name', MAPS)
def test_steps_in_the_field_have_one_length_and_are_clear(name):
    box_map, options = load_map(name), PotentialFieldOptions(step_size=7.0, max_samples=3000)
    result = found_on(box_map, options, 3)
    (tree,) = result.trees
    children = np.flatnonzero(tree.parents >= 0)
    parents = tree.parents[children]
    lengths = np.linalg.norm(tree.nodes[children] - tree.nodes[parents], axis=1)
    if result.path is not None:
        # The last edge joins the goal.
        np.testing.assert_array_equal(tree.nodes[-1], box_map.goal)
        assert lengths[-1] <= 7.0
        lengths = lengths[:-1]
        np.testing.assert_array_equal(result.path.waypoints[0], box_map.start)
        assert load_problem(name).is_path_valid(result.path.waypoints)
    assert len(lengths) > 20
    np.testing.assert_allclose(lengths, 7.0, rtol=1e-12)
    boxes = extended_obstacles(box_map)
    assert not enters(tree.nodes[parents], tree.nodes[children], boxes).any()
    assert (tree.nodes >= box_map.bounds[0]).all()
    assert (tree.nodes <= box_map.bounds[1]).all()


def test_the_force_is_that_of_the_formula():
    options = PotentialFieldOptions(attraction=0.5, repulsion=0.8, influence=4.0)
    walls = np.array([[[0.0, 0.0], [10.0, 10.0]], [[50.0, 50.0], [60.0, 60.0]]])
    q, goal = np.array([5.0, 11.0]), np.array([5.0, 31.0])
    right = np.array([9.0, 11.0])
    # To the draw 1 along x, to the goal 0.5 along y, from the wall a distance of 1 below.
    np.testing.assert_allclose(force(q, right, goal, walls, options), [1.0, 0.5 + 0.8 * 0.75])
    far = q + [0.0, 3.0]
    np.testing.assert_allclose(force(far, far + [1.0, 0.0], goal, walls, options), [1.0, 0.5])
    # Nothing pulls towards where one is, nor does a wall push that one is in contact with.
    at = np.array([5.0, 10.0])
    np.testing.assert_allclose(force(at, at, goal, walls, options), [0.0, 0.5])
    np.testing.assert_allclose(force(at, at, at, walls[:0], options), 0.0)


def test_a_goal_that_pulls_alone_is_approached_straight():
    empty = BoxMap(name='e', bounds=[[0, 0], [90, 90]], obstacles=[], start=[5, 5], goal=[85, 60])
    pulled = found_on(empty, PotentialFieldOptions(attraction=100.0)).path.length
    drawn = found_on(empty, PotentialFieldOptions(attraction=0.0)).path.length
    exact = np.linalg.norm([80, 55])
    assert pulled < 1.01 * exact < drawn


def test_a_growth_ends_with_its_draws():
    walled = BoxMap(
        name='walled',
        bounds=[[0, 0], [9, 9]],
        obstacles=[[[4, 0], [5, 9]]],
        start=[1, 1],
        goal=[8, 1],
    )
    result = found_on(walled, PotentialFieldOptions(step_size=1.0, max_samples=50))
    assert result.path is None
    assert result.status.value == 'sample limit'
    assert result.n_samples == 50
    assert found_on(walled, RoadmapOptions(n_samples=50)).path is None
    assert found_on(walled, LatticeOptions(spacing=1.0)).path is None


@pytest.mark.parametrize('name', list(RELATIVES))
def test_a_relative_finds_the_same_again(name):
    problem = load_problem('c_shape').problem
    one, other = (find_path(problem, RELATIVES[name], np.random.default_rng(4)) for _ in 'ab')
    np.testing.assert_array_equal(one.path.waypoints, other.path.waypoints)
    assert one.cost_history == other.cost_history == (one.path.length,)


@pytest.mark.parametrize('name', list(RELATIVES))
@pytest.mark.parametrize('goal', [[3.0, 3.0], [3.5, 3.0]])
def test_a_goal_that_is_there_or_near_is_found(name, goal):
    small = BoxMap(name='small', bounds=[[0, 0], [9, 9]], obstacles=[], start=[3, 3], goal=goal)
    path = found_on(small, RELATIVES[name]).path
    assert path.length == pytest.approx(goal[0] - 3.0)
    np.testing.assert_allclose(path.waypoints[[0, -1]], [[3.0, 3.0], goal], atol=1e-9)


def test_planners_of_the_package_are_asked_as_before():
    problem = load_problem('c_shape').problem
    assert (
        find_path(problem, RRTOptions(step_size=10.0), np.random.default_rng(0)).path is not None
    )


@pytest.mark.parametrize(
    'options', [LatticeOptions(), RoadmapOptions(), PotentialFieldOptions(), DubinsOptions()]
)
def test_only_maps_in_the_plane_are_for_relatives(options):
    arm = load_problem('arm/front').problem
    with pytest.raises(SceneError, match='arm of 4 dimensions.*expected a map of 2'):
        find_path(arm, options, np.random.default_rng(0))
    room = BoxMap(
        name='room', bounds=[[0] * 3, [9] * 3], obstacles=[], start=[1] * 3, goal=[2] * 3
    )
    with pytest.raises(SceneError, match='map of 3 dimensions.*expected a map of 2'):
        find_path(map_problem(room), options, np.random.default_rng(0))


@pytest.mark.parametrize(
    ('kind', 'value', 'sentence'),
    [
        (LatticeOptions, {'spacing': 0.0}, r'spacing: 0\.0, expected 0\.1 to 1000 \[map\]'),
        (RoadmapOptions, {'n_samples': 1}, r'n_samples: 1, expected a whole number from 2 to'),
        (PotentialFieldOptions, {'attraction': -1}, r'attraction: -1, expected 0 to 100 \[-\]'),
        (DubinsOptions, {'radius': math.nan}, r'radius: nan, expected 0\.01 to 1000 \[map\]'),
    ],
)
def test_options_out_of_range_are_rejected(kind, value, sentence):
    with pytest.raises(OptionsError, match=sentence):
        kind(**value)
