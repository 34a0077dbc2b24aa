# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Write the messages of topics to an MCAP file, byte for byte."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
import time
from types import TracebackType
from typing import Any

from mcap.writer import Writer
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rrth_planner.model.errors import RrthError
from rrth_planner.ros.messages.definitions import definition_of, type_name, type_of_name
from rrth_planner.ros.middleware.open_subscription import Arrival, OpenSubscription

# Size of the chunks written; a recorder that is killed loses no more [bytes].
CHUNK = 128 * 1024
# How often topics of unknown type are searched for [s].
PERIOD = 0.2


class RecordingError(RrthError):
    """A recording that cannot be written or read."""


class RecordingFile:
    """
    An MCAP file of ROS 2 messages, complete when its `with` block is left.

    Parameters
    ----------
    path : Path
        Must not exist yet.

    Attributes
    ----------
    counts : dict
        Messages by topic, those without any included.

    Raises
    ------
    RecordingError
        The file exists, or cannot be made; later, it cannot be written.

    """

    def __init__(self, path: Path) -> None:
        """Make the file."""
        self._path = path
        self.counts: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        try:
            # Closed when the block is left.
            self._file = path.open('xb')
        except FileExistsError:
            raise RecordingError(f'{path}: exists already, expected a new file') from None
        except OSError as problem:
            raise self._failure(problem) from problem
        self._writer = Writer(self._file, chunk_size=CHUNK)
        self._writer.start(profile='ros2', library='rrth_planner')

    def __enter__(self) -> 'RecordingFile':
        """Return the open file."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        problem: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Finish the file; one without any message is removed."""
        try:
            self._writer.finish()
            self._file.close()
        except OSError as failure:
            if problem is None:
                raise self._failure(failure) from failure
        finally:
            with suppress(OSError):
                self._file.close()
            if not any(self.counts.values()):
                self._path.unlink(missing_ok=True)

    def add_topic(self, topic: str, msg_type: Any) -> None:
        """Write the schema of a topic's messages."""
        name = type_name(msg_type)
        try:
            if name not in self._schemas:
                text = definition_of(msg_type).encode()
                self._schemas[name] = self._writer.register_schema(name, 'ros2msg', text)
            self._channels[topic] = self._writer.register_channel(
                topic, 'cdr', self._schemas[name]
            )
        except OSError as problem:
            raise self._failure(problem) from problem
        self.counts[topic] = 0

    def add(self, topic: str, data: bytes, sent: int, received: int) -> None:
        """Write the bytes of a message, with the times of sending and reception [ns]."""
        try:
            self._writer.add_message(
                self._channels[topic], log_time=received, data=data, publish_time=sent
            )
        except OSError as problem:
            raise self._failure(problem) from problem
        self.counts[topic] += 1

    def _failure(self, problem: OSError) -> RecordingError:
        return RecordingError(f'{self._path}: {problem.strerror}, expected to write there')


class RawSubscription(OpenSubscription):
    """An OpenSubscription whose callback takes the bytes."""

    def _deliver(self, data: bytes, arrival: Arrival) -> None:
        self._on_message(data, arrival)


class Recorder(Node):
    """
    Records topics from publishers of any quality of service.

    Parameters
    ----------
    file : RecordingFile
    known : mapping
        Types by topic.
    topics : sequence of str
        What is recorded, relative to the node's namespace; the types of those that are not known
        are looked up once there is a publisher.

    """

    def __init__(
        self, file: RecordingFile, known: Mapping[str, Any], topics: Sequence[str]
    ) -> None:
        """Subscribe."""
        super().__init__('rrth_recorder')
        self._file = file
        # Why the recording must end; raised by `check`, outside of callbacks.
        self._problem: RrthError | None = None
        self._topics: list[OpenSubscription] = []
        self._missing: list[str] = []
        for topic in topics:
            if topic in known:
                self._add_topic(topic, known[topic])
            else:
                self._missing.append(topic)
        self._timer = self.create_timer(
            PERIOD, self._find_missing, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def check(self) -> None:
        """Raise what ends the recording."""
        if self._problem is not None:
            raise self._problem

    def _add_topic(self, topic: str, msg_type: Any) -> None:
        name = self.resolve_topic_name(topic)
        if name in self._file.counts:
            return
        self._file.add_topic(name, msg_type)

        def write(data: bytes, arrival: Arrival) -> None:
            if self._problem is None:
                try:
                    self._file.add(name, data, arrival.sent[0], arrival.received)
                except RrthError as problem:
                    self._problem = problem

        # Late latched messages are part of the recording, too.
        self._topics.append(RawSubscription(self, msg_type, topic, write, takes_late=True))

    def _find_missing(self) -> None:
        offered = dict(self.get_topic_names_and_types()) if self._missing else {}
        for topic in tuple(self._missing):
            types = offered.get(self.resolve_topic_name(topic))
            if not types:
                continue
            self._missing.remove(topic)
            try:
                self._add_topic(topic, type_of_name(types[0]))
            except RrthError as problem:
                self._problem = problem


def since(begin: float) -> float:
    """Return the time since a reading of the monotonic clock [s]."""
    return time.monotonic() - begin
