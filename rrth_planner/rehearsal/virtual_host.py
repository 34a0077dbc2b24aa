# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where requests run in virtual time: they await times, and a planner whose answers take time."""

from collections.abc import Callable, Coroutine, Generator
from typing import Any, Protocol

from rrth_planner.model.errors import RequestError
from rrth_planner.model.status import ErrorCode
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.rehearsal.timeline import Timeline

# A planner that has not answered so long after its time limit is replaced [s].
GRACE = 5.0


class AnsweringPlanner(Protocol):
    """What answers questions."""

    def plan(self, question: PlanQuestion) -> MotionPlan:
        """Return the answer."""


class _Sleep:
    """Awaited, it lets a time pass [s]."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds

    def __await__(self) -> Generator[float, None, None]:
        yield self.seconds


class VirtualHost:
    """
    Runs coroutines on a timeline; in virtual time nothing else takes time.

    Parameters
    ----------
    latency : callable
        Returns how long the next answer takes [s].
    is_dead : callable
        Whether the planner gives no answers now.
    time_limit : float
        Of a plan [s]: a request whose answer does not come GRACE after it fails.

    """

    def __init__(
        self,
        timeline: Timeline,
        planner: AnsweringPlanner,
        latency: Callable[[], float],
        is_dead: Callable[[], bool] = lambda: False,
        time_limit: float = 4.0,
    ) -> None:
        """Begin with no coroutine."""
        self._timeline, self._planner = timeline, planner
        self._latency, self._is_dead, self._time_limit = latency, is_dead, time_limit

    def now(self) -> float:
        """Return the time that messages are stamped with [s]."""
        return self._timeline.now

    def steady(self) -> float:
        """Return a time that is never set [s]."""
        return self._timeline.now

    async def sleep(self, seconds: float) -> None:
        """Return after a time [s]."""
        await _Sleep(seconds)

    async def plan(
        self, question: PlanQuestion, should_stop: Callable[[], bool] = lambda: False
    ) -> MotionPlan:
        """
        Return the answer to a question, once it has come.

        Raise RequestError where none comes in time.
        """
        if self._is_dead():
            longest = self._time_limit + GRACE
            await self.sleep(longest)
            raise RequestError(
                ErrorCode.FAILURE, f'the planner has not answered within {longest:g} s'
            )
        plan = self._planner.plan(question)
        await self.sleep(self._latency())
        return plan

    def begin(self, coroutine: Coroutine[Any, Any, object]) -> None:
        """Have a coroutine run from now on."""
        try:
            seconds = coroutine.send(None)
        except StopIteration:
            return
        self._timeline.after(seconds, lambda: self.begin(coroutine))
