# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Run something in a node's own thread once it has processed the messages received before."""

from collections.abc import Callable
from concurrent.futures import CancelledError, Future, TimeoutError as NotYet
import time
from typing import Any, Generic, TypeVar

from rclpy.node import Node

T = TypeVar('T')
# Longest wait for a node [s].
LONGEST = 1.0
# After so long without a round it is triggered again [s].
AGAIN = 0.02


class NodeIsBusyError(Exception):
    """A node did not process its messages in time."""


class ExecutorBarrier:
    """
    Runs work in the thread that spins a node, after the messages received before.

    In one round an executor handles one message of each subscription, and a guard condition after
    them. It has caught up once it has handled a message that came later, or none for a round.

    Parameters
    ----------
    node : Node
        Spun by a single-threaded executor in another thread; by several threads the work
        may run a little early.
    handled : callable
        Returns the number of handled messages, and the time of arrival of the last one that
        leaves none before it [ns].

    """

    def __init__(self, node: Node, handled: Callable[[], tuple[int, int]]) -> None:
        """Begin without work."""
        self._node, self._handled = node, handled
        self._task: _Task[Any] | None = None
        self._round = node.create_guard_condition(self._on_round)

    def call(self, work: Callable[[], T]) -> T:
        """
        Return what some work returns, or raise what it raises; called by one thread at a time.

        Raises
        ------
        NodeIsBusyError
            The work did not run in time, and will not run any more.

        """
        if self._node.executor is None:
            # Callbacks that are called by hand have processed all messages.
            return work()
        task = _Task(work)
        self._task = task
        end = time.monotonic() + LONGEST
        while True:
            self._round.trigger()
            try:
                return task.future.result(AGAIN)
            except NotYet:
                if task.future.done():
                    # It is the work that raised it.
                    raise
                # In case a wake-up was lost.
                if time.monotonic() > end and task.future.cancel():
                    raise NodeIsBusyError from None
            except CancelledError:
                raise NodeIsBusyError from None

    def _on_round(self) -> None:
        task = self._task
        if task is None or task.future.done():
            return
        before, (task.n_handled, came) = task.n_handled, self._handled()
        if came >= task.begin or task.n_handled == before:
            task.run()
        else:
            self._round.trigger()


class _Task(Generic[T]):
    """Work to run once the node has caught up, which takes one round at least to know."""

    def __init__(self, work: Callable[[], T]) -> None:
        self._work, self.begin, self.n_handled = work, time.time_ns(), -1
        self.future: Future[T] = Future()

    def run(self) -> None:
        """Run the work unless it was cancelled."""
        if not self.future.set_running_or_notify_cancel():
            return
        try:
            self.future.set_result(self._work())
        except BaseException as problem:
            self.future.set_exception(problem)
