# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""State of a moving arm at the start of a motion."""

from dataclasses import dataclass

from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import Trajectory


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MotionState:
    """
    Positions, velocities and accelerations of the joints.

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
    State of a moving arm at the handover to a new motion.

    Parameters
    ----------
    state : MotionState
        At the handover.
    running : Trajectory or None
        The motion that it executes until then; None where that is unknown.
    time : float
        Of the handover, within that motion [s].

    """

    state: MotionState
    running: Trajectory | None = None
    time: float = 0.0
