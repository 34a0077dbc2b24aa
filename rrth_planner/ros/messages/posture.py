# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The messages of trackers as postures: points, frames, or angles of joints."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math
from typing import Any

from geometry_msgs.msg import PoseArray
import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import MessageError, shown
from rrth_planner.model.rotation import rotation_matrices
from rrth_planner.ros.messages.fields import nanoseconds_of, QUATERNION_TOLERANCE
from rrth_planner.wearer.link_tree import link_poses, LinkTree
from rrth_planner.wearer.posture import Posture
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

# The id of a marker is so many times the number of the person, and the number of the joint.
IDS_OF_PERSON = 100
# The person where there is only one.
ONLY = -1
LOST = [math.nan] * 7


@dataclass(frozen=True, slots=True, eq=False)
class TrackedPosture:
    """
    A posture, when it was measured [ns] (0: unknown), and in which frame.

    It has all points of the tracker, whichever a message has: those that are missing are lost.
    """

    posture: Posture
    stamp: int
    frame: str


def posture_from_markers(
    msg: MarkerArray, names: Sequence[str], person: int = ONLY
) -> TrackedPosture:
    """
    Return the points of a person, SPHERE markers with the id `100 person + joint`.

    Other markers are ignored. Of stamps that differ, the oldest counts, of those that are set.

    Parameters
    ----------
    names : sequence of str
        Of the joints, in the order of their numbers.
    person : int
        -1: the only one.

    Raises
    ------
    MessageError
        No or another person, several without a choice, a joint that has no name or comes twice,
        frames that differ.

    """
    people: dict[int, dict[int, Any]] = {}
    for marker in msg.markers:
        if marker.type != Marker.SPHERE or marker.action != Marker.ADD:
            continue
        number, joint = divmod(marker.id, IDS_OF_PERSON)
        if number < 0:
            raise MessageError(f'id {marker.id}, expected 100 person + joint, >= 0')
        joints = people.setdefault(number, {})
        if joint in joints:
            raise MessageError(f'id {marker.id}: given twice, expected each joint once')
        joints[joint] = marker
    if person == ONLY and len(people) == 1:
        (person,) = people
    if person not in people:
        wanted = 'a person' if person == ONLY else f'person {person}'
        raise MessageError(
            f'SPHERE markers of the persons {shown(sorted(people))}, expected those of {wanted}'
            f'{": choose one by the parameter person" if len(people) > 1 else ""}'
        )
    markers = people[person]
    for joint, marker in markers.items():
        if joint >= len(names):
            raise MessageError(
                f'id {marker.id}: joint {joint}, expected 0 to {len(names) - 1}, as the skeleton '
                'has names_by_id'
            )
    frames = {marker.header.frame_id for marker in markers.values()}
    if len(frames) > 1:
        raise MessageError(f'frames {shown(sorted(frames))}, expected one for all joints')
    stamps = [nanoseconds_of(marker.header.stamp) for marker in markers.values()]
    positions = np.full((len(names), 3), math.nan)
    for joint, marker in markers.items():
        p, o = marker.pose.position, marker.pose.orientation
        # A quaternion of no length is that of a point that its tracker has lost.
        if o.x or o.y or o.z or o.w:
            positions[joint] = p.x, p.y, p.z
    return TrackedPosture(
        Posture(names=tuple(names), positions=positions),
        min(filter(None, stamps), default=0),
        frames.pop(),
    )


def posture_from_poses(msg: PoseArray, names: Sequence[str]) -> TrackedPosture:
    """
    Return the frames of an array of poses, which have no names, in the order of names.

    Raises
    ------
    MessageError
        Another number of poses, or a quaternion of another length than 1. What is NaN is
        lost, or has a quaternion of length 0.

    """
    if len(msg.poses) != len(names):
        raise MessageError(
            f'{len(msg.poses)} poses, expected {len(names)}, as the skeleton has names_by_id'
        )
    posture = posture_of_poses(dict(zip(names, msg.poses, strict=True)), names)
    return TrackedPosture(posture, nanoseconds_of(msg.header.stamp), msg.header.frame_id)


def posture_of_poses(poses: Mapping[str, Any], names: Sequence[str]) -> Posture:
    """Return geometry_msgs/Pose by name as a posture; raise MessageError of a bad quaternion."""
    numbers = np.array([_numbers(poses[name]) if name in poses else LOST for name in names])
    quaternions = numbers[:, 3:]
    # One of no length is that of a point that its tracker has lost.
    numbers[~quaternions.any(axis=1)] = math.nan
    positions = np.ascontiguousarray(numbers[:, :3])
    lengths = np.sqrt(np.einsum('ij,ij->i', quaternions, quaternions))
    is_bad = np.abs(lengths - 1.0) > QUATERNION_TOLERANCE
    if is_bad.any():
        k = int(np.argmax(is_bad))
        raise MessageError(
            f'orientation of "{names[k]}": {quaternions[k].tolist()} of length {lengths[k]:.6g}, '
            'expected a quaternion (x, y, z, w) of length 1 [-]'
        )
    return Posture(
        names=tuple(names), positions=positions, rotations=rotation_matrices(quaternions)
    )


def _numbers(pose: Any) -> tuple[float, ...]:
    p, o = pose.position, pose.orientation
    return p.x, p.y, p.z, o.x, o.y, o.z, o.w


def posture_from_joint_state(msg: JointState, tree: LinkTree) -> TrackedPosture:
    """
    Return the links of a person of whom the positions of joints are known, in that of the root.

    Joints of others are ignored; links beyond a joint that is missing, or NaN, are lost.

    Raises
    ------
    MessageError
        None of the joints, one of them twice, another number of positions than of names.

    """
    if len(msg.position) != len(msg.name):
        raise MessageError(
            f'position: {len(msg.position)} values for {len(msg.name)} names, expected one a name '
            '[rad]'
        )
    values = dict(zip(msg.name, msg.position, strict=True))
    known = [joint for joint in tree.joints if joint in values]
    if not known and tree.joints:
        raise MessageError(
            f'name: {shown(list(msg.name))}, expected joints of robot_description: '
            f'{shown(list(tree.joints))}'
        )
    if len(values) < len(msg.name):
        twice = [joint for joint in known if list(msg.name).count(joint) > 1]
        if twice:
            raise MessageError(f'name: "{twice[0]}" twice, expected each joint once')
    positions: Array = np.array([values.get(joint, math.nan) for joint in tree.joints])
    rotations, origins = link_poses(tree, positions)
    posture = Posture(names=tree.names, positions=origins, rotations=rotations)
    return TrackedPosture(posture, nanoseconds_of(msg.header.stamp), msg.header.frame_id)
