# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer as visualization markers: which boxes there are, and until when."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
import functools
import math

from rrth_planner.model.errors import MessageError, one_line
from rrth_planner.model.scene import Scene
from rrth_planner.ros.messages.frames import Lookup
from rrth_planner.ros.messages.marker_edits import BodyPart, Edit, Key, MOST_BOXES, read_edits
from visualization_msgs.msg import Marker, MarkerArray

# A message names so many lost parts.
MOST_NAMED = 20


@dataclass(frozen=True, slots=True, eq=False)
class WearerBody:
    """
    The wearer's boxes by (ns, id), each once, as RViz would show them; a value, never changed.

    Parameters
    ----------
    lost : tuple of ((str, int), BodyPart)
        Those whose lifetime has passed, and that were neither deleted nor added again since: they
        stay where they were last seen. The last of them, of at most 10,000 boxes in all.

    """

    parts: tuple[tuple[Key, BodyPart], ...] = ()
    lost: tuple[tuple[Key, BodyPart], ...] = ()

    @property
    def n_boxes(self) -> int:
        """Number of boxes."""
        return sum(len(part.boxes) for _, part in self.parts)

    def lost_names(self, since: float = math.inf) -> str:
        """Return the names of the parts that have been lost since a time [s], for messages."""
        names = [
            f'"{box.name}"'
            for _, part in self.lost
            if part.expires <= since
            for box in part.boxes[:1]
        ]
        return one_line(', '.join(names[-MOST_NAMED:]))

    def without(self, names: Sequence[str]) -> list[str]:
        """Return which names no box of the body has, lost ones included, nor any namespace."""
        parts = (*self.parts, *self.lost)
        known = {key[0] for key, _ in parts}.union(b.name for _, p in parts for b in p.boxes)
        return [name for name in names if name not in known]

    def shifted(self, step: float) -> 'WearerBody':
        """Return the body by a clock that was set forward by a step [s]."""
        both = (self.parts, self.lost)
        return WearerBody(*(tuple((k, p.shifted(step)) for k, p in parts) for parts in both))

    def at(self, now: float) -> 'WearerBody':
        """Return the body at a time [s]: parts whose lifetime has passed are lost."""
        if all(part.expires > now for _, part in self.parts):
            return self
        gone = dict(self.lost)
        gone.update(item for item in self.parts if item[1].expires <= now)
        lost, n = deque[tuple[Key, BodyPart]](), 0
        for key, part in reversed(gone.items()):
            n += len(part.boxes)
            if n > MOST_BOXES:
                break
            lost.appendleft((key, part))
        present = tuple(item for item in self.parts if item[1].expires > now)
        return WearerBody(present, tuple(lost))

    def apply(
        self, msg: MarkerArray, now: float, base_frame: str, lookup: Lookup | None = None
    ) -> 'WearerBody':
        """
        Return the body after an array: all of its markers in their order, or none of them.

        CUBE and CUBE_LIST markers are added or replace the one of the same ns and id; DELETE
        removes one, DELETEALL all of its ns, or all when its ns is empty. Colours are ignored: an
        invisible box is still an obstacle. Parameters and errors are those of `read_edits`.
        """
        return self.edited(read_edits(msg, now, base_frame, lookup), now)

    def edited(self, edits: Sequence[Edit], now: float) -> 'WearerBody':
        """Return the body after the edits of one array, received at a time [s], or raise."""
        present = self.at(now)
        parts, lost = dict(present.parts), dict(present.lost)
        for edit in edits:
            if edit.action == Marker.DELETEALL:
                ns = edit.key[0]
                parts = {k: part for k, part in parts.items() if ns not in ('', k[0])}
                lost = {k: part for k, part in lost.items() if ns not in ('', k[0])}
                continue
            lost.pop(edit.key, None)
            if edit.part is None:
                parts.pop(edit.key, None)
            else:
                parts[edit.key] = edit.part
        body = WearerBody(tuple(parts.items()), tuple(lost.items()))
        if body.n_boxes > MOST_BOXES:
            raise MessageError(f'{body.n_boxes} boxes, expected at most {MOST_BOXES} in all')
        return body


# The same body is the same scene each time: what is derived from it is kept, here and in the
# planning process.
@functools.lru_cache(maxsize=32)
def scene_of(body: WearerBody) -> Scene:
    """Return the boxes, lost ones too, as a scene; take `body.at(now)` first for times."""
    return Scene(tuple(box for _, part in (*body.parts, *body.lost) for box in part.boxes))
