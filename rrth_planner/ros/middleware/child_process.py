# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A node as a child process, which ends with its owner."""

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
import re
import signal
import subprocess
import sys
from threading import Thread

from rrth_planner.model.errors import RrthError

# A node that has not ended by itself after this time is killed [s].
LONGEST_END = 10.0
LAST_LINES = 3
# The prefix of rclpy's log lines; the severity is kept.
PREFIX = re.compile(r'^\[(\w+)\] \[[0-9.]+\] \[[^\]]*\]: ')


class ChildDiedError(RrthError):
    """A child process ended unexpectedly."""


class ChildProcess:
    """A Python module that runs as a process during a `with` block."""

    def __init__(
        self, module: str, arguments: Sequence[str], on_line: Callable[[str], None]
    ) -> None:
        """Remember what to run; `on_line` takes each line that it writes, in another thread."""
        self._module, self._on_line = module, on_line
        self._command = [sys.executable, '-m', module, *arguments]
        self._lines: deque[str] = deque(maxlen=LAST_LINES)

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

    def __exit__(self, *_: object) -> None:
        """End it by SIGINT, later by SIGKILL."""
        try:
            self._process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(LONGEST_END)
        finally:
            self._process.kill()
            self._process.wait()

    @property
    def pid(self) -> int:
        """The number of the process."""
        return self._process.pid

    def check(self) -> None:
        """Raise ChildDiedError, with its last lines, when it has ended."""
        code = self._process.poll()
        if code is not None:
            self._reader.join(LONGEST_END)
            words = ' / '.join(self._lines) or 'no output'
            raise ChildDiedError(f'{self._module} ended with code {code}: {words}')

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            words = PREFIX.sub(r'\1: ', line).removeprefix('INFO: ').strip()
            if words:
                self._lines.append(words)
                self._on_line(words)
