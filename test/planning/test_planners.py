# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What every planner keeps, whatever the algorithm and the number of joints."""

from dataclasses import replace
import functools

import numpy as np
import pytest
from rrth_planner.collision import reference_checker
from rrth_planner.collision.world import arm_world
from rrth_planner.io.map_file import map_from_mapping
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.status import PlanStatus
from rrth_planner.planning import rrt_star
from rrth_planner.planning.box_map import BoxMap, map_problem, map_world
from rrth_planner.planning.edge_checks import by_check_points, sampled
from rrth_planner.planning.options import (
    InformedRRTStarOptions,
    PrintedRRTHOptions,
    RRTHOptions,
    RRTOptions,
    RRTStarOptions,
    RRTStarSmartOptions,
)
from rrth_planner.planning.planner import plan
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.visibility_graph import shortest_path
import worlds

COMMON = {'time_limit': 60.0, 'max_samples': 1500}
STAR = {**COMMON, 'improve_time': 60.0}
ALGORITHMS = {
    'rrt': RRTOptions(is_bidirectional=False, **{**COMMON, 'max_samples': 20000}),
    'rrt_two_trees': RRTOptions(**COMMON),
    'rrt_uniform_draws': RRTOptions(near_bias=0.0, **COMMON),
    'rrt_star': RRTStarOptions(is_bidirectional=False, **STAR),
    'rrt_star_two_trees': RRTStarOptions(**STAR),
    'informed': InformedRRTStarOptions(is_bidirectional=False, **STAR),
    'informed_two_trees': InformedRRTStarOptions(**STAR),
    'smart': RRTStarSmartOptions(is_bidirectional=False, **STAR),
    'smart_two_trees': RRTStarSmartOptions(**STAR),
    'rrt_h': RRTHOptions(is_bidirectional=False, **{**STAR, 'max_samples': 20000}),
    'rrt_h_two_trees': RRTHOptions(**STAR),
    'rrt_h_uniform_draws': RRTHOptions(near_bias=0.0, **STAR),
}
STAR_LIKE = [name for name, o in ALGORITHMS.items() if isinstance(o, RRTStarOptions)]
# Lengths of the exact shortest paths (visibility graph on the corners).
SHORTEST = {'c_shape': 113.07113394, 'spiral': 158.83831257, 'fence': 361.54565595}


def _wall_map(dof):
    """Return a map of two walls: past one along the second axis, past the other along the last."""
    low, high = np.zeros(dof), np.full(dof, 10.0)
    walls = np.array([[low, high], [low, high]])
    walls[0, :, 0], walls[0, :, 1] = (3.5, 4.5), (0.0, 7.0)
    walls[1, :, 0], walls[1, :, -1] = (6.0, 7.0), (0.0, 7.0)
    start, goal = np.full(dof, 2.0), np.full(dof, 2.0)
    goal[0] = 9.0
    return BoxMap(name=f'wall_{dof}', bounds=[low, high], obstacles=walls, start=start, goal=goal)


def _map(name):
    return map_from_mapping(load_yaml(resource_path(f'config/maps/{name}.yaml')), name)


def _is_box_free(box_map, q_from, q_to):
    """Judge an edge of a map by dense points, within it and none of them deep inside a box."""
    low, high = box_map.bounds
    if not all(((q >= low) & (q <= high)).all() for q in (q_from, q_to)):
        return False
    n = int(np.linalg.norm(q_to - q_from) / 0.01) + 2
    points = q_from + np.linspace(0.0, 1.0, n)[:, None] * (q_to - q_from)
    deep = 1e-6
    inside = (points[:, None] > box_map.obstacles[:, 0] + deep) & (
        points[:, None] < box_map.obstacles[:, 1] - deep
    )
    return not inside.all(axis=2).any()


@functools.cache
def _problems():
    """Return name -> (problem, judge of an edge, factor of the step size)."""
    problems = {}
    for dof in (2, 3, 6):
        box_map = _wall_map(dof)
        problems[f'wall_{dof}'] = (
            map_problem(box_map),
            functools.partial(_is_box_free, box_map),
            2.0,
        )
    arm, scene = worlds.table_1_arm(), worlds.wearer()
    world = arm_world(arm, scene, 0.0, 1.0)
    start = np.array([0.0, -0.35, 1.5707963267948966, 1.5707963267948966])
    # Postures round the body, the straight ways to which are blocked.
    rng, goals = np.random.default_rng(5), []
    while len(goals) < 2:
        q = rng.uniform(*arm.bounds)
        if world.is_valid(q) and not world.is_edge_valid(start, q):
            goals.append(q)
    problems['arm_4'] = (
        PlanningProblem(world=world, q_start=start, q_goals=goals),
        lambda a, b: (
            all(((q >= arm.bounds[0]) & (q <= arm.bounds[1])).all() for q in (a, b))
            and not worlds.edge_touches(arm, scene, 0.0, 1.0, a, b, 2e-3)
        ),
        1.0,
    )
    return problems


def test_no_goal_of_the_problems_is_reached_by_a_straight_edge():
    for problem, is_free, _ in _problems().values():
        for q in problem.q_goals:
            assert problem.world.is_valid(q)
            assert not problem.world.is_edge_valid(problem.q_start, q)
            assert not is_free(problem.q_start, q)


def _options(algorithm, factor):
    options = ALGORITHMS[algorithm]
    return replace(options, step_size=options.step_size * factor)


@functools.cache
def _solved(algorithm, name, seed=3):
    problem, _, factor = _problems()[name]
    return plan(problem, _options(algorithm, factor), np.random.default_rng(seed))


PROBLEMS = ('wall_2', 'wall_3', 'arm_4', 'wall_6')
everything = pytest.mark.parametrize(
    ('algorithm', 'name'), [(a, p) for a in ALGORITHMS for p in PROBLEMS]
)


@everything
def test_a_path_leads_from_start_to_a_goal_by_edges_that_the_checker_finds_free(algorithm, name):
    problem, is_free, _ = _problems()[name]
    result = _solved(algorithm, name)
    assert result.status is PlanStatus.SOLVED
    q = result.path.waypoints
    assert (q[0] == problem.q_start).all()
    assert (np.abs(problem.q_goals - q[-1]).max(axis=1) == 0.0).any()
    assert all(is_free(a, b) for a, b in zip(q[:-1], q[1:], strict=True))


@everything
def test_the_cost_is_the_length_and_never_rises(algorithm, name):
    result = _solved(algorithm, name)
    assert result.cost_history[-1] == pytest.approx(result.path.length, rel=1e-9)
    assert (np.diff(result.cost_history) < 0.0).all()
    assert (np.diff(result.sample_history) >= 0).all()
    assert (np.diff(result.time_history) >= 0.0).all()
    assert len(result.time_history) == len(result.cost_history) == len(result.sample_history)
    assert result.time_history[0] >= 0.0
    assert result.time_history[-1] <= result.planning_time
    assert result.sample_history[-1] <= result.n_samples
    assert result.raw_path is None or result.path.length <= result.raw_path.length + 1e-9


@everything
def test_the_edges_of_the_trees_are_free_and_lead_back_to_a_root(algorithm, name):
    _, is_free, _ = _problems()[name]
    result = _solved(algorithm, name)
    assert result.n_samples > 0
    assert len(result.trees) == 1 + ALGORITHMS[algorithm].is_bidirectional
    assert sum(len(tree.nodes) for tree in result.trees) >= 4
    for tree in result.trees:
        children = np.flatnonzero(tree.parents >= 0)
        # A parent comes before its children, so there is no cycle.
        assert (tree.parents[children] < children).all()
        some = children[:: max(1, len(children) // 60)]
        assert all(is_free(tree.nodes[tree.parents[i]], tree.nodes[i]) for i in some)


@everything
def test_the_same_seed_gives_the_same_bytes(algorithm, name):
    problem, _, factor = _problems()[name]
    again = plan(problem, _options(algorithm, factor), np.random.default_rng(3))
    first = _solved(algorithm, name)
    assert again.path.waypoints.tobytes() == first.path.waypoints.tobytes()
    assert again.cost_history == first.cost_history
    assert [t.nodes.tobytes() for t in again.trees] == [t.nodes.tobytes() for t in first.trees]


@pytest.mark.parametrize('algorithm', STAR_LIKE)
@pytest.mark.parametrize('name', PROBLEMS)
def test_the_best_cost_of_a_tree_never_rises_from_draw_to_draw(algorithm, name, monkeypatch):
    told = []

    def spied(advance):
        def spy(*arguments):
            made = advance(*arguments)
            told.append(arguments[-1][:made].copy())
            return made

        return spy

    for kernel in (rrt_star.rrt_star, rrt_star.informed_rrt_star, rrt_star.rrt_star_smart):
        monkeypatch.setattr(kernel, 'advance', spied(kernel.advance))
    problem, _, factor = _problems()[name]
    for seed in (4, 5):
        told.clear()
        result = plan(problem, _options(algorithm, factor), np.random.default_rng(seed))
        costs = np.concatenate(told)
        assert len(costs) == result.n_samples
        assert (costs[1:] <= costs[:-1]).all()
        assert costs[-1] == pytest.approx(result.path.length, rel=1e-9)
        assert name == 'wall_6' or len(np.unique(costs[np.isfinite(costs)])) > 1


@pytest.mark.parametrize('algorithm', STAR_LIKE)
def test_costs_of_the_tree_are_the_lengths_of_its_branches(algorithm):
    # The best path's length is recomputed from its waypoints, costs came by propagation.
    result = _solved(algorithm, 'wall_3')
    assert result.cost_history[-1] == pytest.approx(result.path.length, rel=1e-9)


@pytest.mark.parametrize('algorithm', ALGORITHMS)
def test_planning_can_be_cancelled_and_ends_in_time(algorithm):
    problem, _, factor = _problems()['wall_6']
    options = _options(algorithm, factor)
    cancelled = plan(problem, options, np.random.default_rng(0), lambda: True)
    assert cancelled.status is PlanStatus.CANCELLED
    assert cancelled.path is None
    short = replace(options, time_limit=1e-3, max_samples=10**6)
    assert plan(problem, short, np.random.default_rng(0)).status in (
        PlanStatus.TIMEOUT,
        PlanStatus.SOLVED,
    )


@pytest.mark.parametrize('algorithm', ALGORITHMS)
def test_a_goal_behind_a_closed_wall_is_not_reached(algorithm):
    closed = _wall_map(2)
    wall = np.array([[[4.5, 0.0], [5.5, 10.0]]])
    box_map = BoxMap(
        name='closed', bounds=closed.bounds, obstacles=wall, start=closed.start, goal=closed.goal
    )
    options = replace(_options(algorithm, 2.0), max_samples=500)
    result = plan(map_problem(box_map), options, np.random.default_rng(0))
    assert result.status is PlanStatus.SAMPLE_LIMIT
    assert result.path is None
    assert result.n_samples == 500


@pytest.mark.parametrize('algorithm', ALGORITHMS)
@pytest.mark.parametrize('name', ['wall_3', 'arm_4'])
def test_a_step_adapted_to_the_clearance_still_finds_free_paths(algorithm, name):
    problem, is_free, factor = _problems()[name]
    options = replace(_options(algorithm, factor), clearance_gain=2.0, max_samples=20000)
    if isinstance(options, RRTStarOptions):
        options = replace(options, max_samples=3000)
    result = plan(problem, options, np.random.default_rng(1))
    assert result.status is PlanStatus.SOLVED
    q = result.path.waypoints
    assert all(is_free(a, b) for a, b in zip(q[:-1], q[1:], strict=True))
    if name == 'wall_3' and isinstance(options, RRTStarOptions):
        # Where there is much room the parent that RRT* chooses is further away than the step.
        return
    plain = replace(options, clearance_gain=0.0)
    mean, mean_plain = (
        np.mean(
            [
                np.linalg.norm(np.diff(tree.nodes[[i, tree.parents[i]]], axis=0)).item()
                for seed in range(3)
                for tree in plan(problem, given, np.random.default_rng(seed)).trees
                for i in np.flatnonzero(tree.parents >= 0)
            ]
        )
        for given in (options, plain)
    )
    assert mean < 0.97 * mean_plain


@pytest.mark.parametrize('algorithm', ALGORITHMS)
def test_trees_of_the_last_plan_are_reused_where_they_are_still_free(algorithm):
    box_map = _map('spiral')
    options = replace(_options(algorithm, 1.0), step_size=10.0, max_samples=20000, goal_bias=0.05)
    if isinstance(options, RRTStarOptions):
        options = replace(options, max_samples=4000)
    moved = BoxMap(
        name='moved',
        bounds=box_map.bounds,
        obstacles=box_map.obstacles + np.array([0.02, 0.0]),
        start=box_map.start + 0.1,
        goal=box_map.goal,
    )
    few = replace(options, max_samples=300)
    n_again = n_anew = 0
    for seed in range(6):
        first = plan(map_problem(box_map), options, np.random.default_rng(seed))
        assert first.status is PlanStatus.SOLVED
        anew = plan(map_problem(moved), few, np.random.default_rng(seed + 1))
        again = plan(map_problem(moved), few, np.random.default_rng(seed + 1), previous=first)
        n_anew += anew.status is PlanStatus.SOLVED
        for tree in again.trees:
            for i in np.flatnonzero(tree.parents >= 0)[::7]:
                assert _is_box_free(moved, tree.nodes[tree.parents[i]], tree.nodes[i])
        if again.status is not PlanStatus.SOLVED:
            continue
        n_again += 1
        assert anew.status is not PlanStatus.SOLVED or again.sample_history[0] <= anew.n_samples
        q = again.path.waypoints
        assert (q[0] == moved.start).all()
        assert all(_is_box_free(moved, a, b) for a, b in zip(q[:-1], q[1:], strict=True))
    # The way out of the spiral takes more than 300 draws, unless the trees know it already. Those
    # of RRT* lean on the corners, which at times have moved into their way.
    assert n_again >= (4 if isinstance(options, RRTStarOptions) else 6)
    assert n_anew <= 3 < n_again


@pytest.mark.parametrize('name', SHORTEST)
@pytest.mark.parametrize('is_bidirectional', [False, True])
def test_rrt_h_is_within_a_thousandth_of_the_shortest_path(name, is_bidirectional):
    options = RRTHOptions(
        step_size=10.0,
        corner_spacing=0.05,
        club_attempts=0,
        is_bidirectional=is_bidirectional,
        time_limit=60.0,
    )
    problem = map_problem(_map(name))
    ratios = [
        plan(problem, options, np.random.default_rng(seed)).path.length / SHORTEST[name]
        for seed in range(100)
    ]
    assert min(ratios) >= 1.0 - 1e-8
    assert np.median(ratios) <= 1.001


def test_the_path_club_finds_the_shorter_way_round():
    problem = map_problem(_map('two_ways'))
    common = {
        'step_size': 10.0,
        'corner_spacing': 0.05,
        'club_radius': 8.0,
        'club_budget': 400,
        'time_limit': 60.0,
    }
    shortest = 98.287
    with_club, without = (
        np.mean(
            [
                plan(
                    problem,
                    RRTHOptions(club_attempts=attempts, improve_time=60.0, **common),
                    np.random.default_rng(seed),
                ).path.length
                < 1.01 * shortest
                for seed in range(100)
            ]
        )
        for attempts in (6, 0)
    )
    assert with_club >= 0.99
    assert without < with_club


def test_the_path_club_turns_growths_away_until_their_budget_is_spent():
    problem = map_problem(_map('two_ways'))
    common = {
        'step_size': 10.0,
        'corner_spacing': 0.05,
        'improve_time': 60.0,
        'time_limit': 60.0,
        'club_budget': 70,
    }
    changes = ({'club_radius': 0.0}, {'club_probability': 0.0}, {'club_count': 10**6})
    n_spared = [0] * len(changes)
    for seed in range(10):
        rng = functools.partial(np.random.default_rng, seed)
        first = plan(problem, RRTHOptions(club_attempts=0, **common), rng())
        closed_to_all = RRTHOptions(
            club_attempts=3, club_radius=500.0, club_count=0, club_probability=1.0, **common
        )
        closed = plan(problem, closed_to_all, rng())
        # All of the map is near a member: nobody is let in, and all draws are made in vain.
        assert closed.n_samples == first.n_samples + 3 * 70
        assert closed.path.waypoints.tobytes() == first.path.waypoints.tobytes()
        for k, change in enumerate(changes):
            let_in = plan(problem, replace(closed_to_all, **change), rng())
            assert let_in.n_samples <= closed.n_samples
            n_spared[k] += closed.n_samples - let_in.n_samples
    assert all(n > 0 for n in n_spared)


@pytest.mark.slow
@pytest.mark.parametrize('kind', [RRTStarOptions, InformedRRTStarOptions])
@pytest.mark.parametrize('name', ['c_shape', 'spiral'])
def test_rrt_star_tends_to_the_shortest_path(kind, name):
    options = kind(
        step_size=10.0,
        max_samples=20000,
        improve_time=600.0,
        time_limit=600.0,
        is_bidirectional=False,
    )
    problem = map_problem(_map(name))
    ratios = [
        plan(problem, options, np.random.default_rng(seed)).path.length / SHORTEST[name]
        for seed in range(3)
    ]
    assert np.median(ratios) <= 1.02


@functools.cache
def _excess(kind, name, n_seeds=20, **changes):
    """Return by how much paths exceed the shortest one, a share for each seed; inf: no path."""
    problem, shortest = map_problem(_map(name)), shortest_path(_map(name))[0]
    options = kind(
        step_size=10.0, time_limit=60.0, improve_time=60.0, is_bidirectional=False, **changes
    )
    results = [plan(problem, options, np.random.default_rng(seed)) for seed in range(n_seeds)]
    return np.array([np.inf if r.path is None else r.path.length / shortest - 1 for r in results])


STARS = (RRTStarOptions, InformedRRTStarOptions, RRTStarSmartOptions)


@pytest.mark.parametrize('name', ['c_shape', 'spiral'])
@pytest.mark.parametrize('kind', STARS)
def test_rrt_h_is_shorter_than_others_after_2000_draws_with_each_seed(kind, name):
    ours = _excess(
        RRTHOptions, name, corner_spacing=0.05, corner_moves=0, club_attempts=0, near_bias=0.0
    )
    assert (ours < _excess(kind, name, max_samples=2000)).all()


def test_informed_rrt_star_gains_by_its_ellipse_where_that_is_slim():
    plain, informed = (
        np.median(_excess(kind, 'c_shape_near', max_samples=2000))
        for kind in (RRTStarOptions, InformedRRTStarOptions)
    )
    assert informed < 0.5 * plain


def test_rrt_star_smart_is_nearer_to_the_shortest_path_than_rrt_star():
    for name in ('c_shape', 'spiral'):
        plain, smart = (
            np.median(_excess(kind, name, max_samples=2000))
            for kind in (RRTStarOptions, RRTStarSmartOptions)
        )
        assert smart < 0.5 * plain


@pytest.mark.parametrize('is_bidirectional', [False, True])
def test_every_so_many_draws_of_rrt_star_smart_are_near_a_beacon(is_bidirectional):
    problem, shares = map_problem(_map('c_shape')), []
    for ratio in (10**6, 8, 2):
        options = RRTStarSmartOptions(
            step_size=10.0,
            max_samples=2000,
            biasing_ratio=ratio,
            improve_time=60.0,
            time_limit=60.0,
            is_bidirectional=is_bidirectional,
        )
        near = []
        for seed in range(5):
            result = plan(problem, options, np.random.default_rng(seed))
            q = result.path.waypoints
            near.append([_share_near(q[1:-1], tree.nodes) for tree in result.trees])
            # Whatever can be skipped is.
            assert not any(
                problem.world.is_edge_valid(a, b) for a, b in zip(q[:-2], q[2:], strict=True)
            )
        # Of each tree: an even ratio must not leave one of two without beacons.
        shares.append(np.mean(near, axis=0))
    assert len(shares[0]) == 1 + is_bidirectional
    assert (1.5 * shares[0] < shares[1]).all()
    assert (1.5 * shares[1] < shares[2]).all()


def _share_near(beacons, nodes):
    return (np.linalg.norm(nodes[:, None] - beacons, axis=2).min(axis=1) < 5.0).mean()


def test_rrt_h_as_printed_can_be_run_and_may_be_invalid():
    options = PrintedRRTHOptions(
        step_size=10.0,
        corner_spacing=1.0,
        target_spacing=1.0,
        check_spacing=1.0,
        club_attempts=0,
        is_bidirectional=False,
    )
    problem = map_problem(_map('c_shape'))
    result = plan(problem, options, np.random.default_rng(0))
    assert result.status is PlanStatus.SOLVED
    assert result.path.length < result.raw_path.length
    assert (result.path.waypoints[-1] == problem.q_goals[0]).all()


def test_sampled_checks_miss_what_the_certificate_sees():
    problem, _, _ = _problems()['arm_4']
    world = problem.world
    rng = np.random.default_rng(11)
    n_missed = n_wrong = 0
    for check in (sampled(world, 0.1), by_check_points(world, 0.1)):
        for _ in range(1500):
            a = rng.uniform(*world.bounds)
            b = np.clip(a + rng.normal(0.0, 0.4, 4), *world.bounds)
            if not world.is_valid(a):
                continue
            proven, accepted = world.is_edge_valid(a, b), check.is_edge_valid(a, b)
            n_missed += accepted and not proven
            n_wrong += proven and not accepted
    # Whatever is proven free is free at every check point; the reverse does not hold.
    assert n_wrong == 0
    assert n_missed > 0


def test_sampled_checks_on_a_map_see_less_than_the_exact_one():
    world = map_world(_map('c_shape'))
    coarse = sampled(world, 4.0)
    rng = np.random.default_rng(3)
    edges = rng.uniform(0.0, 100.0, (4000, 2, 2))
    exact = np.array([world.is_edge_valid(a, b) for a, b in edges])
    seen = np.array([coarse.is_edge_valid(a, b) for a, b in edges])
    judged = np.array([_is_box_free(_map('c_shape'), a, b) for a, b in edges[:300]])
    assert not (exact & ~seen & ~np.array([_starts_inside(a) for a, _ in edges])).any()
    assert (seen & ~exact).sum() > 10
    assert (exact[:300] <= judged).all()


def _starts_inside(q):
    box_map = _map('c_shape')
    return bool(((q > box_map.obstacles[:, 0]) & (q < box_map.obstacles[:, 1])).all(1).any())


def test_bars_of_the_reference_checker_touch_where_the_check_points_do():
    arm, scene = worlds.table_1_arm(), worlds.wearer()
    points = by_check_points(arm_world(arm, scene, 0.0, 1.0), 0.05)
    rng = np.random.default_rng(1)
    q = rng.uniform(*arm.bounds, (2000, 4))
    by_points = np.array([points.is_edge_valid(p, p) for p in q])
    ends = reference_checker.bars(arm, q, 1.0)
    touching = np.zeros(len(q), dtype=bool)
    for box in scene.boxes:
        half = 0.5 * box.size
        touching |= reference_checker.bar_box_contact(ends, box.center, box.rotation, half).any(
            axis=1
        )
    # A check point inside means a bar inside; a seventh of the colliding configurations is missed.
    assert not (~by_points & ~touching).any()
    assert 0.02 < (by_points & touching).sum() / touching.sum() < 0.3


@pytest.mark.parametrize('algorithm', ALGORITHMS)
def test_with_a_goal_bias_of_1_every_draw_is_the_other_end(algorithm):
    box_map = _map('fence')
    ahead = (box_map.goal - box_map.start) / np.linalg.norm(box_map.goal - box_map.start)

    def farthest_aside(goal_bias):
        options = replace(
            _options(algorithm, 1.0), step_size=2.0, max_samples=60, goal_bias=goal_bias
        )
        trees = plan(map_problem(box_map), options, np.random.default_rng(0)).trees
        assert all(len(tree.nodes) > 2 for tree in trees)
        offsets = np.concatenate([tree.nodes for tree in trees]) - box_map.start
        return np.abs(offsets @ [-ahead[1], ahead[0]]).max()

    assert farthest_aside(1.0) < 1e-9
    assert farthest_aside(0.0) > 2.0
