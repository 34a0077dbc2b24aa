# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The edits of the wearer by the markers of one array, read in one pass: bodies come often."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np
from rrth_planner.io.wearer_file import LONGEST_TEXT
from rrth_planner.kernels.collision.boxes import first_bad as first_bad_row, place, POSED
from rrth_planner.kernels.layout import NUMBERS, ROTATION, SIZE
from rrth_planner.model.arrays import Array, FARTHEST
from rrth_planner.model.errors import MessageError, one_line, SceneError
from rrth_planner.model.scene import Box
from rrth_planner.ros.messages.fields import seconds_of, triple_of, unit_quaternion_of
from rrth_planner.ros.messages.frames import FrameError, Lookup, pose_in_base
from visualization_msgs.msg import Marker, MarkerArray

# More boxes than any wearer has; a longer array is a mistake, and would block the node.
MOST_BOXES = 10000
# A body is kept, and so are its names [characters].
LONGEST_NAMESPACE = 256

Key = tuple[str, int]


@dataclass(frozen=True, slots=True, eq=False)
class BodyPart:
    """
    The boxes of one marker.

    Parameters
    ----------
    boxes : tuple of Box
        One for a CUBE, any number for a CUBE_LIST, in the base frame.
    expires : float
        When they vanish [s, the clock of `now`]; inf: never.

    """

    boxes: tuple[Box, ...]
    expires: float = float('inf')


@dataclass(frozen=True, slots=True, eq=False)
class Edit:
    """
    The edit by one marker.

    Parameters
    ----------
    action : int
        Marker.ADD, DELETE or DELETEALL.
    key : (str, int)
        Its ns and id.
    part : BodyPart or None
        What is added; None unless it adds.

    """

    action: int
    key: Key
    part: BodyPart | None = None


def read_edits(
    msg: MarkerArray, now: float, base_frame: str, lookup: Lookup | None = None
) -> tuple[Edit, ...]:
    """
    Return the edits of an array, in its order.

    Parameters
    ----------
    msg : MarkerArray
    now : float
        Time of reception, from which lifetimes count [s].
    base_frame : str
        Frame of the boxes; an empty frame of a marker is taken as it.
    lookup : callable, optional
        frame -> its pose in the base frame, shape (4, 4) [m]; without, no other is known.

    Raises
    ------
    MessageError
        A bad marker; a FrameError when its frame is the reason.

    """
    reading = _Reading(base_frame, lookup)
    found = []
    for index, marker in enumerate(msg.markers):
        reading.n_markers = index
        try:
            found.append(_read(marker, now, reading))
        except FrameError as problem:
            raise FrameError(f'{_label(index, marker)}: {problem}') from problem
        except MessageError as problem:
            raise MessageError(f'{_label(index, marker)}: {problem}') from problem
    boxes = _placed(msg, reading)
    return tuple(
        Edit(action, key)
        if expires is None
        else Edit(action, key, BodyPart(boxes[begin:end], expires))
        for action, key, expires, begin, end in found
    )


def marker_name(marker: Any) -> str:
    """Return the name of a marker: its text, or `ns/id` where it has none."""
    name = marker.text or (f'{marker.ns}/{marker.id}' if marker.ns else f'{marker.id}')
    return one_line(name, LONGEST_TEXT)


class _Reading:
    """The boxes of the markers that have been read, before they are placed."""

    def __init__(self, base_frame: str, lookup: Lookup | None) -> None:
        self._base_frame, self._lookup = base_frame, lookup
        self.n_markers = 0
        # Of each box: its name, its numbers as `place` takes them, marker and frame.
        self.names: list[str] = []
        self.rows: list[tuple[float, ...]] = []
        self.owners: list[int] = []
        self.which: list[int] = []
        self.frames: list[Array] = []
        self._known: dict[str, int] = {}

    def frame(self, name: str) -> int:
        """Return the number of a frame, or raise FrameError."""
        known = self._known.get(name)
        if known is None:
            self.frames.append(pose_in_base(name, self._base_frame, self._lookup))
            known = self._known[name] = len(self.frames) - 1
        return known

    def add(self, name: str, pose: tuple[float, ...], point: tuple[float, ...], at: int) -> None:
        """Add a box whose pose and size are those of its marker, and whose frame has a number."""
        self.names.append(name)
        self.rows.append(pose + point)
        self.owners.append(self.n_markers)
        self.which.append(at)


def _read(marker: Any, now: float, reading: _Reading) -> tuple[int, Key, float | None, int, int]:
    """Return action, key, when it expires, and which boxes are its own; None: it adds none."""
    key = (marker.ns, marker.id)
    if len(marker.ns) > LONGEST_NAMESPACE:
        raise MessageError(
            f'ns of {len(marker.ns)} characters, expected at most {LONGEST_NAMESPACE}'
        )
    action = marker.action
    if action in (Marker.DELETE, Marker.DELETEALL):
        return action, key, None, 0, 0
    if action != Marker.ADD:
        raise MessageError(f'action {action}, expected 0 (ADD), 2 (DELETE) or 3 (DELETEALL)')
    if marker.type not in (Marker.CUBE, Marker.CUBE_LIST):
        raise MessageError(f'type {marker.type}, expected 1 (CUBE) or 6 (CUBE_LIST)')
    size = triple_of(marker.scale, 'scale')
    if not (size[0] > 0.0 and size[1] > 0.0 and size[2] > 0.0):
        raise MessageError(f'scale: {list(size)}, expected three lengths > 0 [m]')
    pose = marker.pose
    row = (
        triple_of(pose.position, 'pose.position')
        + unit_quaternion_of(pose.orientation, 'pose.orientation')
        + size
    )
    lifetime = seconds_of(marker.lifetime)
    if lifetime < 0.0:
        raise MessageError(f'lifetime: {lifetime}, expected 0 (for ever) or more [s]')
    frame, name, begin = reading.frame(marker.header.frame_id), marker_name(marker), 0
    begin = len(reading.rows)
    if marker.type == Marker.CUBE:
        reading.add(name, row, (0.0, 0.0, 0.0), frame)
    else:
        if not 0 < len(marker.points) <= MOST_BOXES:
            raise MessageError(
                f'points: {len(marker.points)}, expected 1 to {MOST_BOXES} in a CUBE_LIST'
            )
        for k, point in enumerate(marker.points):
            reading.add(f'{name}[{k}]', row, triple_of(point, f'points[{k}]'), frame)
    expires = now + lifetime if lifetime > 0.0 else math.inf
    return action, key, expires, begin, len(reading.rows)


def _placed(msg: MarkerArray, reading: _Reading) -> tuple[Box, ...]:
    """Return the boxes in the base frame, or raise MessageError."""
    if not reading.rows:
        return ()
    markers = np.array(reading.rows)
    assert markers.shape[1] == POSED
    which, frames = np.array(reading.which), np.array(reading.frames)
    numbers = np.empty((len(markers), NUMBERS))
    # What overflows is infinite, which is no box.
    place(markers, which, frames, numbers)
    try:
        return boxes_of(reading.names, numbers)
    except SceneError as problem:
        index = reading.owners[first_bad(numbers)]
        raise MessageError(f'{_label(index, msg.markers[index])}: {problem}') from problem


def _label(index: int, marker: Any) -> str:
    return f'marker {index} ("{marker_name(marker)}")'


def boxes_of(names: Sequence[str], numbers: Array) -> tuple[Box, ...]:
    """
    Return boxes from their names and numbers, shape (n, 15), which are frozen by this.

    Raises
    ------
    SceneError
        Of the first that is no box.

    """
    numbers.setflags(write=False)
    bad = first_bad(numbers)
    if bad >= 0:
        row = numbers[bad]
        Box(names[bad], row[:SIZE], row[SIZE:ROTATION], row[ROTATION:].reshape(3, 3))
    return tuple(Box.of_row(name, row) for name, row in zip(names, numbers, strict=True))


def first_bad(numbers: Array) -> int:
    """Return which of some numbers, shape (n, 15), are the first that are no box; -1: none."""
    return int(first_bad_row(numbers, FARTHEST))
