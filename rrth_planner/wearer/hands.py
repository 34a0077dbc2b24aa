# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Hands of whom a tracker sees the wrist, or a point of the palm: how large they are taken to be.

A 95th-percentile hand is 0.207 m long (DIN 33402-2:2020, men); the outer fingers of a broad one
end up to 0.215 m from the wrist. Wrists bend 80 degrees to the palm, 70 back, 20 to the thumb and
30 to the little finger (American Academy of Orthopaedic Surgeons, 1965), and forearms turn. So its
flesh, however fingers bend, is within 3 cm of lines from the wrist up to 110 degrees off the line
of the forearm.
"""

from dataclasses import replace
import math

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import SceneError
from rrth_planner.wearer.skeleton import BASE, Direction, Part, Skeleton

# What their parts are called.
HANDS = ('left hand', 'right hand')
# How far from the wrist flesh of a hand ends, and how far it is from a line from there [m]; how
# far that turns from the line of the forearm [rad].
LENGTH, THICKNESS, BENT = 0.215, 0.03, math.radians(110.0)
# The box of a hand begins so far before the wrist [m].
WRIST = 0.03
# Edges that a box of a hand may have [m].
SMALLEST, LARGEST = 0.05, 1.0
# Of `Box.numbers`, (15,).
_CENTER, _ROTATION = slice(0, 3), slice(6, 15)


def hands_of(skeleton: Skeleton) -> tuple[Part, ...]:
    """Return the hands of a skeleton."""
    return tuple(part for part in skeleton.parts if part.name in HANDS)


def has_fingers(part: Part) -> bool:
    """Return whether a hand is a box round finger points."""
    side = part.name.removesuffix(' hand')
    return not set(part.joints) <= {f'{side} wrist', f'{side} hand'}


def with_hand_size(skeleton: Skeleton, size: float) -> Skeleton:
    """
    Return a skeleton whose hands are cubes that begin just before the wrists.

    Parameters
    ----------
    size : float
        Edge of each cube [m]; 0: hands are as the skeleton has them.

    Raises
    ------
    SceneError
        A size other than 0 or 0.05 to 1; hands that are boxes round finger points.

    """
    if size == 0.0:
        return skeleton
    if not SMALLEST <= size <= LARGEST:
        raise SceneError(
            f'hand_size: {size:g}, expected 0 or a size from {SMALLEST:g} to {LARGEST:g} [m]'
        )
    half = 0.5 * size
    margins = np.array([[half, half], [half, half], [WRIST, size - WRIST]])
    parts = []
    for part in skeleton.parts:
        if part.name in HANDS:
            if has_fingers(part):
                raise SceneError(
                    f'hand_size: {size:g}, expected 0: "{part.name}" is a box round finger points'
                )
            side = part.name.removesuffix(' hand')
            part = replace(part, joints=(f'{side} wrist',), margins=margins)
        parts.append(part)
    return replace(skeleton, parts=tuple(parts))


def round_wrists(skeleton: Skeleton) -> Skeleton:
    """
    Return a skeleton whose boxes of hands hold them however their wrists bend.

    Their centers are the wrists, and their third axes lead on along the forearms; `hand_distances`
    has what of them may be flesh. Hands round finger points stay as they are.
    """
    parts = []
    for part in skeleton.parts:
        if part.name in HANDS and not has_fingers(part):
            elbow, wrist = (f'{part.name.removesuffix(" hand")} {j}' for j in ('elbow', 'wrist'))
            axes = (Direction('up', elbow, wrist),)
            part = Part(part.name, (wrist,), np.full((3, 2), LENGTH), axes, part.rest)
        parts.append(part)
    joints = {
        j for p in parts for j in (*p.joints, *(e for d in p.axes for e in (d.start, d.end)))
    }
    # The points of the palms have no use any more.
    kept = tuple(j for j in skeleton.joints if j.name in joints or not j.name.endswith(' hand'))
    names = {joint.name for joint in kept}
    bones = tuple(b for b in skeleton.bones if {b.start, b.end} <= {*names, BASE})
    return replace(skeleton, joints=kept, parts=tuple(parts), bones=bones)


def hand_distances(points: Array, rows: Array) -> Array:
    """
    Return how far points are from hands with any wrist, 0 inside, (n, k, 3), (n, 15) -> (n, k).

    rows: boxes of hands of `round_wrists`.
    """
    rotation = rows[:, _ROTATION].reshape(-1, 3, 3)
    local = (points - rows[:, None, _CENTER]) @ rotation
    along, across = local[..., 2], np.hypot(local[..., 0], local[..., 1])
    longest, sine, cosine = LENGTH - THICKNESS, math.sin(BENT), math.cos(BENT)
    # Beyond the greatest angle the nearest line is the one that is bent most.
    share = np.clip(along * cosine + across * sine, 0.0, longest)
    beside = np.hypot(along - share * cosine, across - share * sine)
    is_ahead = along * sine >= across * cosine
    middle = np.where(is_ahead, np.maximum(np.hypot(along, across) - longest, 0.0), beside)
    result: Array = np.maximum(middle - THICKNESS, 0.0)
    return result
