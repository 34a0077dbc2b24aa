# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The quintic pieces of a timed motion, from its points."""

import math

from numba.core.types import float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import CUBE, kernel, MAT, OUT_CUBE, OUT_MAT, OUT_VEC, VEC

# Newton iterations to the nearest point of the motion.
STEPS = 3

# Allowance of bounds of derivatives for rounding: relative, and absolute [rad].
SHARE, LEAST = 1e-12, 1e-15


@kernel(void(VEC, MAT, MAT, MAT, OUT_CUBE))
def fit(times, positions, velocities, accelerations, curves):
    """
    Write the quintics that fit both ends of each piece, (n - 1, 6, dof), lowest power first.

    As `trajectory.piece_coefficients`, which needs no compiled code, for the playback.
    """
    for i in range(curves.shape[0]):
        T = times[i + 1] - times[i]
        for k in range(curves.shape[2]):
            c1, a0 = velocities[i, k] * T, accelerations[i, k] * T * T
            # Remainders of position, velocity and acceleration at the end after three terms.
            p = positions[i + 1, k] - positions[i, k] - c1 - 0.5 * a0
            v = velocities[i + 1, k] * T - c1 - a0
            a = accelerations[i + 1, k] * T * T - a0
            curves[i, 0, k], curves[i, 1, k], curves[i, 2, k] = positions[i, k], c1, 0.5 * a0
            curves[i, 3, k] = 10.0 * p - 4.0 * v + 0.5 * a
            curves[i, 4, k] = -15.0 * p + 7.0 * v - a
            curves[i, 5, k] = 6.0 * p - 3.0 * v + 0.5 * a


@kernel(float64(float64, float64))
def larger(a, b):
    """Return the larger of two numbers; NaN if one is NaN, which `max` may ignore."""
    return a if a >= b or math.isnan(a) else b


@kernel(void(CUBE, MAT, MAT, OUT_MAT, OUT_MAT), is_short=True)
def bound(curves, quartic, cubic, speeds, curvatures):
    """
    Write bounds of |dq/du| and |d2q/du2| of quintic pieces over u in [0, 1], (n, dof) each.

    A polynomial lies between its least and greatest Bernstein coefficient (Farouki 2012).
    quartic (5, 5), cubic (4, 4): turn powers into these (`bernstein.to_bernstein`).
    """
    for i in range(curves.shape[0]):
        for k in range(curves.shape[2]):
            speed, curvature = 0.0, 0.0
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
                curvature = larger(curvature, abs(value))
            speeds[i, k] = speed * (1 + SHARE) + LEAST
            curvatures[i, k] = curvature * (1 + SHARE) + LEAST


@kernel(void(CUBE, VEC, int64, OUT_MAT))
def peaks(curves, times, n_instants, most):
    """
    Write bounds of the velocity, acceleration and jerk of each joint, (3, dof).

    curves, times: as for `state_at`. Each piece is sampled at some instants, its ends included;
    between two of these, h apart, a function f is no greater than there by more than
    h^2 / 8 max|f''|.
    """
    between = 0.125 / (n_instants - 1) ** 2
    most[:] = 0.0
    for i in range(curves.shape[0]):
        T = times[i + 1] - times[i]
        for k in range(curves.shape[2]):
            c1, c2, c3 = curves[i, 1, k], curves[i, 2, k], curves[i, 3, k]
            c4, c5 = curves[i, 4, k], curves[i, 5, k]
            v, a, j = 0.0, 0.0, 0.0
            for instant in range(n_instants):
                u = instant / (n_instants - 1)
                v = larger(v, abs((((5 * c5 * u + 4 * c4) * u + 3 * c3) * u + 2 * c2) * u + c1))
                a = larger(a, abs(((20 * c5 * u + 12 * c4) * u + 6 * c3) * u + 2 * c2))
                j = larger(j, abs((60 * c5 * u + 24 * c4) * u + 6 * c3))
            v += between * (6 * abs(c3) + 24 * abs(c4) + 60 * abs(c5))
            a += between * (24 * abs(c4) + 120 * abs(c5))
            j += between * 120 * abs(c5)
            most[0, k] = larger(most[0, k], v / T)
            most[1, k] = larger(most[1, k], a / T**2)
            most[2, k] = larger(most[2, k], j / T**3)


@kernel(void(CUBE, VEC, float64, OUT_VEC, OUT_VEC))
def state_at(curves, times, time, position, velocity):
    """
    Write position and velocity of a motion at a time, (dof,); at rest before and after it.

    curves (n, 6, dof): its pieces, as from `trajectory.piece_coefficients`; times (n + 1,) [s].
    """
    n, dof = curves.shape[0], curves.shape[2]
    i = 0
    while i < n - 1 and times[i + 1] <= time:
        i += 1
    width = times[i + 1] - times[i]
    u = min(max((time - times[i]) / width, 0.0), 1.0)
    is_outside = time < 0.0 or time > times[n]
    for k in range(dof):
        c0, c1, c2 = curves[i, 0, k], curves[i, 1, k], curves[i, 2, k]
        c3, c4, c5 = curves[i, 3, k], curves[i, 4, k], curves[i, 5, k]
        position[k] = ((((c5 * u + c4) * u + c3) * u + c2) * u + c1) * u + c0
        along = (((5 * c5 * u + 4 * c4) * u + 3 * c3) * u + 2 * c2) * u + c1
        velocity[k] = 0.0 if is_outside else along / width


@kernel(float64(CUBE, VEC, float64, VEC, float64, float64, float64), is_short=True)
def time_on(curves, times, guess, q, same, slow, latest):
    """
    Localize an arm at q, (dof,), on a motion: return its time, NaN where it is off the path.

    curves, times: as for `state_at`; guess: the time that is expected without delay [s], not
    corrected where no joint is faster than `slow` [rad/s]; same: greatest distance of a joint from
    the nearest point of the motion [rad]; latest: greatest delay or lead [s].
    """
    p, v = np.empty_like(q), np.empty_like(q)
    at = guess
    for _ in range(STEPS):
        state_at(curves, times, at, p, v)
        fastest, along, square = 0.0, 0.0, 0.0
        for k in range(q.shape[0]):
            fastest = max(fastest, abs(v[k]))
            along += (q[k] - p[k]) * v[k]
            square += v[k] * v[k]
        if fastest > slow:
            at += along / square
        at = min(max(at, guess - latest), guess + latest)
    state_at(curves, times, at, p, v)
    for k in range(q.shape[0]):
        if not abs(p[k] - q[k]) <= same:
            return math.nan
    return at
