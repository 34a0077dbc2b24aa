# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where requests run in virtual time: they await times, and a planner whose answers take time."""

from collections.abc import Callable, Coroutine
from dataclasses import replace
import math
from typing import Any, TypeVar

from rrth_planner.collision.violation import Violation
from rrth_planner.execution.coroutines import Coroutines
from rrth_planner.pipeline.host import LONGEST_ANSWER
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.planning_process import Planner, PlanningProcessError
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.rehearsal.timeline import Timeline

T = TypeVar('T')
# A plan has as long as it needs: what a clock ends differs from run to run [s].
UNLIMITED = 3600.0
# The second checker answers after so long, if nothing else is said [s].
CHECKING = 0.002


class VirtualHost:
    """
    Runs coroutines on a timeline; in virtual time nothing else takes time.

    Parameters
    ----------
    latency : callable
        Returns how long the next answer takes [s].
    is_dead : callable
        Whether the planner gives no answers now.
    stands_until : callable
        Returns until when the host does nothing [s]; then it reads what has come first.
    read : callable
        Has the messages processed that have come.
    new_seed : callable
        Returns the seed of a plan that was given none.
    checking : float
        How long the second checker takes to answer [s].

    """

    def __init__(
        self,
        timeline: Timeline,
        planner: Planner,
        latency: Callable[[], float],
        is_dead: Callable[[], bool] = lambda: False,
        stands_until: Callable[[], float] = lambda: -math.inf,
        read: Callable[[], None] = lambda: None,
        new_seed: Callable[[], int] = lambda: 0,
        checking: float = CHECKING,
    ) -> None:
        """Begin with no coroutine."""
        self._timeline, self._planner = timeline, planner
        self._latency, self._is_dead = latency, is_dead
        self._stands_until, self._read, self._new_seed = stands_until, read, new_seed
        self._checking = checking
        self._coroutines = Coroutines(self.now, self._wake)
        # When they are gone on with next [s].
        self._due = math.inf
        self.n_plans = 0
        # What was logged.
        self.lines: list[str] = []

    def now(self) -> float:
        """Return the time that messages are stamped with [s]."""
        return self._timeline.now

    def steady(self) -> float:
        """Return a time that is never set [s]."""
        return self._timeline.now

    def new_seed(self) -> int:
        """Return the next seed."""
        return self._new_seed()

    async def sleep(self, seconds: float) -> None:
        """Return after a time [s]."""
        await self._coroutines.sleep(seconds)

    async def plan(
        self, question: PlanQuestion, should_stop: Callable[[], bool] = lambda: False
    ) -> MotionPlan:
        """
        Return the answer to a question, once it has come.

        Raise PlanningProcessError where none comes in time.
        """
        self.n_plans += 1
        limit = question.options.time_limit
        if self._is_dead():
            longest = limit + LONGEST_ANSWER
            await self.sleep(longest)
            raise PlanningProcessError(f'the planner has not answered within {longest:g} s')
        unlimited = replace(question.options, time_limit=UNLIMITED)
        plan = self._planner.plan(replace(question, options=unlimited), should_stop)
        await self.sleep(self._latency())
        return plan

    async def violation_seen(self, *arguments: Any) -> Violation | None:
        """Do what `Planner.violation_seen` does."""
        violation = self._planner.violation_seen(*arguments)
        await self.sleep(self._checking)
        return violation

    def begin(self, coroutine: Coroutine[Any, Any, object]) -> None:
        """Have a coroutine run from now on; an error in it ends the rehearsal."""
        end = self._coroutines.start(coroutine)

        def fail_with_it() -> None:
            end.result()

        end.then(fail_with_it)
        self._look_ahead()

    async def help(self, work: Callable[..., T], *arguments: Any) -> T:
        """Raise TimeoutError: a rehearsal writes no files, and shows nothing."""
        raise TimeoutError('a rehearsal writes no files')

    async def read(self) -> None:
        """Return once the messages that have come are processed."""
        self._read()

    def error(self, sentence: str) -> None:
        """Keep an error."""
        self.lines.append(sentence)

    def warning(self, sentence: str, period: float) -> None:
        """Keep a warning."""
        self.lines.append(sentence)

    def close(self) -> None:
        """Do nothing."""

    def _wake(self) -> None:
        self._go_on_at(self._timeline.now)

    def _look_ahead(self) -> None:
        left = self._coroutines.time_left()
        if left < math.inf:
            self._go_on_at(self._timeline.now + left)

    def _go_on_at(self, time: float) -> None:
        """Go on with what is due at a time [s], unless that is done earlier anyway."""
        if time < self._due:
            self._due = time
            self._timeline.at(time, self._go_on)

    def _go_on(self) -> None:
        now = self._timeline.now
        if now < self._due:
            # Something was due earlier, and after that this is.
            return
        self._due = math.inf
        if now < self._stands_until():
            self._go_on_at(self._stands_until())
            return
        self._read()
        self._coroutines.run()
        self._look_ahead()
