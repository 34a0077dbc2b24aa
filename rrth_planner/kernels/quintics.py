# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The quintic pieces of a timed motion, from its points."""

import math

from numba.core.types import float64, void
from rrth_planner.kernels.jit import CUBE, kernel, MAT, OUT_CUBE, OUT_MAT, VEC

# Bounds of derivatives are by so much larger, for rounding: a share, and [rad].
SHARE, LEAST = 1e-12, 1e-15


@kernel(void(VEC, MAT, MAT, MAT, OUT_CUBE))
def fit(times, positions, velocities, accelerations, curves):
    """
    Write the quintics that fit both ends of each piece, (n - 1, 6, dof), lowest power first.

    As `trajectory.piece_coefficients`, which does without compiled code: a playback has none.
    """
    for i in range(curves.shape[0]):
        T = times[i + 1] - times[i]
        for k in range(curves.shape[2]):
            c1, a0 = velocities[i, k] * T, accelerations[i, k] * T * T
            # What position, velocity and acceleration at the end still lack after three terms.
            p = positions[i + 1, k] - positions[i, k] - c1 - 0.5 * a0
            v = velocities[i + 1, k] * T - c1 - a0
            a = accelerations[i + 1, k] * T * T - a0
            curves[i, 0, k], curves[i, 1, k], curves[i, 2, k] = positions[i, k], c1, 0.5 * a0
            curves[i, 3, k] = 10.0 * p - 4.0 * v + 0.5 * a
            curves[i, 4, k] = -15.0 * p + 7.0 * v - a
            curves[i, 5, k] = 6.0 * p - 3.0 * v + 0.5 * a


@kernel(float64(float64, float64))
def larger(a, b):
    """Return the larger of two numbers; NaN where one is that, which `max` may pass over."""
    return a if a >= b or math.isnan(a) else b


@kernel(void(CUBE, MAT, MAT, OUT_MAT, OUT_MAT), is_short=True)
def bound(curves, quartic, cubic, speeds, bends):
    """
    Write bounds of |dq/du| and |d2q/du2| of quintic pieces over u in [0, 1], (n, dof) each.

    A polynomial lies between its least and greatest Bernstein coefficient (Farouki 2012).
    quartic (5, 5), cubic (4, 4): turn powers into these (`bernstein.to_bernstein`).
    """
    for i in range(curves.shape[0]):
        for k in range(curves.shape[2]):
            speed, bend = 0.0, 0.0
            for row in range(5):
                value = 0.0
                for power in range(5):
                    value += quartic[row, power] * (power + 1) * curves[i, power + 1, k]
                speed = larger(speed, abs(value))
            for row in range(4):
                value = 0.0
                for power in range(4):
                    factor = (power + 1) * (power + 2)
                    value += cubic[row, power] * factor * curves[i, power + 2, k]
                bend = larger(bend, abs(value))
            speeds[i, k], bends[i, k] = speed * (1 + SHARE) + LEAST, bend * (1 + SHARE) + LEAST
