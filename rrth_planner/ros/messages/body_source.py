# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where bodies come from: a tracker that measures the wearer, or who describes him once."""

from dataclasses import dataclass, replace
import math
from typing import Any

from rrth_planner.ros.messages.fields import nanoseconds_of, Stamp
from visualization_msgs.msg import Marker

# The name of the node that makes bodies of what a tracker measures.
TRACKER = 'body_boxes_node'
# A body that comes within so long of its publisher's last one is one of a stream [s].
LONGEST_PERIOD = 1.0
# For so long after a body that stands still another one may show it to be a stream's first [s].
UNDECIDED = 0.5
# The number of a publisher's first message.
FIRST = 1


@dataclass(frozen=True, slots=True)
class BodySource:
    """
    What the bodies that came say of where they come from; a value, never changed.

    Parameters
    ----------
    came : float
        When the last one came, by the monotonic clock [s].
    is_stream : bool
        Whether one came that describes no wearer who stands still. For good: he who was measured
        moves, also when that ends.

    """

    came: float = -math.inf
    is_stream: bool = False

    @property
    def stands_still(self) -> bool:
        """Whether all bodies that came describe a wearer who stands still."""
        return self.came > -math.inf and not self.is_stream

    def time_until_known(self, now: float) -> float:
        """Return for how long the last body may still be a stream's first [s]; <= 0: it is not."""
        return self.came + UNDECIDED - now if self.stands_still else 0.0


def has_body(array: Any) -> bool:
    """Return whether a MarkerArray has a part of the wearer."""
    return any(marker.action == Marker.ADD for marker in array.markers)


def is_description(array: Any, sent: Stamp, came: float, source: BodySource) -> bool:
    """
    Return whether a body describes a wearer who stands still.

    It has no stamp, and is its publisher's first, or comes more than `LONGEST_PERIOD` after his
    last one. rclpy does not say who published a message, only its number, and not with every
    middleware; so beside a first one the last one of anybody counts.

    Parameters
    ----------
    array : MarkerArray
        With a part of the body.
    came : float
        By the monotonic clock [s].
    source : BodySource
        Of the bodies before.

    """
    if any(m.action == Marker.ADD and nanoseconds_of(m.header.stamp) for m in array.markers):
        return False
    return sent[1] == FIRST or came - source.came > LONGEST_PERIOD


def after_body(array: Any, sent: Stamp, came: float, source: BodySource) -> BodySource:
    """Return the source after another body; parameters as those of `is_description`."""
    is_stream = source.is_stream or not is_description(array, sent, came, source)
    return BodySource(max(came, source.came), is_stream)


def as_stream(source: BodySource) -> BodySource:
    """Return a source once it is known that a tracker is there."""
    return replace(source, is_stream=True)
