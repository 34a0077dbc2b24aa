# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
What was true of an arm beside a wearer in virtual time: contacts, by plain numpy.

It knows nothing of the proof, and has the wearer where he is, also where no tracker sees him.
"""

from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rrth_planner.collision.reference_checker import bar_box_contact, bar_radii, bars, protrusions
from rrth_planner.execution.decision import Command
from rrth_planner.kernels.layout import ROTATION, SIZE
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.separation import reach_at, reach_of
from rrth_planner.rehearsal.contacts import AT_REST, classes_of, distances_to, FAST, SLOW
from rrth_planner.rehearsal.ray_time import seconds_by_class
from rrth_planner.rehearsal.world import BEGIN, Wearer, World
from rrth_planner.simulation.trajectory_controller import ControllerState
from rrth_planner.wearer.hands import HANDS

# Instants that are judged at once, and those that wait for the wearer to have come so far.
CHUNK, HELD_BACK = 1000, 20
# Every so many half cycles the ray, and the nearest part, are looked at.
SPARSE = 4
# A ray crosses a part in motion where a joint is faster than that [rad/s].
MOVING = 0.01
# Parts that are further away are not measured; for pictures [m].
WITHIN, IN_PICTURES = 0.0, 0.6


@dataclass(slots=True)
class Testimony:
    """
    What was seen.

    Parameters
    ----------
    contacts : Counter
        By class, and by whether the part had got no further than is assumed of it since the
        wearer was seen whom the motion was proven with.
    sentences : list of str
        On contacts of the class FAST.
    ray : dict
        How long the pointing ray of an arm in motion crossed a part, by how that began [s].
    moving_seconds : float
        How long the arm was in motion [s].
    nearest : list of (float, float)
        When [s], how far the nearest part was [m]; for pictures.

    """

    contacts: Counter[tuple[str, bool]] = field(default_factory=Counter)
    sentences: list[str] = field(default_factory=list)
    ray: dict[str, float] = field(default_factory=dict)
    moving_seconds: float = 0.0
    nearest: list[tuple[float, float]] = field(default_factory=list)

    @property
    def ray_seconds(self) -> float:
        """How long the pointing ray of an arm in motion crossed a part [s]."""
        return sum(self.ray.values())


@dataclass(frozen=True, slots=True, eq=False)
class _Sight:
    scene: Scene
    taken: Array


_Sights = tuple[_Sight | None, _Sight | None]


class _Instant(NamedTuple):
    """The arm at a time [s], and the wearers whom what it executes was proven with."""

    time: float
    q: Array
    v: Array
    sights: _Sights


@dataclass(slots=True)
class _Contact:
    """The present contact of a bar with a box."""

    last: int
    word: str
    is_kept: bool


class Witness:
    """
    Sees each cycle of the controller, and judges.

    Parameters
    ----------
    truth : Wearer
        As he is; what a tracker sees of him is with the world.
    is_drawn : bool
        Whether to measure how far the nearest part is, too.
    flesh : Wearer, optional
        What the arm meets of him, in the same order, where that is not his boxes: hands as
        `wearer.hands.round_wrists` has them.

    """

    def __init__(
        self, world: World, truth: Wearer, is_drawn: bool = False, flesh: Wearer | None = None
    ) -> None:
        """Begin with nothing seen."""
        self.testimony = Testimony()
        self._world, self._truth, self._is_drawn = world, truth, is_drawn
        self._flesh = flesh
        self._hands = () if flesh is None else tuple(n for n in flesh.names if n in HANDS)
        # Of the ray at some instants: whether the arm moved, a part was crossed, and whether it
        # would have been had the wearer stood still since the one before; and the boxes then.
        self._rays: list[NDArray[np.bool_]] = []
        self._rows_before: Array | None = None
        separation = world.rules.execution.separation
        self._contact_speed = 0.1 if separation is None else separation.rules.contact_speed
        self._rules = None if separation is None else separation.rules
        self._sights: dict[int, tuple[Command, _Sight]] = {}
        self._active: _Sights = (None, None)
        self._arrived: Command | None = None
        self._seen: list[_Instant] = []
        self._n_judged = 0
        self._open: dict[tuple[int, int], _Contact] = {}
        world.on_setpoint, world.on_command = self._see, self._note

    def close(self) -> Testimony:
        """Judge what is left, and return all that was seen."""
        self._judge(len(self._seen))
        for key in tuple(self._open):
            self._end(key)
        if self._rays:
            period = SPARSE * self._world.arm.controller.period / 2
            is_moving, is_crossed, went_in = np.concatenate(self._rays, axis=1)
            self.testimony.ray = seconds_by_class(is_moving, is_crossed, went_in, period)
        return self.testimony

    def _note(self, command: Command) -> None:
        self._sights[id(command)] = command, _Sight(self._world.scene, self._world.taken)

    def _see(self, time: float, state: ControllerState) -> None:
        arrived = self._world.arrived
        if arrived is not self._arrived and arrived is not None:
            # Older ones have been overtaken.
            sight = self._sights.pop(id(arrived))[1]
            self._arrived, self._active = arrived, (sight, self._active[0])
        # The arm is there a lag after the setpoint is due.
        there = time + self._world.arm.lag_time
        self._seen.append(_Instant(there, state.positions, state.velocities, self._active))
        if len(self._seen) >= CHUNK + HELD_BACK:
            self._judge(CHUNK)

    def _judge(self, n: int) -> None:
        seen, self._seen = self._seen[:n], self._seen[n:]
        if not seen:
            return
        arm, names, found = self._world.rules.required.arm, self._truth.names, self.testimony
        # Between two cycles the arm moves along the line, and is judged in the middle, too.
        times, q, v = (_with_middles(np.array([one[k] for one in seen])) for k in range(3))
        rows = np.nan_to_num(np.array([self._truth.rows_at(time) for time in times]), nan=1e3)
        speed, flesh = self._contact_speed, rows
        if self._flesh is not None:
            at_times = np.array([self._flesh.rows_at(time) for time in times])
            flesh = np.nan_to_num(at_times, nan=1e3)
        distances = distances_to(arm, q, v, names, flesh, speed, WITHIN, self._hands)
        classes = classes_of(distances)
        for i, bar, box in np.argwhere(classes != ''):
            word, speed_there = str(classes[i, bar, box]), float(distances.speeds[i, bar, box])
            sights, at = seen[i // 2].sights, self._n_judged + int(i)
            row: Array = rows[i, box]
            self._meet(float(times[i]), sights, at, int(bar), int(box), word, speed_there, row)
        self._n_judged += len(times)
        for key, contact in tuple(self._open.items()):
            if contact.last < self._n_judged - 1:
                self._end(key)
        period = self._world.arm.controller.period / 2
        is_moving = np.asarray((np.abs(v) > MOVING).any(axis=1))
        found.moving_seconds += float(is_moving.sum()) * period
        few = slice(None, None, SPARSE)
        self._look_along(q[few], rows[few], is_moving[few])
        if self._is_drawn:
            near = distances_to(
                arm, q[few], v[few], names, flesh[few], speed, IN_PICTURES, self._hands
            )
            gaps = np.minimum(near.whole.min(axis=(1, 2)), IN_PICTURES)
            found.nearest += zip(times[few].tolist(), gaps.tolist(), strict=True)

    def _look_along(self, q: Array, rows: Array, is_moving: NDArray[np.bool_]) -> None:
        """Take note of what the ray crosses at some instants, (n, dof), (n, m, 15)."""
        arm, length = self._world.rules.required.arm, self._world.rules.required.ray_guard_length
        before = rows[:1] if self._rows_before is None else self._rows_before
        ray, radius = bars(arm, q, length)[:, -1], bar_radii(arm)[-1]
        self._rays.append(
            np.array(
                [
                    is_moving,
                    _crosses(ray, radius, rows),
                    _crosses(ray, radius, np.concatenate([before, rows[:-1]])),
                ]
            )
        )
        self._rows_before = rows[-1:]

    def _meet(
        self,
        time: float,
        sights: _Sights,
        at: int,
        bar: int,
        box: int,
        word: str,
        speed: float,
        row: Array,
    ) -> None:
        kept = any(self._has_kept(sight, box, row, time) for sight in sights if sight is not None)
        contact = self._open.get((bar, box))
        if contact is not None and contact.last < at - 1:
            self._end((bar, box))
            contact = None
        if contact is None:
            contact = self._open[bar, box] = _Contact(at, word, False)
        contact.last = at
        order = (FAST, SLOW, AT_REST)
        if order.index(word) < order.index(contact.word):
            contact.word, contact.is_kept = word, False
        if word == contact.word:
            contact.is_kept |= kept
        if word == FAST and kept:
            self.testimony.sentences.append(
                f'{time - BEGIN:.3f} s: bar {bar} at {speed:.2f} m/s and '
                f'"{self._truth.names[box]}", which got no further than assumed'
            )

    def _has_kept(self, sight: _Sight, box: int, row: Array, time: float) -> bool:
        """Return whether a part has got no further than assumed since it was seen."""
        name = self._truth.names[box]
        known = [one.name for one in sight.scene.boxes]
        if self._rules is None or name not in known:
            return False
        k = known.index(name)
        elapsed = np.maximum([time - float(sight.taken[k])], 0.0)
        furthest = reach_at(reach_of((name,), self._rules), elapsed)[0] + self._rules.body_error
        return bool(protrusions(sight.scene.boxes[k].numbers, row) <= furthest)

    def _end(self, key: tuple[int, int]) -> None:
        contact = self._open.pop(key)
        self.testimony.contacts[contact.word, contact.is_kept] += 1


def _crosses(ray: Array, radius: float, rows: Array) -> NDArray[np.bool_]:
    """Return whether rays (n, 2, 3) meet one of the boxes (n, m, 15) each, (n,)."""
    half = 0.5 * rows[:, :, SIZE:ROTATION] + radius
    turns = rows[:, :, ROTATION:].reshape(*rows.shape[:2], 3, 3)
    meets = bar_box_contact(ray[:, None], rows[:, :, None, :SIZE], turns, half)
    return np.asarray(meets.any(axis=1))


def _with_middles(values: Array) -> Array:
    """Return values, and the mean of each two neighbours between them, (n, ...) -> (2n-1, ...)."""
    found = np.empty((2 * len(values) - 1, *values.shape[1:]))
    found[::2], found[1::2] = values, 0.5 * (values[:-1] + values[1:])
    return found
