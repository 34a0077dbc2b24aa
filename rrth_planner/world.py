# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where the arm may be: its rows, the wearer's rows, and the edge check between them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rrth_planner.arm import ArmModel
from rrth_planner.arrays import Array
from rrth_planner.errors import OptionsError, SceneError
from rrth_planner.kernels import arm_sampling, arm_validity, jit
from rrth_planner.reach import bar_ends, bar_names, reach_table
from rrth_planner.scene import Scene

# Rounding of kinematics and of the separating axes, with room: coordinates up to 1e4 m carry
# errors of about 1e-11 m.
SLACK = 1e-9
EDGE_CHECK = jit.first_class(arm_validity.is_edge_free)
FREE_RADIUS = jit.first_class(arm_sampling.free_radius)
# Shortest interval that the proof of an edge looks at before it gives up [rad].
RESOLUTION = 5e-4


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class World:
    """
    What planners and certificates need to know, packed for the kernels.

    Parameters
    ----------
    bounds : ndarray, shape (2, dof)
        Lowest and highest configuration [rad or m].
    robot : ndarray, shape (n_rows, 8 + 2 dof)
        Rows of the arm, columns as in `kernels.jit`.
    obstacles : ndarray, shape (15, m)
        Boxes grown by the margin, in the arm's base frame, rows as in `kernels.jit` [m].
    edge_check : compiled function
        The seam `kernels.jit.EDGE_CHECK`.
    free_radius : compiled function
        The seam `kernels.jit.FREE_RADIUS`.
    resolution : float
        Last argument but two of the edge check [rad].
    bar_names, box_names : tuple of str
        What messages call the arm's bars and the boxes.

    """

    bounds: Array
    robot: Array
    obstacles: Array
    edge_check: Callable[..., bool]
    free_radius: Callable[..., float]
    resolution: float
    bar_names: tuple[str, ...]
    box_names: tuple[str, ...]

    @property
    def ray_length(self) -> float:
        """Length of the pointing ray that is guarded in motion [m]."""
        return float(self.robot[-1, jit.D])

    def is_in_bounds(self, q: Array) -> bool:
        """Return whether a configuration, shape (dof,), respects the joints' limits."""
        return bool(((q >= self.bounds[0]) & (q <= self.bounds[1])).all())

    def is_valid(self, q: Array, ray_length: float | None = None) -> bool:
        """Return whether q, shape (dof,), is within limits and free, with a ray that long [m]."""
        ray = self.ray_length if ray_length is None else ray_length
        return self.is_in_bounds(q) and bool(
            arm_validity.is_configuration_free(q, ray, self.robot, self.obstacles)
        )

    def is_edge_valid(self, q_from: Array, q_to: Array) -> bool:
        """Return whether the straight motion between two configurations is proven free."""
        return bool(
            self.is_in_bounds(q_from)
            and self.is_in_bounds(q_to)
            and self.edge_check(q_from, q_to, self.resolution, self.robot, self.obstacles)
        )

    def clearances(self, q: Array, ray_length: float | None = None) -> Array:
        """
        Return the least signed distances of the bars from the grown boxes, (n_bars, m) [m].

        Contact is < 0: the depth by which a bar enters a box. q has the shape (dof,), or (n, dof)
        for the least over n configurations.
        """
        distances = np.empty((len(self.bar_names), self.obstacles.shape[1]))
        ray = self.ray_length if ray_length is None else ray_length
        arm_validity.clearances(np.atleast_2d(q), ray, self.robot, self.obstacles, distances)
        return distances


def arm_world(arm: ArmModel, scene: Scene, margin: float, ray_guard_length: float) -> World:
    """
    Return the world of an arm round its wearer.

    Parameters
    ----------
    arm : ArmModel
    scene : Scene
        The wearer in the base frame.
    margin : float
        Every box is grown by this on every side [m], >= 0.
    ray_guard_length : float
        How much of the pointing ray must stay clear in motion [m], >= 0.

    Raises
    ------
    OptionsError
        A margin or a guard length that is negative or no number.

    """
    for name, value in (('margin', margin), ('ray_guard_length', ray_guard_length)):
        if not 0.0 <= value < np.inf:
            raise OptionsError(f'{name}: {value}, expected a length >= 0 [m]')
    return World(
        bounds=arm.bounds,
        robot=_robot_rows(arm, ray_guard_length),
        obstacles=_box_rows(arm, scene, margin),
        edge_check=EDGE_CHECK,
        free_radius=FREE_RADIUS,
        resolution=RESOLUTION,
        bar_names=tuple(bar_names(arm)),
        box_names=tuple(box.name for box in scene.boxes),
    )


def grown(world: World, by: float) -> World:
    """Return the same world with every box grown by that much more on every side [m]."""
    obstacles = np.array(world.obstacles)
    obstacles[jit.BOX_HALF :] += by
    if (obstacles[jit.BOX_HALF :] <= 0.0).any():
        raise SceneError(f'growth: {by}, expected no box to vanish [m]')
    return replace(world, obstacles=obstacles)


def _robot_rows(arm: ArmModel, ray_length: float) -> Array:
    dof = arm.dof
    rows: Any = np.zeros((dof + 1, jit.REACH + 2 * dof))
    alpha, a, offset, d = arm.dh.T
    rows[:, jit.COS_ALPHA], rows[:, jit.SIN_ALPHA] = np.cos(alpha), np.sin(alpha)
    rows[:, jit.A], rows[:, jit.OFFSET], rows[:, jit.D] = a, offset, d
    rows[-1, jit.D] = ray_length
    rows[:, jit.KIND] = [jit.PRISMATIC if p else jit.REVOLUTE for p in arm.is_prismatic] + [
        jit.FIXED
    ]
    rows[:, jit.RADIUS_A] = rows[:, jit.RADIUS_D] = jit.NO_BAR
    for (row, end), reach in zip(bar_ends(arm), reach_table(arm, ray_length), strict=True):
        column = jit.RADIUS_A if end == 'a' else jit.RADIUS_D
        rows[row, column] = arm.radii[row]
        first = jit.REACH + (0 if end == 'a' else dof)
        rows[row, first : first + dof] = reach
    return rows


def _box_rows(arm: ArmModel, scene: Scene, margin: float) -> Array:
    rows = np.empty((jit.BOX_ROWS, len(scene.boxes)))
    T_mount_base = np.linalg.inv(arm.T_base_mount)
    for j, box in enumerate(scene.boxes):
        axes = (T_mount_base[:3, :3] @ box.rotation).T
        center = T_mount_base[:3, :3] @ box.center + T_mount_base[:3, 3]
        rows[: jit.BOX_OFFSET, j] = axes.ravel()
        rows[jit.BOX_OFFSET : jit.BOX_HALF, j] = -axes @ center
        rows[jit.BOX_HALF :, j] = 0.5 * box.size + margin + SLACK
    return rows
