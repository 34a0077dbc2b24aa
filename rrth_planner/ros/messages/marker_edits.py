# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The edits of the wearer by the markers of one array, read in one pass: bodies come often."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
import math
from typing import Any

import numpy as np
from rrth_planner.io.wearer_file import marker_name
from rrth_planner.kernels.collision.boxes import first_bad, place, POSED
from rrth_planner.kernels.layout import NUMBERS, ROTATION, SIZE
from rrth_planner.model.arrays import Array, FARTHEST
from rrth_planner.model.errors import MessageError, SceneError
from rrth_planner.model.scene import Box
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.ros.messages.fields import (
    nanoseconds_of,
    seconds_of,
    triple_of,
    unit_quaternion_of,
)
from rrth_planner.ros.messages.frames import Lookup, pose_in_base
from visualization_msgs.msg import Marker, MarkerArray

# More boxes than any wearer has; a longer array is a mistake, and would block the node.
MOST_BOXES = 10000
# A body is kept, and so are its names [characters].
LONGEST_NAMESPACE = 256
# Clocks may differ by so much [s].
MOST_AHEAD = 0.1

Key = tuple[str, int]


@dataclass(frozen=True, slots=True, eq=False)
class BodyPart:
    """
    The boxes of one marker: one of a CUBE, any number of a CUBE_LIST.

    Parameters
    ----------
    boxes : tuple of Box
        In the base frame.
    expires : float
        When they are lost [s, the clock of `now`]; inf: never.
    measured : float
        When they were measured [s].
    is_stamped : bool
        Whether the publisher says when that was.
    ends : float
        When they are gone, once they were removed while a motion runs [s]; inf: they were not.

    """

    boxes: tuple[Box, ...]
    expires: float = math.inf
    measured: float = -math.inf
    is_stamped: bool = False
    ends: float = math.inf

    def shifted(self, step: float) -> 'BodyPart':
        """Return the boxes by a clock that was set forward by a step [s]."""
        return replace(self, expires=self.expires + step, measured=self.measured + step)


@dataclass(frozen=True, slots=True, eq=False)
class Edit:
    """
    The edit by a marker: Marker.ADD, DELETE or DELETEALL, its (ns, id), and what it adds.

    Parameters
    ----------
    spared : frozenset of (str, int)
        What a late DELETEALL does nothing to: newer arrays have edited these.

    """

    action: int
    key: Key
    part: BodyPart | None = None
    spared: frozenset[Key] = frozenset()


def measured_at(edits: Sequence[Edit], default: float) -> float:
    """Return the oldest measurement of the boxes of an array; without boxes the default [s]."""
    return min((e.part.measured for e in edits if e.part is not None), default=default)


def read_edits(
    msg: MarkerArray,
    now: float,
    base_frame: str,
    lookup: Lookup | None = None,
    latency: float = 0.0,
) -> tuple[Edit, ...]:
    """
    Return the edits of an array, in its order.

    Parameters
    ----------
    now : float
        Time of reception, from which lifetimes count [s].
    base_frame : str
        Frame of the boxes; an empty frame of a marker is taken as it.
    lookup : callable, optional
        As `frames.Lookup`; without, no other frame is known.
    latency : float
        Age at reception of markers without a stamp [s].

    Raises
    ------
    MessageError
        A bad marker, or one from the future; a FrameError when its frame is the reason.

    """
    reading = _Reading(base_frame, lookup)
    # Of each marker: when it was measured and expires, and where its boxes end among all.
    times, ends = [], [0]
    for index, marker in enumerate(msg.markers):
        try:
            times.append(_read(marker, now, latency, reading))
        except MessageError as problem:
            raise type(problem)(f'{_label(index, marker)}: {problem}') from problem
        ends.append(len(reading.rows))
    numbers = np.empty((len(reading.rows), NUMBERS))
    if reading.rows:
        rows = np.array(reading.rows)
        assert rows.shape[1] == POSED
        # What overflows is infinite, which is no box.
        place(rows, np.array(reading.which), np.array(reading.frames), numbers)
    try:
        boxes = boxes_of(reading.names, numbers)
    except SceneError as problem:
        index = bisect_right(ends, first_bad(numbers, FARTHEST)) - 1
        raise MessageError(f'{_label(index, msg.markers[index])}: {problem}') from problem
    return tuple(
        Edit(m.action, (m.ns, m.id), None if then is None else BodyPart(boxes[begin:end], *then))
        for m, then, (begin, end) in zip(msg.markers, times, pairwise(ends), strict=True)
    )


class _Reading:
    """The boxes of the markers that have been read, before they are placed."""

    def __init__(self, base_frame: str, lookup: Lookup | None) -> None:
        self._base_frame, self._lookup = base_frame, lookup
        # Of each box: its name, its numbers as `place` takes them, and which frame is its own.
        self.names: list[str] = []
        self.rows: list[tuple[float, ...]] = []
        self.which: list[int] = []
        self.frames: list[Array] = []
        self._known: dict[tuple[str, int], int] = {}

    def frame(self, name: str, stamp: int) -> int:
        """Return the number of a frame at a time [ns], or raise FrameError."""
        key = name, stamp
        if key not in self._known:
            self.frames.append(pose_in_base(name, self._base_frame, self._lookup, stamp))
            self._known[key] = len(self.frames) - 1
        return self._known[key]

    def add(self, name: str, row: tuple[float, ...], frame: int) -> None:
        """Add a box in a frame."""
        self.names.append(name)
        self.rows.append(row)
        self.which.append(frame)


def _read(
    marker: Any, now: float, latency: float, reading: _Reading
) -> tuple[float, float, bool] | None:
    """
    Read the boxes of a marker; return when they expire and were measured [s]; None: no box.

    The third value: whether the time of the measurement is the marker's own stamp.
    """
    if len(marker.ns) > LONGEST_NAMESPACE:
        raise MessageError(
            f'ns of {len(marker.ns)} characters, expected at most {LONGEST_NAMESPACE}'
        )
    action = marker.action
    if action in (Marker.DELETE, Marker.DELETEALL):
        return None
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
    stamp = nanoseconds_of(marker.header.stamp)
    measured = stamp / NANOSECONDS if stamp else now - latency
    if measured - now > MOST_AHEAD:
        raise MessageError(
            f'header.stamp: {measured - now:.3f} s in the future, expected at most {MOST_AHEAD:g} '
            '(by the same clock as the planner: see use_sim_time)'
        )
    if measured > now:
        # By another clock: it is no younger than one without a stamp.
        measured = now - latency
    frame = reading.frame(marker.header.frame_id, stamp)
    name = marker_name(marker.text, marker.ns, marker.id)
    if marker.type == Marker.CUBE:
        reading.add(name, (*row, 0.0, 0.0, 0.0), frame)
    else:
        if not 0 < len(marker.points) <= MOST_BOXES:
            raise MessageError(
                f'points: {len(marker.points)}, expected 1 to {MOST_BOXES} in a CUBE_LIST'
            )
        for k, point in enumerate(marker.points):
            reading.add(f'{name}[{k}]', row + triple_of(point, f'points[{k}]'), frame)
    return now + lifetime if lifetime > 0.0 else math.inf, measured, stamp != 0


def _label(index: int, marker: Any) -> str:
    return f'marker {index} ("{marker_name(marker.text, marker.ns, marker.id)}")'


def boxes_of(names: Sequence[str], numbers: Array) -> tuple[Box, ...]:
    """
    Return boxes from their names and numbers, shape (n, 15), which are frozen by this.

    Raises the SceneError of the first that is no box.
    """
    numbers.setflags(write=False)
    bad = first_bad(numbers, FARTHEST)
    if bad >= 0:
        row = numbers[bad]
        Box(names[bad], row[:SIZE], row[SIZE:ROTATION], row[ROTATION:].reshape(3, 3))
    return tuple(Box.of_row(name, row) for name, row in zip(names, numbers, strict=True))
