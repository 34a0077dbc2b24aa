# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The remaining motion by its path parameter s, in cells: s_dot, s_ddot, derivatives by s."""

import math

from numba.core.types import float64, int64, void
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import CUBE, kernel, MAT, OUT_CUBES, OUT_INTS, OUT_MAT, OUT_VEC, VEC
from rrth_planner.kernels.vectors import copy

# Columns of `rows`, one for the begin of each cell and one for the end of the last: time within
# the motion [s], path parameter s [-], s_dot and s_ddot [1/s, 1/s^2].
TIME, S, S_DOT, S_DDOT = range(4)
# `geometry` (cells, 3, 3, dof): of a cell at its begin, then at its end, the first, second and
# third derivative of q by s; then the greatest velocity, acceleration and jerk of the motion since
# the first cell, or the limits where those are more.
BEGIN, END, MOST = range(3)
# Abscissae and weights of Gauss and Legendre: exact for s_dot on a straight edge, which is a
# polynomial of degree 4.
NODES = (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15))
WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)
# Newton iterations from s to a time: each doubles the digits.
ROUNDS = 6
# Least divisor s_dot [1/s].
TINY = 1e-9


@kernel(void(CUBE, VEC, int64, float64, OUT_MAT), is_inner=True)
def derivatives_on(curves, times, piece, time, states):
    """
    Write position, velocity, acceleration and jerk of one piece at a time, (4, dof).

    The piece is extrapolated to both sides by at most half of its width.
    """
    width = times[piece + 1] - times[piece]
    u, scale = min(max((time - times[piece]) / width, -0.5), 1.5), 1.0 / width
    for k in range(curves.shape[2]):
        c0, c1, c2 = curves[piece, 0, k], curves[piece, 1, k], curves[piece, 2, k]
        c3, c4, c5 = curves[piece, 3, k], curves[piece, 4, k], curves[piece, 5, k]
        states[0, k] = ((((c5 * u + c4) * u + c3) * u + c2) * u + c1) * u + c0
        states[1, k] = ((((5 * c5 * u + 4 * c4) * u + 3 * c3) * u + 2 * c2) * u + c1) * scale
        states[2, k] = (((20 * c5 * u + 12 * c4) * u + 6 * c3) * u + 2 * c2) * scale**2
        states[3, k] = ((60 * c5 * u + 24 * c4) * u + 6 * c3) * scale**3


@kernel(float64(CUBE, VEC, int64, float64, MAT), is_inner=True)
def s_dot_at(curves, times, piece, time, limits):
    """Return s_dot, the norm of the velocities, each over the acceleration limit of its joint."""
    width = times[piece + 1] - times[piece]
    u, total = (time - times[piece]) / width, 0.0
    for k in range(curves.shape[2]):
        c1, c2, c3 = curves[piece, 1, k], curves[piece, 2, k], curves[piece, 3, k]
        c4, c5 = curves[piece, 4, k], curves[piece, 5, k]
        v = (((5 * c5 * u + 4 * c4) * u + 3 * c3) * u + 2 * c2) * u + c1
        total += (v / limits[1, k]) ** 2
    return math.sqrt(total) / width


@kernel(float64(CUBE, VEC, int64, float64, float64, MAT), is_inner=True)
def s_between(curves, times, piece, begin, end, limits):
    """Return the change of s between two times of one piece [-]."""
    width, total = end - begin, 0.0
    for i in range(3):
        time = begin + NODES[i] * width
        total += WEIGHTS[i] * s_dot_at(curves, times, piece, time, limits)
    return total * width


@kernel(float64(CUBE, VEC, int64, float64, float64, float64, MAT))
def time_after(curves, times, piece, begin, end, s, limits):
    """Return the time within a cell at which s has grown by so much since `begin` [s]."""
    time = begin
    for _ in range(ROUNDS):
        lacks = s - s_between(curves, times, piece, begin, time, limits)
        step = lacks / max(s_dot_at(curves, times, piece, time, limits), TINY)
        time = min(max(time + step, begin), end)
        if abs(step) < 1e-14:
            break
    return time


@kernel(void(MAT, MAT, OUT_MAT, OUT_VEC), is_inner=True)
def path_derivatives(states, limits, q_s, speeds):
    """
    Write three derivatives of q by s, (3, dof), and s_dot, s_ddot and s_dddot, (3,).

    q' = t s', q'' = t s'' + k s'^2 and q''' = t s''' + 3 k s' s'' + k' s'^3, where t is the first
    derivative of q by s, k and k' the second and the third.
    """
    dof = states.shape[1]
    vv, va, aa, vj = 0.0, 0.0, 0.0, 0.0
    for k in range(dof):
        scale = 1.0 / limits[1, k]
        v, a, j = states[1, k] * scale, states[2, k] * scale, states[3, k] * scale
        vv, va, aa, vj = vv + v * v, va + v * a, aa + a * a, vj + v * j
    s_dot = max(math.sqrt(vv), TINY)
    s_ddot = va / s_dot
    s_dddot = (aa + vj - s_ddot * s_ddot) / s_dot
    speeds[0], speeds[1], speeds[2] = s_dot, s_ddot, s_dddot
    one, square = 1.0 / s_dot, 1.0 / (s_dot * s_dot)
    for k in range(dof):
        t = states[1, k] * one
        turn = (states[2, k] - t * s_ddot) * square
        q_s[0, k], q_s[1, k] = t, turn
        q_s[2, k] = (states[3, k] - t * s_dddot - 3.0 * turn * s_dot * s_ddot) * square * one


@kernel(int64(CUBE, VEC, float64, float64, float64, float64, MAT, OUT_MAT, OUT_INTS, OUT_CUBES))
def look_ahead(curves, times, now, begin, end, step, limits, rows, pieces, geometry):
    """
    Write the cells of a motion between two of its times; return their number.

    Cells end at points of the motion and at `begin`, and no later than `step` after they begin;
    all times in s. curves (n, 6, dof), times (n + 1,): the motion; limits (3, dof): velocity,
    acceleration, jerk. rows (m + 1, 4), pieces (m,), the piece of the motion that each cell is on,
    and geometry (m, 3, 3, dof) are written.
    """
    dof = curves.shape[2]
    states, speeds, most = np.empty((4, dof)), scratch.floats(3), limits.copy()
    piece, n, time, s = 0, 0, now, 0.0
    while times[piece + 1] <= now:
        piece += 1
    while time < end and n < geometry.shape[0]:
        stop = min(times[piece + 1], end)
        if time < begin:
            stop = min(stop, begin)
        # The rest of the piece in equal parts.
        parts = math.ceil((stop - time) / step - 1e-9)
        until = stop if parts <= 1 else time + (stop - time) / parts
        for side in range(2):
            at = time if side == 0 else until
            derivatives_on(curves, times, piece, at, states)
            path_derivatives(states, limits, geometry[n, side], speeds)
            row = n + side
            rows[row, TIME], rows[row, S_DOT], rows[row, S_DDOT] = at, speeds[0], speeds[1]
            for order in range(3):
                for k in range(dof):
                    most[order, k] = max(most[order, k], abs(states[order + 1, k]))
        for order in range(3):
            copy(most[order], geometry[n, MOST, order])
        rows[n, S] = s
        s += s_between(curves, times, piece, time, until, limits)
        rows[n + 1, S] = s
        pieces[n] = piece
        n += 1
        time = until
        if until >= times[piece + 1]:
            piece += 1
    return n
