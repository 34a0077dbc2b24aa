# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The problems of a campaign by name, each with a reference checker independent of the planner."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from rrth_planner.collision.reference_checker import first_contact
from rrth_planner.collision.world import arm_world, World
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.map_file import load_map
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import OptionsError, SceneError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.planning.box_map import map_problem
from rrth_planner.planning.edge_checks import by_check_points, sampled
from rrth_planner.planning.pointing_goals import (
    check_pointing_arm,
    goal_configurations,
    MANY_DRAWS,
)
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.visibility_graph import enters, extended_obstacles, shortest_path
from rrth_planner.visualization.viewer.examples import example_body

CERTIFIED = 'certified'
# Eight points round the wearer [m]; from the folded state none is reached by a straight edge.
TARGETS = {
    'front': (1.5, 0.1, 0.3),
    'front_far': (4.0, 0.0, 0.0),
    'front_left': (1.3, 0.75, 0.3),
    'low_left': (1.1, 0.65, -0.45),
    'left_knee': (0.6, 0.5, -0.7),
    'floor_front': (0.9, 0.0, -1.1),
    'lap': (0.45, 0.0, -0.25),
    'right_hand': (0.45, -0.3, -0.1),
}
# Behind the back, the tool down [rad].
FOLDED = np.array([0.0, -0.35, 0.5 * np.pi, 0.5 * np.pi])
# Growth of the wearer's boxes, and how much of the ray counts as arm [m].
MARGIN, RAY = 0.02, 1.0
# Spacing at which the reference checker samples an arm's motion [rad].
JUDGE_SPACING = 0.002


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NamedProblem:
    """
    A planning problem with the reference check of its paths.

    Parameters
    ----------
    is_path_valid : callable
        Waypoints (n, dof) -> does the path keep clear, by exact clipping on a map, by looking
        every 0.002 rad on the arm.
    is_body_clear : callable
        The same without the margin round the boxes.

    """

    problem: PlanningProblem
    is_path_valid: Callable[[Array], bool]
    is_body_clear: Callable[[Array], bool]


@cache
def load_problem(name: str, collision: str = CERTIFIED) -> NamedProblem:
    """
    Return the problem of a name.

    Parameters
    ----------
    name : str
        A map of `config/maps`, a path that ends in `.yaml`, or `arm/` and one of the TARGETS.
    collision : str
        `certified`, or `sampled:SPACING` or `check_points:SPACING` of the checks along an edge
        [rad].

    Raises
    ------
    RrthError
        There is no such problem or mode.

    """
    if name.startswith('arm/'):
        return _arm_problem(name, collision)
    box_map = load_map(name)
    problem = map_problem(box_map, _checked(map_problem(box_map).world, collision))
    boxes = extended_obstacles(box_map)

    def is_path_valid(waypoints: Array) -> bool:
        is_inside = _are_within(waypoints, box_map.bounds)
        return is_inside and not bool(enters(waypoints[:-1], waypoints[1:], boxes).any())

    return NamedProblem(problem=problem, is_path_valid=is_path_valid, is_body_clear=is_path_valid)


def exact_length(name: str) -> float:
    """Return the length of the exact shortest path on a map [map units]."""
    return shortest_path(load_map(name))[0]


def _arm_problem(name: str, collision: str) -> NamedProblem:
    """Return the problem from the folded configuration to the nearest goal configuration."""
    target = TARGETS.get(name.removeprefix('arm/'))
    if target is None:
        raise SceneError(f'problem "{name}": expected arm/ and one of {", ".join(TARGETS)}')
    arm, scene = load_arm(), example_body('body')
    check_pointing_arm(arm)
    world = arm_world(arm, scene, MARGIN, RAY)
    goals = goal_configurations(arm, PointingGoal(np.array(target)), world, FOLDED, MANY_DRAWS)
    if len(goals.q_goals) == 0:
        raise SceneError(f'problem "{name}": target {target}, expected one with a free goal')
    problem = PlanningProblem(
        world=_checked(world, collision), q_start=FOLDED, q_goals=goals.q_goals[:1]
    )
    return NamedProblem(
        problem=problem,
        is_path_valid=lambda waypoints: (
            _are_within(waypoints, world.bounds) and _keeps_clear(arm, scene, waypoints, MARGIN)
        ),
        is_body_clear=lambda waypoints: _keeps_clear(arm, scene, waypoints, 0.0),
    )


def _are_within(waypoints: Array, bounds: Array) -> bool:
    """Return whether waypoints, (n, dof), are between lower and upper bounds, but for rounding."""
    return bool(((waypoints >= bounds[0] - 1e-9) & (waypoints <= bounds[1] + 1e-9)).all())


def _keeps_clear(arm: ArmModel, scene: Scene, waypoints: Array, margin: float) -> bool:
    """Return whether a path, (n, dof) [rad], is clear of the boxes grown by a margin [m]."""
    for q_from, q_to in zip(waypoints[:-1], waypoints[1:], strict=True):
        n = int(np.linalg.norm(q_to - q_from) / JUDGE_SPACING) + 2
        q = q_from + np.linspace(0.0, 1.0, n)[:, None] * (q_to - q_from)
        if first_contact(arm, scene, q, RAY, margin) is not None:
            return False
    return True


def _checked(world: World, collision: str) -> World:
    """Return the world with its edges checked in a mode."""
    mode, _, spacing = collision.partition(':')
    try:
        if collision == CERTIFIED:
            return world
        return {'sampled': sampled, 'check_points': by_check_points}[mode](world, float(spacing))
    except (KeyError, ValueError):
        raise OptionsError(
            f'collision: {collision!r}, expected certified, sampled:SPACING or '
            'check_points:SPACING [rad]'
        ) from None
