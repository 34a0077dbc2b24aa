# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer as he was seen before, sight by sight, to compare the next ones with."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rrth_planner.kernels.collision.containment import MEASURED, SIGHT
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene

# So many sights are written side by side: the last ones are copied for each new one. At most so
# many times as many are kept.
BLOCK, MOST = 32, 32


@dataclass(frozen=True, slots=True, eq=False)
class KeptSights:
    """
    Sights of the boxes of one scene, in their order.

    Parameters
    ----------
    blocks : tuple of (ndarray, ndarray)
        Up to `BLOCK` sights each: when each came, (k,) [s], and its boxes, (k, m, 16), as
        `containment.excesses` takes them.

    """

    blocks: tuple[tuple[Array, Array], ...] = ()

    @property
    def begin(self) -> float:
        """When the first sight came [s]; without sights: inf."""
        return float(self.blocks[0][0][0]) if self.blocks else np.inf

    def since(self, time: float) -> Iterator[Array]:
        """Yield the sights that came at a time [s] or later, (k, m, 16)."""
        for times, rows in self.blocks:
            yield rows[np.searchsorted(times, time) :]

    def shifted(self, step: float) -> 'KeptSights':
        """Return them by a clock that was set forward by a step [s]."""
        blocks = []
        for times, rows in self.blocks:
            later = rows.copy()
            later[..., MEASURED] += step
            blocks.append((times + step, later))
        return KeptSights(tuple(blocks))


def sight_of(scene: Scene, measured: Array) -> Array:
    """Return a sight; measured (m,): when each box was [s] -> (m, 16)."""
    row = np.empty((len(measured), SIGHT))
    row[:, :MEASURED], row[:, MEASURED] = scene.numbers, measured
    return row


def with_sight(kept: KeptSights, sight: Array, came: float, since: float) -> KeptSights:
    """Return the sights with another one, (m, 16), that came now, without those before a time."""
    # What came later than now is of a clock that was set back.
    blocks = [one for one in kept.blocks if since <= one[0][-1] <= came]
    times, rows = np.array([came]), sight[None]
    if blocks and len(blocks[-1][0]) < BLOCK:
        before, others = blocks.pop()
        times, rows = np.append(before, times), np.concatenate([others, rows])
    return KeptSights((*blocks, (times, rows))[-MOST:])


def matched(kept: KeptSights, places: NDArray[np.intp]) -> KeptSights:
    """Return the sights of other boxes: which of the present ones each is, -1: none, (m,)."""
    blocks, known = [], places >= 0
    for times, rows in kept.blocks:
        found = np.zeros((len(times), len(places), SIGHT))
        # Never seen before.
        found[..., MEASURED] = np.inf
        found[:, known] = rows[:, places[known]]
        blocks.append((times, found))
    return KeptSights(tuple(blocks))
