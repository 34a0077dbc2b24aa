# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Positions and velocities of an arm from joint states that may have other joints, too."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
import functools

import numpy as np
from rrth_planner.execution.standstill import mean_motion, TICK, WINDOW
from rrth_planner.model.arrays import Array, FARTHEST, frozen_array
from rrth_planner.model.errors import MessageError
from rrth_planner.model.trajectory import REST_SPEED
from rrth_planner.ros.messages.fields import seconds_of
from sensor_msgs.msg import JointState

# Greatest latency of a message; with a greater one its stamp is of another clock [s].
LONGEST_WAY = 1.0
# Positions that are older than this say nothing about the present velocity [s].
DIFFERENCE_AGE = 0.5


def has_joint_of(msg: JointState, joint_names: Sequence[str]) -> bool:
    """Return whether a message has any of these joints."""
    return not set(joint_names).isdisjoint(msg.name)


def configuration_from_msg(msg: JointState, joint_names: Sequence[str]) -> Array:
    """
    Return the positions of these joints, by name, shape (dof,) [rad]; others are ignored.

    Raises
    ------
    MessageError
        A joint that is missing or there twice, a position that is missing, not finite or beyond
        1e4.

    """
    names = list(msg.name)
    missing = [name for name in joint_names if name not in names]
    if missing:
        raise MessageError(f'name: no {missing} in {names}, expected all of {list(joint_names)}')
    twice = [name for name in joint_names if names.count(name) > 1]
    if twice:
        raise MessageError(f'name: {twice} twice in {names}, expected each joint once')
    if len(msg.position) != len(names):
        raise MessageError(
            f'position: {len(msg.position)} values for {len(names)} names, expected one a name '
            '[rad]'
        )
    q = [msg.position[names.index(name)] for name in joint_names]
    label = f'position of {list(joint_names)}'
    return frozen_array(q, (len(q),), label, 'rad', MessageError, FARTHEST)


def stamped_at(msg: JointState, received: float) -> float:
    """
    Return when a message was measured [s]: its stamp.

    Where that is not set or of the future, this is the reception.
    """
    stamp = seconds_of(msg.header.stamp)
    return stamp if 0.0 < stamp <= received else received


@dataclass(frozen=True, slots=True, eq=False)
class JointReading:
    """
    The state of the arm in one message.

    Parameters
    ----------
    positions, velocities : ndarray, shape (dof,)
        [rad, rad/s]; velocities as given, NaN included, or differences of the positions.
    taken, received : float
        Time of the measurement: the stamp if it is a little older than the reception, else the
        reception; and that [s].
    velocities_expire : float
        Until when the velocities count; inf: as long as the positions [s].
    recent : (ndarray, ndarray) or None
        `taken` of the readings of the last 0.3 s, this one last, (n,) [s], and their positions,
        (n, dof) [rad]; None: nothing is known of others.

    """

    positions: Array
    velocities: Array
    taken: float
    received: float
    velocities_expire: float
    recent: tuple[Array, Array] | None = None

    def is_moving(self, now: float, rest_speed: float = REST_SPEED) -> bool:
        """Return whether the arm moves at a time [s], faster than a speed [rad/s]."""
        is_slow = (np.abs(self.mean_velocities(rest_speed)) <= rest_speed).all()
        return now <= self.velocities_expire and not bool(is_slow)

    def mean_velocities(self, rest_speed: float = REST_SPEED) -> Array:
        """
        Return how fast the arm has moved lately, (dof,) [rad/s], to compare with a speed.

        By the positions, since drivers differentiate noisy ones; where these have not changed, or
        there are no others, as it was given.
        """
        motion = _mean_motion(self, rest_speed)
        return self.velocities if motion is None else motion[1]

    def mean_positions(self, rest_speed: float = REST_SPEED) -> Array:
        """Return where the arm is, (dof,) [rad], if it rests: the mean over the same time."""
        motion = _mean_motion(self, rest_speed)
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
def _mean_motion(reading: JointReading, rest_speed: float) -> tuple[Array, Array] | None:
    """Return mean positions and velocities; None where only the reading itself counts."""
    if reading.recent is None or not (reading.recent[1] != reading.positions).any():
        return None
    with np.errstate(over='ignore', invalid='ignore'):
        return mean_motion(*reading.recent, rest_speed)


def _with_earlier(q: Array, taken: float, before: JointReading | None) -> tuple[Array, Array]:
    """Return the times and positions of a reading and of those up to `WINDOW` before."""
    times, positions = np.array([taken]), q[None]
    if before is None or before.recent is None:
        return times, positions
    # After a step back of the clock, or of a stamp, there are none before.
    then, earlier = before.recent
    is_lately = (then >= taken - WINDOW - TICK) & (then < taken)
    return np.append(then[is_lately], times), np.concatenate([earlier[is_lately], positions])


def joint_reading(
    msg: JointState, joint_names: Sequence[str], received: float, before: JointReading | None
) -> JointReading:
    """
    Return the positions and velocities of these joints, by name; others are ignored.

    Of a message without velocities, received at a time [s], these are the change since the reading
    before.

    Raises
    ------
    MessageError
        As `configuration_from_msg`, or velocities of only some of the names.

    """
    q = configuration_from_msg(msg, joint_names)
    names, measured = list(msg.name), stamped_at(msg, received)
    taken = measured if received - measured <= LONGEST_WAY else received
    recent = _with_earlier(q, taken, before)
    if len(msg.velocity):
        if len(msg.velocity) != len(names):
            raise MessageError(
                f'velocity: {len(msg.velocity)} values for {len(names)} names, expected none or '
                'one a name [rad/s]'
            )
        v = np.array([msg.velocity[names.index(name)] for name in joint_names], dtype=np.float64)
        return JointReading(q, v, taken, received, float('inf'), recent)
    if before is None or received < before.received:
        # After a step back of the clock the elapsed time is unknown.
        return JointReading(q, np.zeros_like(q), taken, received, received, recent)
    step = max(received - before.received, 1e-9)
    # What overflows is infinite, and never at rest.
    with np.errstate(over='ignore'):
        v = (q - before.positions) / step
    return JointReading(q, v, taken, received, before.received + DIFFERENCE_AGE, recent)
