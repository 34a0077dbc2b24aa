# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A subscription that matches every publisher: best effort, reliable, or latched."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
import time
import traceback
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from rrth_planner.model.errors import MessageError, one_line
from rrth_planner.ros.messages.fields import Stamp
from rrth_planner.ros.middleware.backlog import taken

DEPTH = 50
# So many messages are taken at once, so that other callbacks have their turn.
MOST_AT_ONCE = 8
# Longer messages are not decoded, which would block the node: half a second for a megabyte of
# markers.
MOST_BYTES = 512 * 1024
# Copies of a message arrive within milliseconds of each other; so many are remembered.
REMEMBERED = 1024
# Period of the search for publishers where the middleware does not announce them [s].
POLL_PERIOD = 0.2


def decoded(
    data: bytes,
    msg_type: type,
    most_bytes: int = MOST_BYTES,
    decode: Callable[[bytes], Any] | None = None,
) -> Any:
    """Return a message from its serialized bytes, or raise MessageError."""
    name = msg_type.__name__
    if len(data) > most_bytes:
        raise MessageError(f'{len(data)} bytes, expected a {name} of at most {most_bytes}')
    try:
        return deserialize_message(data, msg_type) if decode is None else decode(data)
    except Exception as problem:
        # A publisher may send anything.
        raise MessageError(f'{len(data)} bytes that are no {name}: {problem}') from problem


@dataclass(frozen=True, slots=True)
class Arrival:
    """
    When a message was sent, when it was received [ns], and whether it is late.

    Parameters
    ----------
    sent : (int, int)
        Source timestamp [ns] and sequence number.
    is_newer : callable or None
        Of a late message, which came after one that was sent later: whether another message was
        sent after it. None: the message is not late, as far as is known.
    is_followed : bool
        Whether another message follows at once.

    """

    sent: Stamp
    received: int
    is_newer: Callable[[Stamp], bool] | None = None
    is_followed: bool = False


class Copies:
    """
    Which of the copies of messages count, and which of those are late.

    No single quality of service matches all publishers, so a message may come by several readers.
    The first copy counts. It is late when a message that was sent after it came before it. The
    clocks of publishers may differ, but a reader delivers the messages of one publisher in the
    order in which they were sent, though it may lose some: what this reader delivered before was
    not sent later by the same publisher, whatever the stamps are. For all other messages the
    stamps decide: those of one publisher are of one clock.
    """

    def __init__(self, takes_late: bool) -> None:
        """Start without messages; a late copy counts, or the next copy may."""
        self._takes_late = takes_late
        # By which readers each message has come, and whether it has counted.
        self._readers: dict[Stamp, set[Any]] = {}
        self._counted: dict[Stamp, None] = {}
        self._newest = 0

    def take(self, sent: Stamp, received: int, reader: Any) -> Arrival | None:
        """Return the arrival of a copy that counts, and remember it; None: it does not."""
        readers = self._readers.setdefault(sent, set())
        if sent in self._counted:
            readers.add(reader)
            return None
        is_newer = self._newer_than(sent, reader)
        readers.add(reader)
        if len(self._readers) > REMEMBERED:
            del self._readers[next(iter(self._readers))]
        if is_newer is not None and not self._takes_late:
            return None
        self._newest = max(self._newest, sent[0])
        self._counted[sent] = None
        if len(self._counted) > REMEMBERED:
            oldest = next(iter(self._counted))
            del self._counted[oldest]
            if oldest[0] == self._newest:
                self._newest = max(stamp for stamp, _ in self._counted)
        return Arrival(sent, received, is_newer)

    def _newer_than(self, sent: Stamp, reader: Any) -> Callable[[Stamp], bool] | None:
        """Return whether other messages were sent after one that came by a reader; None: none."""

        def is_newer(other: Stamp) -> bool:
            # Of forgotten messages, which came long ago, only the stamps are known.
            return other[0] > sent[0] and reader not in self._readers.get(other, ())

        # Nearly always it is the newest of all.
        if self._newest <= sent[0] or not any(map(is_newer, self._counted)):
            return None
        return is_newer


class OpenSubscription:
    """
    Receives a topic from publishers of any quality of service, each message once.

    A best-effort, volatile reader matches all publishers and always exists. For reliable
    publishers another reader requests reliability, and latched messages.

    Parameters
    ----------
    on_message : callable
        Takes each message and its Arrival.
    on_rejection : callable, optional
        Takes the MessageError of each message that is too long, or not of this type.
    on_error : callable, optional
        Takes the name and message of an unexpected error in one of the two above.
    decode : callable, optional
        Turns the bytes of a message into one; without, rclpy does.
    takes_late : bool, optional
        Without, late messages are dropped, since the last one wins.
    takes_all : bool, optional
        What else a reader holds is taken together with a message: else a node that is slower than
        its publisher for a while would go on with old messages, since it takes one in each round.
    is_stream : bool, optional
        Nobody wants a message that is not the newest: one waits at most, none is sent again, and
        there is one reader, which halves the work.

    """

    def __init__(
        self,
        node: Node,
        msg_type: type,
        topic: str,
        on_message: Callable[[Any, Arrival], None],
        on_rejection: Callable[[MessageError], None] = lambda problem: None,
        on_error: Callable[[str], None] = lambda what: None,
        decode: Callable[[bytes], Any] | None = None,
        takes_late: bool = False,
        takes_all: bool = False,
        is_stream: bool = False,
    ) -> None:
        """Subscribe."""
        self._node, self._msg_type, self._topic = node, msg_type, topic
        self._on_message, self._on_rejection, self._on_error = on_message, on_rejection, on_error
        self._decode, self._copies = decode, Copies(takes_late)
        self._reliable: dict[DurabilityPolicy, Subscription] = {}
        self._is_stream, self._takes_all = is_stream, takes_all
        profile = QoSProfile(
            depth=1 if is_stream else DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT
        )
        try:
            on_match = SubscriptionEventCallbacks(
                matched=lambda _: self.match_publishers(), use_default_callbacks=False
            )
            self._live = self._subscribe(profile, None, on_match)
        except UnsupportedEventTypeError:
            self._live = self._subscribe(profile, None, None)
            self._timer = node.create_timer(
                POLL_PERIOD, self.match_publishers, clock=Clock(clock_type=ClockType.STEADY_TIME)
            )
        self.topic_name = self._live.topic_name

    def match_publishers(self) -> None:
        """Add the reliable readers that the present publishers can serve."""
        if self._is_stream:
            return
        for info in self._node.get_publishers_info_by_topic(self.topic_name):
            qos = info.qos_profile
            if (
                qos.reliability == ReliabilityPolicy.RELIABLE
                and qos.durability in (DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL)
                and qos.durability not in self._reliable
            ):
                profile = QoSProfile(
                    depth=DEPTH, reliability=qos.reliability, durability=qos.durability
                )
                events = SubscriptionEventCallbacks(use_default_callbacks=False)
                self._reliable[qos.durability] = self._subscribe(profile, qos.durability, events)

    def _subscribe(
        self,
        profile: QoSProfile,
        reader: DurabilityPolicy | None,
        events: SubscriptionEventCallbacks | None,
    ) -> Subscription:
        callback = partial(self._on_copy, reader=reader)
        # Raw, so that the copies that do not count are not even decoded.
        return self._node.create_subscription(
            self._msg_type, self._topic, callback, profile, event_callbacks=events, raw=True
        )

    def _on_copy(self, data: bytes, info: dict[str, Any], reader: DurabilityPolicy | None) -> None:
        """Take a copy of a message from a reader; None: the one that matches all publishers."""
        arrived = []
        for copy, about in self._with_others(data, info, reader):
            sent = about['source_timestamp'], about['publication_sequence_number']
            # Not every middleware has the time of reception.
            received = about.get('received_timestamp') or time.time_ns()
            arrival = self._copies.take(sent, received, reader)
            if arrival is not None:
                arrived.append((copy, arrival))
        for copy, arrival in arrived[:-1]:
            self._deliver(copy, replace(arrival, is_followed=True))
        for copy, arrival in arrived[-1:]:
            self._deliver(copy, arrival)

    def _with_others(
        self, data: bytes, info: dict[str, Any], reader: DurabilityPolicy | None
    ) -> Iterator[tuple[bytes, dict[str, Any]]]:
        """Yield a copy, and what else its reader holds if all is to be taken."""
        yield data, info
        if self._takes_all:
            source = self._live if reader is None else self._reliable.get(reader, self._live)
            for _ in range(MOST_AT_ONCE - 1):
                found = taken(source)
                if found is None:
                    return
                yield found

    def _deliver(self, data: bytes, arrival: Arrival) -> None:
        """Decode a message and call the callback; an error in either does not end the node."""
        try:
            try:
                msg = decoded(data, self._msg_type, decode=self._decode)
            except MessageError as problem:
                self._on_rejection(problem)
            else:
                self._on_message(msg, arrival)
        except Exception as problem:
            self._on_error(one_line(f'{self._topic}: {type(problem).__name__}: {problem}'))
            self._node.get_logger().error(
                f'{self.topic_name}: the callback failed on a message\n{traceback.format_exc()}'
            )
