# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The last events that the monitor decided about, to be decided again: the same to the bit.

Scenes are kept as names and numbers: those of half a minute beside a tracker are many. Rules,
which are large and hardly ever change, are written once.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
import hashlib
import importlib
import io
import pickle
from typing import Any, cast

from rrth_planner.execution.decide import decide
from rrth_planner.execution.decision import Command
from rrth_planner.execution.event import Begin, BodyCame, Event, Fail
from rrth_planner.execution.fail_safe_stop import pending
from rrth_planner.execution.step import Fate
from rrth_planner.execution.watch import MonitorRules, plain, PlainRules, Watch
from rrth_planner.model.errors import RecordError
from rrth_planner.model.scene import Scene, scene_of_bytes

# How long it remembers, and after how long it keeps what is known by then [s].
MEMORY, SEGMENT = 30.0, 1.0
# What a file begins with: the kind, and the version of its layout; others are rejected. How long
# the digest of a command is [bytes].
KIND, FORMAT, DIGEST = b'rrth flight ', b'2', 16
MAGIC = KIND + FORMAT + b'\n'
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
    ('rrth_planner.model.scene', 'scene_of_bytes'),
    ('rrth_planner.model.trajectory', '_of_bytes'),
}


@dataclass(frozen=True, slots=True)
class Entry:
    """
    An event and what became of it.

    Parameters
    ----------
    event : Event or bytes
        Bytes: as a file has it.
    fate : Fate
    command : bytes
        The digest of what was commanded; empty: nothing was.

    """

    event: Event | bytes
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
    watch : Watch
        What is known after it.
    command : Command or None
        None: nothing was published.
    is_same : bool
        Whether the same was commanded.

    """

    number: int
    event: Event
    watch: Watch
    command: Command | None
    is_same: bool


class FlightRecorder:
    """Keeps the events of the last seconds."""

    def __init__(self, memory: float = MEMORY) -> None:
        """Begin with nothing; memory: how long it remembers [s]."""
        self._memory = memory
        self._segments: deque[tuple[float, Watch, list[Entry]]] = deque()
        self._rules: list[MonitorRules] = []

    def record(self, watch: Watch, event: Event, fate: Fate, command: Command | None) -> None:
        """Keep an event, what was known before it, and what became of it."""
        now = event.at.steady
        if not self._segments or now - self._segments[-1][0] >= SEGMENT:
            self._segments.append((now, watch, []))
            while now - self._segments[0][0] > self._memory + SEGMENT:
                self._segments.popleft()
        digest = b'' if command is None else digest_of(command)
        self._segments[-1][2].append(Entry(_light(event), fate, digest))

    def to_bytes(self) -> bytes:
        """Return a file's content; `read_flight` reads it."""
        # Another thread may record meanwhile.
        segments = tuple(self._segments)
        if not segments:
            raise RecordError('flight recorder: empty, expected at least one event')
        buffer = io.BytesIO()
        _Writer(buffer, self._number).dump(segments[0][1])
        kept = [entry for *_, entries in segments for entry in tuple(entries)]
        entries = [(self._event(one.event), int(one.fate), one.command) for one in kept]
        rules = [pickle.dumps(plain(one), protocol=5) for one in self._rules]
        return MAGIC + pickle.dumps((rules, buffer.getvalue(), entries), protocol=5)

    def _event(self, event: Event | bytes) -> bytes:
        """Return an event as bytes: much sooner without a look at each of its parts."""
        assert isinstance(event, Event)
        at = replace(event.at, rules=cast(MonitorRules, self._number(event.at.rules)))
        event = replace(event, at=at)
        if isinstance(event, Begin):
            event = replace(event, rules=cast(MonitorRules, self._number(event.rules)))
        return pickle.dumps(event, protocol=5)

    def _number(self, rules: MonitorRules) -> int:
        """Return the number of rules, kept from now on."""
        for number, known in enumerate(self._rules):
            if known is rules:
                return number
        self._rules.append(rules)
        return len(self._rules) - 1


def _light(event: Event) -> Event:
    """Return an event with its scenes as names and numbers."""
    if not isinstance(event, BodyCame):
        return event
    sight, look = event.sight, event.look
    scene = None if sight is None else _packed(sight.scene)
    if sight is not None and scene is not None:
        sight = replace(sight, scene=scene)
    if look is not None:
        is_same = event.sight is not None and look.scene is event.sight.scene
        place = scene if is_same and scene is not None else _packed(look.scene)
        look = replace(look, scene=place, expected=_packed(look.expected))
    return replace(event, sight=sight, look=look)


def _full(event: Event) -> Event:
    """Return an event with its scenes."""
    if not isinstance(event, BodyCame):
        return event
    sight, look = event.sight, event.look
    scenes: dict[int, Scene] = {}
    if sight is not None:
        sight = replace(sight, scene=_unpacked(sight.scene, scenes))
    if look is not None:
        scene, expected = (_unpacked(one, scenes) for one in (look.scene, look.expected))
        look = replace(look, scene=scene, expected=expected)
    return replace(event, sight=sight, look=look)


def _packed(scene: Scene) -> Scene:
    return cast(Scene, scene.__reduce__()[1])


def _unpacked(scene: Scene, known: dict[int, Scene]) -> Scene:
    packed = cast(tuple[tuple[str, ...], bytes], scene)
    if id(scene) not in known:
        known[id(scene)] = scene_of_bytes(*packed)
    return known[id(scene)]


class _Writer(pickle.Pickler):
    """Writes rules by their number."""

    def __init__(self, file: io.BytesIO, number: Callable[[MonitorRules], int]) -> None:
        super().__init__(file, protocol=5)
        self._number = number

    def persistent_id(self, value: Any) -> int | None:
        """Return the number of rules."""
        if not hasattr(type(value), 'stands_still') or not hasattr(value, 'replan'):
            return None
        return self._number(value)


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
    """Return the digest of a command: of its motion, to the bit, and its begin."""
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
    if not content.startswith(KIND) or len(content) > LONGEST:
        raise RecordError('flight record: another file, expected one that a planner has saved')
    if not content.startswith(MAGIC):
        given = content[len(KIND) :].partition(b'\n')[0][:8].decode('ascii', 'replace')
        raise RecordError(f'flight record: format {given}, expected {FORMAT.decode()}')
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
        event = _event_of(entry, flight.rules)
        watch, command, is_same = _decided(watch, event, entry)
        yield Replayed(number, event, watch, command, is_same)


def _event_of(entry: Entry, rules: tuple[PlainRules, ...]) -> Event:
    try:
        event = _Reader(cast(bytes, entry.event), []).load()
        event = replace(event, at=replace(event.at, rules=rules[event.at.rules]))
        if isinstance(event, Begin):
            event = replace(event, rules=rules[cast(int, event.rules)])
        event = _full(event)
    except RecordError:
        raise
    except Exception as problem:
        raise RecordError(f'flight record: damaged, {type(problem).__name__}') from problem
    if not isinstance(event, Event):
        raise RecordError(f'flight record: {type(event).__name__}, expected an event')
    return event


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
        return after.watch, None, is_same
    return decision.watch, command, digest == entry.command
