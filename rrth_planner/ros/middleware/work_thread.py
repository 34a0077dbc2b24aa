# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A thread that does one thing after the other."""

from collections.abc import Callable
from queue import SimpleQueue
from threading import Thread


class WorkThread:
    """
    Does what it is given, in turn; that raises nothing.

    A `ThreadPoolExecutor` of one thread takes three times as long to hand something over.
    """

    def __init__(self, name: str) -> None:
        """Begin with nothing to do."""
        self._work: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._is_closed = False
        self._thread = Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def put(self, work: Callable[[], None]) -> None:
        """Have something done."""
        self._work.put(work)

    def close(self) -> None:
        """Return once it has done what it is doing; it does nothing more."""
        self._is_closed = True
        self.put(lambda: None)
        self._thread.join()

    def _run(self) -> None:
        while not self._is_closed:
            self._work.get()()
