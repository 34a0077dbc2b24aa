# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The last sights of a wearer: whether he moves, and where he will be soon."""

from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np
from rrth_planner.execution.expected_wearer import expected_scene
from rrth_planner.model.scene import Scene

T = TypeVar('T')
# A wearer moves whose boxes have changed by so much [m] within so long [s]; of so many sights.
MOVED, LATELY, REMEMBERED = 0.01, 0.25, 64
# Velocities are those of this time at least: what a tracker's noise adds is small then [s].
STEADY = 0.08


class RecentWearer(Generic[T]):
    """
    Remembers sights, by a clock that never steps.

    Parameters
    ----------
    scene_of : callable
        Returns the boxes of a sight, where they are asked for.

    """

    def __init__(self, scene_of: Callable[[T], Scene]) -> None:
        """Begin with no sight."""
        self._scene_of = scene_of
        self._sights: deque[tuple[float, T]] = deque(maxlen=REMEMBERED)

    def saw(self, sight: T, time: float) -> None:
        """Remember a sight that came at a time [s]."""
        sights = self._sights
        # Each part may come by itself, in a message of its own: of many sights a few are enough.
        if len(sights) > 1 and sights[-1][0] - sights[-2][0] < LATELY / REMEMBERED:
            sights.pop()
        sights.append((time, sight))

    def is_moving(self, time: float) -> bool:
        """Return whether a box has moved lately, by a time [s], by more than a tracker's noise."""
        sights = [sight for came, sight in self._sights if came >= time - LATELY]
        if len(sights) < 2:
            return False
        now, before = self._scene_of(sights[-1]).numbers, self._scene_of(sights[0]).numbers
        return now.shape != before.shape or bool(np.abs(now - before).max(initial=0.0) > MOVED)

    def expected(self, time: float) -> Scene:
        """Return where moving parts will be soon after a time [s]; no box: that is unknown."""
        sights = self._sights
        if not sights or time - sights[-1][0] > LATELY:
            return Scene(())
        came, present = sights[-1]
        for then, before in reversed(sights):
            if STEADY <= came - then <= LATELY:
                return expected_scene(self._scene_of(before), self._scene_of(present), came - then)
        return Scene(())
