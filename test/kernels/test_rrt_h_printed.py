# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The three steps as printed: by hand on paper, by the paper's words in numpy, and in a plan."""

import functools

import numpy as np
import pytest
from rrth_planner.kernels.search.rrt_h_published import (
    cut_corners,
    first_contact,
    shortcut_forward,
)
from rrth_planner.kernels.vectors import path_length
from rrth_planner.model.status import PlanStatus
from rrth_planner.planning.box_map import BoxMap, map_problem, map_world
from rrth_planner.planning.options import PrintedRRTHOptions, RRTOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.rrt_h_published import SHORTEN
from worlds import blocked_pair, wearer_world

# From P_0 the points of P_1 -> P_2 are seen over a box; the line of sight to (t, 4) passes the
# height 2 at t / 2, so from t = 2.8 on it enters the box's upper left corner.
CORNER = [[0.0, 0.0], [0.0, 4.0], [8.0, 4.0]]
BOX = [[[1.4, 0.0], [3.0, 2.0]]]
# One P_T per unit of that segment; on the line to P_T(3), of length 5, 25 points P_C.
ONE, FINE = 1.01, 0.2001


def plane(obstacles=BOX):
    """Return the world of a point among rectangles."""
    return map_world(
        BoxMap(
            name='plane',
            bounds=[[-1.0, -1.0], [9.0, 9.0]],
            obstacles=obstacles,
            start=[0.0, 0.0],
            goal=[8.0, 4.0],
        )
    )


def after(step, world, waypoints, *spacings):
    """Return the path after a step."""
    path = np.full((len(waypoints) + 60, len(waypoints[0])), np.nan)
    path[: len(waypoints)] = waypoints
    return path[: step(world.space, path, len(waypoints), *spacings)]


def all_steps(world, waypoints, least, targets, checks):
    """Return the path after steps 1, 2 and 3."""
    path = np.full((len(waypoints) + 60, len(waypoints[0])), np.nan)
    path[: len(waypoints)] = waypoints
    how = np.array([least, 0.0, 0.0, targets, checks])
    n = SHORTEN(world.space, path, len(waypoints), how)
    return path[:n]


def test_the_first_check_point_that_collides_is_told_and_the_start_is_none():
    world = plane()
    a, b = np.array([0.0, 0.0]), np.array([3.0, 4.0])
    # The line is inside from 1.4 / 3 to 1 / 2 of its length.
    assert first_contact(world.space, a, b, FINE) == pytest.approx(12 / 25)
    assert first_contact(world.space, a, b, 1.01) == 2.0
    inside = np.array([2.0, 1.0])
    assert first_contact(world.space, a, inside, 9.0) == 1.0
    assert first_contact(world.space, inside, b, 9.0) == 2.0


def test_forward_the_last_visible_point_takes_the_place_of_the_middle_one():
    pulled = after(shortcut_forward, plane(), CORNER, ONE, FINE)
    np.testing.assert_allclose(pulled, [[0, 0], [2, 4], [8, 4]], atol=1e-12)


def test_points_twice_as_dense_bring_the_middle_one_further():
    # P_T every half: 2.5 is seen, 3 is not.
    pulled = after(shortcut_forward, plane(), CORNER, 0.5 * ONE, FINE)
    np.testing.assert_allclose(pulled, [[0, 0], [2.5, 4], [8, 4]], atol=1e-12)


def test_sparse_check_points_do_not_see_the_box_until_they_fall_into_it():
    # Of the lines to 3, 4 and 5 no third or quarter is inside, of the one to 6 the first quarter.
    pulled = after(shortcut_forward, plane(), CORNER, ONE, 2.0)
    np.testing.assert_allclose(pulled, [[0, 0], [5, 4], [8, 4]], atol=1e-12)


def test_forward_i_moves_on_after_a_deletion_too():
    straight = [[x, 0.0] for x in range(6)]
    pulled = after(shortcut_forward, plane([]), straight, ONE, ONE)
    np.testing.assert_allclose(pulled, [[0, 0], [2, 0], [4, 0], [5, 0]], atol=1e-12)


def test_a_corner_is_cut_two_lines_back_where_the_line_of_sight_collides():
    # P_C(12) of 25 on the line to P_T(1) = (1, 4); from there all of the rest is seen.
    cut = after(cut_corners, plane(), CORNER, ONE, FINE, 0.05)
    np.testing.assert_allclose(cut, [[0, 0], [0.48, 1.92], [8, 4]], atol=1e-12)


def test_where_there_are_no_two_lines_the_corner_lies_before_the_first():
    # P_T at (4, 4) and (8, 4): P_C(4) of 10 on the line to P_T(0), which is P_1.
    cut = after(cut_corners, plane(), CORNER, 4.01, 0.57, 0.05)
    np.testing.assert_allclose(cut, [[0, 0], [0, 1.6], [8, 4]], atol=1e-12)


def test_the_blocked_point_follows_the_new_corner():
    # A second box, close to the new corner, hides P_2 from it, and there k forbids another cut.
    world = plane([*BOX, [[1.15, 2.05], [1.45, 2.2]]])
    cut = after(cut_corners, world, CORNER, ONE, FINE, 1.9)
    np.testing.assert_allclose(cut, [[0, 0], [0.48, 1.92], [3, 4], [8, 4]], atol=1e-12)


def test_nearer_than_k_no_corner_is_cut():
    to_corner = np.hypot(0.48, 1.92)
    cut = after(cut_corners, plane(), CORNER, ONE, FINE, to_corner - 1e-6)
    assert len(cut) == 3
    assert cut[1, 0] == pytest.approx(0.48)
    kept = after(cut_corners, plane(), CORNER, ONE, FINE, to_corner + 1e-6)
    np.testing.assert_array_equal(kept, CORNER)


def points_between(a, b, spacing):
    """Return the points that follow a on the way to b, evenly, no farther apart than asked."""
    n = int(np.linalg.norm(b - a) / spacing) + 1
    return [a + j / n * (b - a) for j in range(1, n + 1)]


def collision(world, p_i, p_t, checks):
    """Return the number of the first P_C that collides and how many there are, or None."""
    line = points_between(p_i, p_t, checks)
    hits = [m for m, p_c in enumerate(line, 1) if not world.is_edge_valid(p_c, p_c)]
    return (hits[0], len(line)) if hits else None


def first_blocked(world, p, i, targets, checks):
    """Return the points P_T and (n, (m, of so many)) of the first line with a collision."""
    line = points_between(p[i + 1], p[i + 2], targets)
    hits = ((n, collision(world, p[i], p_t, checks)) for n, p_t in enumerate(line, 1))
    return [p[i + 1], *line], next((hit for hit in hits if hit[1] is not None), None)


def forward_in_words(world, path, targets, checks):
    """Return a path after step 1 of the paper."""
    p, i = list(path), 0
    while i + 2 < len(p):
        p_t, blocked = first_blocked(world, p, i, targets, checks)
        if blocked is None:
            del p[i + 1]
        else:
            p[i + 1] = p_t[blocked[0] - 1]
        i += 1
    return p


def corners_in_words(world, path, targets, checks, k):
    """Return a path after step 3 of the paper."""
    p, i = list(path), 0
    while i + 2 < len(p):
        p_t, blocked = first_blocked(world, p, i, targets, checks)
        if blocked is None:
            del p[i + 1]
            continue
        n, (m, of) = blocked
        corner = p[i] + m / of * (p_t[max(n - 2, 0)] - p[i])
        if min(np.linalg.norm(corner - p[i]), np.linalg.norm(p[i + 1] - p[i])) >= k:
            p[i + 1 : i + 2] = [corner, p_t[n]]
        i += 1
    return p


def steps_in_words(world, path, k, targets, checks):
    """Return a path after steps 1, 2 and 3 of the paper."""
    p = forward_in_words(world, path, targets, checks)
    p = forward_in_words(world, p[::-1], targets, checks)[::-1]
    return corners_in_words(world, p, targets, checks, k)


def gate(dof):
    """Return a problem with a wall across that is passed only along the last axis."""
    low, high = np.zeros(dof), np.full(dof, 10.0)
    wall = np.array([low, high])
    wall[:, 0], wall[:, -1] = (4.5, 5.5), (0.0, 7.0)
    start = np.full(dof, 2.0)
    goal = start.copy()
    goal[0] = 8.0
    return map_problem(
        BoxMap(name='gate', bounds=[low, high], obstacles=[wall], start=start, goal=goal)
    )


@functools.cache
def case(name):
    """Return the problem of a name, and k and spacings that suit it."""
    if name != 'arm':
        return gate(int(name[-1])), 0.3
    world = wearer_world()
    pair = blocked_pair(np.random.default_rng(13), world)
    return PlanningProblem(world=world, q_start=pair[0], q_goals=pair[1:]), 0.1


everywhere = pytest.mark.parametrize('name', ['gate_2', 'gate_3', 'gate_6', 'arm'])


@everywhere
def test_the_steps_are_those_of_the_paper_in_numpy(name):
    problem, spacing = case(name)
    grow = RRTOptions(step_size=5 * spacing, near_bias=0.0, time_limit=60.0)
    n_cut = 0
    for seed in range(6):
        raw = plan(problem, grow, np.random.default_rng(seed)).path.waypoints
        # Other spacings of P_T and P_C and another k: none may stand for another.
        for k, targets, checks in np.array([[1, 1, 1], [2, 0.7, 0.4], [0.5, 0.3, 1.3]]) * spacing:
            pulled = forward_in_words(problem.world, raw, targets, checks)
            np.testing.assert_allclose(
                after(shortcut_forward, problem.world, raw, targets, checks), pulled, atol=1e-9
            )
            cut = all_steps(problem.world, raw, k, targets, checks)
            words = steps_in_words(problem.world, raw, k, targets, checks)
            np.testing.assert_allclose(cut, words, atol=1e-9)
            n_cut += any(np.abs(raw - q).max(axis=1).min() > 1e-9 for q in cut)
    assert n_cut > 6


@everywhere
def test_a_plan_as_printed_keeps_its_ends_and_its_seed(name):
    problem, spacing = case(name)
    options = PrintedRRTHOptions(
        step_size=10 * spacing,
        # In six dimensions uniform draws alone take millions.
        goal_bias=0.2,
        corner_spacing=1.3 * spacing,
        target_spacing=0.7 * spacing,
        check_spacing=0.4 * spacing,
        club_attempts=0,
        max_samples=200_000,
        time_limit=60.0,
    )
    world = problem.world
    for seed in range(2):
        first, again = (plan(problem, options, np.random.default_rng(seed)) for _ in range(2))
        assert first.status is PlanStatus.SOLVED
        assert first.is_reproducible
        q = first.path.waypoints
        assert q.tobytes() == again.path.waypoints.tobytes()
        assert first.n_samples == again.n_samples > 0
        assert (q[0] == problem.q_start).all()
        assert (q[-1] == problem.q_goals).all(axis=1).any()
        assert first.path.length < first.raw_path.length
        raw = first.raw_path.waypoints
        assert path_length(raw, len(raw)) == pytest.approx(first.raw_path.length)
        words = steps_in_words(world, raw, *np.array([1.3, 0.7, 0.4]) * spacing)
        np.testing.assert_allclose(q, words, atol=1e-9)
        # One tree, from the start; a parent comes before its child, and its edges are proven.
        (tree,) = first.trees
        assert tree.parents[0] == -1
        assert ((tree.parents[1:] >= 0) & (tree.parents[1:] < np.arange(1, len(tree.nodes)))).all()
        for node, parent in zip(tree.nodes[1:], tree.parents[1:], strict=True):
            assert world.is_edge_valid(tree.nodes[parent], node)
