# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Write the messages of topics to an MCAP file, byte for byte."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mcap.writer import Writer
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rrth_planner.model.errors import RecordError, RrthError
from rrth_planner.ros.messages.definitions import definition_of, type_name, type_of_name
from rrth_planner.ros.middleware.open_subscription import Arrival, OpenSubscription

# Size of the chunks written; a recorder that is killed loses no more [bytes].
CHUNK = 128 * 1024
# How often topics of unknown type are searched for [s].
SEARCH_PERIOD = 0.2


class RecordingFile:
    """
    A new MCAP file of ROS 2 messages, complete when its `with` block is left.

    Raises RecordError where it exists, or cannot be written. The messages by topic are counted in
    `counts`, those without any included.
    """

    def __init__(self, path: Path) -> None:
        """Make the file."""
        self._path = path
        self.counts: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        with self._writing():
            try:
                # Closed when the block is left.
                self._file = path.open('xb')
            except FileExistsError:
                raise RecordError(f'{path}: exists already, expected a new file') from None
        self._writer = Writer(self._file, chunk_size=CHUNK)
        self._writer.start(profile='ros2', library='rrth_planner')

    def __enter__(self) -> 'RecordingFile':
        """Return the open file."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Finish the file; one without any message is removed."""
        try:
            with self._writing():
                self._writer.finish()
                self._file.close()
        except RecordError:
            if kind is None:
                raise
        finally:
            with suppress(OSError):
                self._file.close()
            if not any(self.counts.values()):
                self._path.unlink(missing_ok=True)

    def add_topic(self, topic: str, msg_type: Any) -> None:
        """Write the schema of a topic's messages."""
        name = type_name(msg_type)
        with self._writing():
            if name not in self._schemas:
                text = definition_of(msg_type).encode()
                self._schemas[name] = self._writer.register_schema(name, 'ros2msg', text)
            schema = self._schemas[name]
            self._channels[topic] = self._writer.register_channel(topic, 'cdr', schema)
        self.counts[topic] = 0

    def add(self, topic: str, data: bytes, sent: int, received: int) -> None:
        """Write the bytes of a message, with the times of sending and reception [ns]."""
        with self._writing():
            self._writer.add_message(
                self._channels[topic], log_time=received, data=data, publish_time=sent
            )
        self.counts[topic] += 1

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as problem:
            raise RecordError(
                f'{self._path}: {problem.strerror}, expected a writable file'
            ) from problem


class RawSubscription(OpenSubscription):
    """An OpenSubscription whose callback takes the bytes."""

    def _deliver(self, data: bytes, arrival: Arrival) -> None:
        self._on_message(data, arrival)


class Recorder(Node):
    """
    Records topics from publishers of any quality of service.

    Topics are relative to the node's namespace. `known` names the types of some; those of others
    are looked up once there is a publisher.
    """

    def __init__(
        self, file: RecordingFile, known: Mapping[str, str], topics: Sequence[str]
    ) -> None:
        """Subscribe."""
        super().__init__('rrth_recorder')
        self._file = file
        # Why the recording must end; raised by `check`, outside of callbacks.
        self._problem: RrthError | None = None
        self._missing = [topic for topic in topics if topic not in known]
        for topic in topics:
            if topic in known:
                self._add_topic(topic, known[topic])
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self.create_timer(SEARCH_PERIOD, self._find_missing, clock=steady)

    def check(self) -> None:
        """Raise what ends the recording."""
        if self._problem is not None:
            raise self._problem

    def _add_topic(self, topic: str, type_name: str) -> None:
        name = self.resolve_topic_name(topic)
        if name in self._file.counts:
            return
        msg_type = type_of_name(type_name)
        self._file.add_topic(name, msg_type)

        def write(data: bytes, arrival: Arrival) -> None:
            if self._problem is None:
                try:
                    self._file.add(name, data, arrival.sent[0], arrival.received)
                except RrthError as problem:
                    self._problem = problem

        # Late latched messages are part of the recording, too.
        RawSubscription(self, msg_type, topic, write, takes_late=True)

    def _find_missing(self) -> None:
        offered = dict(self.get_topic_names_and_types()) if self._missing else {}
        for topic in tuple(self._missing):
            if types := offered.get(self.resolve_topic_name(topic)):
                self._missing.remove(topic)
                try:
                    self._add_topic(topic, types[0])
                except RrthError as problem:
                    self._problem = problem
