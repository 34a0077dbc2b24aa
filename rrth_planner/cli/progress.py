# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a command is at, on standard error, where it takes long."""

import sys
import time

from rrth_planner.cli.program import say

# Nothing is said of what takes less than this; without a terminal, it is said so often [s].
SILENT_TIME, LINE_PERIOD = 1.0, 10.0
# To the beginning of the line, and clear it.
ERASE = '\r\x1b[K'


class Progress:
    """One line on a terminal that is written anew and goes in the end; elsewhere few lines."""

    def __init__(self, name: str) -> None:
        """Begin; name: of the command."""
        self._name, self._is_drawn = name, False
        self._next = time.monotonic() + SILENT_TIME

    def __call__(self, what: str) -> None:
        """Say what is being done."""
        now = time.monotonic()
        if now < self._next:
            return
        if sys.stderr.isatty():
            print(f'{ERASE}{what} ...', end='', file=sys.stderr, flush=True)
            self._is_drawn = True
        else:
            say(self._name, f'{what} ...')
            self._next = now + LINE_PERIOD

    def __enter__(self) -> 'Progress':
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Clear the line."""
        if self._is_drawn:
            print(ERASE, end='', file=sys.stderr, flush=True)
