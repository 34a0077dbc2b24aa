# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The planned path of a motion, lines and rounded corners, and how far points are from it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.path import Path
from rrth_planner.timing.corner_blends import Blend

# Places on a bent piece from which the nearest is searched, and steps of that search.
STARTS, STEPS = 65, 5
# A straight shorter than this is none: blends may take whole edges [rad].
NONE = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """
    A line or a rounded corner.

    Parameters
    ----------
    coefficients : ndarray, shape (k, dof)
        Of a polynomial in tau from 0 to 1, lowest power first [rad].
    width : float
        Way along it at which its speed is 1 at both ends [rad].

    """

    coefficients: Array
    width: float

    def at(self, tau: Array, order: int = 0) -> Array:
        """Return a derivative with respect to tau, (m,) -> (m, dof) [rad]."""
        c = self.coefficients
        for _ in range(order):
            c = c[1:] * np.arange(1, len(c))[:, None] if len(c) > 1 else 0.0 * c
        powers = tau[:, None] ** np.arange(len(c))
        result: Array = powers @ c
        return result


def planned_pieces(path: Path, blends: Sequence[Blend]) -> list[list[Piece]]:
    """Return the pieces of a path between one stop and the next: a list for each such part."""
    q = path.waypoints
    parts: list[list[Piece]] = [[]]
    begin = q[0]
    for corner, blend in zip(q[1:-1], blends, strict=True):
        if blend.half_length == 0.0:
            parts[-1] += _line(begin, corner)
            parts.append([])
            begin = corner
        else:
            bend = blend.coefficients()
            parts[-1] += _line(begin, bend[0])
            parts[-1].append(Piece(bend, float(np.linalg.norm(bend[1]))))
            begin = bend.sum(axis=0)
    parts[-1] += _line(begin, q[-1])
    return [part for part in parts if part]


def _line(begin: Array, end: Array) -> list[Piece]:
    length = float(np.linalg.norm(end - begin))
    return [Piece(np.stack([begin, end - begin]), length)] if length > NONE else []


def distances(points: Array, pieces: Sequence[Piece]) -> Array:
    """Return how far points are from the nearest of some pieces, (m, dof) -> (m,) [rad]."""
    least = np.full(len(points), np.inf)
    for piece in pieces:
        least = np.minimum(least, _distances(points, piece))
    return least


def _distances(points: Array, piece: Piece) -> Array:
    """Return how far points are from a piece: from the nearest of some places, steps by Gauss."""
    tau = np.linspace(0.0, 1.0, 2 if len(piece.coefficients) == 2 else STARTS)
    # From the begin of the piece, so that the squares do not cancel.
    places = piece.at(tau) - piece.coefficients[0]
    moved = points - piece.coefficients[0]
    tau = tau[((places**2).sum(axis=1) - 2.0 * moved @ places.T).argmin(axis=1)]
    least = np.linalg.norm(points - piece.at(tau), axis=1)
    for _ in range(STEPS):
        ahead = piece.at(tau, 1)
        step = ((points - piece.at(tau)) * ahead).sum(axis=1)
        # The speed vanishes where a corner turns back.
        tau = (tau + step / np.maximum((ahead**2).sum(axis=1), 1e-18)).clip(0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(points - piece.at(tau), axis=1))
    return least
