# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where joints may be: motions within their limits, goals within less, a start a little beyond."""

import functools
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.bernstein import first_outside, to_bernstein
from rrth_planner.model.trajectory import part_of, piece_coefficients, positions_at, Trajectory

# How far beyond its limit a joint may be at the start of a motion [rad], [m].
FARTHEST_BEYOND, FARTHEST_BEYOND_SLIDING = 0.05, 0.005
# Likewise of a continuous joint, which has no stop there: it winds back [rad].
FARTHEST_TURNED = math.tau
# How far from its limit a joint is at a goal [rad], [m]: a drive that stops a little further, or
# an encoder that reads a little more, is not beyond it. At most this share of the joint's range.
GOAL_ROOM, GOAL_ROOM_SLIDING, GOAL_SHARE = 0.005, 0.0005, 0.25
# A joint this far beyond its limit is at it, and one that moves so far back does not [rad, m].
ROUNDING = 1e-6
# Halvings of a piece, to find when a joint reaches its limit.
N_HALVINGS = 40
_BERNSTEIN_4, _BERNSTEIN_5 = to_bernstein(4), to_bernstein(5)


@functools.lru_cache(maxsize=16)
def goal_bounds(arm: ArmModel) -> Array:
    """Return the least and greatest joint positions at goals, (2, dof) [rad or m]."""
    low, high = arm.bounds
    room = np.minimum(_of_each(arm, GOAL_ROOM, GOAL_ROOM_SLIDING), GOAL_SHARE * (high - low))
    return _frozen(low + room, high - room)


def keeps_room(arm: ArmModel, q_goal: Array) -> bool:
    """Return whether a goal, shape (dof,), is within `goal_bounds`."""
    low, high = goal_bounds(arm)
    return bool(((low <= q_goal) & (q_goal <= high)).all())


@functools.lru_cache(maxsize=16)
def start_bounds(arm: ArmModel) -> Array:
    """
    Return the least and greatest joint positions at the start of a motion, (2, dof) [rad or m].

    From this far beyond its limits a joint is led in; a continuous one from a turn.
    """
    beyond = _of_each(arm, FARTHEST_BEYOND, FARTHEST_BEYOND_SLIDING)
    beyond[np.array(arm.is_continuous)] = FARTHEST_TURNED
    return _frozen(arm.bounds[0] - beyond, arm.bounds[1] + beyond)


def turns_near(arm: ArmModel, bounds: Array, q: Array, n_turns: float) -> Array:
    """
    Return bounds in which continuous joints have a few turns only, those nearest to q.

    Parameters
    ----------
    bounds : ndarray, shape (2, dof)
        Least and greatest joint positions [rad or m].
    q : ndarray, shape (dof,)
        In the middle of the turns where the bounds allow it [rad or m].
    n_turns : float
        > 0; 1: bounds that contain each pose of the links once.

    Returns
    -------
    ndarray, shape (2, dof)
        Within the bounds; the same object where no joint has more turns.

    """
    if not any(arm.is_continuous):
        return bounds
    low, high = bounds
    half = n_turns * math.pi
    is_wide = np.array(arm.is_continuous) & (high - low > 2.0 * half)
    if not is_wide.any():
        return bounds
    middle = np.minimum(np.maximum(q, low + half), high - half)
    return _frozen(np.where(is_wide, middle - half, low), np.where(is_wide, middle + half, high))


def bounds_from(arm: ArmModel, q_start: Array) -> Array:
    """Return the limits of a motion that begins at q_start, shape (dof,): (2, dof) [rad or m]."""
    low, high = arm.bounds
    least, most = start_bounds(arm)
    return np.array(
        [
            np.where((least - ROUNDING <= q_start) & (q_start < low), q_start, low),
            np.where((high < q_start) & (q_start <= most + ROUNDING), q_start, high),
        ]
    )


def joints_beyond(arm: ArmModel, q: ArrayLike) -> NDArray[np.int64]:
    """Return the indices of the joints that are beyond a limit at q, shape (dof,)."""
    low, high = arm.bounds
    return np.flatnonzero((q < low - ROUNDING) | (q > high + ROUNDING))


def not_led_in(arm: ArmModel, trajectory: Trajectory) -> int | None:
    """
    Return the first joint that begins beyond a limit and does not move towards it only, or None.

    Within its limits it may move anywhere, but not beyond them again. How far it is beyond is not
    checked.
    """
    for k in joints_beyond(arm, trajectory.positions[0]).tolist():
        limit = float(np.clip(trajectory.positions[0, k], *arm.bounds[:, k]))
        sign = float(np.sign(trajectory.positions[0, k] - limit))
        within = _within_from(trajectory, k, sign, limit)
        before = part_of(trajectory, 0.0, within)
        after = part_of(trajectory, within, trajectory.duration)
        # By the pieces' own time, so that the tolerance is a way.
        rates = sign * piece_coefficients(before)[:, 1:, k].T * np.arange(1.0, 6.0)[:, None]
        places = sign * (piece_coefficients(after)[:, :, k].T - limit * np.eye(6)[:, :1])
        # Of a single point there is no piece.
        if _exceeds(_BERNSTEIN_4 @ rates) or _exceeds(_BERNSTEIN_5 @ places):
            return k
    return None


def _exceeds(control: Array) -> bool:
    """Return whether polynomials exceed rounding, by their Bernstein coefficients (n, m)."""
    m = control.shape[1]
    return m > 0 and (
        first_outside(control, np.full(m, -np.inf), np.full(m, ROUNDING)) is not None
    )


def _within_from(trajectory: Trajectory, k: int, sign: float, limit: float) -> float:
    """Return when joint k, which begins beyond its limit on one side, is first within it [s]."""
    times, excess = trajectory.times, sign * (trajectory.positions[:, k] - limit)
    inside = np.flatnonzero(excess <= 0.0)
    if len(inside) == 0:
        return trajectory.duration
    late = float(times[inside[0]])
    early = float(times[inside[0] - 1])
    for _ in range(N_HALVINGS):
        middle = 0.5 * (early + late)
        if sign * (float(positions_at(trajectory, middle)[0, k]) - limit) <= 0.0:
            late = middle
        else:
            early = middle
    return late


def _of_each(arm: ArmModel, turning: float, sliding: float) -> Array:
    """Return a value for each joint, (dof,): that of revolute [rad] or of prismatic ones [m]."""
    return np.where(np.array(arm.is_prismatic), sliding, turning)


def _frozen(low: Array, high: Array) -> Array:
    bounds = np.array([low, high])
    bounds.setflags(write=False)
    return bounds
