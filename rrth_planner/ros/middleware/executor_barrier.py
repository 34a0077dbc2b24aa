# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Run something in a node's own thread once it has processed the messages received before."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, TimeoutError as NotYet
import time
from typing import TypeVar

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

    An executor handles one message of each subscription in a round; the others are read here.

    Parameters
    ----------
    node : Node
        Spun by a single-threaded executor in another thread.
    read_all : callable
        Processes the messages that have been received and not been processed yet.

    """

    def __init__(self, node: Node, read_all: Callable[[], None]) -> None:
        """Begin without work."""
        self._node, self._read_all = node, read_all
        self._tasks: deque[Callable[[], None]] = deque()
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
        future: Future[T] = Future()

        def run() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                self._read_all()
                future.set_result(work())
            except BaseException as problem:
                future.set_exception(problem)

        self._tasks.append(run)
        end = time.monotonic() + LONGEST
        while True:
            self._round.trigger()
            try:
                return future.result(AGAIN)
            except NotYet:
                if future.done():
                    # It is the work that raised it.
                    raise
                # In case a wake-up was lost.
                if time.monotonic() > end and future.cancel():
                    raise NodeIsBusyError from None

    def _on_round(self) -> None:
        while self._tasks:
            self._tasks.popleft()()
