# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What joint motions look like in space: where the tool is along paths and trees."""

import numpy as np
from rrth_planner.model.arm import ArmModel, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.rotation import quaternion_xyzw, turned_to
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.planning.result import Tree

# Straight joint motions are curves of the tool: points of one edge of a path, and of a tree.
PATH_PIECES, TREE_PIECES = 24, 6
TRAJECTORY_POINTS = 200


def tool_positions(arm: ArmModel, q: Array) -> Array:
    """Return where the tool is, (..., dof) [rad] -> (..., 3) in the base frame [m]."""
    return np.asarray(tool_pose(arm, q)[..., :3, 3])


def edge_curves(arm: ArmModel, q_from: Array, q_to: Array, n_pieces: int) -> Array:
    """Return the tool's path along joint edges, two (n, dof) [rad] -> (n, n_pieces + 1, 3) [m]."""
    share = np.linspace(0.0, 1.0, n_pieces + 1)[:, None]
    return tool_positions(arm, q_from[:, None] + share * (q_to - q_from)[:, None])


def path_curve(arm: ArmModel, waypoints: Array) -> Array:
    """Return the tool's path along a path, (n, dof) [rad] -> (m, 3) [m]."""
    if len(waypoints) < 2:
        return tool_positions(arm, waypoints)
    return edge_curves(arm, waypoints[:-1], waypoints[1:], PATH_PIECES).reshape(-1, 3)


def trajectory_curve(arm: ArmModel, trajectory: Trajectory) -> Array:
    """Return the tool's path along a trajectory, (m, 3) [m]."""
    times = np.linspace(0.0, trajectory.duration, TRAJECTORY_POINTS)
    return tool_positions(arm, sample(trajectory, times)[0])


def tree_segments(arm: ArmModel, tree: Tree) -> Array:
    """Return the tool's path along all edges of a tree as pieces, (m, 2, 3) [m]."""
    children = np.flatnonzero(tree.parents >= 0)
    if not len(children):
        return np.empty((0, 2, 3))
    q_from, q_to = tree.nodes[tree.parents[children]], tree.nodes[children]
    return segments_of(edge_curves(arm, q_from, q_to, TREE_PIECES))


def segments_of(curve: Array) -> Array:
    """Return the pieces of curves, (..., n, 3) -> (m, 2, 3)."""
    pieces = np.stack([curve[..., :-1, :], curve[..., 1:, :]], axis=-2)
    return np.ascontiguousarray(pieces.reshape(-1, 2, 3))


def along_z(begin: Array, end: Array) -> tuple[Array, Array, float]:
    """
    Return where to put a bar along z so that it joins two points.

    Returns
    -------
    tuple of ndarray, shape (3,), ndarray, shape (4,), float
        Its middle [m], its rotation as a quaternion (w, x, y, z), its length [m].

    """
    v = end - begin
    length = float(np.linalg.norm(v))
    z = v / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    return 0.5 * (begin + end), wxyz(turned_to(z)), length


def wxyz(rotation: Array) -> Array:
    """Return the quaternion (w, x, y, z) of a rotation, shape (3, 3)."""
    return np.roll(quaternion_xyzw(rotation), 1)
