# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of the remaining motion against the present wearer."""

from dataclasses import replace

import numpy as np
from rrth_planner.collision.box_tree import tree_depth
from rrth_planner.collision.certificate import BERNSTEIN_3, BERNSTEIN_4, FINENESS
from rrth_planner.collision.penetration import gets_no_deeper, leads_out
from rrth_planner.collision.world import (
    allowed_bars,
    arm_rows,
    arm_world,
    mount_inverse,
    RESOLUTION,
    SLACK,
    without_ray,
)
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.kernels.collision import trajectory_check
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import (
    joined,
    near_point,
    part_of,
    positions_at,
    sample,
    Trajectory,
)

# At a handover the states of both motions agree to rounding: positions, velocities and
# accelerations [rad, rad/s, rad/s^2].
SAME_STATE = 1e-11, 1e-9, 1e-6
# Newton's steps to the time of that state; a square of a speed that counts as none [rad^2/s^2].
REFINEMENTS, TINY = 3, 1e-12


def with_lead_in(
    before: ExecutingMotion, phase: float, after: ExecutingMotion, now: float
) -> ExecutingMotion:
    """
    Return a motion that begins a little later, preceded by the present motion until then.

    The arm is now at the time `phase` within the motion before [s]. The motion after is returned
    as it is where it does not continue that.
    """
    duration = before.trajectory.duration
    if phase < 0.0 or len(before.trajectory.times) == 1 or len(after.trajectory.times) == 1:
        return after
    # By position, not by time: clocks differ by microseconds, and an arm may be slower than its
    # motion.
    first = after.trajectory.positions[0]
    end = before.near(min(phase + after.start_time - now, duration), first)
    for _ in range(REFINEMENTS):
        q, v, _ = (row[0] for row in sample(before.trajectory, [end]))
        end += float((first - q) @ v) / max(float(v @ v), TINY)
    end = near_point(before.trajectory, end)
    if not phase < end <= duration or not _is_same_state(before.trajectory, end, after.trajectory):
        return after
    lead_in = part_of(before.trajectory, phase, end)
    return replace(after, trajectory=joined(lead_in, after.trajectory), start_time=now)


def _is_same_state(before: Trajectory, end: float, after: Trajectory) -> bool:
    """Return whether a motion begins with the state of another one at a time [s]."""
    begin = (after.positions[0], after.velocities[0], after.accelerations[0])
    return all(
        np.abs(one[0] - other).max() <= same
        for one, other, same in zip(sample(before, [end]), begin, SAME_STATE, strict=True)
    )


def is_remaining_free(
    running: ExecutingMotion,
    phase: float,
    arm: ArmModel,
    scene: Scene,
    *,
    margin: float,
    ray_guard_length: float,
) -> bool:
    """
    Return whether the remaining motion is proven free of the present wearer.

    The arm is at a time `phase` within it [s], the scene is in the base frame, `margin` and
    `ray_guard_length` are in metres. At the end the ray must be free up to the target.
    """
    trajectory, begin = running.trajectory, phase
    if phase < running.escape_time:
        world = arm_world(arm, scene, margin, ray_guard_length)
        if not leads_out(trajectory, world, margin, running.escape_time, phase):
            return False
        begin = running.escape_time
    if len(trajectory.times) == 1:
        world = arm_world(arm, scene, margin, ray_guard_length)
        reach = max(ray_guard_length, running.target_distance)
        return world.is_free(trajectory.positions[0], reach)
    robot, chain = arm_rows(arm, ray_guard_length)
    return bool(
        trajectory_check.is_remaining_motion_free(
            trajectory.times,
            trajectory.positions,
            trajectory.velocities,
            trajectory.accelerations,
            begin,
            running.target_distance,
            FINENESS * RESOLUTION,
            chain,
            robot,
            scene.numbers,
            allowed_bars(arm, scene),
            mount_inverse(arm),
            margin + SLACK,
            tree_depth(len(scene.boxes)),
            BERNSTEIN_4,
            BERNSTEIN_3,
        )
    )


def escapes_by_continuing(
    running: ExecutingMotion,
    phase: float,
    arm: ArmModel,
    scene: Scene,
    *,
    margin: float,
    ray_guard_length: float,
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
    if is_place_free(here, arm, scene, margin, ray_guard_length):
        return False
    world = arm_world(arm, scene, margin, ray_guard_length)
    reach = max(ray_guard_length, running.target_distance)
    return (
        world.is_free(trajectory.positions[-1], reach)
        and leads_out(trajectory, without_ray(world), margin, trajectory.duration, phase)
        and gets_no_deeper(trajectory, world, phase)
    )


def is_ray_clear(
    q: Array, arm: ArmModel, scene: Scene, margin: float, ray_guard_length: float
) -> bool:
    """Return whether the pointing ray of an arm at q, (dof,), is clear by a margin [m]."""
    world = arm_world(arm, scene, margin, ray_guard_length)
    return bool(world.clearances(q)[-1].min(initial=np.inf) > 0.0)


def is_place_free(
    q: Array, arm: ArmModel, scene: Scene, margin: float, ray_guard_length: float
) -> bool:
    """
    Return whether the arm is free at q, shape (dof,) [rad], regardless of its joint limits.

    With the margin, and with the pointing ray up to `ray_guard_length` [m].
    """
    robot, chain = arm_rows(arm, ray_guard_length)
    boxes, T_arm_base = scene.numbers, mount_inverse(arm)
    depth = tree_depth(len(scene.boxes))
    return bool(
        trajectory_check.is_place_free(
            q,
            ray_guard_length,
            chain,
            robot,
            boxes,
            allowed_bars(arm, scene),
            T_arm_base,
            margin + SLACK,
            depth,
        )
    )
