# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Do something in a node's own thread once it has read what came."""

from collections.abc import Callable
from concurrent.futures import CancelledError, Future, TimeoutError as NotYet
import time
from typing import Any, Generic, TypeVar

from rclpy.node import Node

T = TypeVar('T')
# Longer than this a node is not waited for [s].
LONGEST = 1.0
# After so long without a round it is asked for again [s].
AGAIN = 0.02


class NodeIsBusyError(Exception):
    """A node did not come to read what was sent to it."""


class ExecutorBarrier:
    """
    Has the thread that spins a node do something after the messages that came before.

    In one round an executor handles one message of each subscription, and a guard condition after
    them. It is through once it has handled a message that came later, or none for a round.

    Parameters
    ----------
    node : Node
        Spun by a single-threaded executor in another thread; by several threads it may be through
        a little early.
    handled : callable
        Returns how many messages were handled, and when the last of them came that leaves none
        before it [ns].

    """

    def __init__(self, node: Node, handled: Callable[[], tuple[int, int]]) -> None:
        """Begin with nothing to do."""
        self._node, self._handled = node, handled
        self._task: _Task[Any] | None = None
        self._round = node.create_guard_condition(self._on_round)

    def call(self, work: Callable[[], T]) -> T:
        """
        Return what some work returns, or raise what it raises; called by one thread at a time.

        Raises
        ------
        NodeIsBusyError
            Its turn did not come; it is not done any more.

        """
        if self._node.executor is None:
            # Whoever calls the node's callbacks by hand has handed over what there is.
            return work()
        task = _Task(work)
        self._task = task
        end = time.monotonic() + LONGEST
        while True:
            self._round.trigger()
            try:
                return task.future.result(AGAIN)
            except NotYet:
                # Should a wake-up have been lost, nothing but this asks for a round.
                if time.monotonic() > end and task.future.cancel():
                    raise NodeIsBusyError from None
            except CancelledError:
                raise NodeIsBusyError from None

    def _on_round(self) -> None:
        task = self._task
        if task is None:
            return
        before, (task.n_handled, came) = task.n_handled, self._handled()
        if came >= task.begin or task.n_handled == before:
            self._task = None
            task.run()
        else:
            self._round.trigger()


class _Task(Generic[T]):
    """Work to be done once the node is through, which is not known before a first round."""

    def __init__(self, work: Callable[[], T]) -> None:
        self._work, self.begin, self.n_handled = work, time.time_ns(), -1
        self.future: Future[T] = Future()

    def run(self) -> None:
        """Do the work, if somebody still waits for it."""
        if not self.future.set_running_or_notify_cancel():
            return
        try:
            self.future.set_result(self._work())
        except BaseException as problem:
            self.future.set_exception(problem)
