# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where the requests of a node run: its own thread, its clock, its planning process."""

from collections.abc import Callable, Coroutine, Iterator
from contextlib import suppress
from functools import partial
import math
from threading import Event
import time
import traceback
from typing import Any, TypeVar

from rclpy.clock import Clock, ClockType
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.task import Future
from rrth_planner.collision.violation import Violation
from rrth_planner.execution.coroutines import Coroutines, Wait
from rrth_planner.model.errors import one_line, RequestError
from rrth_planner.model.status import ErrorCode
from rrth_planner.pipeline.host import LONGEST_ANSWER, random_seed
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.planning_process import (
    LONGEST_WARM_UP,
    Planner,
    PlanningProcessError,
)
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.ros.middleware.backlog import process_backlog
from rrth_planner.ros.middleware.work_thread import WorkThread

T = TypeVar('T')
# A request waits no longer for a file to be written [s].
LONGEST_HELP = 5.0
# Reading what has come pauses after so long, so that the node's timers run; it is given up after
# so long in all [s].
SLICE, LONGEST_READING = 0.01, 1.0
# In case a wake-up was lost [s].
LONGEST_PAUSE = 0.05


class NodeHost:
    """
    Runs the coroutines of requests in the thread that spins a node, which waits for nobody.

    One thread asks the planner, which answers one question at a time, and another one helps with
    what takes long: files, and what shows a motion. Both hand back what they found.

    Parameters
    ----------
    planner : Planner
        Closed with this.
    on_error : callable
        Takes what went wrong where messages are processed for a request.

    """

    def __init__(
        self, node: Node, planner: Planner, on_error: Callable[[str], None] = lambda what: None
    ) -> None:
        """Begin with nothing to do."""
        self._node, self._planner, self._on_error = node, planner, on_error
        self._guard = node.create_guard_condition(self.go_on)
        self._coroutines = Coroutines(time.monotonic, self._wake)
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(LONGEST_PAUSE, self.go_on, clock=steady)
        self._timer.cancel()
        self._asking, self._helping = WorkThread('planner'), WorkThread('helper')
        # How many questions are not answered yet, and until when they are, at the latest [s].
        self._n_asked, self._answered = 0, -math.inf

    def begin(self, coroutine: Coroutine[Any, Any, object]) -> None:
        """Have a coroutine run, whose errors are logged."""
        end = self._start(coroutine)

        def report() -> None:
            try:
                end.result()
            except Exception:
                self.error(traceback.format_exc())

        end.then(report)

    def future_of(self, coroutine: Coroutine[Any, Any, T]) -> Future:
        """Have a coroutine run; return what a callback of the node awaits."""
        end, future = self._start(coroutine), Future()

        def settle() -> None:
            try:
                future.set_result(end.result())
            except BaseException as problem:
                future.set_exception(problem)

        end.then(settle)
        return future

    def go_on(self) -> None:
        """Go on with what is due; called in the node's thread."""
        self._coroutines.run()
        self._look_ahead()

    def now(self) -> float:
        """Return the node's time [s]."""
        return self._node.get_clock().now().nanoseconds * 1e-9

    def steady(self) -> float:
        """Return a time that never steps [s]."""
        return time.monotonic()

    def new_seed(self) -> int:
        """Return one that nobody knows."""
        return random_seed()

    async def sleep(self, seconds: float) -> None:
        """Return after a time [s]."""
        await self._coroutines.sleep(seconds)

    async def plan(self, question: PlanQuestion, should_stop: Callable[[], bool]) -> MotionPlan:
        """Do what `Planner.plan` does."""
        longest, is_over = question.options.time_limit + LONGEST_ANSWER, Event()
        try:
            plan: MotionPlan = await self._ask(
                longest, self._planner.plan, question, lambda: is_over.is_set() or should_stop()
            )
        finally:
            # One that was given up does not keep the next one waiting.
            is_over.set()
        return plan

    async def violation_seen(self, *arguments: Any) -> Violation | None:
        """Do what `Planner.violation_seen` does."""
        asked = self._planner.violation_seen
        violation: Violation | None = await self._ask(LONGEST_ANSWER, asked, *arguments)
        return violation

    async def warm_up(self, *arguments: Any) -> None:
        """Do what `Planner.warm_up` does, before what is asked for later."""
        await self._ask(LONGEST_WARM_UP, self._planner.warm_up, *arguments)

    async def help(self, work: Callable[..., T], *arguments: Any) -> T:
        """Return what some work returns, done by the helper, or raise what it raises."""
        problem = TimeoutError(f'not done within {LONGEST_HELP:g} s')
        result: T = await self._given_to(self._helping, LONGEST_HELP, problem, work, *arguments)
        return result

    async def read(self) -> None:
        """
        Return once the node has processed the messages that have come before.

        Raise RequestError where that takes too long.
        """
        if self._node.executor is None:
            # Callbacks that are called by hand have processed all messages.
            return
        begin = paused = self.steady()
        for _ in self._processed():
            if self.steady() < paused + SLICE:
                continue
            if self.steady() > begin + LONGEST_READING:
                raise RequestError(
                    ErrorCode.SENSOR_INFO_STALE,
                    'the node is busy: bodies received while the motion was planned are not '
                    'processed yet',
                )
            await self.sleep(0.0)
            paused = self.steady()

    def _processed(self) -> Iterator[None]:
        """Process the messages that have come; an error in that is one of the node."""
        try:
            yield from process_backlog(self._node)
        except Exception as problem:
            self.error(traceback.format_exc())
            what = one_line(f'{type(problem).__name__}: {problem}')
            self._on_error(f'a message could not be processed, {what}')
            raise RequestError(ErrorCode.FAILURE, f'an error of the node: {what}') from problem

    def error(self, sentence: str) -> None:
        """Log an error."""
        self._node.get_logger().error(sentence)

    def warning(self, sentence: str, period: float) -> None:
        """Log a warning, at most once in a period [s]."""
        self._node.get_logger().warning(sentence, throttle_duration_sec=period)

    def close(self) -> None:
        """End the planner and the threads; what waits for them is not gone on with."""
        for thread in (self._asking, self._helping):
            thread.close()
        self._planner.close()

    def _start(self, coroutine: Coroutine[Any, Any, T]) -> Wait[T]:
        end = self._coroutines.start(coroutine)
        self._look_ahead()
        return end

    def _look_ahead(self) -> None:
        """Have the timer call when something is due."""
        left = self._coroutines.time_left()
        if math.isinf(left):
            self._timer.cancel()
        else:
            self._timer.timer_period_ns = max(1, int(1e9 * min(left, LONGEST_PAUSE)))
            self._timer.reset()

    def _ask(self, longest: float, work: Callable[..., Any], *arguments: Any) -> Wait[Any]:
        """Have the planner asked; its answer takes so long [s] once it is its turn, at most."""
        present = self.steady()
        self._answered = max(self._answered, present) + longest
        self._n_asked += 1
        problem = PlanningProcessError(f'the planner has not answered within {longest:g} s')
        left = self._answered - present

        def answered() -> Any:
            try:
                return work(*arguments)
            finally:
                # Then it is the turn of the next one, whether anybody still waits for this or not.
                self._coroutines.post(self._on_answer)

        return self._given_to(self._asking, left, problem, answered)

    def _on_answer(self) -> None:
        self._n_asked -= 1
        if self._n_asked == 0:
            self._answered = -math.inf

    def _given_to(
        self,
        thread: WorkThread,
        longest: float,
        problem: Exception,
        work: Callable[..., Any],
        *arguments: Any,
    ) -> Wait[Any]:
        """Have some work done by a thread; a problem is raised after a time [s]."""
        wait: Wait[Any] = Wait()

        def done() -> None:
            try:
                end = partial(wait.give, work(*arguments))
            except BaseException as error:
                end = partial(wait.fail, error)
            self._coroutines.post(end)

        self._coroutines.limit(wait, longest, problem)
        thread.put(done)
        return wait

    def _wake(self) -> None:
        # The node may be gone.
        with suppress(rclpy_implementation.InvalidHandle):
            self._guard.trigger()
