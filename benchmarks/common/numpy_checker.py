# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The strict judge of every path, ours and the peers': plain numpy, nothing shared with them."""

import numpy as np
from rrth_planner.collision.reference_checker import first_contact
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.planning.box_map import BoxMap
from rrth_planner.planning.visibility_graph import enters, extended_obstacles

# Between two instants at which the arm is checked [rad].
SPACING = 5e-4
# Instants that are checked together: bounds the memory.
CHUNK = 20_000


def is_arm_path_free(
    arm: ArmModel, scene: Scene, waypoints: Array, ray_length: float, margin: float
) -> bool:
    """
    Return whether the arm collides with no box at any instant of a path, every 0.0005 rad.

    Parameters
    ----------
    arm : ArmModel
    scene : Scene
    waypoints : ndarray, shape (n, dof)
        [rad].
    ray_length : float
        How much of the pointing ray counts as arm [m].
    margin : float
        Growth of each box on every side [m].

    """
    path = instants(np.asarray(waypoints, dtype=float))
    return all(
        first_contact(arm, scene, path[k : k + CHUNK], ray_length, margin) is None
        for k in range(0, len(path), CHUNK)
    )


def is_map_path_free(box_map: BoxMap, waypoints: Array) -> bool:
    """Return whether no segment of a path, (n, 2), enters a box or leaves the map: exact."""
    path = np.asarray(waypoints, dtype=float)
    low, high = box_map.bounds
    is_inside = bool(((path >= low - 1e-9) & (path <= high + 1e-9)).all())
    return is_inside and not enters(path[:-1], path[1:], extended_obstacles(box_map)).any()


def instants(waypoints: Array, spacing: float = SPACING) -> Array:
    """Return a path as points at most `spacing` apart, every waypoint among them, (m, dof)."""
    pieces = [waypoints[:1]]
    for q_from, q_to in zip(waypoints[:-1], waypoints[1:], strict=True):
        n = max(1, int(np.ceil(np.linalg.norm(q_to - q_from) / spacing)))
        pieces.append(q_from + np.linspace(0.0, 1.0, n + 1)[1:, None] * (q_to - q_from))
    return np.concatenate(pieces)
