# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The goal manifold: every configuration whose pointing ray meets the target, in closed form."""

import math

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.collision.arm_validity import is_configuration_free
from rrth_planner.kernels.jit import CHAIN, EDGE_CHECK, kernel, MAT, OUT_MAT, OUT_VEC, VEC
from rrth_planner.kernels.kinematics.trigonometry import sine_cosine
from rrth_planner.kernels.layout import A, COS_ALPHA, D, KIND, OFFSET, PRISMATIC, SIN_ALPHA
from rrth_planner.kernels.vectors import copy, distance

# Joints of an arm that aims in closed form, at most: the search for a nearer goal tries all
# neighbours on a grid, three times as many with every joint.
MAX_CLOSED_DOF = 8
GRADIENTS_ROOM = SQUARE_ROOM = MAX_CLOSED_DOF * MAX_CLOSED_DOF
# Steps of the search for the nearest goal, and halvings of each; the step of its differences [rad
# or m], and the least relative gain that another step follows.
MAX_NEWTON, MAX_HALVINGS, DIFFERENCE, FINE = 12, 6, 1e-6, 1e-5


@kernel(void(MAT, int64, OUT_VEC), is_inner=True)
def tilt_frame(robot, i, frame):
    """Apply Tx(a) Rx(alpha) of row i; frame (12,) = x, y, z axes and origin."""
    for k in range(3):
        frame[9 + k] += robot[i, A] * frame[k]
        y, z = frame[3 + k], frame[6 + k]
        frame[3 + k] = robot[i, COS_ALPHA] * y + robot[i, SIN_ALPHA] * z
        frame[6 + k] = robot[i, COS_ALPHA] * z - robot[i, SIN_ALPHA] * y


@kernel(float64(float64, float64, float64, float64))
def unwrap(angle, near, lower, upper):
    """Return angle + 2 pi n within [lower, upper] closest to `near`, or NaN where none fits."""
    angle += math.tau * math.floor((near - angle) / math.tau + 0.5)
    if angle > upper:
        angle -= math.tau * math.ceil((angle - upper) / math.tau)
    if angle < lower:
        angle += math.tau * math.ceil((lower - angle) / math.tau)
    return angle if lower <= angle <= upper else math.nan


@kernel(void(MAT, VEC, VEC, OUT_VEC), is_inner=True)
def target_from_elbow(robot, target, q, v):
    """Write where the target is (3,), seen from the pan joint at rest; its base is at q [m]."""
    dof = q.shape[0]
    frame = scratch.floats(12)
    for k in range(12):
        frame[k] = 1.0 if k % 4 == 0 and k < 9 else 0.0
    for i in range(dof - 2):
        tilt_frame(robot, i, frame)
        slides = robot[i, KIND] == PRISMATIC
        s, c = sine_cosine(robot[i, OFFSET] + (0.0 if slides else q[i]))
        d = robot[i, D] + (q[i] if slides else 0.0)
        for k in range(3):
            x, y = frame[k], frame[3 + k]
            frame[k], frame[3 + k] = c * x + s * y, c * y - s * x
            frame[9 + k] += d * frame[6 + k]
    pan = dof - 2
    tilt_frame(robot, pan, frame)
    v[0] = v[1] = v[2] = 0.0
    for k in range(3):
        offset = target[k] - frame[9 + k] - robot[pan, D] * frame[6 + k]
        v[0], v[1] = v[0] + offset * frame[k], v[1] + offset * frame[3 + k]
        v[2] += offset * frame[6 + k]


@kernel(float64(MAT, MAT, VEC, VEC, int64, OUT_VEC), is_inner=True)
def pan_and_tilt(robot, bounds, v, q_near, branch, q):
    """
    Write the last two joints so that the ray meets v; return the ray's reach [m], or -1.

    The last joint's axis is square to the one before, the ray square to it, both without `a`
    offset: a pan and tilt unit with the ray beside the pan axis by e = d of the last row. Then,
    seen from the elbow, v . z_last = e fixes the pan (two branches) and the ray's direction the
    tilt (`docs/algorithms.md`, section 4). -1: too near to the pan axis, or beyond a joint's
    limit.
    """
    pan, tilt = q.shape[0] - 2, q.shape[0] - 1
    vx, vy, vz = v[0], v[1], v[2]
    e = robot[tilt, D]
    tilt_sign, ray_sign = robot[tilt, SIN_ALPHA], robot[tilt + 1, SIN_ALPHA]
    squared = vx * vx + vy * vy
    if squared <= e * e:
        return -1.0
    # Sine of phi - atan2(vy, vx), and its cosine on either branch.
    across = math.sqrt(squared)
    rise = tilt_sign * e / across
    level = math.sqrt(1.0 - rise * rise) * (1.0 if branch == 0 else -1.0)
    c, s = (vx * level - vy * rise) / across, (vy * level + vx * rise) / across
    wx = c * vx + s * vy
    phi, theta = math.atan2(s, c), math.atan2(ray_sign * wx, -ray_sign * tilt_sign * vz)
    q[pan] = unwrap(phi - robot[pan, OFFSET], q_near[pan], bounds[0, pan], bounds[1, pan])
    q[tilt] = unwrap(theta - robot[tilt, OFFSET], q_near[tilt], bounds[0, tilt], bounds[1, tilt])
    if math.isnan(q[pan]) or math.isnan(q[tilt]):
        return -1.0
    return math.sqrt(wx * wx + vz * vz)


@kernel(float64(MAT, MAT, VEC, VEC, int64, OUT_VEC))
def aim(robot, bounds, target, q_near, branch, q):
    """
    Complete q so that the ray meets the target; return the ray's reach [m], or -1.

    All joints but the last two are given in q; the target is in the arm's base frame.
    """
    v = scratch.floats(3)
    target_from_elbow(robot, target, q, v)
    return pan_and_tilt(robot, bounds, v, q_near, branch, q)


@kernel(int64(MAT, MAT, VEC, VEC, VEC, int64, int64, float64, OUT_MAT, OUT_VEC))
def goal_candidates(
    robot, bounds, target, q_near, ratios, first, n_draws, longest, candidates, reaches
):
    """
    Write the aiming configurations over a low-discrepancy set of the free joints (`CANDIDATES`).

    The very first draw keeps the free joints of q_near, so an arm that aims already may stay.
    ratios (dof - 2,): steps of the additive recurrence that spreads the draws (Roberts 2018).
    candidates (2 n_draws, dof), reaches (2 n_draws,) [m].
    """
    n_free = ratios.shape[0]
    v = scratch.floats(3)
    n = 0
    for i in range(first, first + n_draws):
        squared = 0.0
        for k in range(n_free):
            share = 0.5 + i * ratios[k]
            share -= math.floor(share)
            spread = bounds[0, k] + share * (bounds[1, k] - bounds[0, k])
            candidates[n, k] = q_near[k] if i == 0 else spread
            squared += (candidates[n, k] - q_near[k]) ** 2
        if squared > longest * longest:
            continue
        target_from_elbow(robot, target, candidates[n], v)
        n_before = n
        for branch in range(2):
            # A rejected branch leaves the free joints unchanged.
            if n > n_before:
                for k in range(n_free):
                    candidates[n, k] = q_near[k] if i == 0 else candidates[n - 1, k]
            reach = pan_and_tilt(robot, bounds, v, q_near, branch, candidates[n])
            if reach >= 0.0 and distance(candidates[n], q_near) <= longest:
                reaches[n] = reach
                n += 1
    return n


@kernel(boolean(CHAIN, MAT, MAT, VEC, float64), is_inner=True)
def is_goal_free(chain, robot, obstacles, q, reach):
    """Return whether q is free with its ray out to the target, and up to ray_guard_length."""
    ray_length = max(reach, robot[q.shape[0], D])
    return is_configuration_free(q, ray_length, chain, robot, obstacles)


@kernel(float64(MAT, MAT, VEC, VEC, int64, OUT_VEC), is_inner=True)
def nearest_on_manifold(robot, bounds, target, q_from, branch, q):
    """
    Move q along its branch of the goal manifold to where it is nearest to q_from.

    Returns the reach there [m]. Gauss and Newton on the squared distance over the free joints,
    derivatives by differences, the step halved until the distance falls. -1: it left the manifold.
    """
    dof, n_free = q.shape[0], q.shape[0] - 2
    gradients, square = scratch.floats(GRADIENTS_ROOM), scratch.floats(SQUARE_ROOM)
    step, q_try = scratch.floats(MAX_CLOSED_DOF), scratch.floats(MAX_CLOSED_DOF)
    # Views of the length of q, as the kernels expect them.
    trial = q_try[:dof]
    reach = aim(robot, bounds, target, q, branch, q)
    for _ in range(MAX_NEWTON):
        if reach < 0.0:
            break
        for i in range(n_free):
            copy(q, trial)
            trial[i] += DIFFERENCE if q[i] + DIFFERENCE <= bounds[1, i] else -DIFFERENCE
            h = trial[i] - q[i]
            if aim(robot, bounds, target, q, branch, trial) < 0.0:
                return reach
            for k in range(dof):
                gradients[MAX_CLOSED_DOF * i + k] = (trial[k] - q[k]) / h
        for i in range(n_free):
            step[i] = 0.0
            for k in range(dof):
                step[i] -= gradients[MAX_CLOSED_DOF * i + k] * (q[k] - q_from[k])
            for j in range(n_free):
                total = 1e-9 if i == j else 0.0
                for k in range(dof):
                    total += gradients[MAX_CLOSED_DOF * i + k] * gradients[MAX_CLOSED_DOF * j + k]
                square[MAX_CLOSED_DOF * i + j] = total
        # Gauss: the matrix is positive.
        for i in range(n_free):
            for j in range(i + 1, n_free):
                factor = square[MAX_CLOSED_DOF * j + i] / square[MAX_CLOSED_DOF * i + i]
                step[j] -= factor * step[i]
                for k in range(i, n_free):
                    square[MAX_CLOSED_DOF * j + k] -= factor * square[MAX_CLOSED_DOF * i + k]
        for i in range(n_free - 1, -1, -1):
            for j in range(i + 1, n_free):
                step[i] -= square[MAX_CLOSED_DOF * i + j] * step[j]
            step[i] /= square[MAX_CLOSED_DOF * i + i]
        share, best, is_nearer = 1.0, distance(q, q_from), False
        for _ in range(MAX_HALVINGS):
            for i in range(n_free):
                trial[i] = min(bounds[1, i], max(bounds[0, i], q[i] + share * step[i]))
            tried = aim(robot, bounds, target, q, branch, trial)
            if tried >= 0.0 and distance(trial, q_from) < best:
                is_nearer, reach = distance(trial, q_from) < best - FINE * best, tried
                copy(trial, q)
                break
            share *= 0.5
        if not is_nearer:
            break
    return reach


@kernel(float64(EDGE_CHECK, float64, CHAIN, MAT, MAT, MAT, VEC, OUT_MAT, int64, float64))
def slide_goal(is_edge_free, resolution, chain, robot, obstacles, bounds, target, path, n, finest):
    """
    Move the last waypoint along the goal manifold so that the path gets shorter; return the gain.

    At once to the nearest point of the manifold if that is free; otherwise pattern search over the
    free joints: the neighbours of a grid whose step halves when none is better, down to `finest`
    [rad]. The new last edge is proven before it is taken.
    """
    dof = path.shape[1]
    n_free = dof - 2
    q, before = np.empty(dof), path[n - 2]
    start_cost = cost = distance(before, path[n - 1])
    branch, closest = 0, math.inf
    for b in range(2):
        copy(path[n - 1], q)
        if aim(robot, bounds, target, path[n - 1], b, q) >= 0.0:
            offset = distance(q, path[n - 1])
            if offset < closest:
                branch, closest = b, offset
    copy(path[n - 1], q)
    reach = nearest_on_manifold(robot, bounds, target, before, branch, q)
    is_nearer = distance(before, q) < cost - 1e-9
    if reach >= 0.0 and not is_nearer:
        return 0.0
    if (
        reach >= 0.0
        and is_goal_free(chain, robot, obstacles, q, reach)
        and is_edge_free(before, q, resolution, chain, robot, obstacles)
    ):
        copy(q, path[n - 1])
        return start_cost - distance(before, q)
    step = 0.4
    while step > finest:
        is_better = False
        for neighbour in range(3**n_free):
            code = neighbour
            is_inside = True
            for k in range(n_free):
                q[k] = path[n - 1, k] + step * (code % 3 - 1)
                is_inside &= (q[k] >= bounds[0, k]) & (q[k] <= bounds[1, k])
                code //= 3
            if not is_inside:
                continue
            reach = aim(robot, bounds, target, path[n - 1], branch, q)
            if reach < 0.0 or distance(before, q) >= cost - 1e-9:
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
