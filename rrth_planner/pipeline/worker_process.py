# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The process behind `PlanningProcess`.

This module imports nothing big, so that the process starts first and loads while its owner does.
"""

from multiprocessing.connection import Pipe
import os
import signal
import socket
import struct
import subprocess
import sys

WORKER = 'rrth_planner.pipeline.planning_worker'
# A process that has not ended by itself after this time is killed [s].
LONGEST_END = 5.0
# To send it something takes no longer than this, a whole number [s].
LONGEST_SEND = 5


class WorkerProcess:
    """A process that runs `planning_worker`, and ends with this one in any case."""

    def __init__(self) -> None:
        """Start it."""
        self.line, end = Pipe()
        # Ctrl-C is sent to all processes of a terminal; this one, which inherits the signal mask,
        # ends with its parent instead. In a session of its own it would be scheduled apart from
        # its parent, and could starve.
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            # Not by `multiprocessing`, which would import the main script again.
            self._process = subprocess.Popen(
                [sys.executable, '-m', WORKER, str(end.fileno())],
                stdin=subprocess.DEVNULL,
                env={**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, sys.path))},
                pass_fds=[end.fileno()],
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        end.close()
        # One that hangs reads nothing: what it is sent must not wait for ever.
        with socket.socket(fileno=os.dup(self.line.fileno())) as line:
            longest = struct.pack('ll', LONGEST_SEND, 0)
            line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, longest)

    @property
    def pid(self) -> int:
        """The number of the process."""
        return self._process.pid

    def is_alive(self) -> bool:
        """Return whether it has not ended yet."""
        return self._process.poll() is None

    def kill(self) -> None:
        """Kill it, as one that hangs."""
        self._process.kill()

    def end(self) -> int:
        """End it, and return its exit code."""
        self.line.close()
        try:
            return self._process.wait(LONGEST_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()
