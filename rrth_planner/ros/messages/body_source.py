# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where bodies come from: a tracker that measures the wearer, or who describes him once."""

from dataclasses import dataclass, replace
import math
from typing import Any

from rrth_planner.ros.messages.fields import nanoseconds_of
from visualization_msgs.msg import Marker

# The name of the node that makes bodies of what a tracker measures.
TRACKER = 'body_boxes_node'
# For so long after a body that stands still another one may show it to be a stream's first [s].
UNDECIDED = 0.5


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


def is_stamped(array: Any) -> bool:
    """Return whether a MarkerArray says of a part of the wearer when it was measured."""
    markers = (m for m in array.markers if m.action == Marker.ADD)
    return any(nanoseconds_of(marker.header.stamp) for marker in markers)


def after_body(is_description: bool, came: float, source: BodySource) -> BodySource:
    """
    Return the source after another body.

    is_description: as `BodyPublishers.is_description`; came: by the monotonic clock [s].
    """
    return BodySource(max(came, source.came), source.is_stream or not is_description)


def as_stream(source: BodySource) -> BodySource:
    """Return a source once it is known that a tracker is there."""
    return replace(source, is_stream=True)
