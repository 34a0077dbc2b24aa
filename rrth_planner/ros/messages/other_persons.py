# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Persons beside the wearer as markers: a box each."""

from collections.abc import Mapping

from builtin_interfaces.msg import Duration, Time
import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.ros.messages.body_writer import COLOR
from rrth_planner.wearer.joint_positions import FARTHEST_POINT
from visualization_msgs.msg import Marker

# A box reaches so far beyond the points of a person: a hand beyond the wrist, or half a trunk [m].
MARGIN = 0.3
# Who left is deleted in all messages of so long, since one may be lost [ns].
DELETED_FOR = 1 * NANOSECONDS


class OtherPersons:
    """
    A CUBE round each other person in the picture, called `person 3`: as fast as any other part.

    Whoever is not seen for the lifetime has left, and is deleted by name: as a lost part he would
    stop the arm for good.
    """

    def __init__(self, lifetime: float) -> None:
        """Begin without anybody; lifetime: how long a person who is not seen again stays [s]."""
        self._lifetime = round(NANOSECONDS * lifetime)
        # When each was measured last [ns].
        self._seen: dict[int, int] = {}

    def markers(
        self,
        others: Mapping[int, Array],
        T_tracker_frame: Array,
        frame: str,
        stamp: Time,
        measured: int,
    ) -> list[Marker]:
        """
        Return the markers of persons in a frame.

        Parameters
        ----------
        others : mapping of int to ndarray, shape (n, 3)
            Their points, as the tracker has them [m].
        T_tracker_frame : ndarray, shape (4, 4)
            The pose of the frame in that of the tracker [m].
        measured : int
            When the tracker saw them [ns].

        """
        markers = []
        for number, points in others.items():
            # As of the wearer: what is not finite, absurdly far, or at exactly 0 0 0 is lost.
            is_seen = (np.abs(points) <= FARTHEST_POINT).all(axis=1) & points.any(axis=1)
            seen = (points[is_seen] - T_tracker_frame[:3, 3]) @ T_tracker_frame[:3, :3]
            if not len(seen):
                continue
            self._seen[number] = measured
            marker = self._marker(number, frame, stamp)
            lower, upper = seen.min(axis=0) - MARGIN, seen.max(axis=0) + MARGIN
            p, s, c = marker.pose.position, marker.scale, marker.color
            p.x, p.y, p.z = (0.5 * (lower + upper)).tolist()
            s.x, s.y, s.z = (upper - lower).tolist()
            c.r, c.g, c.b, c.a = COLOR
            marker.pose.orientation.w = 1.0
            sec, nanosec = divmod(self._lifetime, NANOSECONDS)
            marker.lifetime = Duration(sec=sec, nanosec=nanosec)
            markers.append(marker)
        for number, last in list(self._seen.items()):
            age = measured - last
            if not 0 <= age <= self._lifetime + DELETED_FOR:
                del self._seen[number]
            if age < 0 or age > self._lifetime:
                marker = self._marker(number, frame, stamp)
                marker.action = Marker.DELETE
                markers.append(marker)
        return markers

    @staticmethod
    def _marker(number: int, frame: str, stamp: Time) -> Marker:
        marker = Marker(ns='person', id=number, text=f'person {number}', type=Marker.CUBE)
        marker.header.frame_id, marker.header.stamp = frame, stamp
        return marker
