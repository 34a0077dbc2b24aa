# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A subscription that hears every publisher: best effort, reliable, or latched before it began."""

from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

DEPTH = 50
# Copies of a message arrive within milliseconds of each other; so many are remembered.
REMEMBERED = 1024
# How often publishers are looked at where the middleware does not announce them [s].
POLL_PERIOD = 0.2

# (source timestamp, sequence number): the same for all copies of a message.
Stamp = tuple[int, int]


class DuplicateFilter:
    """
    Which of the copies of messages count, so that each publisher is heard in its own order.

    No single quality of service hears everybody, so a message may come twice: live, and from a
    reliable reader, which may be late but misses nothing. The first copy counts. When a reliable
    reader brings one that was missed live, those that the same publisher sent after it count
    once more behind it: what came later stays last.
    """

    def __init__(self) -> None:
        """Start with nothing seen."""
        self._order: deque[Stamp] = deque()
        self._seen: set[Stamp] = set()
        self._newest = 0
        self._repeat: set[int] = set()

    def counts_live(self, stamp: Stamp) -> bool:
        """Return whether a copy of the best-effort reader counts, and remember it."""
        is_new = stamp not in self._seen
        if is_new:
            self._remember(stamp)
        return is_new

    def counts_reliable(self, stamp: Stamp) -> bool:
        """Return whether a copy of a reliable reader counts, and remember it."""
        time, number = stamp
        is_missed = stamp not in self._seen
        is_late = is_missed and time < self._newest
        is_behind_late = number in self._repeat
        self._repeat.discard(number)
        if (is_late or is_behind_late) and time < self._newest:
            self._repeat.add(number + 1)
        if is_missed:
            self._remember(stamp)
        return is_missed or is_behind_late

    def _remember(self, stamp: Stamp) -> None:
        self._newest = max(self._newest, stamp[0])
        self._seen.add(stamp)
        self._order.append(stamp)
        if len(self._order) > REMEMBERED:
            self._seen.discard(self._order.popleft())


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
    callback : callable
        Gets each message.

    """

    def __init__(
        self, node: Node, msg_type: type, topic: str, callback: Callable[[Any], None]
    ) -> None:
        """Begin to listen."""
        self._node, self._msg_type, self._topic = node, msg_type, topic
        self._callback = callback
        self._filter = DuplicateFilter()
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
        if self._filter.counts_live(_stamp_of(info)):
            self._callback(deserialize_message(data, self._msg_type))

    def _on_reliable(self, data: bytes, info: dict[str, Any]) -> None:
        if self._filter.counts_reliable(_stamp_of(info)):
            self._callback(deserialize_message(data, self._msg_type))


def _stamp_of(info: dict[str, Any]) -> Stamp:
    return info['source_timestamp'], info['publication_sequence_number']
