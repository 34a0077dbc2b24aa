# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""From a path to a trajectory that both collision checkers find free."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.trajectory_validation import violation_seen
from rrth_planner.collision.violation import Disagreement
from rrth_planner.collision.world import grown, World
from rrth_planner.model.joint_range import not_led_in
from rrth_planner.model.path import Path
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import joined, MotionLimits, Trajectory
from rrth_planner.pipeline.collision_escape import Escape
from rrth_planner.pipeline.rejection import CANCELLED, Rejection
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.timing.corner_blends import Blend, round_corners
from rrth_planner.timing.lead_in import LeadIn, reserved
from rrth_planner.timing.parameterization import excess, parameterize, TooFastError

# Blends are proven with this beyond the margin, so that the timed curve, whose proof has other
# intervals, does not fail by rounding [m].
BLEND_CLEARANCE = 2e-6
# A motion from a moving start may exceed its limits by this factor.
EXCESS = 1.01
# Sizes of the first blend of a moving arm, as shares of the free one.
FIRST_SHARES = (0.5, 0.2, 0.0)


def time_path(
    question: PlanQuestion,
    world: World,
    path: Path,
    lead: LeadIn | None,
    escape: Escape | None,
    reach: float,
    should_stop: Callable[[], bool],
) -> Trajectory | Disagreement | Rejection:
    """
    Return the timed path that both checkers find free, with stops at corners if needed.

    Parameters
    ----------
    world : World
        Its boxes grown by the margin.
    path : Path
        Proven free.
    lead : LeadIn or None
        Precedes the path.
    escape : Escape or None
        The lead-in, where it is an escape.
    reach : float
        From the tool at the end of the path to the target [m].
    should_stop : callable
        Polled; True cancels.

    """
    limits = question.limits
    if lead is not None and lead.speed > 0.0:
        path = _straight_on(lead, path)
    if should_stop():
        return CANCELLED
    rounded = round_corners(path, grown(world, BLEND_CLEARANCE), limits)
    if should_stop():
        return CANCELLED
    choices = [rounded]
    if lead is not None and lead.speed > 0.0 and rounded:
        # The arm must be slow enough at the first blend: a smaller one begins later.
        choices += [
            (replace(rounded[0], half_length=share * rounded[0].half_length), *rounded[1:])
            for share in FIRST_SHARES
        ]
    if any(blend.half_length > 0.0 for blend in rounded):
        choices.append(tuple(replace(blend, half_length=0.0) for blend in rounded))
    escape_time = 0.0 if escape is None else escape.trajectory.duration
    timed = [
        motion
        for motion in in_time(path, choices, limits, lead)
        if not_led_in(question.arm, motion) is None
    ]
    if not timed:
        return Rejection(
            PlanStatus.START_MOVES,
            'the arm moves, and no motion found from its state respects the limits of its joints; '
            'expected an arm at rest',
        )
    trajectory = first_proven(timed, world, escape_time)
    if trajectory is None:
        return Rejection(
            PlanStatus.NOT_CERTIFIED, 'a path was found but its trajectory is not proven free'
        )
    if should_stop():
        return CANCELLED
    violation = violation_seen(question.required, question.scene, trajectory, reach, escape_time)
    if should_stop():
        return CANCELLED
    if violation is not None:
        return Disagreement(trajectory, violation, escape_time)
    return trajectory


def in_time(
    path: Path, choices: Sequence[tuple[Blend, ...]], limits: MotionLimits, lead: LeadIn | None
) -> list[Trajectory]:
    """
    Return the trajectories along a path that hold the limits, the fastest first.

    Parameters
    ----------
    choices : sequence of tuple of Blend
        Blends of the corners.
    lead : LeadIn or None
        What comes before the path, whose first edge is then followed from its speed on.

    """
    timed = []
    for blends in choices:
        if lead is None:
            timed.append(parameterize(path, blends, limits))
            continue
        with suppress(TooFastError):
            within = reserved(limits) if lead.speed > 0.0 else limits
            whole = joined(lead.trajectory, parameterize(path, blends, within, lead.speed))
            if excess(whole, lead.allowed) <= EXCESS:
                timed.append(whole)
    # Where blends must be slow, stopping at each corner can be faster.
    return sorted(timed, key=lambda trajectory: trajectory.duration)


def first_proven(
    timed: Sequence[Trajectory], world: World, escape_time: float = 0.0
) -> Trajectory | None:
    """
    Return the first of some trajectories that is proven free, or None.

    escape_time: until then they are proven to escape from the world's boxes [s].
    """
    for trajectory in timed:
        if certify(trajectory, world, escape_time).is_proven:
            return trajectory
    return None


def _straight_on(lead: LeadIn, path: Path) -> Path:
    """Return the path from the end of the lead-in over where the arm would stop."""
    begin = lead.trajectory.positions[-1]
    rest = path.waypoints if path.length > 0.0 else path.waypoints[:1]
    return Path(np.concatenate([begin[None], rest]))
