# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The seven problems on which planners are compared: three maps, four pointing queries."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
import json
from pathlib import Path

import numpy as np
from rrth_planner.collision.world import arm_world, World
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.map_file import map_from_mapping
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.model.scene import Box, Scene
from rrth_planner.planning.box_map import BoxMap, map_problem
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.visibility_graph import shortest_path

from benchmarks.common import numpy_checker

FOLDER = Path(__file__).parents[1] / 'problems'
MAPS = ('c_shape', 'spiral', 'fence')
QUERIES = ('lap', 'floor_front', 'front_far', 'right_hand')
# Longest extension of a tree and shortest cut of a corner on the maps, which measure 100 by 100.
MAP_STEP, MAP_CORNER = 20.0, 0.02


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Query:
    """
    A problem with one start and one goal.

    Parameters
    ----------
    name : str
    is_map : bool
    problem : PlanningProblem
    best_cost : float
        Exact on the maps, the best known of the arm [map units or rad].
    is_path_free : callable
        The judge: whether a path, (n, dof), is free along its whole length.

    """

    name: str
    is_map: bool
    problem: PlanningProblem
    best_cost: float
    is_path_free: Callable[[Array], bool]

    def is_solved_by(self, waypoints: Array) -> bool:
        """Return whether a path leads from the start to the goal and is free."""
        ends = np.array([self.problem.q_start, self.problem.q_goals[0]])
        return bool(
            np.abs(waypoints[[0, -1]] - ends).max() < 1e-6 and self.is_path_free(waypoints)
        )


@cache
def wearer() -> Scene:
    """Return the standing wearer, forearms forward."""
    data = json.loads((FOLDER / 'wearer.json').read_text(encoding='utf-8'))
    return Scene(
        tuple(
            Box(b['name'], b['center'], b['size'], rotation_matrix(b['quaternion_xyzw']))
            for b in data['boxes']
        )
    )


@cache
def table_1_arm() -> ArmModel:
    """Return the packaged arm."""
    return load_arm()


@cache
def wearer_world() -> World:
    """Return the world of the pointing queries: the packaged arm round the standing wearer."""
    data = _arm_data()
    return arm_world(table_1_arm(), wearer(), data['margin'], data['ray_guard_length'])


@cache
def load_query(name: str) -> Query:
    """Return a problem by its name, one of MAPS or QUERIES."""
    if name in MAPS:
        box_map = load_map(name)
        return Query(
            name=name,
            is_map=True,
            problem=map_problem(box_map),
            best_cost=shortest_path(box_map)[0],
            is_path_free=lambda waypoints: numpy_checker.is_map_path_free(box_map, waypoints),
        )
    data, world = _arm_data(), wearer_world()
    query = data['queries'][name]
    problem = PlanningProblem(world=world, q_start=data['start'], q_goals=[query['goal']])
    return Query(
        name=name,
        is_map=False,
        problem=problem,
        best_cost=query['best_cost'],
        is_path_free=lambda waypoints: numpy_checker.is_arm_path_free(
            table_1_arm(), wearer(), waypoints, world.ray_length, data['margin']
        ),
    )


def load_map(name: str) -> BoxMap:
    """Return a map of `config/maps`."""
    return map_from_mapping(load_yaml(resource_path(f'config/maps/{name}.yaml')), name)


def rrt_h_options(query: Query, improve_time: float) -> RRTHOptions:
    """Return the options with which a problem is planned: the defaults, as long as they may."""
    if not query.is_map:
        return RRTHOptions(improve_time=improve_time, club_attempts=10_000)
    return RRTHOptions(
        step_size=MAP_STEP,
        near_bias=0.0,
        corner_spacing=MAP_CORNER,
        improve_time=improve_time,
        club_attempts=10_000,
    )


@cache
def _arm_data() -> dict:
    return json.loads((FOLDER / 'arm_queries.json').read_text(encoding='utf-8'))
