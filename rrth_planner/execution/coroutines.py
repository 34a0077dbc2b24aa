# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Coroutines that one thread runs, by a clock that it is given."""

from collections import deque
from collections.abc import Callable, Coroutine, Generator
from functools import partial
import heapq
from itertools import count
import math
from typing import Any, Generic, TypeVar

T = TypeVar('T')


class Wait(Generic[T]):
    """What coroutines wait for: a value, or an error, that comes once; later ones are ignored."""

    def __init__(self) -> None:
        """Begin without either."""
        self.is_over = False
        self._value: T | None = None
        self._problem: BaseException | None = None
        self._followers: list[Callable[[], None]] = []

    def give(self, value: T) -> None:
        """End it with a value."""
        self._end(value, None)

    def fail(self, problem: BaseException) -> None:
        """End it with an error."""
        self._end(None, problem)

    def then(self, follower: Callable[[], None]) -> None:
        """Have something called once it is over: now, if it is."""
        if self.is_over:
            follower()
        else:
            self._followers.append(follower)

    def result(self) -> T:
        """Return its value, or raise its error, once it is over."""
        if self._problem is not None:
            raise self._problem
        return self._value  # type: ignore[return-value]

    def __await__(self) -> Generator['Wait[T]', None, T]:
        """Return the value, or raise the error, once it is there."""
        if not self.is_over:
            yield self
        return self.result()

    def _end(self, value: T | None, problem: BaseException | None) -> None:
        if self.is_over:
            return
        self.is_over, self._value, self._problem = True, value, problem
        followers, self._followers = self._followers, []
        for follower in followers:
            follower()


class Coroutines:
    """
    Runs coroutines that await `Wait`s; all of it in one thread, but for `post`.

    Parameters
    ----------
    clock : callable
        Returns a time that never steps [s].
    wake : callable
        Has `run` called soon; may be called by any thread.

    """

    def __init__(self, clock: Callable[[], float], wake: Callable[[], None]) -> None:
        """Begin without any."""
        self._clock, self._wake = clock, wake
        # What other threads want done, what is to be gone on with, and what is done at a time [s],
        # by its number in turn.
        self._posted: deque[Callable[[], None]] = deque()
        self._ready: deque[Callable[[], None]] = deque()
        self._due: list[tuple[float, int, Wait[Any], Callable[[], None]]] = []
        self._numbers = count()
        self._is_running = False

    def start(self, coroutine: Coroutine[Any, Any, T]) -> Wait[T]:
        """Run a coroutine until it waits for something; return the wait for its result."""
        end: Wait[T] = Wait()
        self._go_on(coroutine, end)
        return end

    def sleep(self, seconds: float) -> Wait[None]:
        """Return what is over after a time [s]; after 0, once all that is ready has run."""
        wait: Wait[None] = Wait()
        self._at(seconds, wait, partial(wait.give, None))
        return wait

    def limit(self, wait: Wait[Any], seconds: float, problem: BaseException) -> None:
        """Have a wait end with an error, unless it is over within a time [s]."""
        self._at(seconds, wait, partial(wait.fail, problem))

    def post(self, work: Callable[[], None]) -> None:
        """Have something done by the thread that runs the coroutines; called by any thread."""
        self._posted.append(work)
        self._wake()

    def run(self) -> None:
        """Do what is due, and go on with the coroutines that have what they waited for."""
        self._is_running = True
        try:
            present, last = self._clock(), next(self._numbers)
            while self._due and self._due[0][0] <= present and self._due[0][1] < last:
                heapq.heappop(self._due)[3]()
            while self._posted or self._ready:
                (self._posted or self._ready).popleft()()
        finally:
            self._is_running = False

    def time_left(self) -> float:
        """
        Return in how long `run` is to be called [s]; inf: not unless it is woken.

        To be asked for after each call of `start` and `run`.
        """
        while self._due and self._due[0][2].is_over:
            heapq.heappop(self._due)
        return max(0.0, self._due[0][0] - self._clock()) if self._due else math.inf

    def _at(self, seconds: float, wait: Wait[Any], work: Callable[[], None]) -> None:
        due = self._clock() + seconds
        heapq.heappush(self._due, (due, next(self._numbers), wait, work))

    def _go_on(self, coroutine: Coroutine[Any, Any, T], end: Wait[T]) -> None:
        try:
            wait: Wait[Any] = coroutine.send(None)
        except StopIteration as stop:
            end.give(stop.value)
        except BaseException as problem:
            end.fail(problem)
        else:
            wait.then(partial(self._resume, partial(self._go_on, coroutine, end)))

    def _resume(self, work: Callable[[], None]) -> None:
        # Not at once: who gives a value goes on first.
        self._ready.append(work)
        if not self._is_running:
            self._wake()
