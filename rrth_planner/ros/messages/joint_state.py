# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Positions and velocities of an arm from joint states that may have other joints, too."""

from collections.abc import Sequence
import math

import numpy as np
from rrth_planner.execution.joint_reading import JointReading, with_earlier
from rrth_planner.model.arrays import Array, FARTHEST, frozen_array
from rrth_planner.model.errors import MessageError
from rrth_planner.model.trajectory import REST_SPEED
from rrth_planner.ros.messages.fields import seconds_of
from sensor_msgs.msg import JointState

# Greatest latency of a message; with a greater one its stamp is of another clock [s].
LONGEST_WAY = 1.0
# Positions that are older than this say nothing about the present velocity [s].
DIFFERENCE_AGE = 0.5
# Ranges in which drivers that wrap report positions, and how far noise gets beyond [rad].
WRAPPED, NOISE = ((-math.pi, math.pi), (0.0, math.tau)), 0.1


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


def gaps_between(q: Array, other: Array) -> Array:
    """Return how far joints are apart, whole turns aside: drivers may wrap, (dof,) [rad]."""
    gaps = q - other
    apart: Array = np.abs(gaps - math.tau * np.round(gaps / math.tau))
    return apart


def stamped_at(msg: JointState, received: float) -> float:
    """
    Return when a message was measured [s]: its stamp.

    Where that is not set or of the future, this is the reception.
    """
    stamp = seconds_of(msg.header.stamp)
    return stamp if 0.0 < stamp <= received else received


def _wound(
    q: Array, is_continuous: Sequence[bool], received: float, before: JointReading | None
) -> Array | None:
    """
    Return the turns that a driver that wraps leaves out, (dof,) [rad], or None.

    From one reading to the next within the range of such a driver, a joint that jumps by more than
    half a turn has gone on beyond the end of that range. After a while without readings this holds
    only of joints that have done so before: a driver that counts turns may have been started
    again, and to what it then reports all commands refer.
    """
    if before is None or not any(is_continuous):
        return None
    wound = np.zeros(len(q)) if before.wound is None else before.wound
    last = before.positions - wound
    jumps = math.tau * np.round((q - last) / math.tau)
    pair = np.array([q, last])
    is_wrapped = np.array(is_continuous) & np.any(
        [((pair >= low - NOISE) & (pair <= high + NOISE)).all(axis=0) for low, high in WRAPPED],
        axis=0,
    )
    if not 0.0 <= received - before.received <= DIFFERENCE_AGE:
        is_wrapped &= (wound != 0.0) | (jumps == 0.0)
    # Whoever reports more than a turn does not wrap.
    wound = np.where(is_wrapped, wound - jumps, 0.0)
    return wound if wound.any() else None


def joint_reading(
    msg: JointState,
    joint_names: Sequence[str],
    received: float,
    before: JointReading | None,
    is_continuous: Sequence[bool] = (),
    rest_speed: float = REST_SPEED,
) -> JointReading:
    """
    Return the positions and velocities of these joints, by name; others are ignored.

    Of a message without velocities, received at a time [s], these are the change since the reading
    before. Positions of continuous joints that a driver reports wrapped, from -pi to pi or from 0
    to 2 pi, go on from those of that reading. The arm rests where no joint is faster than
    `rest_speed` [rad/s, of a joint that slides m/s].

    Raises
    ------
    MessageError
        As `configuration_from_msg`, or velocities of only some of the names.

    """
    q = configuration_from_msg(msg, joint_names)
    wound = _wound(q, is_continuous, received, before)
    if wound is not None:
        q = q + wound
        q.setflags(write=False)
    names, measured = list(msg.name), stamped_at(msg, received)
    taken = measured if received - measured <= LONGEST_WAY else received
    recent = with_earlier(q, taken, before)
    if len(msg.velocity):
        if len(msg.velocity) != len(names):
            raise MessageError(
                f'velocity: {len(msg.velocity)} values for {len(names)} names, expected none or '
                'one a name [rad/s]'
            )
        v = np.array([msg.velocity[names.index(name)] for name in joint_names], dtype=np.float64)
        return JointReading(q, v, taken, received, math.inf, recent, wound, rest_speed)
    if before is None or received < before.received:
        # After a step back of the clock the elapsed time is unknown.
        v = np.zeros_like(q)
        return JointReading(q, v, taken, received, received, recent, wound, rest_speed)
    step = max(received - before.received, 1e-9)
    # What overflows is infinite, and never at rest.
    with np.errstate(over='ignore'):
        v = (q - before.positions) / step
    until = before.received + DIFFERENCE_AGE
    return JointReading(q, v, taken, received, until, recent, wound, rest_speed)
