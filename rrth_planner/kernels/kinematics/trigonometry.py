# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Sine and cosine, from which forward kinematics is made."""

import math

from numba.core.types import float64, int64, UniTuple
from rrth_planner.kernels.jit import kernel


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
    s = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    s = 2.75573137070700676789e-06 + z * s
    s = -1.98412698298579493134e-04 + z * s
    s = 8.33333333332248946124e-03 + z * s
    s = -1.66666666666666324348e-01 + z * s
    s = y + y * z * s
    c = 2.08757232129817482790e-09 - z * 1.13596475577881948265e-11
    c = -2.75573143513906633035e-07 + z * c
    c = 2.48015872894767294178e-05 + z * c
    c = -1.38888888888741095749e-03 + z * c
    c = 4.16666666666666019037e-02 + z * c
    c = 1.0 - 0.5 * z + z * z * c
    quarter = int64(turns) & 3
    sine = c if quarter & 1 else s
    cosine = s if quarter & 1 else c
    return (-sine if quarter & 2 else sine), (-cosine if (quarter + 1) & 2 else cosine)
