# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of axis-aligned boxes for a point robot, in any dimension."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.collision.world import World
from rrth_planner.kernels import jit
from rrth_planner.kernels.collision import edge_contacts, map_validity
from rrth_planner.kernels.kinematics import generated_fk
from rrth_planner.kernels.layout import MAX_DOF
from rrth_planner.model.arrays import Array, FARTHEST, frozen_array
from rrth_planner.model.errors import check_type, printable, SceneError
from rrth_planner.model.frozen import Frozen
from rrth_planner.planning.problem import PlanningProblem

EDGE_CHECK = jit.first_class(map_validity.is_edge_free)
SAMPLED_CHECK = jit.first_class(map_validity.is_edge_free_sampled)
NO_CONTACTS = jit.first_class(edge_contacts.no_contacts)
FREE_RADIUS = jit.first_class(map_validity.free_radius)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BoxMap(Frozen):
    """
    A start, a goal and the boxes between them; a point may be on a face of a box, not inside.

    Parameters
    ----------
    bounds : array_like, shape (2, dof)
        Lower and upper corner of the map, in 1 to 64 dimensions. A box at the border extends
        beyond it, so no path passes there.
    obstacles : array_like, shape (m, 2, dof)
        Lower and upper corner of each box.
    start, goal : array_like, shape (dof,)

    Raises
    ------
    SceneError
        Too many dimensions, a box without volume, a start or goal outside the map or inside a box,
        a coordinate beyond 1e4, a name that is not printable.

    """

    name: str
    bounds: Array
    obstacles: Array
    start: Array
    goal: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        name = f'map "{printable(self.name, "name of a map", SceneError)}"'
        bounds = frozen_array(self.bounds, (2, None), f'{name}: bounds', 'map', SceneError)
        dof = bounds.shape[1]
        if not 1 <= dof <= MAX_DOF:
            raise SceneError(f'{name}: bounds of {dof} dimensions, expected 1 to {MAX_DOF}')
        obstacles = self.obstacles
        has_none = (
            obstacles.size == 0 if isinstance(obstacles, np.ndarray) else obstacles in ([], ())
        )
        if has_none:
            obstacles = np.empty((0, 2, dof))
        for field, value, shape in (
            ('bounds', bounds, (2, dof)),
            ('obstacles', obstacles, (None, 2, dof)),
            ('start', self.start, (dof,)),
            ('goal', self.goal, (dof,)),
        ):
            frozen = frozen_array(value, shape, f'{name}: {field}', 'map', SceneError, FARTHEST)
            object.__setattr__(self, field, frozen)
        low, high = self.bounds
        if not (low < high).all():
            raise SceneError(f'{name}: bounds {self.bounds.tolist()}, expected lower < upper')
        for i, (lower, upper) in enumerate(self.obstacles):
            if not (lower < upper).all():
                raise SceneError(
                    f'{name}: obstacle {i} from {lower.tolist()} to {upper.tolist()}, '
                    'expected a positive size along every axis'
                )
        for field in ('start', 'goal'):
            q = getattr(self, field)
            if not ((q >= low) & (q <= high)).all():
                raise SceneError(
                    f'{name}: {field} {q.tolist()}, expected within '
                    f'{low.tolist()} to {high.tolist()}'
                )
            inside = ((q > self.obstacles[:, 0]) & (q < self.obstacles[:, 1])).all(axis=1)
            if inside.any():
                raise SceneError(
                    f'{name}: {field} {q.tolist()} is inside obstacle '
                    f'{int(np.argmax(inside))}, expected a free point'
                )


def map_world(box_map: BoxMap) -> World:
    """Return the world of a point on a map; its edge check is exact."""
    check_type(box_map, BoxMap, 'box_map')
    low, high = box_map.bounds
    beyond = high - low
    lower, upper = np.array(box_map.obstacles[:, 0]), np.array(box_map.obstacles[:, 1])
    lower = np.where(lower <= low, lower - beyond, lower)
    upper = np.where(upper >= high, upper + beyond, upper)
    return World(
        bounds=box_map.bounds,
        chain=generated_fk.NO_CHAIN,
        robot=np.zeros((1, 1)),
        obstacles=np.hstack([lower, upper]),
        edge_check=EDGE_CHECK,
        free_radius=FREE_RADIUS,
        contacts=NO_CONTACTS,
        resolution=1.0,
        bar_names=('point',),
        box_names=tuple(f'obstacle {i}' for i in range(len(lower))),
    )


def map_problem(box_map: BoxMap, world: World | None = None) -> PlanningProblem:
    """Return the planning problem of a map, in its own world or in another one made from it."""
    check_type(box_map, BoxMap, 'box_map')
    return PlanningProblem(
        world=map_world(box_map) if world is None else world,
        q_start=box_map.start,
        q_goals=box_map.goal[None, :],
    )
