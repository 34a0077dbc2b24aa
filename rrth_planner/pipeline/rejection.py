# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Reasons of rejected requests: the part of the arm, the box, and by how much."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.penetration import box_depths
from rrth_planner.collision.world import with_start, World
from rrth_planner.kernels.layout import ROTATION, SIZE
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.joint_range import joints_beyond, ROUNDING, start_bounds
from rrth_planner.model.scene import Scene
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.planning.pointing_goals import GoalSet
from rrth_planner.timing.lead_in import LeadIn

# A joint may move faster than its limit by this share.
EXCESS = 0.005


@dataclass(frozen=True, slots=True)
class Rejection:
    """
    The reason of a request without a motion.

    Parameters
    ----------
    sentence : str
        For the caller, with figures and units.

    """

    status: PlanStatus
    sentence: str


CANCELLED = Rejection(PlanStatus.CANCELLED, 'the plan was cancelled')


def within_limits(arm: ArmModel, q: Array) -> Array:
    """Return a configuration, (dof,), with joints that are past a limit by rounding at it."""
    low, high = arm.bounds
    if ((low <= q) & (q <= high)).all():
        return q
    near: Array = np.clip(q, low, high)
    return near if float(np.abs(near - q).max()) <= ROUNDING else q


def start_rejection(arm: ArmModel, world: World, q_start: Array) -> Rejection | None:
    """
    Return why no motion can start at q_start, or None.

    Parameters
    ----------
    world : World
        Its boxes grown by the margin and the least clearance beyond it.
    q_start : ndarray, shape (dof,)
        Within the limits, or so little beyond that it can be led in [rad].

    """
    least, most = start_bounds(arm)
    outside = np.flatnonzero((q_start < least - ROUNDING) | (q_start > most + ROUNDING))
    if len(outside) > 0:
        return Rejection(PlanStatus.START_OUT_OF_BOUNDS, _place_sentence(arm, q_start, outside[0]))
    if world.is_free(q_start):
        return None
    colliding = world.colliding_bars(q_start)
    if colliding is not None:
        return Rejection(
            PlanStatus.START_IN_COLLISION,
            f'{colliding[0]} and {colliding[1]} of the arm collide, expected them apart; pairs '
            'that may meet are listed as `allowed`',
        )
    return Rejection(PlanStatus.START_IN_COLLISION, 'the arm violates the margin')


def led_in_rejection(
    arm: ArmModel, world: World, q_start: Array, q_first: Array
) -> Rejection | None:
    """
    Return why joints cannot move from q_start to their limits, at q_first, or None.

    Parameters
    ----------
    world : World
        Its boxes grown by the margin and the least clearance beyond it.
    q_start, q_first : ndarray, shape (dof,)
        [rad].

    """
    if with_start(world, arm, q_start).is_edge_valid(q_start, q_first) and world.is_valid(q_first):
        return None
    beyond = joints_beyond(arm, q_start)
    return Rejection(
        PlanStatus.START_OUT_OF_BOUNDS,
        f'{_place_sentence(arm, q_start, beyond[0])}, or a way to its limit that is free',
    )


def led_in_sentence(arm: ArmModel, q_start: Array) -> str:
    """Return the joints that are led in from beyond a limit, and how far, as a sentence."""
    parts = []
    for k in joints_beyond(arm, q_start).tolist():
        unit = arm.units[k]
        excess = abs(q_start[k] - np.clip(q_start[k], *arm.bounds[:, k]))
        parts.append(f'{arm.joint_names[k]} led in from {excess:.2g} {unit} beyond its limit')
    return ', '.join(parts)


def _place_sentence(arm: ArmModel, q: Array, k: int) -> str:
    low, high = arm.bounds[:, k]
    unit = arm.units[k]
    return f'{arm.joint_names[k]} is at {q[k]:.6g} {unit}, expected {low:.6g} to {high:.6g} {unit}'


def depth_sentence(world: World, depths: Array, margin: float) -> str:
    """
    Return which part of the arm is deepest in which box, and how deep, as a sentence.

    Parameters
    ----------
    world : World
        Its boxes grown by the margin.
    depths : ndarray, shape (n_bars, m)
        As `penetration.box_depths` [m].
    margin : float
        [m].

    """
    bar, box = np.unravel_index(int(np.argmax(depths)), depths.shape)
    depth = max(0.0, float(depths[bar, box]))
    distance = margin - depth
    part, name = world.bar_names[bar], world.box_names[box]
    if distance <= 0.0:
        where = f'{-distance:.4f} m inside box "{name}"'
    else:
        where = f'about {distance:.4f} m, less than the margin of {margin:g} m, from box "{name}"'
    return f'{part} is {where}: penetration depth {depth:.4f} m including the margin'


def lead_rejection(
    arm: ArmModel, world: World, lead: LeadIn, limits: MotionLimits
) -> Rejection | None:
    """Return why a moving arm cannot continue straight ahead until it stops, or None."""
    fastest = np.abs(lead.trajectory.velocities) / limits.velocity
    k = int(fastest.max(axis=0).argmax())
    if fastest[:, k].max() > 1.0 + EXCESS:
        speed = np.abs(lead.trajectory.velocities[:, k]).max()
        unit = f'{arm.units[k]}/s'
        return Rejection(
            PlanStatus.START_MOVES,
            f'{arm.joint_names[k]} moves at up to {speed:.3f} {unit}, expected at most '
            f'{limits.velocity[k]:g} {unit} or an arm at rest',
        )
    ways = np.concatenate([lead.trajectory.positions, lead.q_stop[None]])
    low, high = world.bounds
    beyond = np.maximum(low - ways, ways - high).max(axis=0)
    k = int(beyond.argmax())
    if beyond[k] > ROUNDING:
        unit = arm.units[k]
        return Rejection(
            PlanStatus.START_MOVES,
            f'{arm.joint_names[k]} moves too fast to stop straight ahead: it would pass its '
            f'limit by {beyond[k]:.4f} {unit}, expected an arm at rest or further from it',
        )
    is_free = certify(lead.trajectory, world).is_proven
    if is_free and world.is_edge_valid(
        np.clip(lead.trajectory.positions[-1], low, high), np.clip(lead.q_stop, low, high)
    ):
        return None
    return Rejection(
        PlanStatus.START_MOVES,
        'the arm moves, and straight ahead it would violate the margin before it could stop; '
        'expected an arm at rest or one with room ahead',
    )


def target_rejection(scene: Scene, goal: PointingGoal, margin: float) -> Rejection | None:
    """Return why no configuration may point at a target, or None."""
    boxes = scene.numbers
    away = (goal.target - boxes[:, :SIZE])[:, None]
    local = (away @ boxes[:, ROTATION:].reshape(-1, 3, 3))[:, 0]
    excesses = (np.abs(local) - 0.5 * boxes[:, SIZE:ROTATION]).max(axis=1)
    near = np.flatnonzero(excesses <= margin)
    if len(near) == 0:
        return None
    excess, name = float(excesses[near[0]]), scene.boxes[near[0]].name
    where = ', '.join(f'{value:.3f}' for value in goal.target)
    if excess <= 0.0:
        return Rejection(
            PlanStatus.GOAL_IN_COLLISION,
            f'the target ({where}) m is inside box "{name}", penetration depth {-excess:.4f} m',
        )
    return Rejection(
        PlanStatus.GOAL_IN_COLLISION,
        f'the target ({where}) m is {excess:.4f} m from box "{name}", nearer than the margin of '
        f'{margin:g} m: penetration depth {margin - excess:.4f} m including the margin',
    )


def goal_rejection(world: World, goals: GoalSet) -> Rejection:
    """Return why no configuration that points at the target is valid."""
    if goals.n_aiming == 0:
        return Rejection(
            PlanStatus.GOAL_UNREACHABLE,
            'no configuration within the joint limits points at the target',
        )
    pairs: Counter[tuple[str, str]] = Counter()
    least: dict[tuple[str, str], float] = {}
    reaches = np.maximum(goals.blocked_reaches, world.ray_length)
    n_colliding: Counter[tuple[str, str]] = Counter()
    in_way: Counter[str] = Counter()
    for q, reach, depths in zip(
        goals.q_blocked, reaches, box_depths(world, goals.q_blocked, reaches), strict=True
    ):
        colliding = world.colliding_bars(q, float(reach))
        if colliding is not None:
            n_colliding[colliding] += 1
        # A link of two bars counts once.
        found: dict[tuple[str, str], float] = {}
        for bar, box in np.argwhere(depths > 0.0):
            pair = (world.bar_names[bar], world.box_names[box])
            found[pair] = max(found.get(pair, 0.0), float(depths[bar, box]))
        pairs.update(found.keys())
        in_way.update({box for _, box in found})
        for pair, depth in found.items():
            least[pair] = min(least.get(pair, np.inf), depth)
    blame = 'with next to no clearance'
    if n_colliding and n_colliding.most_common(1)[0][1] > max(pairs.values(), default=0):
        (part, other), count = n_colliding.most_common(1)[0]
        share = 100.0 * count / len(goals.q_blocked)
        blame = f'most often {part} and {other} of the arm collide ({share:.0f} %)'
    elif pairs:
        (bar, box), count = pairs.most_common(1)[0]
        share = 100.0 * count / len(goals.q_blocked)
        # Of many only some were looked at.
        some = (
            '' if len(goals.q_blocked) == goals.n_aiming else f' {len(goals.q_blocked)} looked at'
        )
        is_all = in_way[box] == len(goals.q_blocked)
        blame = (
            (f'box "{box}" takes all{some}, ' if is_all else '')
            + f'most often {bar} and box "{box}" ({share:.0f} %), penetration depth '
            f'at least {least[bar, box]:.4f} m including the margin'
        )
    return Rejection(
        PlanStatus.GOAL_IN_COLLISION,
        f'all {goals.n_aiming} goal configurations tried violate the margin, {blame}',
    )
