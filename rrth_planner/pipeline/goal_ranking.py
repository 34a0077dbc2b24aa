# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Goal configurations ranked by how soon the arm may be there beside a wearer who moves."""

import numpy as np
from rrth_planner.collision.separation import permitted_ahead
from rrth_planner.collision.world import grown, World
from rrth_planner.model.arrays import Array
from rrth_planner.model.joint_range import keeps_room
from rrth_planner.model.path import Path
from rrth_planner.model.separation import seen_body, SeenBody, Separation
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.plan_path import SPARE_CLEARANCES
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.pointing_goals import FEW_DRAWS, goal_configurations, spreading_ratios
from rrth_planner.timing.corner_blends import round_corners
from rrth_planner.timing.parameterization import parameterize

# Goals are sought near so many places, spread round the start by up to so much [rad or m]; each
# counts with its nearest ones.
N_PLACES, SPREAD, NEAREST = 8, 1.0, 4
# So many goals, those with the shortest straight edges, are timed.
N_TIMED = 8
# Spacing of the places that a rate is permitted at [s], and the least rate that counts [-].
SPACING, LEAST = 0.03, 0.03


def quickest_path(question: PlanQuestion, world: World, q_start: Array, path: Path) -> Path:
    """
    Return a path, or a straight edge to another goal, whichever the arm may follow sooner.

    By the greatest rates from which a stop keeps clear of a wearer at rest who may move at any
    time (`docs/algorithms.md`, section 8).

    Parameters
    ----------
    question : PlanQuestion
        With `rules`.
    world : World
        Its boxes grown by the margin.
    q_start : ndarray, shape (dof,)
        Where the path begins [rad].

    """
    assert question.rules is not None
    settings = Separation(
        arm=question.arm,
        rules=question.rules,
        margin=question.margin,
        limits=question.limits,
        stop_limits=question.stop_limits or question.limits,
    )
    body = seen_body(question.scene, question.body_age, settings.rules)
    best = path
    blends = round_corners(path, world, question.limits)
    soonest = permitted_duration(parameterize(path, blends, question.limits), body, settings)
    has_room = keeps_room(question.arm, path.waypoints[-1])
    for q_goal in _straight_goals(question, world, q_start, has_room):
        edge = Path(np.stack([q_start, q_goal]))
        motion = parameterize(edge, (), question.limits)
        if motion.duration >= soonest:
            continue
        duration = permitted_duration(motion, body, settings)
        if duration < soonest:
            best, soonest = edge, duration
    return best


def permitted_duration(motion: Trajectory, body: SeenBody, settings: Separation) -> float:
    """Return an estimate of how long a motion takes at the rates that are permitted [s]."""
    n = max(2, int(np.ceil(motion.duration / SPACING)) + 1)
    places = np.linspace(0.0, motion.duration, n)
    rates = permitted_ahead(motion, places, n, body, settings, settings.margin)[:, 0]
    slowness = 1.0 / np.maximum(rates, LEAST)
    return float(0.5 * (slowness[1:] + slowness[:-1]).sum() * (places[1] - places[0]))


def _straight_goals(
    question: PlanQuestion, world: World, q_start: Array, has_room: bool
) -> list[Array]:
    """
    Return the goals that a straight free edge reaches, the nearest first.

    has_room: only those that keep away from the joints' limits.
    """
    arm, goal = question.arm, question.goal
    widest = SPARE_CLEARANCES[0]
    spares = [spare for spare in (question.reserve, widest) if spare >= widest]
    roomy = next((w for w in (grown(world, s) for s in spares) if w.is_valid(q_start)), None)
    if roomy is None:
        return []
    spread = np.arange(N_PLACES)[:, None] * spreading_ratios(arm.dof)
    places = q_start + SPREAD * (2.0 * ((0.5 + spread) % 1.0) - 1.0)
    found = [
        q_goal
        for place in np.clip(places, *arm.bounds)
        for q_goal in goal_configurations(arm, goal, roomy, place, FEW_DRAWS).q_goals[:NEAREST]
        if keeps_room(arm, q_goal) or not has_room
    ]
    found.sort(key=lambda q_goal: float(np.linalg.norm(q_goal - q_start)))
    return [q_goal for q_goal in found if roomy.is_edge_valid(q_start, q_goal)][:N_TIMED]
