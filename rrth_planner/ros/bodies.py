# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer as visualization markers: which boxes there are, and until when."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.errors import MessageError, one_line, SceneError
from rrth_planner.ros.fields import numbers, position_of, rotation_of, seconds_of
from rrth_planner.ros.frames import FrameError, Lookup, pose_in_base
from rrth_planner.scene import Box, Scene
from visualization_msgs.msg import Marker, MarkerArray

# More boxes than any wearer has; a longer array is a mistake, and would hold up everything else.
MOST_BOXES = 10000
# So many markers whose lifetime has passed are remembered, to be named.
MOST_EXPIRED = 100
# A body is kept, and so are its names [characters]; longer texts are cut short.
LONGEST_NAMESPACE, LONGEST_NAME = 256, 100

Key = tuple[str, int]


@dataclass(frozen=True, slots=True, eq=False)
class BodyPart:
    """
    What one marker put into the world.

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
    What one marker does to the wearer.

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


@dataclass(frozen=True, slots=True, eq=False)
class WearerBody:
    """
    The wearer's boxes by namespace and id, as RViz would show them; a value, never changed.

    Parameters
    ----------
    parts : tuple of ((str, int), BodyPart)
        Keys (ns, id), each once.
    expired : tuple of ((str, int), BodyPart)
        Those that were neither deleted nor added again since their lifetime passed; at most 100.

    """

    parts: tuple[tuple[Key, BodyPart], ...] = ()
    expired: tuple[tuple[Key, BodyPart], ...] = ()

    @property
    def n_boxes(self) -> int:
        """Number of boxes."""
        return sum(len(part.boxes) for _, part in self.parts)

    def at(self, now: float) -> 'WearerBody':
        """Return the body without the parts whose lifetime has passed at a time [s]."""
        if all(part.expires > now for _, part in self.parts):
            return self
        # Their first box is enough to name them.
        gone = dict(self.expired) | {
            k: BodyPart(part.boxes[:1], part.expires)
            for k, part in self.parts
            if part.expires <= now
        }
        return WearerBody(
            tuple(item for item in self.parts if item[1].expires > now),
            tuple(gone.items())[-MOST_EXPIRED:],
        )

    def apply(
        self, msg: MarkerArray, now: float, base_frame: str, lookup: Lookup | None = None
    ) -> 'WearerBody':
        """
        Return the body after an array: all of its markers in their order, or none of them.

        CUBE and CUBE_LIST markers are added or replace the one of the same ns and id; DELETE
        removes one, DELETEALL all of its ns, or all when its ns is empty. A lifetime counts from
        `now`. Colours are ignored: an invisible box is still an obstacle.

        Parameters
        ----------
        msg : MarkerArray
        now : float
            Time of reception [s].
        base_frame : str
            Frame of the boxes of this body; an empty frame of a marker is taken as it.
        lookup : callable, optional
            frame -> its pose in the base frame, shape (4, 4) [m]; without, no other is known.

        Raises
        ------
        MessageError
            A bad marker; a FrameError when its frame is the reason.

        """
        return self.edited(read_edits(msg, now, base_frame, lookup), now)

    def edited(self, edits: Sequence[Edit], now: float) -> 'WearerBody':
        """Return the body after the edits of one array, heard at a time [s], or raise."""
        present = self.at(now)
        parts, expired = dict(present.parts), dict(present.expired)
        for edit in edits:
            if edit.action == Marker.DELETEALL:
                ns = edit.key[0]
                parts = {k: part for k, part in parts.items() if ns not in ('', k[0])}
                expired = {k: part for k, part in expired.items() if ns not in ('', k[0])}
                continue
            expired.pop(edit.key, None)
            if edit.part is None:
                parts.pop(edit.key, None)
            else:
                parts[edit.key] = edit.part
        body = WearerBody(tuple(parts.items()), tuple(expired.items()))
        if body.n_boxes > MOST_BOXES:
            raise MessageError(f'{body.n_boxes} boxes, expected at most {MOST_BOXES} in all')
        return body

    def with_older(self, edits: Sequence[Edit], now: float) -> 'WearerBody':
        """
        Return the body with what an array adds where nothing is, heard at a time [s].

        For an array that is older than the body: it takes nothing away and changes nothing.
        """
        older = {e.key: e.part for e in edits if e.part is not None and e.part.expires > now}
        present = dict(self.parts)
        missing = [Edit(Marker.ADD, k, part) for k, part in older.items() if k not in present]
        return self.edited(missing, now)


def read_edits(
    msg: MarkerArray, now: float, base_frame: str, lookup: Lookup | None = None
) -> tuple[Edit, ...]:
    """Return what an array does, in its order; arguments and errors are those of `apply`."""
    return tuple(
        _edit(f'marker {index} ("{marker_name(marker)}")', marker, now, base_frame, lookup)
        for index, marker in enumerate(msg.markers)
    )


def scene_of(body: WearerBody) -> Scene:
    """Return the boxes of a body as a scene; take `body.at(now)` first where time matters."""
    return Scene(tuple(box for _, part in body.parts for box in part.boxes))


def marker_name(marker: Any) -> str:
    """Return what sentences call a marker: its text, or `ns/id` where it has none."""
    name = marker.text or (f'{marker.ns}/{marker.id}' if marker.ns else f'{marker.id}')
    return one_line(name, LONGEST_NAME)


def _edit(label: str, marker: Any, now: float, base_frame: str, lookup: Lookup | None) -> Edit:
    key = (marker.ns, marker.id)
    if len(marker.ns) > LONGEST_NAMESPACE:
        raise MessageError(
            f'{label}: ns of {len(marker.ns)} characters, expected at most {LONGEST_NAMESPACE}'
        )
    if marker.action in (Marker.DELETE, Marker.DELETEALL):
        return Edit(marker.action, key)
    if marker.action != Marker.ADD:
        raise MessageError(
            f'{label}: action {marker.action}, expected 0 (ADD), 2 (DELETE) or 3 (DELETEALL)'
        )
    try:
        return Edit(Marker.ADD, key, _body_part(marker, now, base_frame, lookup))
    except FrameError as problem:
        raise FrameError(f'{label}: {problem}') from problem
    except (MessageError, SceneError) as problem:
        raise MessageError(f'{label}: {problem}') from problem


def _body_part(marker: Any, now: float, base_frame: str, lookup: Lookup | None) -> BodyPart:
    if marker.type not in (Marker.CUBE, Marker.CUBE_LIST):
        raise MessageError(f'type {marker.type}, expected 1 (CUBE) or 6 (CUBE_LIST)')
    size = numbers((marker.scale.x, marker.scale.y, marker.scale.z), 'scale', 'm')
    if not (size > 0.0).all():
        raise MessageError(f'scale: {size.tolist()}, expected three lengths > 0 [m]')
    center = position_of(marker.pose.position, 'pose.position')
    rotation = rotation_of(marker.pose.orientation, 'pose.orientation')
    lifetime = seconds_of(marker.lifetime)
    if lifetime < 0.0:
        raise MessageError(f'lifetime: {lifetime}, expected 0 (for ever) or more [s]')
    T = pose_in_base(marker.header.frame_id, base_frame, lookup)
    rotation_base = T[:3, :3] @ rotation
    # What overflows is infinite, which a box refuses.
    with np.errstate(over='ignore', invalid='ignore'):
        boxes = tuple(
            Box(name, T[:3, :3] @ (center + rotation @ offset) + T[:3, 3], size, rotation_base)
            for name, offset in _boxes_of(marker)
        )
    return BodyPart(boxes, now + lifetime if lifetime > 0.0 else float('inf'))


def _boxes_of(marker: Any) -> Iterator[tuple[str, Array]]:
    """Yield the name and the offset in the marker's own axes of each of its boxes [m]."""
    name = marker_name(marker)
    if marker.type == Marker.CUBE:
        yield name, np.zeros(3)
        return
    if not 0 < len(marker.points) <= MOST_BOXES:
        raise MessageError(
            f'points: {len(marker.points)}, expected 1 to {MOST_BOXES} in a CUBE_LIST'
        )
    for k, point in enumerate(marker.points):
        yield f'{name}[{k}]', position_of(point, f'points[{k}]')
