# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where the arm is, and whether it moves, by one reading and those shortly before it."""

from dataclasses import dataclass, replace
import functools

import numpy as np
from rrth_planner.execution.standstill import mean_motion, TICK, WINDOW
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import REST_SPEED


@dataclass(frozen=True, slots=True, eq=False)
class JointReading:
    """
    The state of the arm at one time.

    Parameters
    ----------
    positions, velocities : ndarray, shape (dof,)
        [rad, rad/s]; velocities as given, NaN included, or differences of the positions. Those of
        joints that a driver reports wrapped go on beyond its range.
    taken, received : float
        Time of the measurement: the stamp if it is a little older than the reception, else the
        reception; and that [s].
    velocities_expire : float
        Until when the velocities count; inf: as long as the positions [s].
    recent : (ndarray, ndarray) or None
        `taken` of the readings of the last 0.3 s, this one last, (n,) [s], and their positions,
        (n, dof) [rad]; None: nothing is known of others.
    wound : ndarray, shape (dof,), or None
        What is added to the positions of the message: whole turns [rad]; None: nothing.
    rest_speed : float
        The arm rests where no joint is faster [rad/s, of a joint that slides m/s].

    """

    positions: Array
    velocities: Array
    taken: float
    received: float
    velocities_expire: float
    recent: tuple[Array, Array] | None = None
    wound: Array | None = None
    rest_speed: float = REST_SPEED

    def is_moving(self, now: float, speed: float | None = None) -> bool:
        """
        Return whether the arm moves at a time [s]; where it does not it rests.

        speed: in place of `rest_speed`, for the mean over the same time. An arm whose velocities
        have expired by then rests.
        """
        greatest = self.rest_speed if speed is None else speed
        is_slow = (np.abs(self.mean_velocities()) <= greatest).all()
        return now <= self.velocities_expire and not bool(is_slow)

    def rests_after(self, time: float) -> bool:
        """Return whether the arm rested at this reading, which came after a time [s]."""
        return self.received >= time and not self.is_moving(self.taken)

    def mean_velocities(self) -> Array:
        """
        Return how fast the arm has moved lately, (dof,) [rad/s], to compare with `rest_speed`.

        By the positions, since drivers differentiate noisy ones; where these have not changed, or
        there are no others, as it was given.
        """
        motion = _mean_motion(self)
        return self.velocities if motion is None else motion[1]

    def mean_positions(self) -> Array:
        """Return where the arm is, (dof,) [rad], if it rests: the mean over the same time."""
        motion = _mean_motion(self)
        return self.positions if motion is None else motion[0]

    def shifted(self, step: float) -> 'JointReading':
        """Return the reading by a clock that was set forward by a step [s]."""
        recent = None if self.recent is None else (self.recent[0] + step, self.recent[1])
        return replace(
            self,
            taken=self.taken + step,
            received=self.received + step,
            velocities_expire=self.velocities_expire + step,
            recent=recent,
        )


@functools.lru_cache(maxsize=8)
def _mean_motion(reading: JointReading) -> tuple[Array, Array] | None:
    """Return mean positions and velocities; None where only the reading itself counts."""
    if reading.recent is None or not (reading.recent[1] != reading.positions).any():
        return None
    with np.errstate(over='ignore', invalid='ignore'):
        return mean_motion(*reading.recent, reading.rest_speed)


def with_earlier(q: Array, taken: float, before: JointReading | None) -> tuple[Array, Array]:
    """
    Return the times, (n,) [s], and positions, (n, dof) [rad], of a reading and those just before.

    q, (dof,), was read at a time [s]; before: the reading before it.
    """
    times, positions = np.array([taken]), q[None]
    if before is None or before.recent is None:
        return times, positions
    # After a step back of the clock, or of a stamp, there are none before.
    then, earlier = before.recent
    is_lately = (then >= taken - WINDOW - TICK) & (then < taken)
    return np.append(then[is_lately], times), np.concatenate([earlier[is_lately], positions])
