# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The two independent checks of a whole motion: the certificate and the second checker."""

from dataclasses import replace

from rrth_planner.collision.certificate import certify
from rrth_planner.collision.penetration import escape_depths, leads_out
from rrth_planner.collision.second_checker import first_escape_violation, first_violation
from rrth_planner.collision.violation import Violation
from rrth_planner.collision.world import World, world_of
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import beyond, Trajectory


def is_proven_free(
    world: World, trajectory: Trajectory, margin: float, reach: float, escape_time: float = 0.0
) -> bool:
    """
    Return whether a motion is certified, and its end with the ray out to the target.

    margin: by which the world's boxes are grown; reach: how far the target is from the tool at the
    end [m]; escape_time: until then the motion escapes from boxes that the arm was in [s].
    """
    return (
        world.is_valid(trajectory.positions[-1], reach)
        and (escape_time == 0.0 or leads_out(trajectory, world, margin, escape_time))
        and certify(trajectory, world, escape_time).is_proven
    )


def violation_seen(
    required: RequiredClearance,
    scene: Scene,
    trajectory: Trajectory,
    reach: float,
    escape_time: float = 0.0,
) -> Violation | None:
    """
    Return the first clearance violation of a motion by the second checker, or None.

    As `second_checker.first_violation`; reach and escape_time as in `is_proven_free`.
    """
    if escape_time > 0.0:
        depths = escape_depths(world_of(required, scene), trajectory.positions[0])
        violation = first_escape_violation(required, scene, depths, trajectory, escape_time)
        if violation is not None:
            return violation
    after = beyond(trajectory, escape_time)
    violation = first_violation(required, scene, after, reach)
    if violation is None:
        return None
    return replace(violation, time=escape_time + violation.time)
