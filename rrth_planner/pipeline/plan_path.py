# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""From a wearer and a target to a path, with spare clearance where there is room."""

from collections.abc import Callable
from dataclasses import replace
import time

import numpy as np
from rrth_planner.collision.world import grown, World
from rrth_planner.model.arrays import Array
from rrth_planner.model.joint_range import goal_bounds, keeps_room
from rrth_planner.model.status import PlanStatus
from rrth_planner.pipeline.rejection import CANCELLED, goal_rejection, Rejection
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.planner import plan, PlanResult
from rrth_planner.planning.pointing_goals import (
    FEW_DRAWS,
    goal_configurations,
    GoalSet,
    MANY_DRAWS,
    pointing_problem,
)

# Clearance beyond the margin that the path is planned with, for its blends; in a narrow passage,
# next to none [m].
SPARE_CLEARANCES = (5e-3, 1e-5)
# Shares of the reserve that are tried before, each with few draws of goals and so many samples at
# most: where there is room, few are needed.
SHARES, FEW_SAMPLES = (1.0, 0.5, 0.25), 500


def find_path(
    question: PlanQuestion,
    world: World,
    q_start: Array,
    should_stop: Callable[[], bool],
    begin: float,
) -> PlanResult | Rejection:
    """
    Return the shortest path found, or why there is none.

    A goal is next to a joint's limit only where no other is found.

    Parameters
    ----------
    world : World
        Its boxes grown by the margin.
    q_start : ndarray, shape (dof,)
        Where the path begins, which need not be where the arm is [rad].
    should_stop : callable
        Polled; True cancels.
    begin : float
        When the request came, by `time.perf_counter`: its time limit counts from there [s].

    """
    found = _find_path(question, world, q_start, should_stop, begin)
    if isinstance(found, Rejection):
        return found
    assert found.path is not None
    if keeps_room(question.arm, found.path.waypoints[-1]):
        return found
    kept = replace(world, bounds=goal_bounds(question.arm))
    other = _find_path(question, kept, q_start, should_stop, begin)
    if isinstance(other, PlanResult):
        return other
    return replace(found, is_reproducible=False) if other.status is PlanStatus.TIMEOUT else found


def _find_path(
    question: PlanQuestion,
    world: World,
    q_start: Array,
    should_stop: Callable[[], bool],
    begin: float,
) -> PlanResult | Rejection:
    """Return what `find_path` does, with goals anywhere in the bounds of the world."""
    arm, goal, options = question.arm, question.goal, question.options
    goals: GoalSet | None = None
    result: PlanResult | None = None
    n_samples, is_clocked = 0, False
    # A start may be where goals may not.
    q_near = q_start if world.is_in_bounds(q_start) else np.clip(q_start, *world.bounds)
    reserves = [share * question.reserve for share in SHARES]
    for spare in (*(r for r in reserves if r > SPARE_CLEARANCES[0]), *SPARE_CLEARANCES, 0.0):
        roomy = grown(world, spare)
        # Without spare clearance only where the start has none: an arm that was in motion.
        if not roomy.is_free(q_start) or (spare == 0.0 and goals is not None):
            continue
        goals = goal_configurations(arm, goal, roomy, q_near, FEW_DRAWS)
        if len(goals.q_goals) == 0 and spare <= SPARE_CLEARANCES[0]:
            goals = goal_configurations(arm, goal, roomy, q_near, MANY_DRAWS)
        if len(goals.q_goals) == 0:
            continue
        # Half of the time for the wide search, the rest for the narrow one.
        share = 0.5 if spare >= SPARE_CLEARANCES[0] else 1.0
        left = max(1e-3, share * options.time_limit - (time.perf_counter() - begin))
        n_most = FEW_SAMPLES if spare > SPARE_CLEARANCES[0] else options.max_samples
        limited = replace(options, time_limit=left, max_samples=min(n_most, options.max_samples))
        if q_near is not q_start:
            # Which edges from there are free says nothing of those from the start.
            goals = replace(goals, n_bent=0)
        problem = pointing_problem(arm, goal, roomy, q_start, goals)
        rng = np.random.default_rng(question.seed)
        result = plan(problem, limited, rng, should_stop)
        n_samples += result.n_samples
        is_clocked |= result.status is PlanStatus.TIMEOUT
        if result.status in (PlanStatus.SOLVED, PlanStatus.CANCELLED):
            break
    if result is None:
        # The start has the smallest spare clearance, so the goals were computed.
        assert goals is not None
        return goal_rejection(world, goals)
    if result.status is PlanStatus.SOLVED:
        return replace(result, is_reproducible=False) if is_clocked else result
    elapsed = time.perf_counter() - begin
    sentence = {
        PlanStatus.TIMEOUT: f'no path within the time limit of {options.time_limit:g} s',
        PlanStatus.CANCELLED: CANCELLED.sentence,
        PlanStatus.SAMPLE_LIMIT: 'no free goal configuration was reached',
    }[result.status]
    return Rejection(result.status, f'{sentence} ({n_samples} samples, {elapsed * 1e3:.0f} ms)')
