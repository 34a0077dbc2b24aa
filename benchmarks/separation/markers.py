# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Section `markers`: the adversary, seen by way of the messages of a tracker.

Boxes become markers, and these become the wearer that the planner knows, as in its node: names are
read, and what is missing is lost.
"""

from functools import partial
import math

import numpy as np
from numpy.typing import NDArray
from rrth_planner.execution.event import Sight
from rrth_planner.kernels.layout import ROTATION, SIZE
from rrth_planner.model.arrays import Array
from rrth_planner.model.rotation import quaternion_xyzw
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.body_publishers import BodyPublishers
from rrth_planner.ros.messages.marker_edits import read_edits
from rrth_planner.ros.messages.marker_order import MarkerOrder
from visualization_msgs.msg import Marker, MarkerArray

from benchmarks.separation.adversary import Faults, HAND, Trial
from benchmarks.separation.lockstep import Eyes, Timing

FRAME = 'torso'
# What else a hand may be called: ns, text and id of its marker. It moves like a hand all the same.
STRANGE = (
    ('torso', '', 0),
    ('chest_camera', '', 3),
    ('chest', '', 7),
    ('things', 'rucksack on torso', 0),
    ('things', 'torso_strap', 1),
    ('things', 'ChestCamera', 2),
    ('', 'tool at the chest', 4),
    ('hands', 'on torso/chest', 5),
)
# What a tracker sends of a part that it does not see: a body without it, or that it is deleted.
LEFT_OUT, DELETED = 'left out', 'deleted'
# As long as `keep_lost` says what is deleted stays while a motion runs [s].
KEPT = 2.0


class MarkerEyes(Eyes):
    """
    The wearer as the planner knows him by arrays of markers without stamps.

    Parameters
    ----------
    called : tuple of (str, str, int)
        What a hand may be called; empty: what it is.
    unseen : str
        LEFT_OUT: each array begins with DELETEALL, as in `msg_examples/body.yaml`; or DELETED.

    """

    def __init__(
        self,
        names: tuple[str, ...],
        rows: Array,
        rng: np.random.Generator,
        *,
        called: tuple[tuple[str, str, int], ...] = (),
        unseen: str = LEFT_OUT,
        age: float = Timing().age,
    ) -> None:
        """Begin with nothing seen, and draw what hands are called."""
        super().__init__(names, rows, np.zeros(len(rows)))
        self._markers = [Marker(ns=name, text=name, type=Marker.CUBE) for name in names]
        if called and HAND in names:
            marker = self._markers[names.index(HAND)]
            marker.ns, marker.text, marker.id = called[rng.integers(len(called))]
        self._unseen, self._age, self._n = unseen, age, 0
        self._order, self._publishers = MarkerOrder(), BodyPublishers()
        self._known = WearerBody()

    def see(self, rows: Array, taken: float, seen: NDArray[np.bool_] | None = None) -> None:
        """Have a frame, as a message."""
        self._n += 1
        markers = [Marker(action=Marker.DELETEALL)] if self._unseen == LEFT_OUT else []
        everything = np.ones(len(rows), np.bool_)
        for marker, row, is_seen in zip(
            self._markers, rows, everything if seen is None else seen, strict=True
        ):
            marker.header.frame_id = FRAME
            marker.action = Marker.ADD if is_seen else Marker.DELETE
            p, o, s = marker.pose.position, marker.pose.orientation, marker.scale
            p.x, p.y, p.z = row[:SIZE].tolist()
            s.x, s.y, s.z = row[SIZE:ROTATION].tolist()
            o.x, o.y, o.z, o.w = quaternion_xyzw(row[ROTATION:].reshape(3, 3)).tolist()
            if is_seen or self._unseen == DELETED:
                markers.append(marker)
        now, sent = taken + self._age, (self._n, self._n)
        array = MarkerArray(markers=markers)
        edits = read_edits(array, now, FRAME, latency=self._age)
        self._known = self._order.apply(
            self._known,
            edits,
            sent,
            now,
            is_description=self._publishers.is_description(array, sent, now),
            keep_removed=KEPT,
        )

    def sight(self, time: float) -> Sight:
        """Return what is known of him at a time [s]."""
        body = self._known.at(time)
        parts = (*body.parts, *body.lost)
        return Sight(
            scene_of(body), np.array([part.measured for _, part in parts for _ in part.boxes])
        )


def trials() -> dict[str, Trial]:
    """Return the trials of the section by what they are called."""
    unseen = Faults(gone=math.inf)
    return {
        'hands with other names': Trial(
            shares=(1.0, 0.0, 0.0), eyes=partial(MarkerEyes, called=STRANGE)
        ),
        'the part left out of the body': Trial(faults=unseen, eyes=MarkerEyes),
        'the part deleted by name': Trial(faults=unseen, eyes=partial(MarkerEyes, unseen=DELETED)),
    }
