# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The goal manifold of any arm: least steps onto it, and along it, by its Jacobian."""

import math

from numba.core.types import float64, UniTuple, void
from rrth_planner.kernels.jit import kernel, MAT, OUT_MAT, OUT_VEC, VEC
from rrth_planner.kernels.kinematics.trigonometry import sine_cosine
from rrth_planner.kernels.layout import A, COS_ALPHA, D, KIND, OFFSET, PRISMATIC, SIN_ALPHA

# Rows of `work`, a column for each joint: how it moves the target past the tool (3), the Jacobian
# of the two equations (2), is the joint held at a limit, a wish, the step, a configuration.
MOVES, JACOBIAN, HELD, WISH, STEP, BEFORE, WORK_ROWS = 0, 3, 5, 6, 7, 8, 9
# A ray passes its target by this much at most, relative to 1 m and to the ray's length.
ACCURACY = 1e-12
# A target nearer to the tool than this has no direction [m].
NEAREST = 1e-6
# Steps of a projection before it gives up; so many in a row without a hundredth gained are enough.
MAX_STEPS, MAX_STALLS = 32, 4
# Damping relative to the square of the angle still to go, at first; then from try to try.
DAMPING, RELAX, STIFFEN = 0.03, 0.2, 8.0
# Damping that keeps the equations of a singular configuration solvable.
LEAST_DAMPING = 1e-12


@kernel(UniTuple(float64, 2)(MAT, VEC, VEC, OUT_MAT))
def measure_aim(robot, target, q, work):
    """
    Return the angle between ray and target seen from the tool [rad], and the target's distance.

    Joint k moves the target past the tool by -m, m = z_k x (target - o_k), or z_k if it slides.
    The Jacobian is -m . u / distance: how it turns the target's direction n towards the ray
    (u = the first axis), and square to that (the second one). The angle is infinite where a
    target has no direction (`docs/algorithms.md`, section 4).
    """
    dof = q.shape[0]
    tx, ty, tz = target[0], target[1], target[2]
    xx, xy, xz, yx, yy, yz, zx, zy, zz = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    for i in range(dof + 1):
        ca, sa, a = robot[i, COS_ALPHA], robot[i, SIN_ALPHA], robot[i, A]
        # (tx, ty, tz): from the origin of the frame to the target.
        tx, ty, tz = tx - a * xx, ty - a * xy, tz - a * xz
        mx, my, mz = ca * yx + sa * zx, ca * yy + sa * zy, ca * yz + sa * zz
        zx, zy, zz = ca * zx - sa * yx, ca * zy - sa * yy, ca * zz - sa * yz
        if i == dof:
            break
        theta, d = robot[i, OFFSET], robot[i, D]
        if robot[i, KIND] == PRISMATIC:
            d += q[i]
            work[MOVES, i], work[MOVES + 1, i], work[MOVES + 2, i] = zx, zy, zz
        else:
            theta += q[i]
            work[MOVES, i] = zy * tz - zz * ty
            work[MOVES + 1, i] = zz * tx - zx * tz
            work[MOVES + 2, i] = zx * ty - zy * tx
        s, c = sine_cosine(theta)
        yx, yy, yz = c * mx - s * xx, c * my - s * xy, c * mz - s * xz
        xx, xy, xz = c * xx + s * mx, c * xy + s * my, c * xz + s * mz
        tx, ty, tz = tx - d * zx, ty - d * zy, tz - d * zz
    distance = math.sqrt(tx * tx + ty * ty + tz * tz)
    if not distance > NEAREST:
        return math.inf, distance
    nx, ny, nz = tx / distance, ty / distance, tz / distance
    cosine = nx * zx + ny * zy + nz * zz
    ux, uy, uz = zx - cosine * nx, zy - cosine * ny, zz - cosine * nz
    sine = math.sqrt(ux * ux + uy * uy + uz * uz)
    if sine > 1e-14:
        ux, uy, uz = ux / sine, uy / sine, uz / sine
        # Next to the ray rounding has tilted u.
        tilt = ux * nx + uy * ny + uz * nz
        ux, uy, uz = ux - tilt * nx, uy - tilt * ny, uz - tilt * nz
    else:
        # On the axis every direction square to it leads to the ray; x is square to z.
        ux, uy, uz = xx, xy, xz
    wx, wy, wz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    for k in range(dof):
        mx, my, mz = work[MOVES, k], work[MOVES + 1, k], work[MOVES + 2, k]
        work[JACOBIAN, k] = -(mx * ux + my * uy + mz * uz) / distance
        work[JACOBIAN + 1, k] = -(mx * wx + my * wy + mz * wz) / distance
    return math.atan2(sine, cosine), distance


@kernel(UniTuple(float64, 2)(OUT_MAT, float64, float64, float64), is_inner=True)
def solve_damped(work, rise, side, damping):
    """Return (J J' + damping)^-1 (rise, side), J the Jacobian of the joints that are not held."""
    a, b, c = damping, 0.0, damping
    for k in range(work.shape[1]):
        if work[HELD, k] == 0.0:
            a += work[JACOBIAN, k] * work[JACOBIAN, k]
            b += work[JACOBIAN, k] * work[JACOBIAN + 1, k]
            c += work[JACOBIAN + 1, k] * work[JACOBIAN + 1, k]
    determinant = a * c - b * b
    return (c * rise - b * side) / determinant, (a * side - b * rise) / determinant


@kernel(void(MAT, VEC, float64, float64, OUT_MAT), is_inner=True)
def least_step(bounds, q, angle, damping, work):
    """
    Write the step J' (J J' + damping)^-1 (angle, 0) from q, within limits.

    Damped least squares (Levenberg 1944; for arms Nakamura and Hanafusa 1986). A joint that would
    pass a limit goes as far as that and is held; the others do what is left.
    """
    rise, side = angle, 0.0
    work[HELD, :] = 0.0
    for _ in range(q.shape[0]):
        f, g = solve_damped(work, rise, side, damping)
        is_inside = True
        for k in range(q.shape[0]):
            if work[HELD, k] != 0.0:
                continue
            step = work[JACOBIAN, k] * f + work[JACOBIAN + 1, k] * g
            work[STEP, k] = min(max(step, bounds[0, k] - q[k]), bounds[1, k] - q[k])
            if work[STEP, k] != step:
                work[HELD, k] = 1.0
                rise -= work[JACOBIAN, k] * work[STEP, k]
                side -= work[JACOBIAN + 1, k] * work[STEP, k]
                is_inside = False
        if is_inside:
            break


@kernel(float64(MAT, MAT, VEC, OUT_VEC, OUT_MAT))
def project(robot, bounds, target, q, work):
    """
    Move q onto the goal manifold by least steps; return the ray's reach [m], or -1.

    The damping follows the success of the steps (Marquardt 1963) and the square of the angle still
    to go (Yamashita and Fukushima 2001). -1: none was found within limits, and q is anything.
    """
    dof = q.shape[0]
    for k in range(dof):
        q[k] = min(max(q[k], bounds[0, k]), bounds[1, k])
    angle, distance = measure_aim(robot, target, q, work)
    damping, n_stalls = DAMPING, 0
    for _ in range(MAX_STEPS):
        # The angle distinguishes the ray from its backward extension.
        if angle * distance <= ACCURACY * (1.0 + distance):
            return distance
        if n_stalls == MAX_STALLS or not angle < math.inf:
            break
        least_step(bounds, q, angle, max(damping * angle * angle, LEAST_DAMPING), work)
        for k in range(dof):
            work[BEFORE, k] = q[k]
            q[k] = min(max(q[k] + work[STEP, k], bounds[0, k]), bounds[1, k])
        before = angle
        angle, distance = measure_aim(robot, target, q, work)
        n_stalls = 0 if angle < 0.99 * before else n_stalls + 1
        if angle < before:
            damping *= RELAX
        else:
            damping *= STIFFEN
            for k in range(dof):
                q[k] = work[BEFORE, k]
            angle, distance = measure_aim(robot, target, q, work)
    return -1.0


@kernel(void(MAT, VEC, OUT_MAT), is_inner=True)
def step_along(bounds, q, work):
    """
    Write the part of a wish that leads along the goal manifold, from q on it, within limits.

    (1 - J' (J J')^-1 J) times the wish (Liegeois 1977); joints at a limit that it
    would push further are held.
    """
    dof = q.shape[0]
    work[HELD, :] = 0.0
    for _ in range(dof + 1):
        rise = side = 0.0
        for k in range(dof):
            if work[HELD, k] == 0.0:
                rise += work[JACOBIAN, k] * work[WISH, k]
                side += work[JACOBIAN + 1, k] * work[WISH, k]
        f, g = solve_damped(work, rise, side, LEAST_DAMPING)
        is_inside = True
        for k in range(dof):
            if work[HELD, k] != 0.0:
                continue
            step = work[WISH, k] - work[JACOBIAN, k] * f - work[JACOBIAN + 1, k] * g
            is_low, is_high = q[k] <= bounds[0, k], q[k] >= bounds[1, k]
            if (is_low and step < 0.0) or (is_high and step > 0.0):
                work[HELD, k] = 1.0
                step = 0.0
                is_inside = False
            work[STEP, k] = step
        if is_inside:
            break
