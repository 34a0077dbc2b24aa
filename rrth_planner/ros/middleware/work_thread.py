# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A thread that does one thing after the other."""

from collections.abc import Callable
from queue import SimpleQueue
from threading import Thread
import traceback

# What hangs, as a file on a disk that is gone, is not waited for any longer [s].
LONGEST_END = 2.0


class WorkThread:
    """
    Does what it is given, in turn; what that raises is written to standard error.

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
        """Have it do nothing more; return once it has done what it is doing, or soon."""
        self._is_closed = True
        self.put(lambda: None)
        self._thread.join(LONGEST_END)

    def _run(self) -> None:
        while not self._is_closed:
            try:
                self._work.get()()
            except Exception:
                traceback.print_exc()
