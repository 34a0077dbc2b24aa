# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Wait until a node has read what came: what it then judges is the newest that there is."""

from collections.abc import Callable
from threading import Event
import time

from rclpy.node import Node

# Longer than this a node is not waited for [s].
LONGEST = 1.0
# After so long without a round it is asked for again [s].
AGAIN = 0.02
# That a node was through is news for so long [s].
NEWS = 0.01


class CatchUp:
    """
    Lets a thread wait until the node's executor has handled the messages that came before.

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
        """Begin with nobody who waits."""
        self._node, self._handled = node, handled
        self._begin = self._n = 0
        self._through = 0.0
        # Whether somebody waits; whether a round was asked for that nobody waits for any more.
        self._is_over, self._is_stale = Event(), False
        self._is_over.set()
        self._round = node.create_guard_condition(self._on_round)

    def __call__(self) -> bool:
        """Wait, one thread at a time; return whether the executor is through."""
        if self._node.executor is None:
            # Whoever calls its callbacks by hand has handed over what there is.
            self._through = time.monotonic()
            return True
        self._begin, self._n = time.time_ns(), self._handled()[0]
        self._is_over.clear()
        self._round.trigger()
        end = time.monotonic() + LONGEST
        while not (is_through := self._is_over.wait(AGAIN)) and time.monotonic() < end:
            # Should a wake-up have been lost, nothing but this asks for a round.
            self._round.trigger()
        self._is_over.set()
        self._is_stale = not is_through
        return is_through

    def is_news(self) -> bool:
        """Return whether the executor was through just now; not if the machine stood still."""
        return time.monotonic() - self._through <= NEWS

    def _on_round(self) -> None:
        is_stale, self._is_stale = self._is_stale, False
        if self._is_over.is_set():
            return
        before, (self._n, came) = self._n, self._handled()
        if not is_stale and (came >= self._begin or self._n == before):
            self._through = time.monotonic()
            self._is_over.set()
        else:
            self._round.trigger()
