# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Time parameterization: straight edges and corner blends, within the joints' limits."""

import numpy as np
from rrth_planner.kernels.trajectory import quintics, timed_path
from rrth_planner.model.arrays import Array, check_dof, float_number
from rrth_planner.model.errors import check_type, RrthError
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import MotionLimits, piece_coefficients, Trajectory
from rrth_planner.timing.corner_blends import Blend

# A path shorter than this is no motion: the arm holds still for HOLD_TIME seconds [rad, s].
STILL_LENGTH, HOLD_TIME = 1e-9, 0.1
# Excess of a limit that is rounding, or the bound between two samples of a piece.
ALLOWED_EXCESS = 2e-3
# Most attempts to slow a motion down as a whole; its rounding.
ATTEMPTS, ROUNDING = 5, 1e-4

# Samples of a piece at which limits are checked, its ends included.
INSTANTS = 33


class TooFastError(RrthError):
    """The path is too short to slow down from the speed at the start."""


def parameterize(
    path: Path, blends: tuple[Blend, ...], limits: MotionLimits, v_start: float = 0.0
) -> Trajectory:
    """
    Return the trajectory that follows a path with rounded corners to rest.

    The cells that `kernels.trajectory.timed_path` cuts it into get the fastest profile of constant
    jerk phases between the speeds that `kernels.trajectory.speed_profile` finds. On straight ones,
    and on blends at constant speed, every piece between two points is a polynomial of at most
    fourth degree: the quintic that a controller interpolates is the curve itself.

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
    RrthError
        Blends for another number of corners, or limits for another number of joints.

    """
    check_type(path, Path, 'path')
    check_type(limits, MotionLimits, 'limits')
    q = path.waypoints
    check_dof(q, len(limits.velocity), 'path')
    v_start = float_number(v_start, 'v_start', 'rad/s', 0.0)
    n_corners = max(0, len(q) - 2)
    blends = tuple(blends) if isinstance(blends, (list, tuple)) else (blends,)
    for blend in blends:
        check_type(blend, Blend, 'blends')
    if len(blends) != n_corners:
        raise RrthError(f'blends: {len(blends)}, expected one for each of {n_corners} corners')
    if path.length < STILL_LENGTH:
        still = np.zeros((2, q.shape[1]))
        return Trajectory(np.array([0.0, HOLD_TIME]), q[[0, 0]], still, still)
    half_lengths = np.array([0.0, *(blend.half_length for blend in blends), 0.0])
    most = timed_path.most_points(len(q))
    times, states = np.empty(most), np.empty((3, most, q.shape[1]))
    n = timed_path.timed_points(q, half_lengths, np.array(limits.rows), v_start, times, states)
    if n == 0:
        raise TooFastError(
            f'speed at the start: {v_start:.3g} rad/s, expected one from which the path is '
            'long enough to slow down'
        )
    trajectory = Trajectory(times[:n], *states[:, :n])
    # A motion with a speed at its start cannot be slowed down as a whole; the caller checks it
    # against the limits together with its lead-in.
    return trajectory if v_start > 0.0 else _within_limits(trajectory, limits)


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
        times = trajectory.times * ratio
        states = np.array([row / ratio**k for k, row in enumerate(trajectory.states)])
        n = timed_path.merge(times, states, len(times))
        trajectory = Trajectory(times[:n], *states[:, :n])
        ratio, enough = limit_ratio(trajectory, limits), 1.0 + ROUNDING
    raise RrthError(
        f'motion: {ratio:.6g} times too fast for the limits of the joints, expected at most 1'
    )


def peaks(trajectory: Trajectory) -> Array:
    """
    Return bounds of the velocity, acceleration and jerk of each joint, (3, dof).

    Of a single point: 0.
    """
    most = np.empty((3, trajectory.positions.shape[1]))
    quintics.peaks(piece_coefficients(trajectory), trajectory.times, INSTANTS, most)
    return most


def limit_ratio(trajectory: Trajectory, limits: MotionLimits) -> float:
    """
    Return the factor by which a trajectory must be slowed to keep its limits; <= 1: it does.

    A motion within a limit by `peaks` nowhere exceeds it by more than 0.2 %.
    """
    ratios = enumerate(_ratios(trajectory, limits), start=1)
    return max((ratio / (1 + ALLOWED_EXCESS)) ** (1 / order) for order, ratio in ratios)


def excess(trajectory: Trajectory, limits: MotionLimits) -> float:
    """Return the greatest ratio of a trajectory to its limits; 1.01: 1 % beyond."""
    return max(_ratios(trajectory, limits))


def _ratios(trajectory: Trajectory, limits: MotionLimits) -> list[float]:
    """Return the greatest ratio of each derivative to its limits."""
    ratios: list[float] = (peaks(trajectory) / limits.rows).max(axis=1).tolist()
    return ratios
