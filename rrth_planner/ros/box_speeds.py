# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How fast each of the wearer's boxes moves, by what was said of it last and before."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.ros.bodies import WearerBody
from rrth_planner.ros.edits import Key
from rrth_planner.scene import Box
from rrth_planner.underway import box_speed

# Some trackers say the same again between two looks: the fastest of so long counts [s].
HELD = 0.3
# A box that nothing was said of for longer counts as seen so long ago [s].
MOST_AGE = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """A box, since when it is as it is [s], and how fast it may be [m/s], until then at least."""

    box: Box
    since: float
    speed: float
    until: float


class BoxSpeeds:
    """The speeds of the boxes, each by its own last messages: arrays may tell of some only."""

    def __init__(self) -> None:
        """Begin with no body."""
        self._seen: dict[tuple[Key, int], _Seen] | None = None

    def look(self, body: WearerBody, came: float, most: float) -> tuple[Array, Array] | None:
        """
        Return how fast the boxes of a body may go on moving; None where that does not count.

        A box that was not there before may be as fast as any; of the first body nothing is known.

        Parameters
        ----------
        body : WearerBody
            As it is at that time; the one of before tells of no other speeds.
        came : float
            When it came, or is looked at again [s].
        most : float
            No box counts as faster; 0: speeds do not count [m/s].

        Returns
        -------
        speeds, ages : ndarray, shape (m,)
            And how long ago each box was seen [m/s, s].

        """
        if most == 0.0:
            self._seen = None
            return None
        before, is_first = self._seen or {}, self._seen is None
        self._seen = {
            (key, k): _again(before.get((key, k)), box, came, 0.0 if is_first else np.inf)
            for key, part in body.parts
            for k, box in enumerate(part.boxes)
        }
        if is_first:
            return None
        speeds, since = (
            np.array([[s.speed, s.since] for s in self._seen.values()]).reshape(-1, 2).T
        )
        return np.minimum(speeds, most), np.clip(came - since, 0.0, MOST_AGE)


def _again(before: _Seen | None, box: Box, came: float, unknown: float) -> _Seen:
    if before is None:
        return _Seen(box, came, unknown, came)
    if before.box is box:
        # Nothing was said of it.
        return before
    speed = box_speed(before.box, box, came - before.since)
    if speed < before.speed and came < before.until:
        return _Seen(box, came, before.speed, before.until)
    return _Seen(box, came, speed, came + HELD)
