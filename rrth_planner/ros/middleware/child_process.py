# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A node as a process of its own, which ends when its owner does."""

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
import re
import signal
import subprocess
import sys
from threading import Thread
from types import TracebackType

from rrth_planner.model.errors import RrthError

# A node that has not ended by itself after this time is killed [s].
PATIENCE = 10.0
LAST_WORDS = 3
# What rclpy writes before the sentences of its log, here without the time and the name.
PREFIX = re.compile(r'^\[(\w+)\] \[[0-9.]+\] \[[^\]]*\]: ')


class ChildDiedError(RrthError):
    """A process that should still be running has ended."""


class ChildProcess:
    """
    A Python module that runs as a process, between entering and leaving a `with` block.

    Parameters
    ----------
    module : str
        Run as `python -m module`.
    arguments : sequence of str
    on_line : callable
        Called with each line that it writes, from another thread.

    """

    def __init__(
        self, module: str, arguments: Sequence[str], on_line: Callable[[str], None]
    ) -> None:
        """Remember what to run."""
        self._module, self._on_line = module, on_line
        self._command = [sys.executable, '-m', module, *arguments]
        self._lines: deque[str] = deque(maxlen=LAST_WORDS)

    def __enter__(self) -> 'ChildProcess':
        """Start it."""
        self._process = subprocess.Popen(
            self._command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors='replace',
        )
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        problem: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End it: politely, then not."""
        try:
            self._process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(PATIENCE)
        finally:
            self._process.kill()
            self._process.wait()

    @property
    def pid(self) -> int:
        """The number of the process."""
        return self._process.pid

    def check(self) -> None:
        """Raise ChildDiedError, with its last words, when it has ended."""
        code = self._process.poll()
        if code is not None:
            self._reader.join(PATIENCE)
            words = ' / '.join(self._lines) or 'it said nothing'
            raise ChildDiedError(f'{self._module} ended with code {code}: {words}')

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            words = PREFIX.sub(r'\1: ', line).removeprefix('INFO: ').strip()
            if words:
                self._lines.append(words)
                self._on_line(words)
