# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Time as a number: what happens is due at a time, and happens in the order in which it is due."""

from collections.abc import Callable
import heapq
from itertools import count


class Timeline:
    """
    What is due, and the present.

    Parameters
    ----------
    now : float
        [s].

    """

    def __init__(self, now: float = 0.0) -> None:
        """Begin with nothing that is due."""
        self.now = now
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._numbers = count()

    def at(self, time: float, act: Callable[[], None]) -> None:
        """Have something done at a time, or now where that has passed [s]."""
        heapq.heappush(self._due, (max(time, self.now), next(self._numbers), act))

    def after(self, seconds: float, act: Callable[[], None]) -> None:
        """Have something done after a time [s]."""
        self.at(self.now + seconds, act)

    def every(self, period: float, act: Callable[[], None], first: float = 0.0) -> None:
        """Have something done again and again, for the first time after `first` [s]."""
        begin, numbers = self.now + first, count()

        def again() -> None:
            # By the number of periods: errors do not add up.
            self.at(begin + next(numbers) * period, act_and_again)

        def act_and_again() -> None:
            again()
            act()

        again()

    def run(self, until: float) -> None:
        """Do all that is due until a time [s], which is the present then."""
        while self._due and self._due[0][0] <= until:
            self.now, _, act = heapq.heappop(self._due)
            act()
        self.now = until
