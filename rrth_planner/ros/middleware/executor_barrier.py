# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Run something in a node's own thread once it has processed the messages received before."""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, TimeoutError as NotYet
import time
from typing import Any, TypeVar

from rclpy.node import Node
from rclpy.subscription import Subscription

T = TypeVar('T')
# Longest wait for a node [s].
LONGEST = 1.0
# After so long without a round it is triggered again [s].
AGAIN = 0.02
# Reading pauses after so long, so that the node's timers run [s].
SLICE = 0.01


class NodeIsBusyError(Exception):
    """A node did not process its messages in time."""


class ExecutorBarrier:
    """
    Runs work in the thread that spins a node, after the messages received before.

    In a round an executor takes one message from each reader; the others are taken here.

    Parameters
    ----------
    node : Node
        Spun by a single-threaded executor in another thread.

    """

    def __init__(self, node: Node) -> None:
        """Begin without work."""
        self._node = node
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
        reading = self._reading()

        def run() -> None:
            try:
                end = time.monotonic() + SLICE
                for _ in reading:
                    if future.cancelled():
                        return
                    if time.monotonic() > end:
                        self._tasks.append(run)
                        self._round.trigger()
                        return
                if future.set_running_or_notify_cancel():
                    future.set_result(work())
            except BaseException as problem:
                if future.running() or future.set_running_or_notify_cancel():
                    future.set_exception(problem)

        self._tasks.append(run)
        end = time.monotonic() + LONGEST
        while True:
            self._round.trigger()
            try:
                return future.result(AGAIN)
            except NotYet:
                if future.done():
                    # It may be the work that raised it.
                    return future.result()
                # In case a wake-up was lost.
                if time.monotonic() > end and future.cancel():
                    raise NodeIsBusyError from None

    def _on_round(self) -> None:
        for _ in range(len(self._tasks)):
            self._tasks.popleft()()

    def _reading(self) -> Iterator[None]:
        """Process the messages that the node's readers hold, one callback at each step."""
        begin = time.time_ns()
        for reader in list(self._node.subscriptions):
            # No more than these can have come before.
            for _ in range(max(1, reader.qos_profile.depth)):
                found = taken(reader)
                if found is None:
                    break
                message, info = found
                has_info = reader._callback_type is Subscription.CallbackType.WithMessageInfo
                reader.callback(message, *((info,) if has_info else ()))
                yield
                # A callback may take further ones; not every middleware has this time.
                if (info.get('received_timestamp') or 0) > begin:
                    break


def taken(reader: Subscription) -> tuple[Any, dict[str, Any]] | None:
    """Return the next message that a reader holds, and what the middleware says of it."""
    with reader.handle:
        found: tuple[Any, dict[str, Any]] | None = reader.handle.take_message(
            reader.msg_type, reader.raw
        )
    return found
