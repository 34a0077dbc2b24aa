# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Paths of RRT-H made smooth: no corner, no tighter turn than asked for, clear of the walls."""

import numpy as np
import pytest
from rrth_planner.planning.box_map import BoxMap, map_problem
from rrth_planner.planning.visibility_graph import shortest_path
from rrth_planner.reproduction.experiments import DUBINS, HALVED, RADII, RELATIVES
from rrth_planner.reproduction.problems import load_problem
from rrth_planner.reproduction.relatives.dubins_path import DubinsOptions, smooth
from rrth_planner.reproduction.relatives.dubins_words import follow, FULL_TURN
from rrth_planner.reproduction.relatives.search import find_path


def turn_between(first, second):
    """Return how far apart two headings are [rad]."""
    return np.abs((second - first + np.pi) % FULL_TURN - np.pi)


@pytest.mark.parametrize('problem', ['c_shape', 'spiral', 'fence', 'c_shape_near'])
@pytest.mark.parametrize(('name', 'radius'), list(zip(DUBINS, RADII, strict=True)))
def test_a_smoothed_path_turns_no_tighter_has_no_corner_and_is_clear(problem, name, radius):
    named, options, rng = load_problem(problem), RELATIVES[name], np.random.default_rng(1)
    result = find_path(named.problem, options, rng)
    if result.path is None:
        assert (problem, radius) == ('fence', 10.0)
        return
    assert named.is_path_valid(result.path.waypoints)
    poses, curvatures, lengths = smooth(result.raw_path.waypoints, named.problem, options)
    assert (np.abs(curvatures) <= 1.0 / radius + 1e-12).all()
    ends = follow(poses, curvatures, lengths)
    np.testing.assert_allclose(ends[:-1, :2], poses[1:, :2], atol=1e-6)
    assert turn_between(ends[:-1, 2], poses[1:, 2]).max() < 1e-6
    np.testing.assert_allclose(poses[0, :2], named.problem.q_start, atol=1e-9)
    np.testing.assert_allclose(ends[-1, :2], named.problem.q_goals[0], atol=1e-6)
    assert lengths.sum() == pytest.approx(result.path.length, rel=1e-5)
    # Nothing smooth is shorter than the waypoints that it goes through, all or some of them.
    assert lengths.sum() > 0.999 * result.raw_path.length
    # The points that stand for it turn no tighter than it does.
    steps = np.diff(result.path.waypoints, axis=0)
    headings, sizes = np.arctan2(steps[:, 1], steps[:, 0]), np.linalg.norm(steps, axis=1)
    is_bent = np.minimum(sizes[:-1], sizes[1:]) > 1e-3
    bends = turn_between(headings[:-1], headings[1:])[is_bent]
    assert (bends <= (0.5 * (sizes[:-1] + sizes[1:])[is_bent] + 1e-6) / radius).all()


@pytest.mark.parametrize(
    ('problem', 'i', 'seed'),
    [('c_shape', 2, 72), ('spiral', 0, 75), ('spiral', 1, 88), ('c_shape_near', 0, 33)],
)
def test_chords_are_clear_of_a_corner_that_their_arc_just_clears(problem, i, seed):
    # With these seeds the shortest path has an arc within 1e-4 of a corner.
    named = load_problem(problem)
    result = find_path(named.problem, RELATIVES[DUBINS[i]], np.random.default_rng(seed))
    assert named.is_path_valid(result.path.waypoints)


def test_a_radius_that_does_not_fit_is_not_found():
    corridor = BoxMap(
        name='corridor',
        bounds=[[0, 0], [30, 30]],
        obstacles=[[[0, 4], [26, 26]]],
        start=[2, 2],
        goal=[2, 28],
    )
    problem, exact = map_problem(corridor), shortest_path(corridor)[0]
    fits, wide = (
        find_path(problem, DubinsOptions(radius=radius, goal_bias=0.0), np.random.default_rng(0))
        for radius in (1.0, 20.0)
    )
    assert exact < fits.path.length < 1.1 * exact
    assert wide.path is None
    assert wide.status.value == 'sample limit'
    # The path that could not be smoothed.
    assert wide.raw_path.length == pytest.approx(exact, rel=1e-2)


def test_the_radius_is_halved_only_where_it_must_be():
    named, halved = load_problem('fence'), RELATIVES[HALVED]
    n_tighter = 0
    # Of the first the radius has to be halved.
    for seed in (0, 5):
        plain, other = (
            find_path(named.problem, options, np.random.default_rng(seed))
            for options in (RELATIVES[DUBINS[-1]], halved)
        )
        assert named.is_path_valid(other.path.waypoints)
        poses, curvatures, _ = smooth(other.raw_path.waypoints, named.problem, halved)
        is_tighter = np.abs(curvatures) > 1.0 / RADII[-1] + 1e-12
        assert (np.abs(curvatures) <= 4.0 / RADII[-1] + 1e-12).all()
        if plain.path is not None:
            np.testing.assert_array_equal(other.path.waypoints, plain.path.waypoints)
            assert not is_tighter.any()
        else:
            # One word or two of it.
            assert 0 < is_tighter.sum() <= 6 < len(poses)
            n_tighter += 1
    assert n_tighter == 1
