# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The points of the timed motion along a path with corner blends."""

import math

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import CUBE, kernel, MAT, OUT_CUBE, OUT_MAT, OUT_VEC, VEC
from rrth_planner.kernels.trajectory.speed_profile import (
    BEGIN,
    cell_speeds,
    END,
    knots,
    MOST_PHASES,
    SEGMENT,
    WIDTH,
)

# Ends of the cells of a blend, as shares of its length, where it is passed at several speeds:
# slower in the middle, where that is faster by `WORTH` than one cell at constant speed.
SHARES = (0.0, 0.05, 0.12, 0.22, 0.35, 0.65, 0.78, 0.88, 0.95, 1.0)
WORTH = 1.01
# Messages carry whole nanoseconds; two points closer than this are merged: in shorter pieces the
# rounding of positions and times amounts to a considerable jerk [s].
TICK, CLOSEST = 1e-9, 5e-5
# Directions that differ by no more go straight on: more points would only cost time.
STRAIGHT = 1e-12


def most_points(n: int) -> int:
    """Return how many points `timed_points` writes at most for a path of n > 1 waypoints."""
    return 1 + MOST_PHASES * (n - 1 + (n - 2) * (len(SHARES) - 1))


@kernel(int64(MAT, VEC, OUT_CUBE, OUT_VEC), is_inner=True)
def segments(waypoints, half_lengths, parts, widths):
    """
    Write straight parts and blends in turn, without those of length 0; return their number.

    parts (3, m, dof): where each begins, its direction u, and the change of direction to its end;
    widths (m,): their lengths [rad]. At the path parameter s a segment is at
    q = origin + u s + turn width g(s / width), g(x) = x^3 - x^4 / 2: the direction turns from u to
    u + turn by the smooth step g'.
    """
    n_edges, dof, m = waypoints.shape[0] - 1, waypoints.shape[1], 0
    for i in range(n_edges):
        length = 0.0
        for k in range(dof):
            length += (waypoints[i + 1, k] - waypoints[i, k]) ** 2
        length = math.sqrt(length)
        if length == 0.0:
            continue
        is_turned = False
        for k in range(dof):
            u = (waypoints[i + 1, k] - waypoints[i, k]) / length
            parts[0, m, k] = waypoints[i, k] + half_lengths[i] * u
            parts[1, m, k], parts[2, m, k] = u, 0.0
            if half_lengths[i] > 0.0:
                parts[2, m - 1, k] = u - parts[1, m - 1, k]
                is_turned |= not abs(parts[2, m - 1, k]) <= STRAIGHT
        if half_lengths[i] > 0.0 and not is_turned:
            for k in range(dof):
                parts[2, m - 1, k] = 0.0
        widths[m] = length - half_lengths[i] - half_lengths[i + 1]
        m += 1
        if half_lengths[i + 1] > 0.0:
            for k in range(dof):
                parts[1, m, k] = parts[1, m - 1, k]
                parts[0, m, k] = waypoints[i + 1, k] - half_lengths[i + 1] * parts[1, m, k]
            widths[m] = 2.0 * half_lengths[i + 1]
            m += 1
    return m


@kernel(int64(MAT, VEC, boolean, OUT_MAT), is_inner=True)
def cut(turns, widths, is_fine, places):
    """
    Write the cells of segments, as `speed_profile.cell_speeds` takes them; return their number.

    turns (m, dof), widths (m,): as from `segments`; is_fine: whether blends are cut.
    """
    n = 0
    for row in range(turns.shape[0]):
        is_cut = False
        for k in range(turns.shape[1]):
            is_cut |= is_fine and turns[row, k] != 0.0
        for i in range(len(SHARES) - 1 if is_cut else 1):
            places[n, BEGIN] = SHARES[i] if is_cut else 0.0
            places[n, END] = SHARES[i + 1] if is_cut else 1.0
            places[n, WIDTH], places[n, SEGMENT] = widths[row], row
            n += 1
    return n


@kernel(void(CUBE, int64, float64, float64, float64, float64, int64, OUT_CUBE), is_inner=True)
def joint_state(parts, row, width, s, v, a, n, states):
    """Write as point n the state of the joints at s, with s_dot v and s_ddot a, on a segment."""
    x = s / width
    for k in range(parts.shape[2]):
        u, turn = parts[1, row, k], parts[2, row, k]
        ahead = u + turn * (x * x * (3 - 2 * x))
        curvature = turn * (6 * x * (1 - x) / width)
        states[0, n, k] = parts[0, row, k] + u * s + turn * (width * x**3 * (1 - 0.5 * x))
        states[1, n, k] = ahead * v
        states[2, n, k] = ahead * a + curvature * v * v


@kernel(int64(OUT_VEC, OUT_CUBE, int64))
def merge(times, states, n):
    """
    Merge close ones of n points, and round their times to whole nanoseconds; return their number.

    times (n,) [s]; states (3, n, dof): position, velocity and acceleration. Each point moves along
    its own motion to the rounded time: one left in place while its time moves by half a nanosecond
    would cost a short piece 1e-9 v / T^2 of acceleration. The last one is at rest.
    """
    dof, m = states.shape[2], 1
    for i in range(1, n):
        is_close = times[i] - times[m - 1] < CLOSEST
        if is_close and m == 1 and i < n - 1:
            continue
        if is_close and m > 1:
            m -= 1
        times[m] = times[i]
        for row in range(3):
            for k in range(dof):
                states[row, m, k] = states[row, i, k]
        m += 1
    for i in range(m):
        rounded = math.floor(times[i] / TICK + 0.5) * TICK
        shift = rounded - times[i] if i < m - 1 else 0.0
        times[i] = rounded
        for k in range(dof):
            v, a = states[1, i, k], states[2, i, k]
            states[0, i, k] += shift * v + 0.5 * shift * shift * a
            states[1, i, k] = v + shift * a if i < m - 1 else 0.0
            if i == m - 1:
                states[2, i, k] = 0.0
    return m


@kernel(int64(MAT, VEC, MAT, float64, OUT_VEC, OUT_CUBE))
def timed_points(waypoints, half_lengths, limits, v_start, times, states):
    """
    Write the points of the motion along a path; return their number, 0 where there is none.

    waypoints (n, dof), n > 1, not all the same [rad]; half_lengths (n,): of the blend at each one,
    0 at both ends [rad]; limits (3, dof): velocity, acceleration, jerk; v_start: speed along the
    first edge at the start [rad/s], from which there may be no room to slow down. times (most,)
    [s] and states (3, most, dof), as for `merge`, have room for `most_points`.
    """
    dof, most = waypoints.shape[1], 2 * waypoints.shape[0]
    parts, widths = np.empty((3, most, dof)), np.empty(most)
    m = segments(waypoints, half_lengths, parts, widths)
    directions, turns = parts[1, :m], parts[2, :m]
    # Once with whole blends, once with blends that are cut.
    most = m * (len(SHARES) - 1)
    places, cells, speeds = np.empty((2, most, 4)), np.empty((2, most, 4)), np.empty((2, most + 1))
    chosen, n_cells, best = 0, 0, math.inf
    for way in range(2):
        n = cut(turns, widths, way == 1, places[way])
        duration = cell_speeds(
            directions, turns, places[way, :n], limits, v_start, cells[way], speeds[way]
        )
        if way == 0 or best > WORTH * duration:
            chosen, n_cells, best = way, n, duration
    if best == math.inf:
        return 0
    rows = np.empty((MOST_PHASES * n_cells, 5))
    n = knots(cells[chosen, :n_cells], speeds[chosen], rows)
    times[0] = 0.0
    joint_state(parts, 0, widths[0], 0.0, speeds[chosen, 0], 0.0, 0, states)
    for i in range(n):
        place = places[chosen, int(rows[i, 1])]
        row, width, s = int(place[SEGMENT]), place[WIDTH], place[BEGIN] * place[WIDTH] + rows[i, 2]
        times[i + 1] = rows[i, 0]
        joint_state(parts, row, width, s, rows[i, 3], rows[i, 4], i + 1, states)
    for k in range(dof):
        states[0, n, k] = waypoints[waypoints.shape[0] - 1, k]
    return merge(times, states, n + 1)
