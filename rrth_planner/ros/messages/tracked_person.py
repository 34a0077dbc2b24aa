# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A tracked person as messages: the points and frames of his skeleton."""

import math

from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Pose, PoseArray
import numpy as np
from rrth_planner.model.rotation import quaternion_xyzw
from rrth_planner.ros.messages.body_writer import COLOR
from rrth_planner.wearer.posture import Posture
from rrth_planner.wearer.skeleton import Skeleton
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

# A point that is not seen for so long is lost [s]; so wide is it [m].
LIFETIME, WIDTH = 0.5, 0.05


def points_to_msg(posture: Posture, skeleton: Skeleton, frame: str, stamp: Time) -> MarkerArray:
    """Return a SPHERE for each point that is seen, with the id that the skeleton gives it."""
    # Trackers without ids count their points.
    names = list(skeleton.names_by_id or posture.names)
    markers = []
    for name, position in zip(posture.names, posture.positions.tolist(), strict=True):
        if name in names and not np.isnan(position).any():
            marker = Marker(ns='points', id=names.index(name), type=Marker.SPHERE)
            p, s, c = marker.pose.position, marker.scale, marker.color
            p.x, p.y, p.z = position
            marker.pose.orientation.w = 1.0
            s.x = s.y = s.z = WIDTH
            c.r, c.g, c.b, c.a = COLOR
            markers.append(marker)
    for marker in markers:
        marker.header.frame_id, marker.header.stamp = frame, stamp
        marker.lifetime = Duration(nanosec=round(1e9 * LIFETIME))
    return MarkerArray(markers=markers)


def poses_to_msg(posture: Posture, skeleton: Skeleton, frame: str, stamp: Time) -> PoseArray:
    """Return the pose of each point, in the order of the skeleton; what is lost is NaN."""
    message = PoseArray(header=Header(frame_id=frame, stamp=stamp))
    place = {name: k for k, name in enumerate(posture.names)}
    # Trackers without numbers count their points.
    for name in skeleton.names_by_id or posture.names:
        position, quaternion = [math.nan] * 3, [math.nan] * 4
        k = place.get(name)
        if k is not None:
            position = posture.positions[k].tolist()
        if k is not None and posture.rotations is not None:
            quaternion = quaternion_xyzw(posture.rotations[k]).tolist()
        pose = Pose()
        p, o = pose.position, pose.orientation
        p.x, p.y, p.z = position
        o.x, o.y, o.z, o.w = quaternion
        message.poses.append(pose)
    return message
