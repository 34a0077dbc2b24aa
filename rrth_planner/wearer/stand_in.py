# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded person as another tracker would see him: the points or frames of its skeleton."""

from collections.abc import Callable

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import SceneError
from rrth_planner.wearer.body_boxes import base_pose
from rrth_planner.wearer.joint_positions import joint_positions
from rrth_planner.wearer.posture import Posture
from rrth_planner.wearer.skeleton import Skeleton

# How the axes of trackers lead from where a person stands, forward, left and up, as rows: he looks
# at a camera (x right, y down, z forward; or x forward, y left, z up), or stands in a laboratory.
LOOKING = {
    'optical': ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)),
    'camera': ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    'room': ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
}
# The chest is so far before a camera, or above the floor of a laboratory [m].
PLACES = {'optical': (0.0, 0.0, 2.5), 'camera': (2.5, 0.0, 0.0), 'room': (0.0, 0.0, 1.3)}
# The point of the spine in the chest, above the origin of the base frame [m].
CHEST = (-0.03, 0.0, 0.05)
# Rigid bodies as docs/trackers.md says to put them: from base, middle of the upper arm and wrist,
# forward, left and up where the arms hang; left is outwards for the left arm [m].
PLATE_ON_CHEST, PLATE_ON_ARM, PLATE_ON_HAND = (-0.1, 0.0, 0.0), 0.05, (0.0, 0.0, -0.05)

# A recording has no fingers: those of a stretched hand, their knuckles from the wrist along the
# hand and to the thumb, and how far their four points are along them from there [m].
FINGERS = {'index': 0.033, 'middle': 0.011, 'ring': -0.011, 'pinky': -0.033}
KNUCKLES, ALONG_FINGER = 0.105, (0.0, 0.045, 0.065, 0.085)
THUMB, ALONG_THUMB = (0.03, 0.025), (0.0, 0.015, 0.03, 0.045)


def stand_in(
    recorded: Skeleton, first: Posture, tracker: Skeleton, view: str
) -> Callable[[Posture], Posture]:
    """
    Return a function that turns postures of a recording into those of another tracker.

    Parameters
    ----------
    recorded : Skeleton
        Of the recording.
    first : Posture
        Of the recording: where he is then is before the tracker.
    view : str
        One of `LOOKING`.

    Raises
    ------
    SceneError
        The base frame is lost in the first posture.

    """
    turn = np.array(LOOKING[view]) @ recorded.axes.T
    move = np.array(PLACES[view]) - turn @ base_pose(recorded, first)[:3, 3]
    names = tracker.names_by_id
    see = _points if names else _plates

    def convert(posture: Posture) -> Posture:
        positions, rotations = see(recorded, posture, tracker)
        return Posture(
            names=tuple(positions),
            positions=np.array(list(positions.values())) @ turn.T + move,
            rotations=turn @ np.array(list(rotations.values())) if rotations else None,
        )

    return convert


Seen = tuple[dict[str, Array], dict[str, Array]]


def _points(recorded: Skeleton, posture: Posture, tracker: Skeleton) -> Seen:
    """Return the points of a tracker; those that no joint is made of are lost."""
    joints = _joints_by_name(recorded, posture)
    T = base_pose(recorded, posture)
    joints['chest'] = T[:3, :3] @ np.array(CHEST) + T[:3, 3]
    joints |= _fingers(joints, T[:3, :3])
    positions = {name: np.full(3, np.nan) for name in tracker.names_by_id}
    # A point that is a joint by itself is there, whichever mean it belongs to.
    for joint in sorted(tracker.joints, key=lambda joint: -len(joint.points)):
        for point in joint.points:
            positions[point] = joints.get(joint.name, np.full(3, np.nan))
    return positions, {}


def _fingers(joints: dict[str, Array], base: Array) -> dict[str, Array]:
    """Return the points of the fingers of stretched hands, thumbs to the front."""
    found: dict[str, Array] = {}
    for side in ('left', 'right'):
        lost = np.full(3, np.nan)
        wrist, hand = (joints.get(f'{side} {name}', lost) for name in ('wrist', 'hand'))
        if np.isnan(wrist + hand).any():
            continue
        palm = _hanging(wrist - hand, base[:, 0])
        along, across = -palm[:, 2], palm[:, 0]
        for finger, beside in FINGERS.items():
            for k, way in enumerate(ALONG_FINGER, 1):
                found[f'{side} {finger} {k}'] = wrist + (KNUCKLES + way) * along + beside * across
        for k, way in enumerate(ALONG_THUMB, 1):
            place = (THUMB[0] + way) * along + (THUMB[1] + way) * across
            found[f'{side} thumb {k}'] = wrist + place
    return found


def _joints_by_name(skeleton: Skeleton, posture: Posture) -> dict[str, Array]:
    """Return where each joint is in the frame of the tracker, (3,) [m], NaN: lost."""
    places = joint_positions(skeleton, posture)
    return {joint.name: at for joint, at in zip(skeleton.joints, places, strict=True)}


def _plates(recorded: Skeleton, posture: Posture, _: Skeleton) -> Seen:
    """Return the rigid bodies of config/skeletons/rigid_bodies.yaml."""
    joints = _joints_by_name(recorded, posture)
    T = base_pose(recorded, posture)
    positions = {'chest': T[:3, :3] @ np.array(PLATE_ON_CHEST) + T[:3, 3]}
    rotations = {'chest': T[:3, :3]}
    for side, sign in (('left', 1.0), ('right', -1.0)):
        shoulder, elbow, wrist, hand = (
            joints[f'{side} {name}'] for name in ('shoulder', 'elbow', 'wrist', 'hand')
        )
        upper = _hanging(shoulder - elbow, T[:3, 0])
        positions[f'{side}_arm'] = 0.5 * (shoulder + elbow) + sign * PLATE_ON_ARM * upper[:, 1]
        rotations[f'{side}_arm'] = upper
        palm = _hanging(wrist - hand, T[:3, 0])
        positions[f'{side}_hand'] = wrist + palm @ np.array(PLATE_ON_HAND)
        rotations[f'{side}_hand'] = palm
    return positions, rotations


def _hanging(up: Array, forward: Array) -> Array:
    """Return axes (3, 3) whose third points up a limb, and whose first is nearest to forward."""
    third = up / np.linalg.norm(up)
    first = forward - (forward @ third) * third
    length = np.linalg.norm(first)
    if not length > 0.0:
        raise SceneError('a limb that points straight forward, expected another direction')
    first /= length
    return np.column_stack([first, np.cross(third, first), third])
