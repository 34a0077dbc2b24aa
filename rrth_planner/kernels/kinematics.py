# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Forward kinematics of a modified Denavit-Hartenberg chain."""

import math

from numba.core.types import float64, int64, UniTuple, void
from rrth_planner.kernels.jit import (
    A,
    COS_ALPHA,
    D,
    kernel,
    KIND,
    MAT,
    NO_BAR,
    OFFSET,
    OUT_MAT,
    PRISMATIC,
    RADIUS_A,
    RADIUS_D,
    REVOLUTE,
    SIN_ALPHA,
    VEC,
)


@kernel(UniTuple(float64, 2)(float64))
def sine_cosine(x):
    """
    Return sine and cosine of an angle [rad], |x| < 1e5, to about 1e-15.

    Reduced by quarter turns (Cody and Waite 1980), then the polynomials of fdlibm (Sun 1993).
    Unlike a call of the C library this is inlined.
    """
    turns = math.floor(x * 0.6366197723675814 + 0.5)
    y = (x - turns * 1.57079632673412561417) - turns * 6.07710050650619224932e-11
    z = y * y
    s = y + y * z * (
        -1.66666666666666324348e-01
        + z
        * (
            8.33333333332248946124e-03
            + z
            * (
                -1.98412698298579493134e-04
                + z
                * (
                    2.75573137070700676789e-06
                    + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
                )
            )
        )
    )
    c = (
        1.0
        - 0.5 * z
        + z
        * z
        * (
            4.16666666666666019037e-02
            + z
            * (
                -1.38888888888741095749e-03
                + z
                * (
                    2.48015872894767294178e-05
                    + z
                    * (
                        -2.75573143513906633035e-07
                        + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11)
                    )
                )
            )
        )
    )
    quarter = int64(turns) & 3
    sine = c if quarter & 1 else s
    cosine = s if quarter & 1 else c
    return (-sine if quarter & 2 else sine), (-cosine if (quarter + 1) & 2 else cosine)


@kernel(void(MAT, VEC, float64, OUT_MAT, int64))
def chain_points(robot, q, ray_length, points, row):
    """
    Write the ends of the arm's bars at q into a row of `points`, in the arm's base frame [m].

    points[row] = x, y, z of the start of the first bar, then of the end of each bar; the last
    bar is the pointing ray. Craig's T = Rx(alpha) Tx(a) Rz(theta) Tz(d), a row at a time.
    """
    px = py = pz = 0.0
    xx, xy, xz = 1.0, 0.0, 0.0
    yx, yy, yz = 0.0, 1.0, 0.0
    zx, zy, zz = 0.0, 0.0, 1.0
    column = 0
    n_rows = robot.shape[0]
    for i in range(n_rows):
        if column == 0 and robot[i, RADIUS_A] != NO_BAR:
            points[row, 0], points[row, 1], points[row, 2] = px, py, pz
            column = 3
        ca, sa, a = robot[i, COS_ALPHA], robot[i, SIN_ALPHA], robot[i, A]
        px, py, pz = px + a * xx, py + a * xy, pz + a * xz
        if robot[i, RADIUS_A] != NO_BAR:
            points[row, column], points[row, column + 1], points[row, column + 2] = px, py, pz
            column += 3
        mx, my, mz = ca * yx + sa * zx, ca * yy + sa * zy, ca * yz + sa * zz
        zx, zy, zz = ca * zx - sa * yx, ca * zy - sa * yy, ca * zz - sa * yz
        theta, d = robot[i, OFFSET], robot[i, D]
        if i == n_rows - 1:
            d = ray_length
        elif robot[i, KIND] == REVOLUTE:
            theta += q[i]
        elif robot[i, KIND] == PRISMATIC:
            d += q[i]
        s, c = sine_cosine(theta)
        yx, yy, yz = c * mx - s * xx, c * my - s * xy, c * mz - s * xz
        xx, xy, xz = c * xx + s * mx, c * xy + s * my, c * xz + s * mz
        if column == 0 and robot[i, RADIUS_D] != NO_BAR:
            points[row, 0], points[row, 1], points[row, 2] = px, py, pz
            column = 3
        px, py, pz = px + d * zx, py + d * zy, pz + d * zz
        if robot[i, RADIUS_D] != NO_BAR:
            points[row, column], points[row, column + 1], points[row, column + 2] = px, py, pz
            column += 3


@kernel(int64(MAT))
def count_bars(robot):
    """Return the number of bars that `chain_points` writes the ends of."""
    n = 0
    for i in range(robot.shape[0]):
        n += int64(robot[i, RADIUS_A] != NO_BAR) + int64(robot[i, RADIUS_D] != NO_BAR)
    return n
