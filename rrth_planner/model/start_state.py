# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How an arm moves where a motion begins."""

from dataclasses import dataclass

from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import Trajectory


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MotionState:
    """
    Where the arm is and how it moves.

    Parameters
    ----------
    positions, velocities, accelerations : ndarray, shape (dof,)
        [rad, rad/s, rad/s^2].

    """

    positions: Array
    velocities: Array
    accelerations: Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StartState:
    """
    What an arm that moves does when a motion takes over from its present one.

    Parameters
    ----------
    state : MotionState
        At that time.
    running : Trajectory or None
        The motion that it follows until then; None where that is not known.
    time : float
        Within that motion [s].

    """

    state: MotionState
    running: Trajectory | None = None
    time: float = 0.0
