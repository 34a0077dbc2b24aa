# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the planning process and its owner send each other."""

from dataclasses import dataclass
from multiprocessing.connection import Connection
import pickle
import select
from typing import Any

from rrth_planner.model.arm import ArmModel
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.planning.options import TreeOptions

# What is sent once; a channel remembers so many of them, more than any message has parts.
SENT_ONCE, REMEMBERED = (ArmModel, Scene, MotionLimits, TreeOptions), 64
# The one part of a message that cancels what the process works on.
STOP = 'stop'


@dataclass(frozen=True, slots=True)
class Raised:
    """An error instead of an answer, with its traceback."""

    problem: Exception
    where: str


class Channel:
    """
    One end of a pipe to another process.

    A message has some parts. What lasts from question to question, `SENT_ONCE`, is sent once, and
    then named by its identity at the sender. So the receiver has the same object each time, and
    keeps what it derives from it.

    Parameters
    ----------
    line : Connection
        It is written and read only here.

    """

    def __init__(self, line: Connection) -> None:
        """Begin with nothing sent."""
        self.line = line
        self._readable = select.poll()
        self._readable.register(line, select.POLLIN)
        self._sent: dict[int, Any] = {}
        self._received: dict[int, Any] = {}

    def send(self, *parts: Any) -> None:
        """Send a message."""
        known = {id(part): part for part in parts if isinstance(part, SENT_ONCE)}
        # Kept alive, so that nothing else can have its identity.
        news = {name: part for name, part in known.items() if name not in self._sent}
        names = [id(part) if id(part) in known else None for part in parts]
        others = [part for part, name in zip(parts, names, strict=True) if name is None]
        # In one call: each one releases the interpreter, and waits for it again.
        self.line.send_bytes(pickle.dumps((news, names, others), protocol=5))
        self._sent.update(news)
        _forget_first(self._sent)

    def is_readable(self, timeout: float) -> bool:
        """
        Return whether a message or the end of the line is there, or comes within a time [s].

        A hundred times as fast as the connection's own `poll`: planning asks it often.
        """
        return bool(self._readable.poll(1e3 * timeout))

    def receive(self) -> tuple[Any, ...]:
        """Return the parts of the next message; what was read-only is read-only."""
        news, names, others = pickle.loads(self.line.recv_bytes())
        self._received.update(news)
        rest = iter(others)
        parts = tuple(next(rest) if name is None else self._received[name] for name in names)
        _forget_first(self._received)
        return parts


def _forget_first(parts: dict[int, Any]) -> None:
    """Forget what was sent first, beyond what is remembered."""
    while len(parts) > REMEMBERED:
        del parts[next(iter(parts))]
