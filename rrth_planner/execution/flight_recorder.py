# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The last events that the guard decided about, to be decided again: the same to the bit.

Rules, which are large and hardly ever change, are kept once, and events as bytes, since those of
half a minute beside a tracker are many.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
import hashlib
import importlib
import io
import pickle
from typing import Any

from rrth_planner.execution.decide import decide
from rrth_planner.execution.decision import Command
from rrth_planner.execution.event import Event, Fail
from rrth_planner.execution.fail_safe_stop import pending
from rrth_planner.execution.watch import MonitorRules, plain, PlainRules, Watch
from rrth_planner.model.errors import RecordError

# How long it remembers, and after how long it keeps what is known by then [s].
MEMORY, SEGMENT = 30.0, 1.0
# What a file begins with, and how a command is told from others [bytes].
MAGIC, DIGEST = b'rrth flight 1\n', 16
# A longer file is none of this [bytes].
LONGEST = 2**28
# Whose values a record may hold.
ROOMS = tuple(f'rrth_planner.{room}.' for room in ('model', 'collision', 'timing', 'execution'))
ARRAYS = {
    ('numpy', 'ndarray'),
    ('numpy', 'dtype'),
    ('numpy.core.multiarray', '_reconstruct'),
    ('numpy.core.multiarray', 'scalar'),
    ('numpy._core.multiarray', '_reconstruct'),
    ('numpy._core.multiarray', 'scalar'),
    ('numpy.core.numeric', '_frombuffer'),
    ('numpy._core.numeric', '_frombuffer'),
}
# What builds values of those rooms from their parts.
BUILDERS = {
    ('rrth_planner.model.frozen', '_made'),
    ('rrth_planner.model.scene', '_of_rows'),
    ('rrth_planner.model.trajectory', '_of_bytes'),
}


class Fate(IntEnum):
    """What became of a decision."""

    # Published, if there was anything to publish, and kept.
    KEPT = 0
    # Its command was too late, or could not be published.
    OTHERWISE = 1
    # There was none, or it was not kept: an error.
    NONE = 2
    # Nor was there a stop: one is to be published.
    PENDING = 3


@dataclass(frozen=True, slots=True)
class Entry:
    """
    An event and what became of it.

    Parameters
    ----------
    event : bytes
        As `FlightRecorder` writes it.
    fate : Fate
    command : bytes
        The digest of what was commanded; empty: nothing was.

    """

    event: bytes
    fate: Fate
    command: bytes


@dataclass(frozen=True, slots=True)
class Replayed:
    """
    An event that was decided again.

    Parameters
    ----------
    number : int
        From 0.
    is_same : bool
        Whether the same was commanded.

    """

    number: int
    event: Event
    command: Command | None
    is_same: bool


class FlightRecorder:
    """Keeps the events of the last `MEMORY` seconds."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._segments: deque[tuple[float, Watch, list[Entry]]] = deque()
        self._rules: list[MonitorRules] = []

    def record(self, watch: Watch, event: Event, fate: Fate, command: Command | None) -> None:
        """Keep an event, what was known before it, and what became of it."""
        now = event.at.steady
        if not self._segments or now - self._segments[-1][0] >= SEGMENT:
            self._segments.append((now, watch, []))
            while now - self._segments[0][0] > MEMORY + SEGMENT:
                self._segments.popleft()
        entry = Entry(self._written(event), fate, b'' if command is None else digest_of(command))
        self._segments[-1][2].append(entry)

    def to_bytes(self) -> bytes:
        """Return a file's content; `read_flight` reads it."""
        if not self._segments:
            raise RecordError('flight recorder: empty, expected at least one event')
        first = self._written(self._segments[0][1])
        entries = [(e.event, int(e.fate), e.command) for _, _, es in self._segments for e in es]
        rules = [pickle.dumps(plain(one), protocol=5) for one in self._rules]
        return MAGIC + pickle.dumps((rules, first, entries), protocol=5)

    def _written(self, value: Any) -> bytes:
        buffer = io.BytesIO()
        _Writer(buffer, self._rules).dump(value)
        return buffer.getvalue()


class _Writer(pickle.Pickler):
    """Writes rules by their number."""

    def __init__(self, file: io.BytesIO, rules: list[MonitorRules]) -> None:
        super().__init__(file, protocol=5)
        self._known = rules

    def persistent_id(self, value: Any) -> int | None:
        """Return the number of rules."""
        if not hasattr(type(value), 'ray_guard_length') or not hasattr(value, 'replan'):
            return None
        for number, known in enumerate(self._known):
            if known is value:
                return number
        self._known.append(value)
        return len(self._known) - 1


class _Reader(pickle.Unpickler):
    """Reads values of this package and arrays only: whatever else a file holds is not called."""

    def __init__(self, content: bytes, rules: list[PlainRules]) -> None:
        super().__init__(io.BytesIO(content))
        self._known = rules

    def persistent_load(self, number: Any) -> PlainRules:
        """Return rules by their number."""
        if not isinstance(number, int) or not 0 <= number < len(self._known):
            raise RecordError(f'flight record: rules {number!r}, expected known ones')
        return self._known[number]

    def find_class(self, module: str, name: str) -> Any:
        """Return a class that a record may hold."""
        if (module, name) in ARRAYS | BUILDERS:
            return getattr(importlib.import_module(module), name)
        if module.startswith(ROOMS) and '.' not in name:
            found = getattr(importlib.import_module(module), name, None)
            if isinstance(found, type) and found.__module__ == module:
                return found
        raise RecordError(f'flight record: {module}.{name}, expected values of this package')


def digest_of(command: Command) -> bytes:
    """Return by what a command is told from all others: its motion, to the bit, and its begin."""
    motion = command.motion.trajectory
    digest = hashlib.blake2b(repr(command.begin).encode(), digest_size=DIGEST)
    for array in (motion.times, *motion.states):
        digest.update(array.tobytes())
    return digest.digest()


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """
    A record that was read.

    Parameters
    ----------
    watch : Watch
        What was known before the first event.

    """

    watch: Watch
    entries: tuple[Entry, ...]
    rules: tuple[PlainRules, ...]


def read_flight(content: bytes) -> Flight:
    """
    Return the record of a file's content.

    Raises
    ------
    RecordError
        It is no such content.

    """
    if not content.startswith(MAGIC) or len(content) > LONGEST:
        raise RecordError('flight record: another file, expected one that a planner has saved')
    try:
        rules, first, entries = _Reader(content[len(MAGIC) :], []).load()
        known = [_Reader(one, []).load() for one in rules]
        watch = _Reader(first, known).load()
        found = tuple(Entry(bytes(e), Fate(fate), bytes(c)) for e, fate, c in entries)
    except RecordError:
        raise
    except Exception as problem:
        raise RecordError(f'flight record: damaged, {type(problem).__name__}') from problem
    if not isinstance(watch, Watch):
        raise RecordError('flight record: no watch, expected what was known before the events')
    return Flight(watch, found, tuple(known))


def replay(flight: Flight) -> Iterator[Replayed]:
    """Decide about all events of a record again; each with whether the same was commanded."""
    watch = flight.watch
    for number, entry in enumerate(flight.entries):
        event = _Reader(entry.event, list(flight.rules)).load()
        if not isinstance(event, Event):
            raise RecordError(f'flight record: entry {number} is no event')
        watch, command, is_same = _decided(watch, event, entry)
        yield Replayed(number, event, command, is_same)


def _decided(watch: Watch, event: Event, entry: Entry) -> tuple[Watch, Command | None, bool]:
    if entry.fate is Fate.PENDING:
        assert isinstance(event, Fail)
        return pending(watch, event), None, True
    try:
        decision = decide(watch, event)
    except Exception:
        return watch, None, entry.fate is Fate.NONE
    command = decision.command
    digest = b'' if command is None else digest_of(command)
    if entry.fate is Fate.NONE:
        # Whatever failed then: nothing was kept.
        return watch, None, True
    if entry.fate is Fate.OTHERWISE:
        is_same = decision.otherwise is not None
        after = decision.otherwise or decision
        return after.watch, command, is_same
    return decision.watch, command, digest == entry.command
