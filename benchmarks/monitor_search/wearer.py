# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whom the arm is beside: a torso that stands, hands that wander, and that reach for the arm."""

from bisect import bisect_right
from collections.abc import Callable

import numpy as np
from rrth_planner.kernels.layout import SIZE
from rrth_planner.model.arrays import Array
from rrth_planner.rehearsal.world import BEGIN

# Where hands wander: from, to [m]; how fast, of what is stated [m/s].
PLACES = np.array([[-0.2, -0.7, -0.2], [0.9, 0.7, 1.0]])
SPEEDS = (0.2, 1.95)
HAND = np.array([0.1, 0.1, 0.2])
TORSO = np.array([0.3, 0.4, 0.6]), np.array([0.35, 0.0, -0.3])
# The share of ways that lead to the arm, and that end with a rest [-]; how long that lasts [s].
REACHES, RESTS, REST = 0.6, 0.3, 1.0
AWAY = np.array([4.0, 4.0, 0.0])
# How far from the arm hands of others are where they are seen for the first time [m].
FIRST_SEEN = (0.8, 1.4)


class Hand:
    """
    A box that goes from place to place.

    Parameters
    ----------
    aim : callable
        Returns where the arm can be met after a time [s], (3,) [m].

    """

    def __init__(
        self, rng: np.random.Generator, place: Array, aim: Callable[[float], Array]
    ) -> None:
        """Begin at a place, (3,) [m]."""
        self._rng, self._aim = rng, aim
        self._times, self._places = [BEGIN], [place]

    def go_on(self, now: float) -> None:
        """Set out again where the last way has ended [s]."""
        rng = self._rng
        while self._times[-1] <= now:
            speed = float(rng.uniform(*SPEEDS))
            if rng.random() < REACHES:
                self._reach(now, SPEEDS[1] if rng.random() < 0.5 else speed)
            else:
                self._go(now, rng.uniform(*PLACES), speed)
            if rng.random() < RESTS:
                self._go(self._times[-1] + float(rng.uniform(0.0, REST)), self._places[-1], 1.0)

    def leave(self, now: float) -> None:
        """Go away from here on [s]."""
        place = self.place_at(now)
        while self._times[-1] > now:
            self._times.pop()
            self._places.pop()
        self._times.append(now)
        self._places.append(place)
        self._go(now, AWAY, SPEEDS[1])
        self._go(now + 1e6, AWAY, 1.0)

    def place_at(self, time: float) -> Array:
        """Return where it is, or was [s], (3,) [m]."""
        times, places = self._times, self._places
        k = bisect_right(times, time)
        if k in (0, len(times)):
            return places[max(k - 1, 0)]
        velocity = (places[k] - places[k - 1]) / (times[k] - times[k - 1])
        place: Array = velocity * (time - times[k - 1]) + places[k - 1]
        return place

    def _reach(self, now: float, speed: float) -> None:
        """Go where the arm will be, and a little further."""
        here, flight = self._places[-1], 0.0
        for _ in range(3):
            goal = self._aim(flight)
            flight = float(np.linalg.norm(goal - here)) / speed
        self._go(now, here + 1.1 * (goal - here), speed)

    def _go(self, now: float, place: Array, speed: float) -> None:
        begin = max(self._times[-1], now)
        if begin > self._times[-1]:
            self._times.append(begin)
            self._places.append(self._places[-1])
        way = float(np.linalg.norm(place - self._places[-1]))
        self._times.append(begin + max(way / speed, 1e-3))
        self._places.append(place)


class Person:
    """
    A torso that stands, a hand, and hands of others that come in later.

    They stay for a moment, as one that came from behind a curtain; then they go.
    """

    names = ('torso', 'hand', *(f'hand of another {k}' for k in range(1, 4)))

    def __init__(self, rng: np.random.Generator, aim: Callable[[float], Array]) -> None:
        """Place the hands, those of others further away."""
        self.hand = Hand(rng, rng.uniform(*PLACES), aim)
        self.others = []
        for _ in self.names[2:]:
            direction = rng.normal(size=3)
            direction[0] = abs(direction[0])
            far = float(rng.uniform(*FIRST_SEEN)) * direction / np.linalg.norm(direction)
            self.others.append(Hand(rng, far, aim))
        size, place = TORSO
        turn = np.eye(3).ravel()
        hands = [np.concatenate([AWAY, HAND, turn])] * (len(self.names) - 1)
        self._rows = np.array([np.concatenate([place, size, turn]), *hands])

    def rows_at(self, time: float) -> Array:
        """Return torso and hands at a time [s], (5, 15)."""
        rows = self._rows.copy()
        for row, hand in zip(rows[1:], (self.hand, *self.others), strict=True):
            row[:SIZE] = hand.place_at(time)
        return rows
