# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A clearance violation, and the disagreement of the two collision checks about a motion."""

from dataclasses import dataclass

from rrth_planner.model.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class Violation:
    """
    Where a trajectory comes closer to the wearer than the margin, or the arm collides with itself.

    When [s], the distance from the body itself or the other part of the arm [m], which part of the
    arm, and which box or part.
    """

    time: float
    distance: float
    bar: str
    box: str
    is_of_arm: bool = False

    @property
    def other(self) -> str:
        """What the part of the arm is too near to, for messages."""
        return self.box if self.is_of_arm else f'box "{self.box}"'


@dataclass(frozen=True, slots=True, eq=False)
class Disagreement:
    """
    A certified motion in which the second checker finds a clearance violation, here the first one.

    It is never published. Until `escape_time` it escapes from boxes that the arm was in [s].
    """

    trajectory: Trajectory
    violation: Violation
    escape_time: float = 0.0

    def sentence(self, margin: float) -> str:
        """Return a sentence about it, for the demanded margin [m]."""
        violation = self.violation
        expected = f'expected at least {0.0 if violation.is_of_arm else margin:g} m'
        if violation.time < self.escape_time and not violation.is_of_arm:
            expected = 'during the escape, expected no penetration deeper than at the start'
        return (
            f'the two collision checks disagree: {violation.bar} is {violation.distance:.4f} m '
            f'from {violation.other} at {violation.time:.3f} s, {expected}'
        )
