# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""People beside an arm in virtual time: a recorded one, and one whose hand goes for the arm."""

from collections.abc import Sequence
import math

import numpy as np
from rrth_planner.model.arm import ArmModel, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RecordError, SceneError
from rrth_planner.model.scene import Box, Scene
from rrth_planner.rehearsal.world import BEGIN
from rrth_planner.wearer.body_boxes import rows_of_postures
from rrth_planner.wearer.recorded_person import postures_at, RecordedPerson
from rrth_planner.wearer.skeleton import Skeleton

# A recorded person is seen, and judged, at instants so far apart: a multiple of them is the period
# of trackers with 30, 60 and 120 frames a second, and that of a controller with 200 Hz [s].
INSTANT = 1 / 600
# His boxes are found at so many of them at once.
BLOCK = 120
# A hand that goes for the arm looks so often where that is [s].
HAND_PERIOD = 0.02
# How large it is [m].
HAND = (0.1, 0.1, 0.2)


class RecordedWearer:
    """
    A recorded person, played forwards and backwards, on and on.

    Parameters
    ----------
    rate : float
        How fast he is played, of 1.
    begin : float
        Where in the recording it begins: what comes before is not played [s].

    Raises
    ------
    RecordError
        No part of him is seen at the beginning, or nothing is left of the recording.

    """

    def __init__(
        self, person: RecordedPerson, skeleton: Skeleton, rate: float = 1.0, begin: float = 0.0
    ) -> None:
        """Begin at `BEGIN`."""
        self._person, self._skeleton = person, skeleton
        self._rate, self._first = rate, begin
        # The way there and back is a whole number of instants.
        self._n = int((person.duration - begin) / (rate * INSTANT))
        if self._n < 1:
            raise RecordError(
                f'begin: {begin:g}, expected less than the recording lasts, '
                f'{person.duration:.3f} [s]'
            )
        is_seen = np.isfinite(self._found(0, 1)[0].sum(axis=1))
        if not is_seen.any():
            raise RecordError(f'no part of the person is seen {begin:g} s after its beginning')
        self._parts = np.flatnonzero(is_seen)
        self.names = tuple(skeleton.parts[k].name for k in self._parts)
        self._rows = np.full((self._n + 1, len(self.names), 15), np.nan)
        self._is_known = [False] * (self._n // BLOCK + 1)

    def rows_at(self, time: float) -> Array:
        """Return his boxes at the instant next to a time [s], (m, 15); NaN: a lost part."""
        k = max(0, round((time - BEGIN) / INSTANT)) % (2 * self._n)
        k = self._n - abs(k - self._n)
        block = k // BLOCK
        if not self._is_known[block]:
            first = block * BLOCK
            found = self._found(first, min(first + BLOCK, self._n + 1))
            self._rows[first : first + len(found)] = found[:, self._parts]
            self._is_known[block] = True
        rows: Array = self._rows[k]
        return rows

    def _found(self, first: int, end: int) -> Array:
        """Return the boxes of all parts at some instants, (end - first, n_parts, 15)."""
        k = np.arange(first, end, dtype=np.float64)
        times: Array = self._first + k * INSTANT * self._rate
        postures = postures_at(self._person, times)
        return rows_of_postures(self._skeleton, self._person.names, *postures)


class InterceptingWearer:
    """
    Somebody who stands still but for one hand, which goes for the tool of the arm.

    Parameters
    ----------
    scene : Scene
        All of him but that hand.
    hand : str
        What it is called.
    home : (float, float, float)
        Where it rests [m].
    speed : float
        Its [m/s].
    waits, pursues : float
        How long it rests where it is at first, and how long it goes for the arm then, again and
        again [s].

    """

    def __init__(
        self,
        scene: Scene,
        hand: str,
        home: tuple[float, float, float],
        speed: float,
        waits: float,
        pursues: float,
    ) -> None:
        """Begin at rest."""
        whole = Scene((*scene.boxes, Box(hand, np.array(home), np.array(HAND), np.eye(3))))
        self.names = tuple(box.name for box in whole.boxes)
        self._rows, self._home = whole.numbers.copy(), np.array(home)
        self._speed, self._waits, self._pursues = speed, waits, pursues
        self._times, self._places = [BEGIN], [self._home]

    def advance(self, time: float, arm: ArmModel, q: Array) -> None:
        """Let the hand go on from a time until it looks again, with the arm at q, (dof,)."""
        if time < self._times[-1] - 1e-9:
            return
        place = self._places[-1]
        is_pursuing = (time - BEGIN) % (self._waits + self._pursues) > self._waits
        goal = tool_pose(arm, q)[:3, 3] if is_pursuing else self._home
        way = goal - place
        length = float(np.linalg.norm(way))
        step = min(length, self._speed * HAND_PERIOD)
        self._times.append(time + HAND_PERIOD)
        self._places.append(place if length < 1e-12 else place + step / length * way)

    def rows_at(self, time: float) -> Array:
        """Return his boxes at a time that was advanced to [s], (m, 15)."""
        rows = self._rows.copy()
        k = int(np.searchsorted(self._times, time))
        if k == 0 or k >= len(self._times):
            rows[-1, :3] = self._places[min(k, len(self._places) - 1)]
            return rows
        begin, end = self._times[k - 1], self._times[k]
        share = (time - begin) / (end - begin)
        rows[-1, :3] = (1.0 - share) * self._places[k - 1] + share * self._places[k]
        return rows


class Hidden:
    """
    Somebody as a tracker sees him that loses parts.

    Parameters
    ----------
    losses : sequence of (str, float, float)
        Which part is lost from when to when, after the begin [s].

    """

    def __init__(
        self,
        wearer: 'RecordedWearer | InterceptingWearer',
        losses: Sequence[tuple[str, float, float]],
    ) -> None:
        """Hide what is lost."""
        self.names, self._wearer = wearer.names, wearer
        for name, _, _ in losses:
            if name not in self.names:
                raise SceneError(f'loses: "{name}", expected one of {", ".join(self.names)}')
        self._losses = [(self.names.index(name), begin, end) for name, begin, end in losses]

    def rows_at(self, time: float) -> Array:
        """Return his boxes at a time [s], (m, 15); NaN: a part that is lost."""
        lost = [k for k, begin, end in self._losses if begin <= time - BEGIN < end]
        rows = self._wearer.rows_at(time)
        if lost:
            rows = rows.copy()
            rows[lost] = math.nan
        return rows
