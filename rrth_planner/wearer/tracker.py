# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A tracker that sees a recorded person: what it measures, and when it publishes that."""

from dataclasses import dataclass, replace
import math

import numpy as np
from rrth_planner.model.errors import OptionsError
from rrth_planner.wearer.posture import Posture
from rrth_planner.wearer.recorded_person import posture_at, RecordedPerson


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracker:
    """
    A tracker with the faults of real ones; it measures at even times, the first at 0.

    Parameters
    ----------
    fps : float
        Measurements per second, > 0 [1/s].
    rate : float
        How fast the person moves: 1 as recorded, 0 not at all.
    latency : float
        From a measurement until it is published, >= 0 [s].
    drop : float
        Share of measurements that are never published, 0 to below 1.
    noise : float
        Standard deviation of each coordinate of each point, >= 0 [m].
    seed : int
        Of noise and dropped measurements, >= 0: the same are drawn again.

    Raises
    ------
    OptionsError
        A value outside its range.

    """

    fps: float = 60.0
    rate: float = 1.0
    latency: float = 0.0
    drop: float = 0.0
    noise: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate."""
        for name, is_good, expected in (
            ('fps', 0.0 < self.fps < math.inf, 'a number > 0 [1/s]'),
            ('rate', 0.0 <= self.rate < math.inf, 'a number >= 0'),
            ('latency', 0.0 <= self.latency < math.inf, 'a time >= 0 [s]'),
            ('drop', 0.0 <= self.drop < 1.0, 'a share from 0 to below 1'),
            ('noise', 0.0 <= self.noise < math.inf, 'a length >= 0 [m]'),
            ('seed', self.seed >= 0, 'a whole number >= 0'),
        ):
            if not is_good:
                raise OptionsError(f'{name}: {getattr(self, name)}, expected {expected}')


def measurement(tracker: Tracker, person: RecordedPerson, number: int) -> Posture | None:
    """Return what a tracker measures at `number / fps`, or None where that is dropped."""
    # Each measurement has its own, whichever others were asked for.
    rng = np.random.default_rng((tracker.seed, number))
    if rng.random() < tracker.drop:
        return None
    posture = posture_at(person, tracker.rate * number / tracker.fps)
    if tracker.noise == 0.0:
        return posture
    noise = rng.normal(scale=tracker.noise, size=posture.positions.shape)
    return replace(posture, positions=posture.positions + noise)


def newest_number(tracker: Tracker, time: float) -> int:
    """Return the number of the newest measurement that is published by a time [s]; -1: none."""
    # A measurement is due at its time, whatever is lost by rounding.
    return max(-1, math.floor((time - tracker.latency) * tracker.fps + 1e-9))


def publishing_time(tracker: Tracker, number: int) -> float:
    """Return when a measurement is published [s]."""
    return number / tracker.fps + tracker.latency
