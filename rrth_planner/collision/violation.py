# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the second judge may say against a motion that the first one has proven."""

from dataclasses import dataclass

from rrth_planner.model.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class Violation:
    """
    Where a trajectory comes nearer to the wearer than the margin.

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
    A motion that is proven free by the certificate and touches for python-fcl.

    Parameters
    ----------
    trajectory : Trajectory
        Never published.
    touch : Violation
        What python-fcl saw first.
    escape_time : float
        Until then the motion leads out of boxes that the arm was in [s].

    """

    trajectory: Trajectory
    touch: Violation
    escape_time: float = 0.0

    def sentence(self, margin: float) -> str:
        """Return what to say of it, for the margin that was to be kept [m]."""
        touch = self.touch
        expected = f'expected at least {margin:g} m'
        if touch.time < self.escape_time:
            expected = 'on the way out of the wearer; expected no part deeper than at the start'
        return (
            f'the two collision checks disagree: {touch.bar} is {touch.distance:.4f} m from box '
            f'"{touch.box}" at {touch.time:.3f} s, {expected}'
        )
