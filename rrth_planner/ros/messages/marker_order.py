# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Order of the edits of each marker, so that a late array undoes nothing."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from rrth_planner.ros.messages.body import WearerBody
from rrth_planner.ros.messages.fields import Stamp
from rrth_planner.ros.messages.marker_edits import Edit, Key
from visualization_msgs.msg import Marker

# So many deleted markers, and so many namespaces, are remembered; of one that is forgotten a late
# array may add the box once more.
REMEMBERED = 10_000


class MarkerOrder:
    """
    Applies arrays of markers, to each marker in the order in which its edits were sent.

    The clocks of two publishers may differ, so their arrays have no common order; but nearly
    always one publisher alone sends a marker.
    """

    def __init__(self) -> None:
        """Begin with nothing remembered."""
        # By marker, and by namespace whose markers were all deleted ('': those of all).
        self._markers: dict[Key, Stamp] = {}
        self._namespaces: dict[str, Stamp] = {}

    def apply(
        self,
        body: WearerBody,
        edits: Sequence[Edit],
        sent: Stamp,
        received: float,
        is_newer: Callable[[Stamp], bool] | None = None,
        *,
        is_description: bool = True,
        keep_removed: float = 0.0,
    ) -> WearerBody:
        """
        Return the body after an array that came at a time [s], and remember when it was sent.

        is_newer: of a late array, whether another one was sent after it. The last two are those of
        `WearerBody.edited`.

        Raises
        ------
        MessageError
            Too many boxes; nothing is remembered then.

        """
        kept = edits if is_newer is None else list(self._kept(body, edits, is_newer))
        after = body.edited(
            kept, received, is_description=is_description, keep_removed=keep_removed
        ).at(received)
        for edit in edits:
            if edit.action == Marker.DELETEALL:
                self._remember_all(edit.key[0], sent, is_newer or (lambda _: False))
            elif is_newer is None or not self._is_overtaken(edit.key, is_newer):
                self._markers[edit.key] = sent
        if len(self._markers) > REMEMBERED + len(after.parts):
            present = {key for key, _ in after.parts}
            self._markers = {k: stamp for k, stamp in self._markers.items() if k in present}
        while len(self._namespaces) > REMEMBERED:
            del self._namespaces[next(iter(self._namespaces))]
        return after

    def _kept(
        self, body: WearerBody, edits: Sequence[Edit], is_newer: Callable[[Stamp], bool]
    ) -> Iterator[Edit]:
        """Yield the edits of a late array to markers that have no newer edit."""
        keys = [key for key, _ in (*body.parts, *body.lost)]
        for edit in edits:
            if edit.action == Marker.DELETEALL:
                spared = (key for key in keys if self._is_overtaken(key, is_newer))
                yield replace(edit, spared=frozenset(spared))
            elif not self._is_overtaken(edit.key, is_newer):
                yield edit

    def _is_overtaken(self, key: Key, is_newer: Callable[[Stamp], bool]) -> bool:
        """Return whether a marker has a newer edit."""
        done = (self._markers.get(key), *map(self._namespaces.get, ('', key[0])))
        return any(stamp is not None and is_newer(stamp) for stamp in done)

    def _remember_all(self, ns: str, sent: Stamp, is_newer: Callable[[Stamp], bool]) -> None:
        """Remember that all markers of a namespace were deleted."""
        before = self._namespaces.get(ns)
        if before is None or not is_newer(before):
            self._namespaces[ns] = sent
        self._markers = {
            key: stamp
            for key, stamp in self._markers.items()
            if ns not in ('', key[0]) or is_newer(stamp)
        }
