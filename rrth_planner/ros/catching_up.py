# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Wait until a node has read what came: what it then judges is the newest that there is."""

from collections.abc import Callable
from threading import Event
import time

from rclpy.node import Node

# A node that is busy for longer is not waited for [s], nor one that hears more than it can read.
LONGEST, MOST_ROUNDS = 0.25, 3


class CatchUp:
    """
    Lets a thread wait until the node's executor has handled the messages that came before.

    In one round an executor handles one message of each subscription, and a guard condition after
    them. It is through once it has handled a message that came later, or none for a round.

    Parameters
    ----------
    node : Node
        Spun by another thread.
    heard : callable
        Returns how many messages were handled, and when the last of them came [ns].

    """

    def __init__(self, node: Node, heard: Callable[[], tuple[int, int]]) -> None:
        """Begin with nobody who waits."""
        self._node, self._heard = node, heard
        self._begin = self._count = self._n_rounds = 0
        self._is_over = Event()
        self._is_over.set()
        self._round = node.create_guard_condition(self._on_round)

    def __call__(self) -> bool:
        """Wait, one thread at a time; return whether the executor is through."""
        if self._node.executor is None:
            return False
        self._begin, self._count, self._n_rounds = time.time_ns(), self._heard()[0], 0
        self._is_over.clear()
        self._round.trigger()
        is_through = self._is_over.wait(LONGEST)
        self._is_over.set()
        return is_through

    def _on_round(self) -> None:
        if self._is_over.is_set():
            return
        before, (self._count, arrived) = self._count, self._heard()
        self._n_rounds += 1
        if arrived >= self._begin or self._count == before or self._n_rounds == MOST_ROUNDS:
            self._is_over.set()
        else:
            self._round.trigger()
