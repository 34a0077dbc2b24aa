# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What lies ahead on a running motion: its way, cut into cells, and what it asks of the joints."""

import math

from numba.core.types import Array, float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import CUBE, kernel, MAT, OUT_CUBES, OUT_INTS, OUT_MAT, OUT_VEC, VEC

CUBES = Array(float64, 4, 'C', readonly=True)
# Columns of `rows`, one for the begin of each cell and one for the end of the last: time within
# the motion [s], way [-], speed along the way and its slope [1/s, 1/s^2].
TIME, WAY, SPEED, SLOPE = range(4)
# `geometry` (cells, 3, 3, dof): of a cell at its begin, then at its end, the direction of the way
# and how that bends with the way, once and twice derived; then what the motion has done from the
# first cell on: the greatest velocity, acceleration and jerk, or the limits where those are more.
BEGIN, END, MOST = range(3)
# Abscissae and weights of Gauss and Legendre: exact for the speed on a straight edge, which is a
# polynomial of degree 4.
NODES = (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15))
WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)
# Rounds that turn a way into a time: each doubles the digits.
ROUNDS = 6
# A speed that counts as none, so that nothing is divided by zero [1/s].
TINY = 1e-9


@kernel(void(CUBE, VEC, int64, float64, OUT_MAT))
def derivatives_on(curves, times, piece, time, states):
    """
    Write position, velocity, acceleration and jerk of one piece at a time, (4, dof).

    A little before and after it the piece goes on, but by no more than half of itself.
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


@kernel(float64(CUBE, VEC, int64, float64, MAT))
def way_speed(curves, times, piece, time, limits):
    """Return the speed along the way: joints are weighed by their greatest accelerations."""
    width = times[piece + 1] - times[piece]
    u, total = (time - times[piece]) / width, 0.0
    for k in range(curves.shape[2]):
        c1, c2, c3 = curves[piece, 1, k], curves[piece, 2, k], curves[piece, 3, k]
        c4, c5 = curves[piece, 4, k], curves[piece, 5, k]
        v = (((5 * c5 * u + 4 * c4) * u + 3 * c3) * u + 2 * c2) * u + c1
        total += (v / limits[1, k]) ** 2
    return math.sqrt(total) / width


@kernel(float64(CUBE, VEC, int64, float64, float64, MAT))
def way_between(curves, times, piece, begin, end, limits):
    """Return the way between two times of one piece [-]."""
    width, total = end - begin, 0.0
    for i in range(3):
        time = begin + NODES[i] * width
        total += WEIGHTS[i] * way_speed(curves, times, piece, time, limits)
    return total * width


@kernel(float64(CUBE, VEC, int64, float64, float64, float64, MAT))
def time_after(curves, times, piece, begin, end, way, limits):
    """Return when a motion has come so much further than at `begin`, within a cell [s]."""
    time = begin
    for _ in range(ROUNDS):
        lacks = way - way_between(curves, times, piece, begin, time, limits)
        step = lacks / max(way_speed(curves, times, piece, time, limits), TINY)
        time = min(max(time + step, begin), end)
        if abs(step) < 1e-14:
            break
    return time


@kernel(void(MAT, MAT, OUT_MAT, OUT_VEC))
def along_way(states, limits, bends, speeds):
    """
    Write direction of the way and its two derivatives by it, (3, dof); speed, slope, bend, (3,).

    With x the way, q' = t x', q'' = t x'' + k x'^2 and q''' = t x''' + 3 k x' x'' + k' x'^3, where
    t is the direction, k and k' its derivatives.
    """
    dof = states.shape[1]
    vv, va, aa, vj = 0.0, 0.0, 0.0, 0.0
    for k in range(dof):
        scale = 1.0 / limits[1, k]
        v, a, j = states[1, k] * scale, states[2, k] * scale, states[3, k] * scale
        vv, va, aa, vj = vv + v * v, va + v * a, aa + a * a, vj + v * j
    speed = max(math.sqrt(vv), TINY)
    slope = va / speed
    bend = (aa + vj - slope * slope) / speed
    speeds[0], speeds[1], speeds[2] = speed, slope, bend
    one, square = 1.0 / speed, 1.0 / (speed * speed)
    for k in range(dof):
        t = states[1, k] * one
        turn = (states[2, k] - t * slope) * square
        bends[0, k], bends[1, k] = t, turn
        bends[2, k] = (states[3, k] - t * bend - 3.0 * turn * speed * slope) * square * one


@kernel(int64(CUBE, VEC, float64, float64, float64, float64, MAT, OUT_MAT, OUT_INTS, OUT_CUBES))
def look_ahead(curves, times, now, begin, end, step, limits, rows, pieces, geometry):
    """
    Write the cells of a motion between two of its times; return their number.

    Cells end at points of the motion and at `begin`, and no later than `step` after they begin.

    Parameters
    ----------
    curves, times : array, shape (n, 6, dof) and (n + 1,)
        The motion.
    now, begin, end : float
        [s].
    step : float
        [s].
    limits : array, shape (3, dof)
        Velocity, acceleration, jerk.
    rows : array, shape (m + 1, 4)
        Written.
    pieces : array, shape (m,)
        Written: the piece of the motion that each cell is on.
    geometry : array, shape (m, 3, 3, dof)
        Written.

    """
    dof = curves.shape[2]
    states, speeds, most = np.empty((4, dof)), np.empty(3), limits.copy()
    piece, n, time, way = 0, 0, now, 0.0
    while times[piece + 1] <= now:
        piece += 1
    while time < end and n < geometry.shape[0]:
        stop = min(times[piece + 1], end)
        if time < begin:
            stop = min(stop, begin)
        # What is left of the piece in equal parts.
        parts = math.ceil((stop - time) / step - 1e-9)
        until = stop if parts <= 1 else time + (stop - time) / parts
        for side in range(2):
            at = time if side == 0 else until
            derivatives_on(curves, times, piece, at, states)
            along_way(states, limits, geometry[n, side], speeds)
            row = n + side
            rows[row, TIME], rows[row, SPEED], rows[row, SLOPE] = at, speeds[0], speeds[1]
            for order in range(3):
                for k in range(dof):
                    most[order, k] = max(most[order, k], abs(states[order + 1, k]))
        geometry[n, MOST] = most
        rows[n, WAY] = way
        way += way_between(curves, times, piece, time, until, limits)
        rows[n + 1, WAY] = way
        pieces[n] = piece
        n += 1
        time = until
        if until >= times[piece + 1]:
            piece += 1
    return n
