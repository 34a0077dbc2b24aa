# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The collision modes: the paper's equations word for word, and every planner in every mode."""

from dataclasses import replace
import functools

import numpy as np
import pytest
from rrth_planner.collision.reference_checker import first_contact
from rrth_planner.collision.world import arm_world
from rrth_planner.io.map_file import load_map
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.status import PlanStatus
from rrth_planner.planning.box_map import map_problem
from rrth_planner.planning.edge_checks import by_check_points, sampled
from rrth_planner.planning.options import (
    InformedRRTStarOptions,
    RRTHOptions,
    RRTOptions,
    RRTStarOptions,
    RRTStarSmartOptions,
)
from rrth_planner.planning.planner import plan
from rrth_planner.planning.pointing_goals import goal_configurations
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.visibility_graph import enters, extended_obstacles
from worlds import FOLDED, MARGIN, oracle_bars, RAY, table_1_arm, wearer

# Of each bar, the ray's first metre among them (section 6.2).
TEN = np.arange(1, 11) / 10.0
SPACING = 0.02
MODES = {
    'certified': lambda world, spacing: world,
    'sampled': sampled,
    'check_points': by_check_points,
}
BASE = {'time_limit': 600.0, 'max_samples': 20000}
STAR = {'time_limit': 600.0, 'improve_time': 600.0, 'max_samples': 600}
PLANNERS = {
    'rrt': RRTOptions(**BASE),
    'rrt_star': RRTStarOptions(**STAR),
    'informed': InformedRRTStarOptions(**STAR),
    'smart': RRTStarSmartOptions(**STAR),
    'rrt_h': RRTHOptions(improve_time=600.0, **BASE),
}


def check_points(arm, q):
    """Return the points P_C of the arm at some configurations, (n, dof) -> (n, m, 3) [m]."""
    bars = oracle_bars(arm, q, RAY)
    start, end = bars[:, :, None, 0], bars[:, :, None, 1]
    return (start + TEN[:, None] * (end - start)).reshape(len(bars), -1, 3)


def equation_1(points, box, margin):
    """Return P of points (..., 3): the sum over the six faces of S.D / |S.D|."""
    total = np.zeros(points.shape[:-1])
    for axis in range(3):
        for side in (-1.0, 1.0):
            S = side * box.rotation[:, axis]
            P_O = box.center + (0.5 * box.size[axis] + margin) * S
            # From the check point towards the face: +1 on the inner side.
            total += np.sign((P_O - points) @ S)
    return total


def is_free_by_the_equations(arm, scene, margin, q):
    """Return whether no point has P = 6, its place inside a cuboid; (n, dof) -> (n,)."""
    points = check_points(arm, np.atleast_2d(q))
    collides = [(equation_1(points, box, margin) == 6.0).any(axis=1) for box in scene.boxes]
    return ~np.any(collides, axis=0)


def on_edge(a, b, spacing):
    """Return the configurations at which an edge is looked at, (n, dof)."""
    n = int(np.linalg.norm(b - a) / spacing) + 1
    return a + np.arange(1, n + 1)[:, None] / n * (b - a)


@functools.cache
def worn():
    """Return the paper's arm, the wearer and the world of both, checked by points."""
    arm, scene = table_1_arm(), wearer()
    return arm, scene, by_check_points(arm_world(arm, scene, MARGIN, RAY), SPACING)


def test_the_check_points_mode_is_equations_1_and_2():
    arm, scene, world = worn()
    q = np.random.default_rng(61).uniform(*arm.bounds, size=(10_000, arm.dof))
    expected = is_free_by_the_equations(arm, scene, MARGIN, q)
    assert 0.2 < expected.mean() < 0.8
    assert [world.is_edge_valid(a, a) for a in q] == expected.tolist()


def test_an_edge_is_looked_at_no_farther_apart_than_asked():
    arm, scene, world = worn()
    rng = np.random.default_rng(62)
    told, expected = [], []
    for a in rng.uniform(*arm.bounds, size=(400, arm.dof)):
        b = np.clip(a + rng.normal(0.0, 0.2, arm.dof), *arm.bounds)
        told.append(world.is_edge_valid(a, b))
        between = is_free_by_the_equations(arm, scene, MARGIN, on_edge(a, b, SPACING))
        expected.append(bool(between.all()))
    assert told == expected
    assert 0.1 < np.mean(told) < 0.9


def test_ten_check_points_lie_on_the_first_metre_of_the_ray_and_ten_on_each_bar():
    arm = table_1_arm()
    q = np.array([0.3, -0.8, 0.4, 1.1])
    T = tool_pose(arm, q)
    bars = oracle_bars(arm, q, RAY)[0]
    np.testing.assert_allclose(bars[-1], [T[:3, 3], T[:3, 3] + T[:3, 2]], atol=1e-12)

    def is_seen(point, size):
        scene = Scene((Box('speck', point, np.full(3, size), np.eye(3)),))
        world = by_check_points(arm_world(arm, scene, 0.0, RAY), SPACING)
        return not world.is_edge_valid(q, q)

    # The specks are smaller than the distance between two check points of the shortest bar.
    for start, end in bars:
        size = 0.01 * np.linalg.norm(end - start)
        for share in TEN:
            assert is_seen(start + share * (end - start), size)
            assert not is_seen(start + (share - 0.05) * (end - start), size)
    start, end = bars[-1]
    for beyond in (1.05, 1.1, 1.5):
        assert not is_seen(start + beyond * (end - start), 0.01)


def on_the_map(mode):
    """Return a problem in the plane, the judge of its edges in a mode, and the step's factor."""
    box_map = load_map('c_shape')
    problem, boxes = map_problem(box_map), extended_obstacles(box_map)
    world = MODES[mode](problem.world, SPACING)

    def is_free(a, b):
        if mode == 'certified':
            return not enters(a[None], b[None], boxes).any()
        q = on_edge(a, b, SPACING)[:, None]
        # A wall begins a little inside its faces, which may be touched.
        inside = (q > boxes[:, 0] + 1e-9) & (q < boxes[:, 1] - 1e-9)
        return not inside.all(axis=2).any()

    return map_problem(box_map, world), is_free, 6.0


def on_the_arm(mode):
    """Return a problem of the arm, the judge of its edges in a mode, and the step's factor."""
    arm, scene = table_1_arm(), wearer()
    exact = arm_world(arm, scene, MARGIN, RAY)
    goals = goal_configurations(arm, PointingGoal([0.45, 0.0, -0.25]), exact, FOLDED, 128)
    assert goals.n_bent > 0
    world = MODES[mode](exact, SPACING)

    def is_free(a, b):
        if mode == 'check_points':
            return is_free_by_the_equations(arm, scene, MARGIN, on_edge(a, b, SPACING)).all()
        q = on_edge(a, b, 0.25 * SPACING if mode == 'certified' else SPACING)
        return first_contact(arm, scene, q, RAY, MARGIN) is None

    q_goals = goals.q_goals[:1]
    return PlanningProblem(world=world, q_start=FOLDED, q_goals=q_goals), is_free, 0.4


@pytest.mark.parametrize('place', [on_the_map, on_the_arm])
@pytest.mark.parametrize('mode', MODES)
@pytest.mark.parametrize('planner', PLANNERS)
def test_every_planner_keeps_what_its_collision_mode_asks(planner, mode, place):
    problem, is_free, factor = place(mode)
    options = replace(PLANNERS[planner], step_size=PLANNERS[planner].step_size * factor)
    result = plan(problem, options, np.random.default_rng(7))
    assert result.status is PlanStatus.SOLVED
    # No straight edge: there was something to plan.
    assert result.n_samples > 0
    assert len(result.trees) > 0
    q = result.path.waypoints
    assert (q[0] == problem.q_start).all()
    assert (q[-1] == problem.q_goals[0]).all()
    assert all(is_free(a, b) for a, b in zip(q[:-1], q[1:], strict=True))
