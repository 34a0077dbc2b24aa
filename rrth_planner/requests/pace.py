# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The pace that a request asks for: lower limits of the joints than those of the parameters."""

from dataclasses import replace

import numpy as np
from rrth_planner.model.errors import RequestError
from rrth_planner.model.goal import PacedGoal, PointingGoal
from rrth_planner.model.status import ErrorCode
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.request import PlanQuestion

# A motion is made so much longer than its least duration, so that the next plan is not shorter by
# rounding [-]; the least duration is kept up to this [s].
MORE, ROUNDING = 1e-3, 1e-6
# So often a motion is planned again that is too short.
MOST_SLOWER = 5


def limits_of(limits: MotionLimits, goal: PointingGoal) -> MotionLimits:
    """Return the limits of a motion to a goal, given those of the parameters."""
    if not isinstance(goal, PacedGoal):
        return limits
    return replace(limits, velocity=np.minimum(limits.velocity, goal.max_velocity))


def is_too_short(plan: MotionPlan, goal: PointingGoal) -> bool:
    """Return whether a plan has a motion of less than its goal's least duration."""
    if plan.trajectory is None or not isinstance(goal, PacedGoal):
        return False
    # An arm that aims already has nowhere to go.
    return 0.0 < plan.trajectory.duration < goal.min_duration - ROUNDING


def require_long_enough(plan: MotionPlan, goal: PointingGoal) -> None:
    """Raise RequestError where a plan has a motion of less than its goal's least duration."""
    if is_too_short(plan, goal):
        assert plan.trajectory is not None and isinstance(goal, PacedGoal)
        raise RequestError(
            ErrorCode.PLANNING_FAILED,
            f'the arm moves, and the motion takes {plan.trajectory.duration:.3f} s from there, '
            f'expected at least {goal.min_duration:g} s (min_duration)',
        )


def slower(question: PlanQuestion, plan: MotionPlan, goal: PointingGoal) -> PlanQuestion:
    """
    Return the question whose motion lasts as long as the goal asks for.

    A motion from rest, along the same path, scales as a whole. For an arm that moves, whose
    lead-in and stops do not scale, only the velocity is lower: several questions may be needed.
    """
    assert plan.trajectory is not None and isinstance(goal, PacedGoal)
    ratio = plan.trajectory.duration / goal.min_duration / (1.0 + MORE)
    v, a, j = question.limits.rows
    if question.moving is not None:
        return replace(question, limits=MotionLimits(ratio * v, a, j))
    return replace(question, limits=MotionLimits(ratio * v, ratio**2 * a, ratio**3 * j))
