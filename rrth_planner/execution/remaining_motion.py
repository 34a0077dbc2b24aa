# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What is left of a motion that runs, held against the wearer as he is seen now."""

from dataclasses import replace

import numpy as np
from rrth_planner.collision.box_tree import tree_depth
from rrth_planner.collision.certificate import BERNSTEIN_3, BERNSTEIN_4, FINENESS
from rrth_planner.collision.penetration import leads_out
from rrth_planner.collision.world import arm_rows, arm_world, mount_inverse, RESOLUTION, SLACK
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

# Where one motion takes over from another their states are the same: positions, velocities and
# accelerations to rounding [rad, rad/s, rad/s^2].
SAME_STATE = 1e-11, 1e-9, 1e-6
# Newton's steps to the time of that state; a square of a speed that counts as none [rad^2/s^2].
REFINEMENTS, TINY = 3, 1e-12


def taken_over(
    before: ExecutingMotion, phase: float, after: ExecutingMotion, now: float
) -> ExecutingMotion:
    """
    Return a motion that begins a little later, with what the arm does until then before it.

    Parameters
    ----------
    before : ExecutingMotion
        That the arm follows until then.
    phase, now : float
        The time within it that the arm has come to, and the time by which that is so [s].
    after : ExecutingMotion
        That takes over; returned as it is where nothing is known of the way to it.

    """
    duration = before.trajectory.duration
    if phase < 0.0 or len(before.trajectory.times) == 1 or len(after.trajectory.times) == 1:
        return after
    # By place, not by time: clocks differ by microseconds, and an arm may be slower than its
    # motion.
    first = after.trajectory.positions[0]
    end = before.near(min(phase + after.start_time - now, duration), first)
    for _ in range(REFINEMENTS):
        q, v, _ = (row[0] for row in sample(before.trajectory, [end]))
        end += float((first - q) @ v) / max(float(v @ v), TINY)
    end = near_point(before.trajectory, end)
    if not phase < end <= duration or not _is_same_state(before.trajectory, end, after.trajectory):
        return after
    way = part_of(before.trajectory, phase, end)
    return replace(after, trajectory=joined(way, after.trajectory), start_time=now)


def _is_same_state(before: Trajectory, end: float, after: Trajectory) -> bool:
    """Return whether a motion begins with the state of another one at a time [s]."""
    begin = (after.positions[0], after.velocities[0], after.accelerations[0])
    return all(
        np.abs(one[0] - other).max() <= same
        for one, other, same in zip(sample(before, [end]), begin, SAME_STATE, strict=True)
    )


def is_still_free(
    running: ExecutingMotion,
    phase: float,
    arm: ArmModel,
    scene: Scene,
    *,
    margin: float,
    ray_guard_length: float,
) -> bool:
    """
    Return whether what is left of a motion is proven free of the wearer as seen now.

    Parameters
    ----------
    running : ExecutingMotion
    phase : float
        Time within the motion that it has come to [s].
    arm : ArmModel
    scene : Scene
        The wearer in the base frame.
    margin, ray_guard_length : float
        [m].

    """
    trajectory = running.trajectory
    checked = phase
    if phase < running.escape_time:
        world = arm_world(arm, scene, margin, ray_guard_length)
        if not leads_out(trajectory, world, running.escape_time, phase):
            return False
        checked = running.escape_time
    return _is_rest_free(running, checked, arm, scene, margin, ray_guard_length)


def leads_away(
    running: ExecutingMotion,
    phase: float,
    arm: ArmModel,
    scene: Scene,
    *,
    margin: float,
    ray_guard_length: float,
) -> bool:
    """
    Return whether the arm is too near to the wearer now, and proven to get away by going on.

    Then it gets no nearer to any box than it is, comes near no other, and ends clear of all of
    them (`penetration.leads_out`), while an arm that brakes stays. Of a motion whose trouble lies
    ahead this is False: a stop follows its path, and is never nearer than going on.

    Parameters
    ----------
    running, phase, arm, scene, margin, ray_guard_length
        As for `is_still_free`.

    """
    trajectory = running.trajectory
    here = positions_at(trajectory, [phase])[0]
    # Most often it is; an arm that is to be stopped waits for the answer.
    if is_place_free(here, arm, scene, margin, ray_guard_length):
        return False
    world = arm_world(arm, scene, margin, ray_guard_length)
    return world.is_valid(
        trajectory.positions[-1], max(ray_guard_length, running.reach)
    ) and leads_out(trajectory, world, trajectory.duration, phase)


def is_place_free(
    q: Array, arm: ArmModel, scene: Scene, margin: float, ray_guard_length: float
) -> bool:
    """
    Return whether the arm is free at q, shape (dof,) [rad], whatever its joints' limits.

    With the margin and with as much of the pointing ray as is to be clear of the wearer [m].
    """
    _, chain = arm_rows(arm, ray_guard_length)
    boxes, T_arm_base = scene.numbers, mount_inverse(arm)
    depth = tree_depth(len(scene.boxes))
    return bool(
        trajectory_check.is_place_free(
            q, ray_guard_length, chain, boxes, T_arm_base, margin + SLACK, depth
        )
    )


def _is_rest_free(
    running: ExecutingMotion,
    begin: float,
    arm: ArmModel,
    scene: Scene,
    margin: float,
    ray_guard_length: float,
) -> bool:
    """Return what `certify` says of the rest, and of the end with the ray it needs, in one go."""
    trajectory = running.trajectory
    if len(trajectory.times) == 1:
        world = arm_world(arm, scene, margin, ray_guard_length)
        return world.is_valid(trajectory.positions[0], max(ray_guard_length, running.reach))
    robot, chain = arm_rows(arm, ray_guard_length)
    return bool(
        trajectory_check.is_remaining_motion_free(
            trajectory.times,
            trajectory.positions,
            trajectory.velocities,
            trajectory.accelerations,
            begin,
            running.reach,
            FINENESS * RESOLUTION,
            chain,
            robot,
            scene.numbers,
            mount_inverse(arm),
            margin + SLACK,
            tree_depth(len(scene.boxes)),
            BERNSTEIN_4,
            BERNSTEIN_3,
        )
    )
