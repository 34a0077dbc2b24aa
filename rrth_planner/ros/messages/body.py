# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer as visualization markers: which boxes there are, and until when."""

from collections.abc import Sequence
from dataclasses import dataclass

from rrth_planner.model.errors import MessageError, one_line
from rrth_planner.model.scene import Scene
from rrth_planner.ros.messages.frames import Lookup
from rrth_planner.ros.messages.marker_edits import BodyPart, Edit, Key, MOST_BOXES, read_edits
from visualization_msgs.msg import Marker, MarkerArray

# So many expired markers are remembered, for messages.
MOST_EXPIRED = 100


@dataclass(frozen=True, slots=True, eq=False)
class WearerBody:
    """
    The wearer's boxes by (ns, id), each once, as RViz would show them; a value, never changed.

    Parameters
    ----------
    expired : tuple of ((str, int), BodyPart)
        Those whose lifetime has passed, and that were neither deleted nor added again since: their
        place is unknown. At most 100.

    """

    parts: tuple[tuple[Key, BodyPart], ...] = ()
    expired: tuple[tuple[Key, BodyPart], ...] = ()

    @property
    def n_boxes(self) -> int:
        """Number of boxes."""
        return sum(len(part.boxes) for _, part in self.parts)

    @property
    def expired_names(self) -> str:
        """The names of the expired parts, for messages."""
        return one_line(', '.join(f'"{box.name}"' for _, p in self.expired for box in p.boxes))

    def at(self, now: float) -> 'WearerBody':
        """Return the body at a time [s]: parts whose lifetime has passed are expired."""
        if all(part.expires > now for _, part in self.parts):
            return self
        gone = dict(self.expired)
        for key, part in self.parts:
            if part.expires <= now:
                # Its first box suffices for the name.
                gone[key] = BodyPart(part.boxes[:1], part.expires)
        present = tuple(item for item in self.parts if item[1].expires > now)
        return WearerBody(present, tuple(gone.items())[-MOST_EXPIRED:])

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


def scene_of(body: WearerBody) -> Scene:
    """Return the boxes of a body as a scene; take `body.at(now)` first where time matters."""
    return Scene(tuple(box for _, part in body.parts for box in part.boxes))
