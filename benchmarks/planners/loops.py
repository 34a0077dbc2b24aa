# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Compiled loops over configurations and edges: what is timed without Python in between.

The only file of the benchmarks that knows signatures of kernels. Nothing here is kept compiled,
so that no edited kernel is overlooked.
"""

from collections.abc import Callable

from numba import njit
import numpy as np
from rrth_planner.collision.world import World
from rrth_planner.kernels.collision import arm_validity
from rrth_planner.model.arrays import Array
from rrth_planner.planning.edge_checks import sampled

# Between two checks of an edge that is checked at a spacing [rad].
SPACING = 0.02

_is_configuration_free = arm_validity.is_configuration_free


@njit(nogil=True)
def _check_configurations(positions, ray_length, chain, robot, boxes, flags):
    for i in range(positions.shape[0]):
        flags[i] = _is_configuration_free(positions[i], ray_length, chain, robot, boxes)


@njit(nogil=True)
def _check_edges(check, starts, ends, resolution, chain, robot, boxes, flags):
    for i in range(starts.shape[0]):
        flags[i] = check(starts[i], ends[i], resolution, chain, robot, boxes)


def check_configurations(world: World, positions: Array, flags: Array) -> None:
    """Write whether each configuration, (n, dof), is free."""
    _check_configurations(
        positions, world.ray_length, world.chain, world.robot, world.obstacles, flags
    )


def check_edges(world: World, starts: Array, ends: Array, flags: Array) -> None:
    """Write whether the edge check of a world passes each edge, (n, dof) to (n, dof)."""
    _check_edges(
        world.edge_check,
        starts,
        ends,
        world.resolution,
        world.chain,
        world.robot,
        world.obstacles,
        flags,
    )


def check_batches(world: World, starts: Array, ends: Array, flags: Array) -> None:
    """Write whether each edge is free at configurations 0.02 rad apart; no proof."""
    check_edges(sampled(world, SPACING), starts, ends, flags)


def batch_size(length: float) -> int:
    """Return how many configurations `check_batches` checks on a free edge of a length [rad]."""
    return int(length / SPACING) + 1


def peer_check(world: World, is_map: bool) -> Callable[..., bool]:
    """
    Return the check of an edge that a peer calls with the numbers of both ends.

    Exact on a map; that of the arm checks configurations 0.02 rad apart, and an edge without
    length at its configuration.
    """
    world = world if is_map else sampled(world, SPACING)
    check = getattr(world.edge_check, 'compiled', world.edge_check)
    chain, resolution = getattr(world.chain, 'compiled', world.chain), world.resolution
    robot, boxes = np.array(world.robot), np.array(world.obstacles)

    @njit
    def check_in_plane(x, y, u, v):
        q_from, q_to = np.empty(2), np.empty(2)
        q_from[0], q_from[1], q_to[0], q_to[1] = x, y, u, v
        return check(q_from, q_to, resolution, chain, robot, boxes)

    @njit
    def check_in_joint_space(a, b, c, d, e, f, g, h):
        q_from, q_to = np.empty(4), np.empty(4)
        q_from[0], q_from[1], q_from[2], q_from[3] = a, b, c, d
        q_to[0], q_to[1], q_to[2], q_to[3] = e, f, g, h
        return check(q_from, q_to, resolution, chain, robot, boxes)

    return check_in_plane if is_map else check_in_joint_space
