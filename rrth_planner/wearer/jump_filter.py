# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Points of a tracker that jump stay where they were until a second measurement confirms it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.model.frozen import Frozen
from rrth_planner.wearer.posture import Posture

# A posture that came so long after the one before does not say what jumps [s].
LONGEST_GAP = 0.2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FilteredPosture(Frozen):
    """
    A posture without jumps, and what is needed to filter the next one.

    Parameters
    ----------
    posture : Posture
        Held-back points are where they were before; those that were measured in three places in
        a row are lost.
    time : float
        Of the measurement [s].
    measured : ndarray, shape (n, 3)
        All points as they were measured [m].
    is_doubtful : ndarray, shape (n,)
        Whether the measurement of a point was not taken.
    n_held : int
        Number of points that jumped just now.

    """

    posture: Posture
    time: float
    measured: Array
    is_doubtful: NDArray[np.bool_]
    n_held: int = 0


def without_jumps(
    before: FilteredPosture | None, posture: Posture, time: float, most: float
) -> FilteredPosture:
    """
    Return a posture in which no point has moved further than a distance since the one before.

    A point that has, stays where it was for one posture, with its rotation. The next measurement
    confirms the new place or is back at the old one; else the point is lost until two
    measurements in a row agree. A point that was lost is taken where it is found again.

    Parameters
    ----------
    before : FilteredPosture or None
        Of the posture before. None, one of other points, of a later time, or older than 0.2 s:
        everything is taken as measured.
    time : float
        Of the measurement [s].
    most : float
        How far a point moves at most between two postures [m].

    """
    measured = posture.positions
    if (
        before is None
        or not 0.0 <= time - before.time <= LONGEST_GAP
        or posture.names != before.posture.names
    ):
        return FilteredPosture(
            posture=posture,
            time=time,
            measured=measured,
            is_doubtful=np.zeros(len(measured), dtype=bool),
        )
    last = before.posture.positions
    # Not a number where either is lost, and so not above anything.
    has_moved = _distances(measured, last) > most
    was_doubtful = before.is_doubtful
    is_confirmed = _distances(measured, before.measured) <= most
    # Of a point that was measured in three places nothing else is known than the last one.
    is_unknown = was_doubtful & np.isnan(last).any(axis=1)
    is_doubtful = (has_moved | is_unknown) & ~(was_doubtful & is_confirmed)
    is_doubtful &= ~np.isnan(measured).any(axis=1)
    if not is_doubtful.any():
        passed = posture
    else:
        is_held = is_doubtful & ~was_doubtful
        passed = Posture(
            names=posture.names,
            positions=_chosen(measured, last, is_doubtful, is_held),
            rotations=None
            if posture.rotations is None
            else _chosen(posture.rotations, before.posture.rotations, is_doubtful, is_held),
        )
    return FilteredPosture(
        posture=passed,
        time=time,
        measured=measured,
        is_doubtful=is_doubtful,
        n_held=int(np.count_nonzero(is_doubtful & ~was_doubtful)),
    )


def _distances(places: Array, others: Array) -> Array:
    way = places - others
    distances: Array = np.sqrt(np.einsum('ij,ij->i', way, way))
    return distances


def _chosen(
    measured: Array, last: Array | None, is_doubtful: NDArray[np.bool_], is_held: NDArray[np.bool_]
) -> Array:
    """Return what was measured; where that is doubtful the last one if held, else NaN."""
    chosen = measured.copy()
    chosen[is_doubtful] = np.nan
    if last is not None:
        chosen[is_held] = last[is_held]
    return chosen
