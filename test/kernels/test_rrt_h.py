# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Growth, the three steps and the draws of RRT-H."""

import numpy as np
import pytest
from rrth_planner.kernels.rrt import advance, is_rejected_by_club
from rrth_planner.kernels.rrt_h import pull_taut
from rrth_planner.kernels.sampling import draw_informed, draw_uniform
from rrth_planner.kernels.tree import nearest, path_length, steer, trace_path
from worlds import edge_touches, free_configuration, MARGIN, RAY, table_1_arm, wearer, wearer_world

CAPACITY = 400


def grow(world, q_start, q_goals, rng, n_draws, best_cost=np.inf, club=None, step_size=0.5):
    """Return two trees after some draws: nodes, parents, sizes, meeting, draws made."""
    tree_q = np.full((2, CAPACITY, 4), np.nan)
    parents = np.full((2, CAPACITY), -1, dtype=np.int64)
    tree_q[0, 0], tree_q[1, : len(q_goals)] = q_start, q_goals
    n_goals = len(q_goals)
    sizes = np.array([1, n_goals, 0, n_goals], dtype=np.int64)
    meeting = np.full(2, -1, dtype=np.int64)
    drawn = advance(
        world.edge_check,
        world.free_radius,
        world.resolution,
        world.robot,
        world.obstacles,
        world.bounds,
        step_size,
        0.0,
        0.05,
        True,
        best_cost,
        np.empty((0, 4)) if club is None else club,
        0.5,
        2,
        0.9,
        n_draws,
        rng,
        tree_q,
        parents,
        sizes,
        meeting,
    )
    return tree_q, parents, sizes, meeting, drawn


@pytest.fixture(scope='module')
def blocked_pairs():
    """Pairs of free configurations whose straight edge is not free."""
    world, rng = wearer_world(), np.random.default_rng(41)
    pairs = []
    while len(pairs) < 25:
        pair = free_configuration(rng, world), free_configuration(rng, world)
        if not world.is_edge_valid(*pair):
            pairs.append(pair)
    return pairs


def test_trees_are_rooted_acyclic_and_their_edges_free(blocked_pairs):
    world, rng = wearer_world(), np.random.default_rng(42)
    arm, scene = table_1_arm(), wearer()
    n_met = 0
    for q_start, q_goal in blocked_pairs[:12]:
        q_goals = np.stack([q_goal, free_configuration(rng, world)])
        tree_q, parents, sizes, meeting, drawn = grow(world, q_start, q_goals, rng, 200)
        assert 1 <= drawn <= 200
        assert np.array_equal(tree_q[0, 0], q_start)
        assert np.array_equal(tree_q[1, :2], q_goals)
        for side, n_roots in ((0, 1), (1, 2)):
            assert (parents[side, :n_roots] == -1).all()
            assert np.isnan(tree_q[side, sizes[side] :]).all()
            for i in range(n_roots, sizes[side]):
                # A parent is older than its child: no cycle, and every way ends at a root.
                assert 0 <= parents[side, i] < i
                q, before = tree_q[side, i], tree_q[side, parents[side, i]]
                assert world.is_in_bounds(q)
                assert np.linalg.norm(q - before) <= 0.5 + 1e-12
                assert not edge_touches(arm, scene, MARGIN, RAY, before, q, 1e-3)
        if meeting[0] >= 0:
            n_met += 1
            ends = tree_q[0, meeting[0]], tree_q[1, meeting[1]]
            assert not edge_touches(arm, scene, MARGIN, RAY, *ends)
            path = np.full((CAPACITY, 4), np.nan)
            n = trace_path(tree_q, parents, meeting[0], meeting[1], path)
            assert np.array_equal(path[0], q_start)
            assert (path[n - 1] == q_goals).all(axis=1).any()
            assert np.isnan(path[n:]).all()
        else:
            assert (meeting == -1).all()
    assert n_met > 6


def test_a_path_without_room_is_not_traced():
    tree_q = np.zeros((2, 8, 2))
    tree_q[0, :5, 0] = np.arange(5)
    tree_q[1, :3, 0] = [7, 6, 5]
    parents = np.array([[-1, 0, 1, 2, 3, -1, -1, -1], [-1, 0, 1, -1, -1, -1, -1, -1]])
    path = np.full((8, 2), np.nan)
    assert trace_path(tree_q, parents, 4, 2, path) == 8
    assert np.array_equal(path[:, 0], np.arange(8))
    assert trace_path(tree_q, parents, 4, 2, np.empty((7, 2))) == 0
    assert trace_path(tree_q, parents, 4, 2, np.empty((4, 2))) == 0
    tree_q[1, 2, 0] = 4
    assert trace_path(tree_q, parents, 4, 2, path) == 7


def test_growth_stops_where_the_trees_are_full(blocked_pairs):
    world, rng = wearer_world(), np.random.default_rng(43)
    q_start, q_goal = blocked_pairs[0]
    # A step so short that nothing meets.
    _, _, sizes, meeting, drawn = grow(world, q_start, q_goal[None], rng, 3000, step_size=1e-4)
    assert (sizes[:2] <= CAPACITY).all()
    assert drawn == 3000
    assert (meeting == -1).all()


def test_the_same_seed_grows_the_same_trees(blocked_pairs):
    world = wearer_world()
    for pair in blocked_pairs[:4]:
        first, second = (
            grow(world, pair[0], pair[1][None], np.random.default_rng(9), 60) for _ in range(2)
        )
        for a, b in zip(first[:4], second[:4], strict=True):
            assert a.tobytes() == b.tobytes()


def taut(world, waypoints, spacing=0.01, room=64):
    path = np.full((room, 4), np.nan)
    path[: len(waypoints)] = waypoints
    arguments = (world.edge_check, world.resolution, world.robot, world.obstacles)
    n = pull_taut(*arguments, path, len(waypoints), spacing, 30)
    return path[:n]


def test_pulling_taut_never_lengthens_and_keeps_both_ends(blocked_pairs):
    world, arm, scene = wearer_world(), table_1_arm(), wearer()
    rng = np.random.default_rng(44)
    n_paths = 0
    for q_start, q_goal in blocked_pairs:
        tree_q, parents, _, meeting, _ = grow(world, q_start, q_goal[None], rng, 300)
        if meeting[0] < 0:
            continue
        n_paths += 1
        path = np.empty((CAPACITY, 4))
        n = trace_path(tree_q, parents, meeting[0], meeting[1], path)
        raw = path[:n].copy()
        for spacing in (0.3, 0.01):
            pulled = taut(world, raw, spacing)
            assert path_length(pulled, len(pulled)) <= path_length(raw, n) * (1 + 1e-12)
            assert np.array_equal(pulled[0], raw[0])
            assert np.array_equal(pulled[-1], raw[-1])
            for a, b in zip(pulled[:-1], pulled[1:], strict=True):
                assert not edge_touches(arm, scene, MARGIN, RAY, a, b)
                assert world.is_edge_valid(a, b) or np.linalg.norm(a - b) < 1e-9
    assert n_paths > 15


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


def test_a_full_buffer_takes_no_further_waypoint(blocked_pairs):
    world, rng = wearer_world(), np.random.default_rng(47)
    n_paths = 0
    for q_start, q_goal in blocked_pairs:
        tree_q, parents, _, meeting, _ = grow(world, q_start, q_goal[None], rng, 300)
        if meeting[0] < 0:
            continue
        path = np.empty((CAPACITY, 4))
        n = trace_path(tree_q, parents, meeting[0], meeting[1], path)
        assert len(taut(world, path[:n], room=n)) <= n
        n_paths += 1
    assert n_paths > 15


def test_the_club_turns_away_only_points_in_a_crowd():
    rng = np.random.default_rng(48)
    club = np.zeros((3, 4))
    club[2, 0] = 0.45
    q, far = np.zeros(4), np.full(4, 3.0)
    assert is_rejected_by_club(q, club, 0.5, 2, 1.0, rng)
    assert not is_rejected_by_club(q, club, 0.5, 3, 1.0, rng)
    assert not is_rejected_by_club(q, club, 0.4, 2, 1.0, rng)
    assert not is_rejected_by_club(q, club, 0.5, 2, 0.0, rng)
    assert not is_rejected_by_club(far, club, 0.5, 0, 1.0, rng)
    assert not is_rejected_by_club(q, np.empty((0, 4)), 0.5, 0, 1.0, rng)
    share = np.mean([is_rejected_by_club(q, club, 0.5, 2, 0.9, rng) for _ in range(4000)])
    assert abs(share - 0.9) < 0.02


def test_uniform_draws_fill_the_bounds_evenly():
    rng = np.random.default_rng(49)
    bounds = np.array([[-1.0, 2.0, -3.0], [1.0, 2.5, 0.0]])
    q = np.empty((8000, 3))
    for row in q:
        draw_uniform(bounds, rng, row)
    share = (q - bounds[0]) / (bounds[1] - bounds[0])
    assert ((share >= 0.0) & (share <= 1.0)).all()
    for k in range(3):
        assert kolmogorov(share[:, k]) < 1.95 / np.sqrt(len(q))


def kolmogorov(values):
    """Return the greatest gap between a sample and the uniform distribution."""
    x, n = np.sort(values), len(values)
    steps = np.arange(1, n + 1) / n
    return max((steps - x).max(), (x - steps + 1.0 / n).max())


@pytest.mark.parametrize('dof', [2, 3, 4, 6])
def test_informed_draws_fill_the_ellipsoid_evenly(dof):
    rng = np.random.default_rng(50 + dof)
    q_start, q_goal = rng.uniform(-1, 1, (2, dof))
    focal = np.linalg.norm(q_goal - q_start)
    best = 1.3 * focal
    bounds = np.stack([np.full(dof, -20.0), np.full(dof, 20.0)])
    q = np.empty((8000, dof))
    for row in q:
        assert draw_informed(bounds, q_start, q_goal, best, rng, row)
    detour = np.linalg.norm(q - q_start, axis=1) + np.linalg.norm(q - q_goal, axis=1)
    assert (detour <= best * (1 + 1e-12)).all()
    # Back to the unit ball: along the line of the foci, and square to it.
    e = (q_goal - q_start) / focal
    local = q - 0.5 * (q_start + q_goal)
    along = local @ e
    square = local - along[:, None] * e
    minor = 0.5 * np.sqrt(best**2 - focal**2)
    unit = np.concatenate([(along / (0.5 * best))[:, None], square / minor], axis=1)
    radius = np.linalg.norm(unit, axis=1)
    assert kolmogorov(radius**dof) < 1.95 / np.sqrt(len(q))
    directions = unit / radius[:, None]
    assert np.abs(directions.mean(axis=0)).max() < 0.05
    # No direction is preferred: the second moments are those of a sphere.
    assert abs((directions[:, 0] ** 2).mean() - 1.0 / dof) < 0.02


def test_informed_draws_stay_within_the_bounds_and_say_when_nothing_can_be_better():
    rng = np.random.default_rng(57)
    bounds = np.array([[-0.2, -0.2], [1.2, 0.05]])
    q_start, q_goal, q = np.zeros(2), np.array([1.0, 0.0]), np.empty(2)
    n_drawn = 0
    for _ in range(2000):
        # In a narrow strip all its tries may fail.
        if draw_informed(bounds, q_start, q_goal, 1.5, rng, q):
            n_drawn += 1
            assert (q >= bounds[0]).all()
            assert (q <= bounds[1]).all()
            assert np.linalg.norm(q - q_start) + np.linalg.norm(q - q_goal) <= 1.5 + 1e-12
    assert n_drawn > 1900
    assert not draw_informed(bounds, q_start, q_goal, 1.0, rng, q)
    assert not draw_informed(bounds, q_start, q_goal, 0.5, rng, q)
    assert not draw_informed(bounds, q_start, q_start, 0.5, rng, q)
    outside = np.array([[5.0, 5.0], [6.0, 6.0]])
    assert not draw_informed(outside, q_start, q_goal, 1.5, rng, q)


def test_nearest_and_steer_are_what_their_names_say():
    rng = np.random.default_rng(58)
    nodes = rng.uniform(-1, 1, (50, 4))
    for _ in range(100):
        q, size = rng.uniform(-1, 1, 4), int(rng.integers(1, 51))
        found = nearest(nodes, size, q)
        assert found == np.argmin(np.linalg.norm(nodes[:size] - q, axis=1))
        q_new = np.empty(4)
        step = rng.uniform(0.01, 3.0)
        steer(nodes[found], q, step, q_new)
        gap = np.linalg.norm(q - nodes[found])
        if gap <= step:
            assert np.array_equal(q_new, q)
        else:
            assert np.linalg.norm(q_new - nodes[found]) == pytest.approx(step)
            assert np.linalg.norm(q - q_new) == pytest.approx(gap - step)
