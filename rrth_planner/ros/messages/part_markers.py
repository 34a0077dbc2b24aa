# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The parts of a tracked wearer as markers, one a part."""

from collections.abc import Iterable

from builtin_interfaces.msg import Duration, Time
from rrth_planner.kernels.layout import ROTATION
from rrth_planner.model.rotation import quaternion_xyzw
from rrth_planner.model.scene import Scene
from rrth_planner.ros.messages.body_writer import COLOR
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray


class PartMarkers:
    """
    A CUBE for each part that is seen, named by its `ns` and `text`.

    The markers are kept, since making them anew takes longer than all the rest: a message is that
    of the last scene, until it is published.

    Parameters
    ----------
    names : iterable of str
        Of all parts.
    lifetime : float
        How long a part that is not seen again stays [s].

    """

    def __init__(self, names: Iterable[str], lifetime: float) -> None:
        """Make the markers, all with one header."""
        self._header = Header()
        self._markers = {}
        for name in names:
            marker = Marker(ns=name, text=name, type=Marker.CUBE, header=self._header)
            marker.lifetime = Duration(
                sec=int(lifetime), nanosec=min(round(1e9 * (lifetime % 1.0)), 999_999_999)
            )
            color = marker.color
            color.r, color.g, color.b, color.a = COLOR
            self._markers[name] = marker

    def message(self, scene: Scene, frame: str, stamp: Time) -> MarkerArray:
        """
        Return the boxes of a scene in a frame, valid until the next call.

        Parts that are missing are left out: where they were they stay until their lifetime has
        passed.
        """
        self._header.frame_id, self._header.stamp = frame, stamp
        quaternions = quaternion_xyzw(scene.numbers[:, ROTATION:].reshape(-1, 3, 3)).tolist()
        markers = []
        for box, q in zip(scene.boxes, quaternions, strict=True):
            marker = self._markers[box.name]
            p, o, s = marker.pose.position, marker.pose.orientation, marker.scale
            p.x, p.y, p.z = box.center.tolist()
            o.x, o.y, o.z, o.w = q
            s.x, s.y, s.z = box.size.tolist()
            markers.append(marker)
        return MarkerArray(markers=markers)
