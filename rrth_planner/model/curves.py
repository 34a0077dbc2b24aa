# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
What is asked of motions with every body, by compiled code.

The numbers are those of `model.trajectory`, but for the rounding of a processor's products. That
module needs no compiler, which a playback starts without; here an answer takes a tenth of the
time.
"""

import functools

import numpy as np
from rrth_planner.kernels.trajectory.points import are_points, write_pieces, write_states
from rrth_planner.model.arrays import Array, FARTHEST
from rrth_planner.model.trajectory import part_of, Trajectory


# Of a motion, its commitment, the message with that, and the next ones.
@functools.lru_cache(maxsize=16)
def curves_of(trajectory: Trajectory) -> Array:
    """Return the polynomials of all pieces, (n - 1, 6, dof), as `piece_coefficients`."""
    curves = np.empty((len(trajectory.times) - 1, 6, trajectory.positions.shape[1]))
    write_pieces(trajectory.times, *trajectory.states, curves)
    curves.setflags(write=False)
    return curves


def states_at(trajectory: Trajectory, times: Array) -> Array:
    """
    Return the states at some times, as `sample`: positions, velocities, accelerations.

    times (m,): not decreasing [s]. (3, m, dof) [rad, rad/s, rad/s^2].
    """
    shape = 3, len(times), trajectory.positions.shape[1]
    if len(trajectory.times) == 1:
        held = np.zeros(shape)
        held[0] = trajectory.positions
        return held
    states = np.empty(shape)
    write_states(curves_of(trajectory), trajectory.times, times, states)
    return states


def state_at(trajectory: Trajectory, time: float) -> Array:
    """Return the state at a time [s], (3, dof)."""
    state: Array = states_at(trajectory, np.array([time]))[:, 0]
    return state


def part(trajectory: Trajectory, begin: float, end: float) -> Trajectory:
    """Return the part between two times [s], as `part_of`."""
    return part_of(trajectory, begin, end, curves_of, motion_through)


def motion_through(times: Array, states: Array) -> Trajectory:
    """
    Return the motion through points, without copies: nobody else may hold the arrays.

    times (n,) [s]; states (3, n, dof). Raise RrthError as `Trajectory`.
    """
    if not are_points(times, states, FARTHEST):
        # It says what is wrong.
        return Trajectory(times, *states)
    return Trajectory.of_arrays(times, states)
