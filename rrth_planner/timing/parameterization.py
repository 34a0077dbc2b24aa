# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Time parameterization: straight edges and corner blends, within the joints' limits."""

from dataclasses import dataclass
from itertools import pairwise
import math

import numpy as np
from rrth_planner.kernels.trajectory.speed_profile import cell_speeds, knots, MOST_PHASES
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import MotionLimits, piece_coefficients, Trajectory
from rrth_planner.timing.corner_blends import Blend

# A path shorter than this is no motion: the arm holds still for HOLD seconds [rad, s].
STILL, HOLD = 1e-9, 0.1
# Messages carry whole nanoseconds; two points closer than this are merged: in shorter pieces the
# rounding of positions and times amounts to a considerable jerk [s].
TICK, CLOSEST = 1e-9, 5e-5
# Cells of a blend, as shares of its length: one cell at constant speed, or several, slower in the
# middle, where that is faster by `WORTH`.
SUBDIVISIONS = ((0.0, 1.0), (0.0, 0.05, 0.12, 0.22, 0.35, 0.65, 0.78, 0.88, 0.95, 1.0))
WORTH = 1.01
# Excess of a limit that is rounding, or the bound between two samples of a piece.
ALLOWED = 2e-3
# Most attempts to slow a motion down as a whole; its rounding.
ATTEMPTS, ROUNDING = 5, 1e-4

# Samples of a piece at which limits are checked: the powers of u in the first and the second
# derivative there.
_U = np.linspace(0.0, 1.0, 33)[:, None]
_BETWEEN = (1.0 / 32) ** 2 / 8
_FIRST = np.arange(1, 6) * _U ** np.arange(5)
_SECOND = np.array([2.0, 6.0, 12.0, 20.0]) * _U ** np.arange(4)
_THIRD = np.array([6.0, 24.0, 60.0]) * _U ** np.arange(3)


class TooFastError(RrthError):
    """The path is too short to slow down from the speed at the start."""


def parameterize(
    path: Path, blends: tuple[Blend, ...], limits: MotionLimits, v_start: float = 0.0
) -> Trajectory:
    """
    Return the trajectory that follows a path with rounded corners to rest.

    Cells get the fastest profile of constant jerk phases between the speeds that
    `kernels.trajectory.speed_profile` finds. On straight ones, and on blends at constant speed,
    every piece between two points is a polynomial of at most fourth degree: the quintic that a
    controller interpolates is the curve itself.

    Parameters
    ----------
    blends : tuple of Blend
        One for each inner waypoint; `half_length` 0 means to stop there, unless the path goes
        straight on.
    v_start : float
        Speed along the first edge at the start, without acceleration [rad/s]. Above 0 the limits
        are for the caller to check (`excess`).

    Returns
    -------
    Trajectory
        At rest at its end; its times are whole nanoseconds.

    Raises
    ------
    TooFastError
        The path is too short to slow down from the speed at the start.

    """
    q = path.waypoints
    if path.length < STILL:
        still = np.zeros((2, q.shape[1]))
        return Trajectory(np.array([0.0, HOLD]), q[[0, 0]], still, still)
    segments = _segments(path, blends)
    table = np.stack(limits.rows)
    whole, fine = (_speeds(segments, shares, table, v_start) for shares in SUBDIVISIONS)
    best = whole if whole.duration <= WORTH * fine.duration else fine
    if best.duration == math.inf:
        raise TooFastError(
            f'speed at the start: {v_start:.3g} rad/s, expected one from which the path is '
            'long enough to slow down'
        )
    trajectory = _assemble(*_knots(segments, best))
    # A motion with a speed at its start cannot be slowed down as a whole; the caller checks it
    # against the limits together with its lead-in.
    return trajectory if v_start > 0.0 else _within_limits(trajectory, limits)


@dataclass(frozen=True, slots=True, eq=False)
class _Segments:
    """
    Straight parts and blends in turn, without those of length 0.

    At the path parameter s, q = origins + u s + turns width g(s / width), g(x) = x^3 - x^4 / 2;
    the direction turns from u to u + turns by the smooth step g'.
    """

    end: Array
    origins: Array
    directions: Array
    turns: Array
    widths: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Speeds:
    """Result of `speed_profile.cell_speeds`; `rows` is the segment of each cell."""

    rows: list[int]
    places: Array
    cells: Array
    speeds: Array
    duration: float


def _segments(path: Path, blends: tuple[Blend, ...]) -> _Segments:
    q = path.waypoints
    cuts = [0.0, *(blend.half_length for blend in blends), 0.0]
    edges = np.diff(q, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    u = edges / lengths[:, None]
    rows: list[tuple[Array, Array, Array, float]] = []
    for i, length in enumerate(lengths.tolist()):
        straight = length - cuts[i] - cuts[i + 1]
        rows.append((q[i] + cuts[i] * u[i], u[i], np.zeros_like(u[i]), straight))
        if cuts[i + 1] > 0.0:
            half = cuts[i + 1]
            rows.append((q[i + 1] - half * u[i], u[i], u[i + 1] - u[i], 2 * half))
    return _Segments(q[-1], *map(np.array, zip(*rows, strict=True)))


def _speeds(
    segments: _Segments, shares: tuple[float, ...], table: Array, v_start: float
) -> _Speeds:
    """Return the speed profile of a path whose blends are cut into cells at some shares."""
    rows, places = [], []
    for row, width in enumerate(segments.widths.tolist()):
        is_blend = bool(segments.turns[row].any())
        for begin, end in pairwise(shares if is_blend else (0.0, 1.0)):
            rows.append(row)
            places.append((begin, end, width))
    grid = np.array(places)
    cells, speeds = np.empty((len(rows), 4)), np.empty(len(rows) + 1)
    duration = cell_speeds(
        segments.directions[rows], segments.turns[rows], grid, table, v_start, cells, speeds
    )
    return _Speeds(rows, grid, cells, speeds, duration)


def _knots(segments: _Segments, found: _Speeds) -> tuple[Array, Array, Array, Array]:
    """Return times, positions, velocities and accelerations at the ends of all phases."""
    n_cells = len(found.cells)
    ends = np.zeros((1 + MOST_PHASES * n_cells, 5))
    ends[0, 3] = found.speeds[0]
    ends = ends[: 1 + knots(found.cells, found.speeds, ends[1:])]
    cell = ends[:, 1].astype(np.intp)
    at = np.array(found.rows)[cell]
    u, turn, width = segments.directions[at], segments.turns[at], segments.widths[at, None]
    s = (found.places[cell, 0] * found.places[cell, 2] + ends[:, 2])[:, None]
    v, a = ends[:, 3:4], ends[:, 4:5]
    x = s / width
    ahead = u + turn * (x * x * (3 - 2 * x))
    curvature = turn * (6 * x * (1 - x) / width)
    q = segments.origins[at] + u * s + turn * (width * x**3 * (1 - 0.5 * x))
    q[-1] = segments.end
    return ends[:, 0], q, ahead * v, ahead * a + curvature * v * v


def _assemble(
    times: Array, positions: Array, velocities: Array, accelerations: Array
) -> Trajectory:
    """
    Return the trajectory through knots at whole nanoseconds, close ones merged.

    Each knot moves along its own motion to the rounded time: a knot left in place while its time
    moves by half a nanosecond would cost a short piece 1e-9 v / T^2 of acceleration.
    """
    kept = [0]
    for i in range(1, len(times)):
        if times[i] - times[kept[-1]] < CLOSEST and i < len(times) - 1 and len(kept) == 1:
            continue
        if times[i] - times[kept[-1]] < CLOSEST and len(kept) > 1:
            kept.pop()
        kept.append(i)
    exact = times[kept]
    rounded = np.round(exact / TICK) * TICK
    q, v, a = positions[kept], velocities[kept], accelerations[kept]
    # The last knot is at rest, so it is not moved.
    shift = (rounded - exact)[:, None]
    shift[-1] = 0.0
    q += shift * v + 0.5 * shift**2 * a
    v += shift * a
    v[-1] = a[-1] = 0.0
    return Trajectory(rounded, q, v, a)


def _within_limits(trajectory: Trajectory, limits: MotionLimits) -> Trajectory:
    """
    Return the trajectory, slowed down as a whole where a piece exceeds a limit.

    The quintic through scaled values is the same curve run slower. Only merged knots and rounding
    make this necessary.
    """
    ratio, enough = limit_ratio(trajectory, limits), 1.0
    for _ in range(ATTEMPTS):
        if ratio <= enough:
            return trajectory
        trajectory = _assemble(
            trajectory.times * ratio,
            trajectory.positions,
            trajectory.velocities / ratio,
            trajectory.accelerations / ratio**2,
        )
        ratio, enough = limit_ratio(trajectory, limits), 1.0 + ROUNDING
    raise RrthError(
        f'motion: {ratio:.6g} times too fast for the limits of the joints, expected at most 1'
    )


def peaks(trajectory: Trajectory) -> tuple[Array, Array, Array]:
    """
    Return bounds of the velocity, acceleration and jerk of each joint, (dof,) each.

    Each piece is sampled 33 times; between two of these instants, h apart, a function f is no
    greater than there by more than h^2 / 8 max|f''|.
    """
    # Powers first: all pieces and joints in one product.
    c = piece_coefficients(trajectory).transpose(1, 0, 2)
    n, dof = c.shape[1:]
    T = np.diff(trajectory.times)[:, None]
    size = np.abs(c)
    curvatures = (
        6 * size[3] + 24 * size[4] + 60 * size[5],
        24 * size[4] + 120 * size[5],
        120 * size[5],
    )
    found = []
    for order, powers in enumerate((_FIRST, _SECOND, _THIRD), start=1):
        sampled = np.abs(powers @ c[order:].reshape(6 - order, -1)).max(axis=0).reshape(n, dof)
        found.append(((sampled + _BETWEEN * curvatures[order - 1]) / T**order).max(axis=0))
    return found[0], found[1], found[2]


def limit_ratio(trajectory: Trajectory, limits: MotionLimits) -> float:
    """
    Return the factor by which a trajectory must be slowed to keep its limits; <= 1: it does.

    A motion within a limit by `peaks` nowhere exceeds it by more than 0.2 %.
    """
    ratios = enumerate(_ratios(trajectory, limits), start=1)
    return max((ratio / (1 + ALLOWED)) ** (1 / order) for order, ratio in ratios)


def excess(trajectory: Trajectory, limits: MotionLimits) -> float:
    """Return the greatest ratio of a trajectory to its limits; 1.01: 1 % beyond."""
    return max(_ratios(trajectory, limits))


def _ratios(trajectory: Trajectory, limits: MotionLimits) -> list[float]:
    """Return the greatest ratio of each derivative to its limits."""
    pairs = zip(peaks(trajectory), limits.rows, strict=True)
    return [float((peak / limit).max()) for peak, limit in pairs]
