# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the planning process and its owner send each other."""

from dataclasses import dataclass
import io
from multiprocessing.connection import Connection
import pickle
import select
from typing import Any

from rrth_planner.model.arm import ArmModel
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.planning.options import TreeOptions

# What is sent once; a channel remembers so many of them, more than any message holds.
SENT_ONCE, REMEMBERED = (ArmModel, Scene, MotionLimits, TreeOptions), 64
# Sent while the process works, to cancel that.
STOP = None


@dataclass(frozen=True, slots=True)
class Raised:
    """An error instead of an answer, with its traceback."""

    problem: Exception
    where: str


class Channel:
    """
    One end of a pipe to another process.

    What lasts from question to question, `SENT_ONCE`, is sent once, and then named by its identity
    at the sender. So the receiver has the same object each time, and keeps what it derives from
    it.

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

    def send(self, value: Any) -> None:
        """Send a value."""
        out = io.BytesIO()
        pickler = _Pickler(out, self._sent)
        pickler.dump(value)
        # In one call: each one releases the interpreter, and waits for it again.
        self.line.send_bytes(pickle.dumps((pickler.news, out.getvalue()), protocol=5))
        self._sent.update(pickler.news)
        _forget_first(self._sent)

    def is_readable(self, timeout: float) -> bool:
        """
        Return whether a value or the end of the line is there, or comes within a time [s].

        A hundred times as fast as the connection's own `poll`: planning asks it often.
        """
        return bool(self._readable.poll(1e3 * timeout))

    def receive(self) -> Any:
        """Return the next value; what was read-only is read-only."""
        news, data = pickle.loads(self.line.recv_bytes())
        self._received.update(news)
        value = _Unpickler(data, self._received).load()
        _forget_first(self._received)
        return value


class _Pickler(pickle.Pickler):
    """Writes identities of what is sent once; `news` are those objects that were not sent yet."""

    def __init__(self, out: io.BytesIO, sent: dict[int, Any]) -> None:
        super().__init__(out, protocol=5)
        self._sent = sent
        self.news: dict[int, Any] = {}

    def persistent_id(self, part: Any) -> int | None:
        if not isinstance(part, SENT_ONCE):
            return None
        if id(part) not in self._sent:
            # Kept alive, so that nothing else can have its identity.
            self.news[id(part)] = part
        return id(part)


class _Unpickler(pickle.Unpickler):
    """Reads what `_Pickler` writes."""

    def __init__(self, data: bytes, received: dict[int, Any]) -> None:
        super().__init__(io.BytesIO(data))
        self._received = received

    def persistent_load(self, identity: int) -> Any:
        return self._received[identity]


def _forget_first(parts: dict[int, Any]) -> None:
    """Forget what was sent first, beyond what is remembered."""
    while len(parts) > REMEMBERED:
        del parts[next(iter(parts))]
