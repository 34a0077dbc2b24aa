# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Which arrays describe the wearer once and for all, and which belong to a stream of them."""

from collections import deque
from typing import Any

from rrth_planner.ros.messages.body_source import has_body, is_stamped
from rrth_planner.ros.messages.fields import Stamp

# What comes later than this after its publisher's last array continues no stream [s].
LONGEST_PAUSE = 1.0
# The number of a message that nobody has counted.
UNNUMBERED = 2**64 - 1
# So many arrays are remembered.
REMEMBERED = 1024


class BodyPublishers:
    """
    Knows when each publisher of bodies published last.

    A message does not say who published it, but each publisher counts its own from 1: one with a
    smaller number may be of the same publisher, and is taken to be.
    """

    def __init__(self) -> None:
        """Begin without any."""
        # Number and time of arrival [s] of each array.
        self._last: deque[tuple[int, float]] = deque(maxlen=REMEMBERED)

    def is_description(self, array: Any, sent: Stamp, came: float) -> bool:
        """
        Return whether a MarkerArray describes the wearer anew, and remember when a body came.

        It does where no box of it has a stamp, so that nobody knows when it was measured, and
        where it is the first array of its publisher, or comes more than `LONGEST_PAUSE` after the
        last one. All others belong to a stream, in which what is missing was not seen.

        Parameters
        ----------
        sent : (int, int)
            Source timestamp [ns] and number of the message.
        came : float
            When it came, by a clock that is never set [s].

        """
        # Not every middleware counts messages; rclpy then has None.
        number = UNNUMBERED if sent[1] is None else sent[1]
        continues = any(
            came - then <= LONGEST_PAUSE and (before < number or before == UNNUMBERED)
            for before, then in reversed(self._last)
        )
        if has_body(array):
            self._last.append((number, came))
        return not continues and not is_stamped(array)
