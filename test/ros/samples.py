# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that the tests send: a body, a target, joint positions."""

from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

JOINTS = ['joint_1', 'joint_2', 'joint_3', 'joint_4']
FOLDED = [0.0, -0.35, 1.5707963267948966, 1.5707963267948966]


def box(
    ns='torso', index=0, center=(0.0, 0.0, 0.0), size=(0.3, 0.46, 0.6), frame='torso', **fields
):
    """Return a CUBE marker."""
    marker = Marker(ns=ns, id=index, type=Marker.CUBE, action=Marker.ADD, **fields)
    marker.header.frame_id = frame
    p, s = marker.pose.position, marker.scale
    p.x, p.y, p.z = center
    s.x, s.y, s.z = size
    return marker


def command(action, ns='', index=0):
    """Return a DELETE or DELETEALL marker."""
    return Marker(ns=ns, id=index, action=action)


def array(*markers):
    """Return a MarkerArray."""
    return MarkerArray(markers=list(markers))


def wearer():
    """Return a torso with a head, replacing every box before."""
    return array(
        command(Marker.DELETEALL),
        box('torso'),
        box('head', center=(0.02, 0.0, 0.45), size=(0.26, 0.24, 0.3)),
    )


def target(x=1.5, y=0.1, z=0.3, frame='torso'):
    """Return a target."""
    msg = PointStamped()
    msg.header.frame_id = frame
    msg.point.x, msg.point.y, msg.point.z = x, y, z
    return msg


def joints(position=FOLDED, name=JOINTS, velocity=None):
    """Return joint positions, by default of an arm at rest."""
    speeds = [0.0] * len(name) if velocity is None else list(velocity)
    return JointState(name=list(name), position=list(position), velocity=speeds)


def fenced():
    """Return a torso and plates round the forearm of the folded arm, which cannot get out."""
    body = wearer()
    for k, (y, z) in enumerate(((-0.04, 0.552), (-0.16, 0.552), (-0.1, 0.632), (-0.1, 0.472))):
        size = (0.06, 0.02, 0.18) if k < 2 else (0.06, 0.14, 0.02)
        body.markers.append(box('plate', k, (-0.421, y, z), size))
    return body
