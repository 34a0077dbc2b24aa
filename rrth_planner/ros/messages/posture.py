# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The messages of trackers as postures: points, frames, or angles of joints."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
import math
from typing import Any

from geometry_msgs.msg import PoseArray
import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import MessageError, shown
from rrth_planner.model.rotation import rotation_matrices
from rrth_planner.ros.messages.fields import nanoseconds_of, QUATERNION_TOLERANCE
from rrth_planner.ros.messages.wearer_choice import ONLY
from rrth_planner.wearer.link_tree import link_poses, LinkTree
from rrth_planner.wearer.posture import Posture
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

# The id of a marker is so many times the number of the person, and the number of the joint.
IDS_OF_PERSON = 100
# Of zed_msgs/Object: the keypoints of each body_format, the states of tracking in which a person
# is where the message says, or is only guessed to be there, and the greatest confidence.
BODY_FORMATS = (18, 34, 38, 70)
TRACKED, SEARCHED = 1, 2
MOST_CONFIDENCE = 100.0
# Between the name of a subject and that of a rigid body or point.
SEPARATORS = '_:/.'
# A person by his number, or what chooses one among the points of all.
Person = int | Callable[[Mapping[int, Array]], int]
LOST = [math.nan] * 7


@dataclass(frozen=True, slots=True, eq=False)
class TrackedPosture:
    """
    A posture, when it was measured [ns] (0: unknown), and in which frame.

    It has all points of the tracker, whichever a message has: those that are missing are lost.
    others: the points (n, 3) of other persons in the same frame, by their numbers [m].
    """

    posture: Posture
    stamp: int
    frame: str
    others: Mapping[int, Array] = field(default_factory=dict)


def posture_from_markers(
    msg: MarkerArray, names: Sequence[str], person: Person = ONLY, min_confidence: float = 0.0
) -> TrackedPosture:
    """
    Return the points of a person, SPHERE markers with the id `100 person + joint`.

    A marker whose text is one of the names is that joint, whatever its id says of it. The alpha of
    its colour is its confidence. Other markers are ignored. Of stamps that differ, the oldest
    counts, of those that are set.

    Parameters
    ----------
    names : sequence of str
        Of the joints, in the order of their numbers.
    person : int or callable
        -1: the only one; or what chooses a number among the points of all.
    min_confidence : float
        A point with less confidence is lost.

    Raises
    ------
    MessageError
        No or another person, several without a choice, a joint that has no name or comes twice,
        frames that differ.

    """
    people: dict[int, dict[int, Any]] = {}
    place = {name: k for k, name in enumerate(names)}
    for marker in msg.markers:
        if marker.type != Marker.SPHERE or marker.action != Marker.ADD:
            continue
        number, joint = divmod(marker.id, IDS_OF_PERSON)
        if number < 0:
            raise MessageError(f'id {marker.id}, expected 100 person + joint, >= 0')
        joint = place.get(marker.text, joint)
        joints = people.setdefault(number, {})
        if joint in joints:
            raise MessageError(f'id {marker.id}: given twice, expected each joint once')
        joints[joint] = marker
    points = {number: _points_of(joints, len(names), 0.0) for number, joints in people.items()}
    chosen = _chosen(points, person, 'SPHERE markers of the persons')
    markers = people[chosen]
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
    return TrackedPosture(
        Posture(names=tuple(names), positions=_points_of(markers, len(names), min_confidence)),
        min(filter(None, stamps), default=0),
        frames.pop(),
        {number: found for number, found in points.items() if number != chosen},
    )


def _points_of(markers: Mapping[int, Any], n: int, min_confidence: float) -> Array:
    """Return where the joints of a person are, (n, 3), NaN where they are lost [m]."""
    positions = np.full((n, 3), math.nan)
    for joint, marker in markers.items():
        if joint >= n or marker.color.a < min_confidence:
            continue
        p, o = marker.pose.position, marker.pose.orientation
        # A quaternion of no length is that of a point that its tracker has lost.
        if o.x or o.y or o.z or o.w:
            positions[joint] = p.x, p.y, p.z
    return positions


def _chosen(people: Mapping[int, Array], person: Person, what: str) -> int:
    """Return the number of a person among the points of all, or raise MessageError."""
    number = person(people) if callable(person) else person
    if number == ONLY and len(people) == 1:
        (number,) = people
    if number not in people:
        wanted = 'a person' if number == ONLY else f'person {number}'
        raise MessageError(
            f'{what} {shown(sorted(people))}, expected those of {wanted}'
            f'{": choose one by the parameter person" if len(people) > 1 else ""}'
        )
    return number


def posture_from_zed(
    msg: Any, names: Sequence[str], person: Person = ONLY, min_confidence: float = 0.0
) -> TrackedPosture:
    """
    Return the keypoints of a person of a zed_msgs/ObjectsStamped; what is NaN is lost.

    The number of a person is his label_id. Objects without a skeleton are ignored.

    Parameters
    ----------
    names : sequence of str
        Of the keypoints, in the order of the SDK: as many as the body_format has.
    person : int or callable
        -1: the only one; or what chooses a number among the points of all.
    min_confidence : float
        All points of a wearer with less confidence, from 0 to 1, are lost.

    Raises
    ------
    MessageError
        No or another person, several without a choice, another body_format, a wearer who is not
        seen but searched for.

    """
    found: dict[int, Any] = {}
    points: dict[int, Array] = {}
    for thing in msg.objects:
        if not thing.skeleton_available:
            continue
        number = int(thing.label_id)
        if number in found:
            raise MessageError(f'label_id {number}: given twice, expected each person once')
        n = BODY_FORMATS[thing.body_format] if 0 <= thing.body_format < 4 else 0
        if n != len(names):
            raise MessageError(
                f'body_format {thing.body_format}, BODY_{n}, expected BODY_{len(names)}, as the '
                'skeleton has names_by_id'
            )
        found[number] = thing
        points[number] = np.array([p.kp for p in thing.skeleton_3d.keypoints[:n]], dtype=float)
    chosen = _chosen(points, person, 'skeletons of the persons')
    wearer = found[chosen]
    if wearer.tracking_available and wearer.tracking_state != TRACKED:
        is_searched = wearer.tracking_state == SEARCHED
        raise MessageError(
            f'tracking_state {wearer.tracking_state} of person {chosen}'
            f'{", who is hidden: his points are guesses" if is_searched else ""}, expected 1 (OK)'
        )
    positions = points.pop(chosen)
    if wearer.confidence < min_confidence * MOST_CONFIDENCE:
        positions = np.full_like(positions, math.nan)
    return TrackedPosture(
        Posture(names=tuple(names), positions=positions),
        nanoseconds_of(msg.header.stamp),
        msg.header.frame_id,
        points,
    )


def posture_from_rigid_bodies(msg: Any, names: Sequence[str], prefix: str = '') -> TrackedPosture:
    """
    Return the rigid bodies of a mocap4r2_msgs/RigidBodies that have a skeleton's names.

    Parameters
    ----------
    prefix : str
        What stands before each name in the message, such as `Anna_`.

    Raises
    ------
    MessageError
        None of them, one twice, or a quaternion of another length than 1.

    """
    poses: dict[str, Any] = {}
    for body in msg.rigidbodies:
        name = body.rigid_body_name.removeprefix(prefix)
        if not body.rigid_body_name.startswith(prefix) or name not in names:
            continue
        if name in poses:
            raise MessageError(f'rigid body "{body.rigid_body_name}": given twice, expected once')
        poses[name] = body.pose
    if not poses:
        given = sorted({body.rigid_body_name for body in msg.rigidbodies})
        subject = _subject(given, names)
        raise MessageError(
            f'rigid bodies {shown(given)}, expected some of {shown([prefix + n for n in names])}'
            f'{f": set the parameter name_prefix to {subject}" if subject else ""}'
        )
    posture = posture_of_poses(poses, names)
    return TrackedPosture(posture, nanoseconds_of(msg.header.stamp), msg.header.frame_id)


def _subject(given: Sequence[str], names: Sequence[str]) -> str:
    """Return what stands before a name of a skeleton in a given one, and its separator."""
    for one in given:
        for name in names:
            before = one.removesuffix(name)
            if before != one and before and before[-1] in SEPARATORS:
                return before
    return ''


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
