# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of the remaining motion against the present wearer."""

from rrth_planner.collision.box_tree import tree_depth
from rrth_planner.collision.certificate import BERNSTEIN_3, BERNSTEIN_4, FINENESS
from rrth_planner.collision.penetration import gets_no_deeper, leads_out
from rrth_planner.collision.world import (
    allowed_bars,
    arm_rows,
    mount_inverse,
    RESOLUTION,
    SLACK,
    without_ray,
    world_of,
)
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.kernels import jit
from rrth_planner.kernels.collision import trajectory_check
from rrth_planner.model.arrays import Array
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import (
    positions_at,
)


def is_remaining_free(
    running: ExecutingMotion, phase: float, required: RequiredClearance, scene: Scene
) -> bool:
    """
    Return whether the remaining motion is proven free of the present wearer.

    The arm is at a time `phase` within it [s], the scene is in the base frame. At the end the ray
    must be free up to the target.
    """
    trajectory, begin, arm = running.trajectory, phase, required.arm
    if phase < running.escape_time:
        world = world_of(required, scene)
        if not leads_out(trajectory, world, required.margin, running.escape_time, phase):
            return False
        begin = running.escape_time
    if len(trajectory.times) == 1:
        reach = max(required.ray_guard_length, running.target_distance)
        return world_of(required, scene).is_free(trajectory.positions[0], reach)
    robot, chain = arm_rows(arm, required.ray_guard_length)
    return bool(
        trajectory_check.is_remaining_motion_free(
            trajectory.times,
            trajectory.positions,
            trajectory.velocities,
            trajectory.accelerations,
            begin,
            running.target_distance,
            FINENESS * RESOLUTION,
            jit.address(chain),
            robot,
            scene.numbers,
            allowed_bars(arm, scene),
            mount_inverse(arm),
            required.margin + SLACK,
            tree_depth(len(scene.boxes)),
            BERNSTEIN_4,
            BERNSTEIN_3,
        )
    )


def escapes_by_continuing(
    running: ExecutingMotion, phase: float, required: RequiredClearance, scene: Scene
) -> bool:
    """
    Return whether the arm violates the margin now, and is proven to escape by continuing.

    Then the bars escape (`penetration.leads_out`), the pointing ray gets no deeper than now and
    into no other box (`penetration.gets_no_deeper`), and the motion ends clear of all boxes, while
    a stop would stay in violation. The ray has no body: one that the wearer puts a hand into does
    not stop an arm that takes it out again. Where the violation lies ahead this is False: a stop,
    along the same path, is never nearer to it. The parameters are those of `is_remaining_free`.
    """
    trajectory = running.trajectory
    here = positions_at(trajectory, [phase])[0]
    # Most often it is, and a stop waits for the answer.
    if is_place_free(here, required, scene):
        return False
    world, margin = world_of(required, scene), required.margin
    reach = max(required.ray_guard_length, running.target_distance)
    return (
        world.is_free(trajectory.positions[-1], reach)
        and leads_out(trajectory, without_ray(world), margin, trajectory.duration, phase)
        and gets_no_deeper(trajectory, world, phase)
    )


def is_ray_clear(q: Array, required: RequiredClearance, scene: Scene) -> bool:
    """Return whether the pointing ray of an arm at q, (dof,), is clear by the margin."""
    return not box_in_ray(q, required, scene)


def box_in_ray(q: Array, required: RequiredClearance, scene: Scene) -> str:
    """Return which box is nearest to the pointing ray, at q (dof,); empty: it is clear of all."""
    if not scene.boxes:
        return ''
    gaps = world_of(required, scene).clearances(q)[-1]
    nearest = int(gaps.argmin())
    return scene.names[nearest] if gaps[nearest] <= 0.0 else ''


def is_place_free(q: Array, required: RequiredClearance, scene: Scene) -> bool:
    """Return whether the arm is free at q, shape (dof,) [rad], regardless of its joint limits."""
    arm, ray = required.arm, required.ray_guard_length
    robot, chain = arm_rows(arm, ray)
    boxes, T_arm_base = scene.numbers, mount_inverse(arm)
    depth = tree_depth(len(scene.boxes))
    return bool(
        trajectory_check.is_place_free(
            q,
            ray,
            jit.address(chain),
            robot,
            boxes,
            allowed_bars(arm, scene),
            T_arm_base,
            required.margin + SLACK,
            depth,
        )
    )
