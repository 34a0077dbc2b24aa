# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Other ways to check an edge: at a spacing, or at the paper's check points."""

from dataclasses import replace

from rrth_planner.collision.world import World
from rrth_planner.kernels import jit
from rrth_planner.kernels.collision import arm_sampled
from rrth_planner.planning.box_map import (
    EDGE_CHECK as MAP_CHECK,
    SAMPLED_CHECK as SAMPLED_MAP_CHECK,
)

SAMPLED_ARM_CHECK = jit.first_class(arm_sampled.is_edge_free_sampled)
POINTS_ARM_CHECK = jit.first_class(arm_sampled.is_edge_free_at_points)


def sampled(world: World, resolution: float) -> World:
    """
    Return the same world, edges checked exactly but only at a spacing.

    Contacts between two checks are missed: 98 of 100 shortened arm paths accepted at 0.02 rad
    collide. For comparisons only, never on an arm that is worn.

    Parameters
    ----------
    resolution : float
        Spacing of the checks along an edge [rad].

    """
    check = SAMPLED_MAP_CHECK if world.edge_check is MAP_CHECK else SAMPLED_ARM_CHECK
    return replace(world, edge_check=check, resolution=resolution)


def by_check_points(world: World, resolution: float) -> World:
    """
    Return the same world, checked as the paper does: points inside cuboids (its eqs. 1 and 2).

    On a map the point itself is the only check point; an arm has ten on each bar and on the ray.

    Parameters
    ----------
    resolution : float
        Spacing of the checks along an edge [rad].

    """
    check = SAMPLED_MAP_CHECK if world.edge_check is MAP_CHECK else POINTS_ARM_CHECK
    return replace(world, edge_check=check, resolution=resolution)
