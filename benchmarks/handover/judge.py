# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The commands of a controller, cycle by cycle, by what replaced what."""

from dataclasses import dataclass, field
import math

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import MotionLimits

# What a message is.
HANDOVER, EXTENSION, STOP, BEGIN = 'handover', 'extension', 'stop', 'begin'
# A command may differ from what the message before commands for the same instant by so much [rad].
MOST_APART = 1e-4
# Speeds and accelerations may exceed the limits by this factor: 1 %, and what the rounding of a
# stamp to a whole nanosecond makes of a second difference at 1 kHz.
MOST_FAST = 1.0105


@dataclass(slots=True)
class Join:
    """
    A message that replaced another one in a controller.

    Parameters
    ----------
    kind : str
    apart : float
        How far its first command is from what the message before commands for that instant [rad].
    velocity, acceleration : float
        Greatest of the commands from then on until the next message, as shares of the limits, by
        first and second differences of the commands.

    """

    kind: str
    apart: float
    velocity: float = 0.0
    acceleration: float = 0.0

    @property
    def is_good(self) -> bool:
        """Whether nothing of it is beyond what is allowed."""
        fastest = max(self.velocity, self.acceleration)
        return self.apart <= MOST_APART and fastest <= MOST_FAST


@dataclass(slots=True, eq=False)
class Judge:
    """
    Looks at each command as it is given.

    Differences are taken between the very commands, over one cycle each: of a curve within its
    limits none exceeds them, by the mean value theorem, and a step of d shows as d / period^2. In
    doubles of some rad that is exact to 1e-9 rad/s^2 at 1 kHz.

    Parameters
    ----------
    joins : list of Join
        What was seen.

    """

    period: float
    limits: MotionLimits
    joins: list[Join] = field(default_factory=list)
    _last: list[Array] = field(default_factory=list)

    def replaced(self, kind: str, command: Array, former: Array) -> None:
        """Take note of a message, by its first command and that of the one before, (dof,)."""
        self.joins.append(Join(kind, float(np.abs(command - former).max())))

    def commanded(self, command: Array) -> None:
        """Take note of a command, (dof,) [rad]."""
        self._last = [*self._last[-2:], command]
        if not self.joins:
            return
        join = self.joins[-1]
        for order, name, limit in (
            (1, 'velocity', self.limits.velocity),
            (2, 'acceleration', self.limits.acceleration),
        ):
            if len(self._last) > order:
                steps = np.diff(self._last[-1 - order :], order, axis=0)[0]
                share = float((np.abs(steps) / self.period**order / limit).max())
                setattr(join, name, max(getattr(join, name), share))


@dataclass(slots=True)
class Sum:
    """
    What was seen of many joins.

    Parameters
    ----------
    counts : dict of str to int
        By kind.
    apart, velocity, acceleration : float
        Greatest ones.
    n_apart, n_fast : int
        How many are beyond what is allowed, by their place, and by speed or acceleration.

    """

    counts: dict[str, int] = field(default_factory=dict)
    apart: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0
    n_apart: int = 0
    n_fast: int = 0

    @property
    def n(self) -> int:
        """All of them but the ones from rest."""
        return sum(n for kind, n in self.counts.items() if kind != BEGIN)


def summed(joins: list[Join]) -> Sum:
    """Return what was seen of joins."""
    total = Sum()
    for join in joins:
        total.counts[join.kind] = total.counts.get(join.kind, 0) + 1
        for name in ('apart', 'velocity', 'acceleration'):
            setattr(total, name, max(getattr(total, name), getattr(join, name)))
        total.n_apart += not join.apart <= MOST_APART
        fastest = max(join.velocity, join.acceleration)
        total.n_fast += not fastest <= MOST_FAST or math.isnan(fastest)
    return total
