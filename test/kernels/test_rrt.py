# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Growth: rooted trees of free edges, a path where they meet, and points of the club kept off."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from rrth_planner.kernels.search.random import random_state
from rrth_planner.kernels.search.rrt import is_rejected_by_club
from rrth_planner.model.status import PlanStatus
from rrth_planner.planning import buffers, rrt, rrt_h
from rrth_planner.planning.box_map import BoxMap, map_problem
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import RRTHOptions, RRTOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.problem import PlanningProblem
from worlds import (
    blocked_pair,
    edge_touches,
    free_configuration,
    MARGIN,
    RAY,
    table_1_arm,
    wearer,
    wearer_world,
)

STEP = 0.5


def grow(world, q_start, q_goals, rng, budget, **options):
    """Return what one growth brought, and the room it grew in, which was filled with NaN."""
    problem = PlanningProblem(world=world, q_start=q_start, q_goals=q_goals)
    chosen = RRTOptions(**{'step_size': STEP, **options})
    room = buffers.workspace(4, rrt.room_for(len(q_goals), (), budget))
    room.tree_q[:] = np.nan
    never = Deadline(1000.0, lambda: False)
    return rrt.search(problem, chosen, rng, never, budget=budget), room


@pytest.fixture(scope='module')
def blocked_pairs():
    """Pairs of free configurations whose straight edge is not free."""
    world, rng = wearer_world(), np.random.default_rng(41)
    return [blocked_pair(rng, world) for _ in range(25)]


@pytest.mark.parametrize('near_bias', [0.0, 0.9])
@pytest.mark.parametrize('is_bidirectional', [False, True])
def test_trees_are_rooted_acyclic_and_their_edges_free(blocked_pairs, near_bias, is_bidirectional):
    world, rng = wearer_world(), np.random.default_rng(42)
    arm, scene = table_1_arm(), wearer()
    options = {'near_bias': near_bias, 'is_bidirectional': is_bidirectional}
    n_met = 0
    for q_start, q_goal in blocked_pairs[:12]:
        q_goals = np.stack([q_goal, free_configuration(rng, world)])
        grown, room = grow(world, q_start, q_goals, rng, 200, **options)
        assert 1 <= grown.n_samples <= 200
        assert grown.is_reproducible
        assert len(grown.trees) == 1 + is_bidirectional
        assert np.array_equal(grown.trees[0].nodes[0], q_start)
        assert np.array_equal(room.tree_q[0, 1, :2], q_goals)
        for side, tree in enumerate(grown.trees):
            n_roots = (1, 2)[side]
            assert (tree.parents[:n_roots] == -1).all()
            assert np.isnan(room.tree_q[0, side, len(tree.nodes) :]).all()
            for i in range(n_roots, len(tree.nodes)):
                # A parent is older than its child: no cycle, and every way ends at a root.
                assert 0 <= tree.parents[i] < i
                q, before = tree.nodes[i], tree.nodes[tree.parents[i]]
                assert world.is_in_bounds(q)
                assert np.linalg.norm(q - before) <= STEP + 1e-12
                assert not edge_touches(arm, scene, MARGIN, RAY, before, q, 1e-3)
        assert np.isnan(room.tree_q[1]).all()
        if grown.path is None:
            assert grown.status is PlanStatus.SAMPLE_LIMIT
            assert grown.n_samples == 200
            continue
        n_met += 1
        path = grown.path.waypoints
        assert np.array_equal(path[0], q_start)
        assert (path[-1] == q_goals).all(axis=1).any()
        # All but the edge at which the trees meet are edges of one of them.
        known = {tuple(q) for tree in grown.trees for q in tree.nodes} | set(map(tuple, q_goals))
        assert all(tuple(q) in known for q in path)
        for a, b in zip(path[:-1], path[1:], strict=True):
            assert not edge_touches(arm, scene, MARGIN, RAY, a, b, 1e-3)
    assert n_met > (6 if is_bidirectional else 2)


def test_growth_stops_where_the_trees_are_full(blocked_pairs, monkeypatch):
    world, rng = wearer_world(), np.random.default_rng(43)
    q_start, q_goal = blocked_pairs[0]
    # A step so short that nothing meets, and room for a few nodes.
    options = {'step_size': 0.01, 'goal_bias': 0.0, 'max_samples': 3000, 'time_limit': 1000.0}
    problem = PlanningProblem(world=world, q_start=q_start, q_goals=[q_goal])
    for home, kind in ((rrt, RRTOptions), (rrt_h, RRTHOptions)):
        monkeypatch.setattr(home, 'room_for', lambda *_: 40)
        # Each thread has arrays of its own.
        with ThreadPoolExecutor(1) as thread:
            result = thread.submit(plan, problem, kind(**options), rng).result()
        assert result.status is PlanStatus.SAMPLE_LIMIT
        assert result.path is None
        assert all(len(tree.nodes) <= 40 for tree in result.trees)
        assert max(len(tree.nodes) for tree in result.trees) >= 39


@pytest.mark.parametrize('near_bias', [0.0, 0.9])
def test_the_same_seed_grows_the_same_trees(blocked_pairs, near_bias):
    world = wearer_world()
    for pair in blocked_pairs[:4]:
        first, second = (
            grow(world, pair[0], pair[1:], np.random.default_rng(9), 60, near_bias=near_bias)[0]
            for _ in range(2)
        )
        assert first.n_samples == second.n_samples
        for a, b in zip(first.trees, second.trees, strict=True):
            assert a.nodes.tobytes() == b.nodes.tobytes()
            assert a.parents.tobytes() == b.parents.tobytes()


def test_draws_near_the_ends_make_the_way_out_of_a_tight_place_short():
    # A cell of 4 with a door of 1, in a hall of 100.
    walls = [
        [[8, 8], [12, 8.5]],
        [[8, 11.5], [12, 12]],
        [[8, 8], [8.5, 12]],
        [[11.5, 8], [12, 9]],
        [[11.5, 10], [12, 12]],
    ]
    cell = BoxMap(
        name='cell',
        bounds=[[0, 0], [100, 100]],
        obstacles=walls,
        start=[10, 11],
        goal=[80, 20],
    )
    n_drawn = []
    for near_bias in (0.0, 0.9):
        options = RRTOptions(step_size=10.0, near_bias=near_bias, time_limit=1000.0)
        results = [plan(map_problem(cell), options, np.random.default_rng(i)) for i in range(40)]
        assert all(result.status is PlanStatus.SOLVED for result in results)
        n_drawn.append(np.mean([result.n_samples for result in results]))
    assert n_drawn[1] < 0.5 * n_drawn[0]


def test_the_club_turns_away_only_points_in_a_crowd():
    rng = random_state(np.random.default_rng(48))
    club = np.zeros((3, 4))
    club[2, 0] = 0.45
    q, far = np.zeros(4), np.full(4, 3.0)

    def is_rejected(q, club, *options):
        return is_rejected_by_club(q, club, np.array([0.0, 0.0, 0.0, 0.0, 0.0, *options]), rng)

    assert is_rejected(q, club, 0.5, 2, 1.0)
    assert not is_rejected(q, club, 0.5, 3, 1.0)
    assert not is_rejected(q, club, 0.4, 2, 1.0)
    assert not is_rejected(q, club, 0.5, 2, 0.0)
    assert not is_rejected(far, club, 0.5, 0, 1.0)
    assert not is_rejected(q, np.empty((0, 4)), 0.5, 0, 1.0)
    share = np.mean([is_rejected(q, club, 0.5, 2, 0.9) for _ in range(4000)])
    assert abs(share - 0.9) < 0.02
