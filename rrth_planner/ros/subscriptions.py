# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A subscription that hears every publisher: best effort, reliable, or latched before it began."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
import time
import traceback
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from rrth_planner.errors import MessageError

DEPTH = 50
# Longer messages are not decoded, which would hold up everything else: half a second for a
# megabyte of markers.
MOST_BYTES = 512 * 1024
# Copies of a message arrive within milliseconds of each other; so many are remembered.
REMEMBERED = 1024
# How often publishers are looked at where the middleware does not announce them [s].
POLL_PERIOD = 0.2

# (source timestamp, sequence number): the same for all copies of a message.
Stamp = tuple[int, int]


def decoded(
    data: bytes,
    msg_type: type,
    most_bytes: int = MOST_BYTES,
    decode: Callable[[bytes], Any] | None = None,
) -> Any:
    """Return a message as it came from the wire, or raise MessageError."""
    name = msg_type.__name__
    if len(data) > most_bytes:
        raise MessageError(f'{len(data)} bytes, expected a {name} of at most {most_bytes}')
    try:
        return deserialize_message(data, msg_type) if decode is None else decode(data)
    except Exception as problem:
        # Whoever may write to a topic may write anything.
        raise MessageError(f'{len(data)} bytes that are no {name}: {problem}') from problem


class DuplicateFilter:
    """
    Which of the copies of messages count, and which of those come late.

    No single quality of service hears everybody, so a message may come twice: live, and from a
    reliable reader, which may be late but misses nothing. The first copy counts. A copy of a
    reliable reader is late when something that was sent after it, by whomever, has counted: it
    was latched before, or missed live.
    """

    def __init__(self) -> None:
        """Start with nothing seen."""
        self._seen: dict[Stamp, None] = {}
        self._seen_late: dict[Stamp, None] = {}
        self.newest = 0

    def counts_live(self, stamp: Stamp) -> bool:
        """Return whether a copy of the best-effort reader counts, and remember it."""
        if stamp in self._seen:
            return False
        # What comes live is the news, even from a machine whose clock is behind.
        self.newest = max(self.newest, stamp[0])
        _remember(self._seen, stamp)
        return True

    def is_late(self, stamp: Stamp) -> bool:
        """Return whether a copy of a reliable reader is older than what has counted."""
        return stamp[0] < self.newest

    def counts_reliable(self, stamp: Stamp) -> bool:
        """Return whether a copy of a reliable reader counts, and remember it."""
        if not self.is_late(stamp):
            return self.counts_live(stamp)
        is_new = stamp not in self._seen and stamp not in self._seen_late
        _remember(self._seen_late, stamp)
        return is_new


def _remember(stamps: dict[Stamp, None], stamp: Stamp) -> None:
    stamps[stamp] = None
    if len(stamps) > REMEMBERED:
        del stamps[next(iter(stamps))]


class OpenSubscription:
    """
    Hear a topic from publishers of any quality of service, each message once.

    A best-effort, volatile reader matches everybody and is always there. For publishers that are
    reliable another reader asks for reliability, and for what was latched before it began.

    Parameters
    ----------
    node : Node
    msg_type : type
    topic : str
    on_message : callable
        Gets each message, when it was sent and when it came [ns]: the first of these never fall.
    on_late : callable, optional
        Gets each message that is older than one before, when it was sent and when it came [ns];
        without, these are dropped, since the last one wins.
    on_refusal : callable, optional
        Gets the MessageError of each message that is too long, or is none of this type.
    way : context manager, optional
        Entered while a message is read and dealt with, again for each.
    decode : callable, optional
        Turns the bytes of a message into one; without, rclpy does.
    rest : callable, optional
        Called after each copy of a message.

    """

    def __init__(
        self,
        node: Node,
        msg_type: type,
        topic: str,
        on_message: Callable[[Any, int, int], None],
        on_late: Callable[[Any, int, int], None] | None = None,
        on_refusal: Callable[[MessageError], None] = lambda problem: None,
        way: AbstractContextManager[None] | None = None,
        decode: Callable[[bytes], Any] | None = None,
        rest: Callable[[], None] = lambda: None,
    ) -> None:
        """Begin to listen."""
        self._on_refusal, self._way = on_refusal, way or nullcontext()
        self._decode, self._rest = decode, rest
        self._node, self._msg_type, self._topic = node, msg_type, topic
        self._on_message, self._on_late = on_message, on_late
        self._filter = DuplicateFilter()
        self._n_read = self._live_came = 0
        self._reliable: dict[DurabilityPolicy, Subscription] = {}
        profile = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        try:
            self._live = self._subscribe(
                profile,
                self._on_live,
                SubscriptionEventCallbacks(
                    matched=lambda _: self.look_at_publishers(), use_default_callbacks=False
                ),
            )
        except UnsupportedEventTypeError:
            self._live = self._subscribe(profile, self._on_live, None)
            self._timer = node.create_timer(
                POLL_PERIOD, self.look_at_publishers, clock=Clock(clock_type=ClockType.STEADY_TIME)
            )
        self.topic_name = self._live.topic_name

    def progress(self) -> tuple[int, int]:
        """
        Return how many copies were read, and when the one came that was read last [ns].

        Of the reader that hears everybody; 0 where its middleware does not say.
        """
        return self._n_read, self._live_came

    def look_at_publishers(self) -> None:
        """Add the reliable readers that the present publishers can serve."""
        for info in self._node.get_publishers_info_by_topic(self.topic_name):
            durability = info.qos_profile.durability
            if (
                info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
                and durability in (DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL)
                and durability not in self._reliable
            ):
                profile = QoSProfile(
                    depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE, durability=durability
                )
                self._reliable[durability] = self._subscribe(
                    profile,
                    self._on_reliable,
                    SubscriptionEventCallbacks(use_default_callbacks=False),
                )

    def _subscribe(
        self, profile: QoSProfile, callback: Any, events: SubscriptionEventCallbacks | None
    ) -> Subscription:
        # Raw, so that the copies that do not count are not even decoded.
        return self._node.create_subscription(
            self._msg_type, self._topic, callback, profile, event_callbacks=events, raw=True
        )

    def _on_live(self, data: bytes, info: dict[str, Any]) -> None:
        self._live_came = info.get('received_timestamp') or 0
        self._n_read += 1
        if self._filter.counts_live(_stamp_of(info)):
            self._hand_on(data, self._on_message, self._filter.newest, info)
        self._rest()

    def _on_reliable(self, data: bytes, info: dict[str, Any]) -> None:
        self._n_read += 1
        stamp = _stamp_of(info)
        is_late = self._filter.is_late(stamp)
        if self._filter.counts_reliable(stamp):
            if not is_late:
                self._hand_on(data, self._on_message, self._filter.newest, info)
            elif self._on_late is not None:
                self._hand_on(data, self._on_late, stamp[0], info)
        self._rest()

    def _hand_on(
        self,
        data: bytes,
        hearer: Callable[[Any, int, int], None],
        sent: int,
        info: dict[str, Any],
    ) -> None:
        """Decode a message for who hears it; whatever is wrong with it, the node goes on."""
        with self._way:
            try:
                msg = decoded(data, self._msg_type, decode=self._decode)
            except MessageError as problem:
                self._on_refusal(problem)
                return
            try:
                # Not every middleware says when it came.
                hearer(msg, sent, info.get('received_timestamp') or time.time_ns())
            except Exception:
                self._node.get_logger().error(
                    f'{self.topic_name}: a message was not dealt with\n{traceback.format_exc()}'
                )


def _stamp_of(info: dict[str, Any]) -> Stamp:
    return info['source_timestamp'], info['publication_sequence_number']
