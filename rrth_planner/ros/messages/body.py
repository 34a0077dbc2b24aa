# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer as visualization markers: which boxes there are, and until when."""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
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
        Those whose lifetime has passed, or that are missing in a later body, and that were neither
        removed nor added again since: they stay where they were last seen. The last of them, of at
        most 10,000 boxes in all.

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
        is_same = all(part.expires > now for _, part in self.parts)
        if is_same and all(part.ends > now for _, part in self.lost):
            return self
        lost = {key: part for key, part in self.lost if part.ends > now}
        lost.update(item for item in self.parts if item[1].expires <= now)
        present = tuple(item for item in self.parts if item[1].expires > now)
        return WearerBody(present, _last(lost))

    def apply(
        self, msg: MarkerArray, now: float, base_frame: str, lookup: Lookup | None = None
    ) -> 'WearerBody':
        """
        Return the body after an array: all of its markers in their order, or none of them.

        The array is a description while no motion runs. Colours are ignored: an invisible box is
        still an obstacle. Parameters and errors are those of `read_edits`.
        """
        return self.edited(read_edits(msg, now, base_frame, lookup), now)

    def edited(
        self,
        edits: Sequence[Edit],
        now: float,
        *,
        is_description: bool = True,
        keep_removed: float = 0.0,
    ) -> 'WearerBody':
        """
        Return the body after the edits of one array, received at a time [s], or raise.

        CUBE and CUBE_LIST markers are added or replace the one of the same ns and id. DELETE
        removes one. DELETEALL begins all parts anew, or those of its ns if that is not empty: what
        the array then leaves out is lost. A description removes it instead, where it has no stamp.

        Parameters
        ----------
        is_description : bool
            As `BodyPublishers.is_description` says.
        keep_removed : float
            How long what is removed stays where it was: drivers delete what they do not see [s].

        """
        present = self.at(now)
        parts, lost = dict(present.parts), dict(present.lost)
        # What the array takes away, and until when that stays [s].
        stays: dict[Key, float] = {}
        for edit in edits:
            if edit.part is not None:
                if stays.pop(edit.key, None) is not None:
                    # In the order of the array.
                    parts.pop(edit.key, None)
                lost.pop(edit.key, None)
                parts[edit.key] = edit.part
            elif edit.action == Marker.DELETE:
                stays[edit.key] = now + keep_removed
            else:
                for key, part in (*lost.items(), *parts.items()):
                    if edit.key[0] in ('', key[0]) and key not in edit.spared:
                        is_removed = is_description and not part.is_stamped
                        stays.setdefault(key, now + keep_removed if is_removed else math.inf)
        for key, ends in stays.items():
            left = parts.pop(key, None) or lost.pop(key, None)
            if left is not None and min(ends, left.ends) > now:
                until = min(ends, left.ends)
                lost[key] = replace(left, expires=min(left.expires, now), ends=until)
        body = WearerBody(tuple(parts.items()), _last(lost))
        if body.n_boxes > MOST_BOXES:
            raise MessageError(f'{body.n_boxes} boxes, expected at most {MOST_BOXES} in all')
        return body


def _last(lost: Mapping[Key, BodyPart]) -> tuple[tuple[Key, BodyPart], ...]:
    """Return the last of the lost parts, of at most `MOST_BOXES` boxes in all."""
    kept, n = deque[tuple[Key, BodyPart]](), 0
    for key, part in reversed(tuple(lost.items())):
        n += len(part.boxes)
        if n > MOST_BOXES:
            break
        kept.appendleft((key, part))
    return tuple(kept)


# The same body is the same scene each time: what is derived from it is kept, here and in the
# planning process.
@functools.lru_cache(maxsize=32)
def scene_of(body: WearerBody) -> Scene:
    """Return the boxes, lost ones too, as a scene; take `body.at(now)` first for times."""
    return Scene(tuple(box for _, part in (*body.parts, *body.lost) for box in part.boxes))
