# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How far an arm that follows a timed motion has come."""

import math

from numba.core.types import float64, void
import numpy as np
from rrth_planner.kernels.jit import CUBE, kernel, OUT_VEC, VEC

# Newton's steps to where the arm is nearest to.
STEPS = 3


@kernel(void(CUBE, VEC, float64, OUT_VEC, OUT_VEC))
def state_at(curves, times, time, position, velocity):
    """
    Write position and velocity of a motion at a time, (dof,); outside of it, it stands still.

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
    Return the time within a motion that an arm at q, (dof,), is at; NaN where it is elsewhere.

    Parameters
    ----------
    curves, times : array
        As for `state_at`.
    guess : float
        The time that it would be at if it were exact [s].
    q : array, shape (dof,)
    same : float
        It is elsewhere where a joint is further than this from where it is nearest to [rad].
    slow : float
        How late it is cannot be told where no joint is faster than this [rad/s].
    latest : float
        By how much it may be late, or early [s].

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
