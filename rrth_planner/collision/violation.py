# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A clearance violation, and the disagreement of the two collision checks about a motion."""

from dataclasses import dataclass

from rrth_planner.model.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class Violation:
    """
    Where a trajectory comes closer to the wearer than the margin.

    When [s], the distance from the body itself [m], which part of the arm, and which box.
    """

    time: float
    distance: float
    bar: str
    box: str


@dataclass(frozen=True, slots=True, eq=False)
class Disagreement:
    """
    A certified motion in which python-fcl finds a clearance violation, here the first one.

    It is never published. Until `escape_time` it escapes from boxes that the arm was in [s].
    """

    trajectory: Trajectory
    violation: Violation
    escape_time: float = 0.0

    def sentence(self, margin: float) -> str:
        """Return a sentence about it, for the demanded margin [m]."""
        violation = self.violation
        expected = f'expected at least {margin:g} m'
        if violation.time < self.escape_time:
            expected = 'during the escape, expected no penetration deeper than at the start'
        return (
            f'the two collision checks disagree: {violation.bar} is {violation.distance:.4f} m '
            f'from box "{violation.box}" at {violation.time:.3f} s, {expected}'
        )
