# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How the pointing ray of an arm came to cross a part of the wearer."""

import numpy as np
from numpy.typing import NDArray

CAME_AT_REST = 'a part came while the arm rested, which left through it'
CAME_AT_THE_END = 'a part came while the arm came to rest'
CAME = 'a part came, and the arm went on across it'
WENT_IN = 'the arm went in'
CLASSES = (CAME_AT_REST, CAME_AT_THE_END, CAME, WENT_IN)
# An arm that rests within so long after the part has left comes to rest [s].
SOON = 0.15


def seconds_by_class(
    is_moving: NDArray[np.bool_],
    is_crossed: NDArray[np.bool_],
    went_in: NDArray[np.bool_],
    period: float,
) -> dict[str, float]:
    """
    Return how long the ray of an arm in motion crossed a part, by how that began [s].

    Parameters
    ----------
    is_moving, is_crossed : ndarray, shape (n,)
        Whether the arm moves and its ray crosses a part, from instant to instant.
    went_in : ndarray, shape (n,)
        Whether the ray crosses a part that is where it was at the instant before.
    period : float
        Between two instants [s].

    """
    found: dict[str, float] = {}
    steps = np.diff(np.concatenate([[False], is_crossed, [False]]).astype(np.int8))
    n_soon = round(SOON / period)
    for first, end in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True):
        seconds = float(is_moving[first:end].sum()) * period
        if seconds == 0.0:
            continue
        if not is_moving[first]:
            word = CAME_AT_REST
        elif went_in[first]:
            word = WENT_IN
        elif not is_moving[first : end + n_soon].all():
            word = CAME_AT_THE_END
        else:
            word = CAME
        found[word] = found.get(word, 0.0) + seconds
    return found
