# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a request awaits while it runs: time, and a planner."""

from collections.abc import Callable, Coroutine
import secrets
import time
from typing import Any, Protocol, TypeVar

from rrth_planner.collision.violation import Violation
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.planning_process import Planner
from rrth_planner.pipeline.request import PlanQuestion

T = TypeVar('T')
# A planner that hangs is given up so long after its time limit, or after any other question [s].
LONGEST_ANSWER = 5.0


class Host(Protocol):
    """Where a request runs. A node waits for nobody; a program without one may wait in place."""

    def now(self) -> float:
        """Return the time that messages are stamped with [s]."""

    def steady(self) -> float:
        """Return a time that goes on whatever happens to that clock [s]."""

    def new_seed(self) -> int:
        """Return a seed for a plan that was given none."""

    async def sleep(self, seconds: float) -> None:
        """Return after a time [s]."""

    async def plan(self, question: PlanQuestion, should_stop: Callable[[], bool]) -> MotionPlan:
        """Do what `Planner.plan` does."""

    async def violation_seen(self, *arguments: Any) -> Violation | None:
        """Do what `Planner.violation_seen` does."""


class RequestHost(Host, Protocol):
    """Where the requests of a node run, in one thread."""

    def begin(self, coroutine: Coroutine[Any, Any, object]) -> None:
        """Have a coroutine run, whose errors are logged."""

    async def help(self, work: Callable[..., T], *arguments: Any) -> T:
        """Return what some work returns that takes long, done by another thread."""

    async def read(self) -> None:
        """Return once the messages that have come before are processed, or raise RequestError."""

    def error(self, sentence: str) -> None:
        """Log an error."""

    def warning(self, sentence: str, period: float) -> None:
        """Log a warning, at most once in a period [s]."""

    def close(self) -> None:
        """End the planner and what helps; what waits for them is not gone on with."""


class BlockingHost:
    """
    Waits in place; for programs that do nothing else meanwhile.

    Parameters
    ----------
    clock : callable
        Returns the time that messages are stamped with [s].
    sleep : callable, optional
        Lets a time pass [s].
    steady : callable, optional
        Returns a time that never steps [s].

    """

    def __init__(
        self,
        planner: Planner,
        clock: Callable[[], float],
        sleep: Callable[[float], None] = time.sleep,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        """Wait by a clock, for a planner."""
        self.now, self.steady = clock, steady
        self._planner, self._sleep = planner, sleep

    def new_seed(self) -> int:
        """Return one that nobody knows."""
        return random_seed()

    async def sleep(self, seconds: float) -> None:
        """Return after a time [s]."""
        self._sleep(seconds)

    async def plan(self, question: PlanQuestion, should_stop: Callable[[], bool]) -> MotionPlan:
        """Do what `Planner.plan` does."""
        return self._planner.plan(question, should_stop)

    async def violation_seen(self, *arguments: Any) -> Violation | None:
        """Do what `Planner.violation_seen` does."""
        return self._planner.violation_seen(*arguments)


def random_seed() -> int:
    """Return a seed that nobody knows."""
    return secrets.randbelow(2**31)


def completed(coroutine: Coroutine[Any, Any, T]) -> T:
    """Return the result of a coroutine that awaits only what is there, as of a BlockingHost."""
    try:
        coroutine.send(None)
    except StopIteration as end:
        result: T = end.value
        return result
    coroutine.close()
    raise RuntimeError('a coroutine waits for what is not there, expected one that does not')
