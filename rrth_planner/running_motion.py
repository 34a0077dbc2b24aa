# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A motion that an arm was told to follow, and how far the arm has come."""

from dataclasses import dataclass
import math

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.kernels.following import time_on
from rrth_planner.takeover import REST_SPEED, SAME_POSITION
from rrth_planner.trajectory import piece_coefficients, positions_at, sample, Trajectory

# How late an arm is cannot be told where it hardly moves [rad/s]; most that counts [s].
SLOW, LATEST = 0.05, 0.05
# An arm that is further from all of its motion, in one joint, does something else [rad].
ELSEWHERE = 0.1
# Places of a motion at which an arm is looked for [s].
SPACING = 5e-3
# An arm that is so near to where its motion is now is on time [rad].
ON_TIME = 5e-4
# For so long after its begin a motion has hardly left the place where it begins [s].
BEGINNING = 0.05
# Instants that are looked at to tell whether it moves soon.
N_SOON = 9


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RunningMotion:
    """
    A motion and when it began.

    Parameters
    ----------
    trajectory : Trajectory
    start_time : float
        [s].
    reach : float
        How much of the pointing ray must be clear at the end [m].
    escape_time : float
        Until then the motion may lead out of the wearer [s].

    """

    trajectory: Trajectory
    start_time: float
    reach: float = 0.0
    escape_time: float = 0.0

    def phase(self, q: Array, taken: float, now: float) -> float | None:
        """
        Return the time within the motion that the arm is at now [s]; None where it is elsewhere.

        An arm may be late, slow, or a little beside its motion: it counts as where it is nearest
        to. Before its motion begins the time is negative. Velocities are not asked for: not every
        driver has any.

        Parameters
        ----------
        q : ndarray, shape (dof,)
            A reading of the arm [rad].
        taken, now : float
            When it was read, and now [s].

        """
        motion, guess = self.trajectory, taken - self.start_time
        if now < self.start_time:
            # It takes over from another one, where the arm is still.
            return now - self.start_time
        if len(motion.times) == 1:
            is_there = np.abs(motion.positions[0] - q).max() <= ELSEWHERE
            return max(0.0, now - self.start_time) if is_there else None
        # Mostly the arm is where it was told to be, a little late: it began when it heard of it.
        at = self._near(guess, q, SAME_POSITION)
        if not math.isfinite(at):
            times = np.linspace(0.0, motion.duration, 2 + int(motion.duration / SPACING))
            gaps = positions_at(motion, times) - q
            if not np.abs(gaps).max(axis=1).min() <= ELSEWHERE:
                return None
            squares = (gaps * gaps).sum(axis=1)
            # A motion may pass a place twice.
            near = times[squares <= squares.min() + SAME_POSITION**2]
            nearest = float(near[np.abs(near - guess).argmin()])
            at = self._near(nearest, q, math.inf)
        return float(at) + now - taken

    def is_on_time(self, q: Array, v: Array, taken: float) -> bool:
        """Return whether an arm was where the motion is at that time, and as fast [rad, s]."""
        since = taken - self.start_time
        if not BEGINNING <= since <= self.trajectory.duration:
            return False
        wanted, pace, _ = (values[0] for values in sample(self.trajectory, [since]))
        return bool(np.abs(wanted - q).max() <= ON_TIME and np.abs(pace - v).max() <= REST_SPEED)

    def will_move(self, time: float, span: float) -> bool:
        """Return whether the motion moves soon after a time [s], within a span [s]."""
        since = time - self.start_time + np.linspace(0.0, span, N_SOON)
        return bool((np.abs(sample(self.trajectory, since)[1]) > REST_SPEED).any())

    def _near(self, guess: float, q: Array, same: float) -> float:
        motion = self.trajectory
        curves = piece_coefficients(motion)
        return float(time_on(curves, motion.times, guess, q, same, SLOW, LATEST))
