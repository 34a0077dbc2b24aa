# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The clock and the cancel flag of one plan."""

from collections.abc import Callable
import time

from rrth_planner.model.status import PlanStatus


class Deadline:
    """
    Clock of a plan, and its end.

    Parameters
    ----------
    time_limit : float
        [s], from now.
    should_stop : callable
        Returns True to cancel the plan.

    """

    def __init__(self, time_limit: float, should_stop: Callable[[], bool]) -> None:
        """Start the clock."""
        self.start = time.perf_counter()
        self._time_limit, self._should_stop = time_limit, should_stop

    def elapsed(self) -> float:
        """Return the time since the plan began [s]."""
        return time.perf_counter() - self.start

    def within(self, span: float) -> float:
        """Return the time a span from now, or the end of the plan if that comes first [s]."""
        return min(time.perf_counter() + span, self.start + self._time_limit)

    def status(self) -> PlanStatus | None:
        """Return why planning must end now, or None."""
        if self._should_stop():
            return PlanStatus.CANCELLED
        return PlanStatus.TIMEOUT if self.elapsed() > self._time_limit else None
