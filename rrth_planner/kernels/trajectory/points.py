# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
What `model.trajectory` does with the points of a motion, compiled, for those who ask often.

Each operation rounds as numpy does: both have the same numbers.
"""

import math

from numba.core.types import boolean, float64, void
from rrth_planner.kernels.jit import CUBE, fused, kernel, MAT, OUT_CUBE, VEC


@kernel(void(VEC, MAT, MAT, MAT, OUT_CUBE), is_short=True, is_exact=True)
def write_pieces(times, positions, velocities, accelerations, curves):
    """Write the polynomials of all pieces, (n - 1, 6, dof), as `trajectory.piece_coefficients`."""
    for i in range(curves.shape[0]):
        T = times[i + 1] - times[i]
        square = T * T
        for k in range(curves.shape[2]):
            c0, c1, a0 = positions[i, k], velocities[i, k] * T, accelerations[i, k] * square
            c2 = 0.5 * a0
            # Remainders of position, velocity and acceleration at the end after three terms.
            p = positions[i + 1, k] - c0 - c1 - c2
            v = velocities[i + 1, k] * T - c1 - a0
            a = accelerations[i + 1, k] * square - a0
            curves[i, 0, k], curves[i, 1, k], curves[i, 2, k] = c0, c1, c2
            curves[i, 3, k] = fused(0.5, a, fused(-4.0, v, 10.0 * p))
            curves[i, 4, k] = fused(-1.0, a, fused(7.0, v, -15.0 * p))
            curves[i, 5, k] = fused(0.5, a, fused(-3.0, v, 6.0 * p))


@kernel(void(CUBE, VEC, VEC, OUT_CUBE), is_short=True, is_exact=True)
def write_states(curves, times, at, states):
    """
    Write the states of a motion at some times, (3, m, dof), as `trajectory.sample`.

    curves (n, 6, dof), times (n + 1,) [s]; at (m,) [s], not decreasing.
    """
    n, i = curves.shape[0], 0
    for j in range(at.shape[0]):
        while i < n - 1 and times[i + 1] <= at[j]:
            i += 1
        width = times[i + 1] - times[i]
        u = min(max((at[j] - times[i]) / width, 0.0), 1.0)
        is_outside = at[j] < 0.0 or at[j] > times[n]
        for k in range(curves.shape[2]):
            c0, c1, c2 = curves[i, 0, k], curves[i, 1, k], curves[i, 2, k]
            c3, c4, c5 = curves[i, 3, k], curves[i, 4, k], curves[i, 5, k]
            states[0, j, k] = ((((c5 * u + c4) * u + c3) * u + c2) * u + c1) * u + c0
            v = (((5.0 * c5 * u + 4.0 * c4) * u + 3.0 * c3) * u + 2.0 * c2) * u + c1
            a = ((20.0 * c5 * u + 12.0 * c4) * u + 6.0 * c3) * u + 2.0 * c2
            states[1, j, k] = 0.0 if is_outside else v / width
            states[2, j, k] = 0.0 if is_outside else a / (width * width)


@kernel(boolean(VEC, CUBE, float64), is_short=True)
def are_points(times, states, farthest):
    """
    Return whether arrays are the points of a motion: finite, in the order of time, from 0.

    times (n,) [s], n > 0; states (3, n, dof); farthest: greatest magnitude of a position [rad].
    """
    n = times.shape[0]
    if n == 0 or n != states.shape[1] or times[0] != 0.0 or not times[n - 1] < math.inf:
        return False
    for i in range(n):
        if i > 0 and not times[i] > times[i - 1]:
            return False
        for k in range(states.shape[2]):
            if not abs(states[0, i, k]) <= farthest:
                return False
            for order in range(1, 3):
                if not abs(states[order, i, k]) < math.inf:
                    return False
    return True
