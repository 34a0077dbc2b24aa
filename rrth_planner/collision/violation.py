# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A clearance violation, and the disagreement of the two collision checks about a motion."""

from dataclasses import dataclass

from rrth_planner.model.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class Violation:
    """
    Where a trajectory comes closer to the wearer than the margin.

    Parameters
    ----------
    time : float
        [s].
    distance : float
        From the body itself [m].
    bar, box : str
        Which part of the arm, which box.

    """

    time: float
    distance: float
    bar: str
    box: str


@dataclass(frozen=True, slots=True, eq=False)
class Disagreement:
    """
    A certified motion in which python-fcl finds a clearance violation.

    Parameters
    ----------
    trajectory : Trajectory
        Never published.
    violation : Violation
        The first one that python-fcl found.
    escape_time : float
        Until then the motion escapes from boxes that the arm was in [s].

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
