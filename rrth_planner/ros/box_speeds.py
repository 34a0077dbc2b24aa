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


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """A box, since when it is as it is [s], and how fast it came there [m/s]."""

    box: Box
    since: float
    speed: float


class BoxSpeeds:
    """The speeds of the boxes, each by its own last two messages: arrays may tell of some only."""

    def __init__(self) -> None:
        """Begin with no body."""
        self._seen: dict[tuple[Key, int], _Seen] | None = None

    def look(self, body: WearerBody, now: float, most: float) -> Array | None:
        """
        Return how fast the boxes of a body may go on moving; None where that does not count.

        A box that was not there before may be as fast as any; of the first body nothing is known.

        Parameters
        ----------
        body : WearerBody
            At that time; the one of before tells of no other speeds.
        now : float
            [s].
        most : float
            No box counts as faster; 0: speeds do not count [m/s].

        Returns
        -------
        ndarray, shape (m,), or None
            [m/s].

        """
        if most == 0.0:
            self._seen = None
            return None
        before, is_first = self._seen or {}, self._seen is None
        self._seen = {
            (key, k): _again(before.get((key, k)), box, now, 0.0 if is_first else np.inf)
            for key, part in body.parts
            for k, box in enumerate(part.boxes)
        }
        if is_first:
            return None
        return np.minimum([seen.speed for seen in self._seen.values()], most)


def _again(before: _Seen | None, box: Box, now: float, unknown: float) -> _Seen:
    if before is None:
        return _Seen(box, now, unknown)
    if before.box is box:
        # Nothing was said of it.
        return before
    return _Seen(box, now, box_speed(before.box, box, now - before.since))
