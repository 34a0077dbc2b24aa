# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How fast a motion is passed through until it stands still."""

from dataclasses import dataclass, field

import numpy as np
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import RrthError

# By how much rate and slope may miss 0 at the end; by how much the rate may be below 0 [-].
REST, ROUNDING = 1e-7, 1e-9
# Steps to the time of a way: enough where the rate is 0 at the end.
NEWTON = 25
# How closely a way is met [s].
ENOUGH = 1e-13


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RateProfile:
    """
    A rate that begins with 1 and ends with 0; its bend is a straight line between two corners.

    So the time within the motion is a quartic there, with two continuous derivatives everywhere,
    whatever the bends are: a profile changes when the arm is where, but never where it goes.

    Parameters
    ----------
    times : array_like, shape (n + 1,)
        Corners, from 0, strictly increasing [s].
    bends : array_like, shape (n, 2)
        Second derivative of the rate, at the beginning and the end of each interval [1/s^2].

    Raises
    ------
    RrthError
        Numbers that do not end with the rate and its slope 0.

    """

    times: Array
    bends: Array

    slopes: Array = field(init=False)
    rates: Array = field(init=False)
    ways: Array = field(init=False)

    def __post_init__(self) -> None:
        """Validate, freeze, and integrate up to each corner."""
        times = frozen_array(self.times, (None,), 'times', 's', RrthError)
        bends = frozen_array(self.bends, (len(times) - 1, 2), 'bends', '1/s^2', RrthError)
        if len(times) < 2 or times[0] != 0.0 or not (np.diff(times) > 0.0).all():
            raise RrthError('times: expected at least two, from 0, strictly increasing [s]')
        slopes, rates, ways = integrated(times, bends)
        if not max(abs(rates[-1]), abs(slopes[-1] * times[-1])) <= REST:
            raise RrthError(
                f'bends: a last rate of {rates[-1]} with a slope of {slopes[-1]}, expected 0 [-] '
                'and 0 [1/s]'
            )
        values = {'times': times, 'bends': bends, 'slopes': slopes, 'rates': rates, 'ways': ways}
        for name, value in values.items():
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def is_forward(self) -> bool:
        """Whether the rate is nowhere below 0, by more than rounding."""
        r, third = self.rates, np.diff(self.times) / 3.0
        # Its Bernstein coefficients in each interval.
        inner = np.minimum(r[:-1] + third * self.slopes[:-1], r[1:] - third * self.slopes[1:])
        return bool(min(r.min(), inner.min()) >= -ROUNDING)

    @property
    def duration(self) -> float:
        """When the rate is 0 [s]."""
        return float(self.times[-1])

    def at(self, times: Array) -> tuple[Array, Array, Array, Array]:
        """
        Return the rate's integral [s], the rate [-], its slope [1/s] and bend [1/s^2] at times.

        Before 0 the rate is 1, after the end it is 0.
        """
        i = np.searchsorted(self.times[1:-1], times, side='right')
        begin = self.times[i]
        b = self.bends[i, 0]
        c = (self.bends[i, 1] - b) / (self.times[i + 1] - begin)
        dt = np.clip(times, 0.0, self.times[-1]) - begin
        r, w = self.rates[i], self.slopes[i]
        is_inside = (times > 0.0) & (times < self.times[-1])
        return (
            self.ways[i]
            + dt * (r + dt * (w / 2.0 + dt * (b / 6.0 + dt * c / 24.0)))
            + np.minimum(times, 0.0),
            np.where(
                is_inside, r + dt * (w + dt * (b / 2.0 + dt * c / 6.0)), 1.0 * (times <= 0.0)
            ),
            np.where(is_inside, w + dt * (b + dt * c / 2.0), 0.0),
            np.where(is_inside, b + dt * c, 0.0),
        )

    def times_of(self, ways: Array) -> Array:
        """Return when it has come so far [s], for those ways that it passes, (m,) -> (k,)."""
        ways = ways[(ways > 0.0) & (ways < self.ways[-1])]
        i = np.clip(np.searchsorted(self.ways, ways, side='right') - 1, 0, len(self.times) - 2)
        low, high = self.times[i], self.times[i + 1]
        time = 0.5 * (low + high)
        # Newton's steps, within what is known: the way does not decrease.
        for _ in range(NEWTON if len(ways) else 0):
            way, rate, _, _ = self.at(time)
            low, high = np.where(way < ways, time, low), np.where(way < ways, high, time)
            time = time + (ways - way) / np.maximum(rate, ROUNDING)
            time = np.where((time >= low) & (time <= high), time, 0.5 * (low + high))
            if np.abs(ways - way).max() < ENOUGH:
                break
        return time


def integrated(times: Array, bends: Array) -> tuple[Array, Array, Array]:
    """Return slopes, rates and ways at corners, (n + 1,), from bends between them, (n, 2)."""
    step, b0, b1 = np.diff(times), bends[:, 0], bends[:, 1]
    slopes = np.append(0.0, np.cumsum(step * (b0 + b1) / 2.0))
    w = slopes[:-1]
    rates = np.append(1.0, 1.0 + np.cumsum(step * w + step**2 * (2.0 * b0 + b1) / 6.0))
    pieces = step * rates[:-1] + step**2 * w / 2.0 + step**3 * (3.0 * b0 + b1) / 24.0
    return slopes, rates, np.append(0.0, np.cumsum(pieces))
