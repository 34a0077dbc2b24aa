# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The rate at which a motion is executed, from its present value to another one, smoothly."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.kernels.trajectory.rate_profile import (
    LASTS,
    profile_after,
    SAME_RATE,
    SPACING,
    state_of,
    steer,
    TAU,
    write_scaled,
)
from rrth_planner.model.arrays import Array
from rrth_planner.model.curves import curves_of, motion_through
from rrth_planner.model.frozen import Frozen
from rrth_planner.model.trajectory import MotionLimits, Trajectory

# Derivatives of a rate below that are not worth a change [1/s]: it would end within 0.2 ms, in
# which rounding is a jerk.
NO_SLOPE = 5e-3


@dataclass(frozen=True, slots=True, eq=False)
class RateProfile(Frozen):
    """
    How far within a motion an arm is from some instant on, and at which rate it executes it.

    Parameters
    ----------
    phases : ndarray, shape (3, 5)
        As in `kernels.trajectory.rate_profile`; after them the rate is constant.

    """

    phases: Array

    @property
    def change_time(self) -> float:
        """How long the rate changes [s]."""
        return float(self.phases[:, LASTS].sum())

    @property
    def begin(self) -> float:
        """The time within the motion at which it begins [s]."""
        return float(self.phases[0, TAU])


def steady(time: float, rate: float) -> RateProfile:
    """Return a constant rate from a time within the motion on [s]."""
    return RateProfile(np.array([[0.0, time, rate, 0.0, 0.0]] * 3))


def rate_state(profile: RateProfile, time: float) -> Array:
    """Return time within the motion [s], rate and its derivative [1/s], (3,), at a time [s]."""
    state = np.empty(3)
    state_of(profile.phases, time, state)
    return state


def continued(profile: RateProfile, time: float) -> RateProfile:
    """Return what is left of a profile after a time [s]."""
    phases = np.empty((3, 5))
    profile_after(profile.phases, time, phases)
    return RateProfile(phases)


def steered(
    motion: Trajectory, state: Array, target: float, limits: MotionLimits
) -> RateProfile | None:
    """
    Return the profile that takes the rate from a state to a target, None where limits forbid it.

    state (3,): as from `rate_state`. The rate changes as fast as the joints allow, or a little
    slower; the motion at the changing rate exceeds no limit by more than 0.3 %.
    """
    if abs(target - state[1]) < SAME_RATE and abs(state[2]) < NO_SLOPE:
        return steady(float(state[0]), float(state[1]))
    phases = np.empty((3, 5))
    curves = curves_of(motion)
    if not steer(curves, motion.times, state, target, *limits.rows, phases):
        return None
    return RateProfile(phases)


def scaled(motion: Trajectory, profile: RateProfile) -> Trajectory:
    """
    Return a motion executed at the rates of a profile, to its end.

    Its points are on the path of the motion, no further than 10 ms apart while the rate changes. A
    profile that ends at rate 0 ends where it comes to rest on the way.
    """
    curves, dof = curves_of(motion), motion.positions.shape[1]
    most = len(motion.times) + 8 + int(profile.change_time / SPACING)
    times, states = np.empty(most), np.empty((3, most, dof))
    n = write_scaled(curves, motion.times, profile.phases, times, states)
    return motion_through(times[:n].copy(), states[:, :n].copy())
