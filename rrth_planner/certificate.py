# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The proof that a timed curve, as a controller will run it, never touches the wearer."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.bernstein import to_bernstein
from rrth_planner.kernels import arm_validity
from rrth_planner.trajectory import piece_coefficients, positions_at, Trajectory
from rrth_planner.world import World

# Instants at which the least clearance is looked for; a figure for people, not the proof [s].
CLEARANCE_PERIOD = 0.01


@dataclass(frozen=True, slots=True)
class Certificate:
    """
    Whether a trajectory is proven free; if not, the piece that is not.

    Parameters
    ----------
    is_proven : bool
    piece : int
        Index of the first piece that is not proven; -1 where all are.
    touches : bool
        Whether that piece was seen to touch, rather than left undecided.

    """

    is_proven: bool
    piece: int = -1
    touches: bool = False


_BERNSTEIN_4, _BERNSTEIN_3 = to_bernstein(4), to_bernstein(3)


def derivative_bounds(coefficients: Array) -> tuple[Array, Array]:
    """
    Return bounds of |dq/du| and |d2q/du2| of quintic pieces over u in [0, 1].

    A polynomial lies between its least and greatest Bernstein coefficient (Farouki 2012).

    Parameters
    ----------
    coefficients : ndarray, shape (n, 6, dof)
        As from `piece_coefficients` [rad].

    Returns
    -------
    tuple of ndarray, each of shape (n, dof)
        [rad].

    """
    powers = np.arange(1, 6)[None, :, None]
    first = coefficients[:, 1:] * powers
    second = first[:, 1:] * powers[:, :4]
    speed = np.abs(_BERNSTEIN_4 @ first).max(axis=1)
    bend = np.abs(_BERNSTEIN_3 @ second).max(axis=1)
    # Rounding of the conversion.
    return speed * (1 + 1e-12) + 1e-15, bend * (1 + 1e-12) + 1e-15


def certify(trajectory: Trajectory, world: World) -> Certificate:
    """
    Return the proof that a quintic-interpolated trajectory is free of the world's boxes.

    Each piece is proven by the second-order certificate of `kernels.arm_validity.prove_curve`,
    from the very numbers that the trajectory holds.
    """
    if len(trajectory.times) == 1:
        is_free = world.is_valid(trajectory.positions[0])
        return Certificate(is_proven=is_free, piece=-1 if is_free else 0, touches=not is_free)
    coefficients = piece_coefficients(trajectory)
    speed, bend = derivative_bounds(coefficients)
    for i, curve in enumerate(coefficients):
        proof = arm_validity.prove_curve(
            curve,
            speed[i],
            bend[i],
            0.2 * world.resolution,
            world.chain,
            world.robot,
            world.obstacles,
        )
        if proof != 1:
            return Certificate(is_proven=False, piece=i, touches=proof == 0)
    return Certificate(is_proven=True)


def least_clearance(trajectory: Trajectory, world: World) -> float:
    """Return the least distance from the world's boxes, looked at every 10 ms [m]."""
    times = np.append(np.arange(0.0, trajectory.duration, CLEARANCE_PERIOD), trajectory.duration)
    return float(world.clearances(positions_at(trajectory, times)).min(initial=np.inf))
