# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The time-optimal peer: toppra on the same rounded path, velocity and acceleration limited."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.timing.corner_blends import Blend
import toppra
from toppra import algorithm, constraint
from toppra.interpolator import AbstractGeometricPath

from benchmarks.motions.path import Piece, planned_pieces

# Points of the grid on a line, and on a rounded corner. With twice as many of each the durations
# of motions round corners are shorter by some 5e-5 of them.
ON_LINE, ON_CORNER = 320, 960
# The speed rises from rest within the first of these shares of the path.
ENDS = np.geomspace(1e-5, 1e-2, 12)

toppra.setup_logging('ERROR')


class RoundedPath(AbstractGeometricPath):  # type: ignore[misc]
    """Lines and rounded corners that meet with two continuous derivatives."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self._pieces = pieces
        self._ends = np.cumsum([piece.width for piece in pieces])

    def __call__(self, path_positions: ArrayLike, order: int = 0) -> Array:
        """Return a derivative of the path, (m,) [rad] -> (m, dof), or () -> (dof,)."""
        s = np.atleast_1d(np.asarray(path_positions, dtype=float))
        which = np.searchsorted(self._ends[:-1], s, side='right')
        result = np.empty((len(s), self.dof))
        for k, piece in enumerate(self._pieces):
            own = which == k
            tau = (s[own] - self._ends[k]) / piece.width + 1.0
            result[own] = piece.at(tau, order) / piece.width**order
        return result if np.ndim(path_positions) else result[0]

    @property
    def dof(self) -> int:
        """Number of joints."""
        return int(self._pieces[0].coefficients.shape[1])

    @property
    def path_interval(self) -> Array:
        """Begin and end, shape (2,) [rad]."""
        return np.array([0.0, self._ends[-1]])

    def grid(self, refinement: int = 1) -> Array:
        """Return the grid points of toppra on the path, shape (n,) [rad]."""
        length = self._ends[-1]
        places = [length * ENDS, length * (1.0 - ENDS), [length]]
        for piece, end in zip(self._pieces, self._ends, strict=True):
            n = refinement * (ON_LINE if len(piece.coefficients) == 2 else ON_CORNER)
            places.append(np.linspace(end - piece.width, end, n, endpoint=False))
        return np.unique(np.concatenate(places))


def optimal_duration(
    path: Path, blends: Sequence[Blend], limits: MotionLimits, refinement: int = 1
) -> float:
    """
    Return the least time that a rounded path takes without a limit of jerk [s]; NaN: none found.

    Parameters
    ----------
    path : Path
    blends : sequence of Blend
        Where one has no length, the motion stops.
    limits : MotionLimits
        Jerk is left aside.
    refinement : int
        By which the grid is finer.

    """
    parts = planned_pieces(path, blends)
    return sum(_duration(RoundedPath(part), limits, refinement) for part in parts)


def _duration(rounded: RoundedPath, limits: MotionLimits, refinement: int) -> float:
    grid = rounded.grid(refinement)
    solver = algorithm.TOPPRA(
        [
            constraint.JointVelocityConstraint(_both_ways(limits.velocity)),
            constraint.JointAccelerationConstraint(
                _both_ways(limits.acceleration),
                discretization_scheme=constraint.DiscretizationType.Interpolation,
            ),
        ],
        rounded,
        gridpoints=grid,
        parametrizer='ParametrizeConstAccel',
    )
    speeds: NDArray[np.float64] | None = solver.compute_parameterization(0, 0)[1]
    if speeds is None:
        return np.nan
    # Between two places of the grid the acceleration along the path is constant.
    return float((2.0 * np.diff(grid) / (speeds[1:] + speeds[:-1])).sum())


def _both_ways(limit: Array) -> Array:
    return np.stack([-limit, limit], axis=1)
