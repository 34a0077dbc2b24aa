# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Upper bounds of the displacement of the bars along a trajectory."""

import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.reach import reach_table
from rrth_planner.model.trajectory import piece_coefficients, Trajectory

# Intervals that each piece is cut into, and the powers of u that q'(u) has at their ends.
INTERVALS = 8
_CUTS = np.linspace(0.0, 1.0, INTERVALS + 1)
_FIRST = np.arange(1, 6) * _CUTS[:, None] ** np.arange(5)
# Bernstein coefficients of the third derivatives of u^3, u^4 and u^5, which bound them, and how
# far a function can be from its chord over an interval for each unit of its second derivative.
_THIRD = np.array([[6.0, 0.0, 0.0], [6.0, 12.0, 0.0], [6.0, 24.0, 60.0]])
_CHORD = 0.125 / INTERVALS**2


def displacements(arm: ArmModel, trajectory: Trajectory, times: Array, ray_length: float) -> Array:
    """
    Return upper bounds of the path length of the points of each bar since the start.

    Between any two of the instants no point of the bar moves further than the difference.

    Parameters
    ----------
    arm : ArmModel
    trajectory : Trajectory
    times : ndarray, shape (n,)
        Not decreasing [s].
    ray_length : float
        Length of the pointing ray [m].

    Returns
    -------
    ndarray, shape (n_bars, n)
        Bars as in `arm.bar_ends` [m].

    """
    reaches = reach_table(arm, ray_length)
    # Both ends of a bar bound the speed of all its points.
    reaches = np.maximum(reaches, np.vstack([reaches[:1], reaches[:-1]]))
    if len(trajectory.times) == 1:
        return np.zeros((len(reaches), len(times)))
    c = piece_coefficients(trajectory)
    speeds = np.abs(_FIRST @ c[:, 1:])
    curvature = np.abs(_THIRD @ c[:, 3:]).max(axis=1)
    top = np.maximum(speeds[:, :-1], speeds[:, 1:]) + _CHORD * curvature[:, None]
    steps = (top / INTERVALS).reshape(-1, arm.dof) @ reaches.T
    grid = trajectory.times[:-1, None] + np.diff(trajectory.times)[:, None] * _CUTS[:-1]
    grid = np.append(grid, trajectory.times[-1])
    bounds = np.zeros((len(reaches), len(grid)))
    np.cumsum(steps.T, axis=1, out=bounds[:, 1:])
    return np.array([np.interp(times, grid, bound) for bound in bounds])
