# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A plan that outgrows the arrays that are made for it ends with a status."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from rrth_planner.io.map_file import load_map
from rrth_planner.kernels.search import rrt_h
from rrth_planner.model.errors import RrthError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.status import PlanStatus
from rrth_planner.planning import buffers, pointing_goals, rrt, rrt_star
from rrth_planner.planning.box_map import map_problem
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
from rrth_planner.planning.visibility_graph import enters, extended_obstacles
from worlds import blocked_pair, FOLDED, free_configuration, table_1_arm, wearer_world

ALGORITHMS = (
    RRTOptions,
    RRTStarOptions,
    InformedRRTStarOptions,
    RRTStarSmartOptions,
    RRTHOptions,
    PrintedRRTHOptions,
)
# Sizes of the arrays, smaller than any plan on the spiral needs; is a path found all the same?
LITTLE = {
    'MAX_WAYPOINTS': (3, False),
    'MAX_NODES': (20, False),
    'MAX_CLUB': (3, True),
    'MAX_HISTORY': (1, True),
    'MAX_MEETINGS': (1, True),
}


def sizes_of(module):
    """Return the names of the sizes that a module sets."""
    return {name for name in vars(module) if name.startswith('MAX_')}


def test_every_size_of_the_arrays_of_a_plan_is_listed():
    assert sizes_of(buffers) | sizes_of(rrt_star) | sizes_of(rrt) == set(LITTLE)


@pytest.mark.parametrize('kind', ALGORITHMS)
@pytest.mark.parametrize('name', LITTLE)
def test_a_plan_that_outgrows_an_array_ends_with_a_status(kind, name, monkeypatch):
    size, is_found = LITTLE[name]
    for module in (buffers, rrt, rrt_star):
        if hasattr(module, name):
            monkeypatch.setattr(module, name, size)
    box_map = load_map('spiral')
    options = kind(step_size=10.0, max_samples=1500, time_limit=1000.0)
    # Each thread has arrays of its own.
    with ThreadPoolExecutor(1) as thread:
        result = thread.submit(
            plan, map_problem(box_map), options, np.random.default_rng(78)
        ).result()
    assert result.status is (PlanStatus.SOLVED if is_found else PlanStatus.SAMPLE_LIMIT)
    assert (result.path is not None) == is_found
    if is_found and kind is not PrintedRRTHOptions:
        q = result.path.waypoints
        assert not enters(q[:-1], q[1:], extended_obstacles(box_map)).any()


def test_the_history_of_a_plan_ends_with_its_best_path_also_when_it_is_full():
    paths, state = np.zeros((3, 4, 2)), np.zeros(rrt_h.STATE_SIZE, dtype=np.int64)
    history = np.zeros((2, 3))
    for length in (5.0, 4.0, 3.0, 2.0):
        paths[rrt_h.WORK, 1, 0] = length
        rrt_h.keep_best(paths, 2, 0, state, history)
        assert history[state[rrt_h.N_HISTORY] - 1, rrt_h.COST] == length
    assert history[0, rrt_h.COST] == 5.0


@pytest.mark.parametrize('kind', [RRTOptions, RRTStarOptions, RRTHOptions])
def test_more_goals_than_a_tree_has_roots_for_are_planned_to(kind):
    world, rng = wearer_world(), np.random.default_rng(79)
    goals = np.array([free_configuration(rng, world) for _ in range(5 * rrt_h.MAX_ROOTS)])
    q_start = free_configuration(rng, world)
    goals = goals[np.argsort(np.linalg.norm(goals - q_start, axis=1))]
    problem = PlanningProblem(world=world, q_start=q_start, q_goals=goals)
    options = kind(max_samples=400, time_limit=1000.0)
    assert plan(problem, options, rng).path is not None
    for n_bent in (-1, len(goals) + 1):
        with pytest.raises(RrthError, match=f'n_bent: {n_bent}, expected 0 to {len(goals)}'):
            replace(problem, n_bent=n_bent)


def test_no_more_goals_are_kept_than_there_is_room_for(monkeypatch):
    monkeypatch.setattr(pointing_goals, 'MOST_GOALS', 2)
    monkeypatch.setattr(pointing_goals, 'MOST_BLOCKED', 3)
    world, rng = wearer_world(), np.random.default_rng(80)
    n_goals, n_blocked = set(), set()
    for target in rng.uniform((-1.0, -1.0, -1.0), (1.5, 1.0, 1.0), (40, 3)):
        found = pointing_goals.goal_configurations(
            table_1_arm(), PointingGoal(target), world, FOLDED, pointing_goals.MANY_DRAWS
        )
        n_goals.add(len(found.q_goals))
        n_blocked.add(len(found.q_blocked))
    assert max(n_goals) == 2
    assert max(n_blocked) == 3


@pytest.mark.parametrize('kind', [RRTOptions, RRTStarOptions, RRTHOptions])
def test_a_plan_of_another_number_of_joints_is_not_built_on(kind):
    world, rng = wearer_world(), np.random.default_rng(81)
    q_start, q_goal = blocked_pair(rng, world)
    problem = PlanningProblem(world=world, q_start=q_start, q_goals=[q_goal])
    before = plan(map_problem(load_map('spiral')), RRTOptions(step_size=10.0), rng)
    with pytest.raises(RrthError, match=r'previous: .*, expected a value for each of 4 joints'):
        plan(problem, kind(), rng, previous=before)
