# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The goal manifold of any arm, numerically: the counterparts of `pan_tilt_ik`."""

import math

from numba.core.types import boolean, float64, int64
import numpy as np
from rrth_planner.kernels.jit import CHAIN, EDGE_CHECK, kernel, MAT, OUT_MAT, OUT_VEC, VEC
from rrth_planner.kernels.kinematics.ik_projection import (
    measure_aim,
    project,
    STEP,
    step_along,
    WISH,
    WORK_ROWS,
)
from rrth_planner.kernels.kinematics.pan_tilt_ik import is_goal_free, unwrap
from rrth_planner.kernels.layout import KIND, REVOLUTE
from rrth_planner.kernels.vectors import copy, distance

# Configurations nearer than this in every joint are one [rad or m].
TWIN = 1e-6


@kernel(boolean(MAT, int64, VEC), is_inner=True)
def is_among(candidates, n, q):
    """Return whether q is one of the first n candidates."""
    for i in range(n):
        k = 0
        while k < q.shape[0] and abs(candidates[i, k] - q[k]) < TWIN:
            k += 1
        if k == q.shape[0]:
            return True
    return False


@kernel(int64(MAT, MAT, VEC, VEC, VEC, int64, int64, float64, OUT_MAT, OUT_VEC))
def goal_candidates(
    robot, bounds, target, q_near, ratios, first, n_draws, longest, candidates, reaches
):
    """
    Write the projections of a low-discrepancy set onto the goal manifold (`CANDIDATES`).

    The very first one is that of q_near, so an arm that aims already may stay. Every other draw
    takes its revolute joints by whole turns as near to q_near as limits allow.
    ratios (dof,): steps of the additive recurrence that spreads the draws (Roberts 2018).
    candidates (2 n_draws, dof), reaches (2 n_draws,) [m].
    """
    dof = q_near.shape[0]
    work = np.empty((WORK_ROWS, dof))
    n = 0
    for i in range(2 * first, 2 * (first + n_draws)):
        q = candidates[n]
        for k in range(dof):
            low, high = bounds[0, k], bounds[1, k]
            q[k] = low + (0.5 + i * ratios[k]) % 1.0 * (high - low)
            if i % 2 == 0 and robot[k, KIND] == REVOLUTE:
                q[k] = unwrap(q[k], q_near[k], low, high)
            if i == 0:
                q[k] = q_near[k]
        reach = project(robot, bounds, target, q, work)
        is_near = reach >= 0.0 and distance(q, q_near) <= longest
        if is_near and not is_among(candidates, n, q):
            reaches[n] = reach
            n += 1
    return n


@kernel(float64(EDGE_CHECK, float64, CHAIN, MAT, MAT, MAT, VEC, OUT_MAT, int64, float64))
def slide_goal(is_edge_free, resolution, chain, robot, obstacles, bounds, target, path, n, finest):
    """
    Move the last waypoint along the goal manifold so that the path gets shorter; return the gain.

    Tried are the direction of steepest descent, then those of the single joints, each projected
    back, by a step that halves when none is better, down to `finest` [rad]. The new last edge is
    proven before it is taken.
    """
    dof = path.shape[1]
    q, before, work = np.empty(dof), path[n - 2], np.empty((WORK_ROWS, dof))
    start_cost = cost = distance(before, path[n - 1])
    step = 0.8
    while step > finest:
        is_better = False
        for direction in range(dof + 1):
            copy(path[n - 1], q)
            measure_aim(robot, target, q, work)
            for k in range(dof):
                steepest = before[k] - q[k]
                work[WISH, k] = steepest if direction == 0 else float64(k == direction - 1)
            step_along(bounds, q, work)
            length = gradient = 0.0
            for k in range(dof):
                length += work[STEP, k] ** 2
                gradient += work[STEP, k] * (before[k] - q[k])
            length = math.sqrt(length)
            advance = min(step, length) if direction == 0 else step
            # A straight step would not shorten: |g - s u|^2 >= |g|^2.
            if not (advance >= finest and 2.0 * abs(gradient) > advance * length):
                continue
            for k in range(dof):
                q[k] += math.copysign(advance / length, gradient) * work[STEP, k]
            reach = project(robot, bounds, target, q, work)
            # Less than a fifth of the predicted decrease is no progress (Armijo 1966).
            promised = advance * abs(gradient) / (length * cost)
            if reach < 0.0 or not distance(before, q) < cost - 0.2 * promised:
                continue
            if is_goal_free(chain, robot, obstacles, q, reach) and is_edge_free(
                before, q, resolution, chain, robot, obstacles
            ):
                copy(q, path[n - 1])
                cost = distance(before, q)
                is_better = True
                break
        if not is_better:
            step *= 0.5
    return start_cost - cost
