# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Stops on a line: a jerk down to a deceleration, that held, and a jerk back to rest."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LineStops:
    """
    Stops of three phases, of constant jerk each, along a path.

    Parameters
    ----------
    delays : ndarray, shape (n,)
        When each begins [s].
    durations : ndarray, shape (n, 3)
        Of the phases [s]; NaN where there is no such stop.
    ways, speeds, slopes : ndarray, shape (n, 3)
        At the beginning of the phases [-, 1/s, 1/s^2].
    bends : ndarray, shape (n, 3)
        Jerks of the phases [1/s^3].

    """

    delays: Array
    durations: Array
    ways: Array
    speeds: Array
    slopes: Array
    bends: Array

    @property
    def ends(self) -> Array:
        """When they end, (n,) [s]."""
        return np.asarray(self.delays + self.durations.sum(axis=1))

    def chosen(self, which: NDArray[np.intp]) -> 'LineStops':
        """Return some of them."""
        return LineStops(**{part.name: getattr(self, part.name)[which] for part in fields(self)})

    def at(self, shares: Array) -> tuple[Array, ...]:
        """Return times, ways, speeds, slopes, bends at shares of each phase, (n, 3, m)."""
        t = self.durations[..., None] * shares
        begin = self.delays[:, None] + np.cumsum(self.durations, axis=1) - self.durations
        parts = (part[..., None] for part in (self.ways, self.speeds, self.slopes, self.bends))
        return begin[..., None] + t, *_cubic(t, *parts)

    def during(self, times: Array, middle: Array) -> tuple[Array, ...]:
        """Return ways, speeds, slopes, bends of the first one, in the phases of `middle`."""
        ends = self.delays[0] + np.cumsum(self.durations[0])
        p = np.searchsorted(ends[:2], middle)
        parts = (part[0, p] for part in (self.ways, self.speeds, self.slopes, self.bends))
        return _cubic(times - (ends - self.durations[0])[p], *parts)


def line_stops(
    delays: Array, state: tuple[Array, Array, Array], decelerations: Array, jerks: Array
) -> LineStops:
    """
    Return the soonest stops from some states with some greatest decelerations and some jerks.

    Parameters
    ----------
    delays : ndarray, shape (n,)
        When they begin [s].
    state : tuple of ndarray, each of shape (n,)
        Way, speed and its slope then [-, 1/s, 1/s^2].
    decelerations, jerks : ndarray, shape (n,)
        [1/s^2, 1/s^3].

    """
    x, v, a = state
    rho = jerks
    # Where the motion already slows down faster, the stop goes on from there.
    sigma = np.maximum(decelerations, -a)
    peak = np.minimum(np.sqrt(rho * v + 0.5 * a * a), sigma)
    ramp = (a + peak) / rho
    hold = np.maximum((v + (0.5 * a * a - peak * peak) / rho) / peak, 0.0)
    # Not where the jerk back to rest takes more speed than there is.
    is_real = (ramp >= 0.0) & (v >= 0.5 * a * np.minimum(a, 0.0) / rho)
    speed_1 = v + ramp * (a - 0.5 * rho * ramp)
    speed_2 = 0.5 * peak * peak / rho
    way_1 = x + ramp * (v + ramp * (0.5 * a - rho * ramp / 6.0))
    way_2 = way_1 + 0.5 * hold * (speed_1 + speed_2)
    return LineStops(
        delays=delays,
        durations=np.stack([np.where(is_real, ramp, np.nan), hold, peak / rho], axis=1),
        ways=np.stack([x, way_1, way_2], axis=1),
        speeds=np.stack([v, speed_1, speed_2], axis=1),
        slopes=np.stack([a, -peak, -peak], axis=1),
        bends=np.stack([-rho, np.zeros_like(v), rho], axis=1),
    )


def _cubic(t: Array, x: Array, v: Array, a: Array, j: Array) -> tuple[Array, ...]:
    """Return a way and its three derivatives after a time."""
    return (
        x + t * (v + t * (0.5 * a + t * j / 6.0)),
        v + t * (a + 0.5 * t * j),
        a + t * j,
        j + 0.0 * t,
    )
