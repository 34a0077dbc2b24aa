# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The certificate: a continuous collision check of a timed curve, as a controller runs it."""

from collections.abc import Sequence
from dataclasses import dataclass
import functools
import math

import numpy as np
from rrth_planner.collision.world import World
from rrth_planner.kernels.collision.arm_clearance import least_along
from rrth_planner.kernels.collision.trajectory_check import prove_pieces
from rrth_planner.kernels.trajectory.quintics import bound
from rrth_planner.model.arrays import Array, check_dof, float_number
from rrth_planner.model.bernstein import to_bernstein
from rrth_planner.model.errors import check_type
from rrth_planner.model.trajectory import piece_coefficients, Trajectory

# Sampling period of the least clearance: a figure for people, not part of the certificate [s].
CLEARANCE_PERIOD = 0.01
# Finest interval of a curve, as a share of the resolution of edges [-].
FINENESS = 0.2


@dataclass(frozen=True, slots=True)
class Certificate:
    """
    Whether a trajectory is proven free; if not, the first piece that is not (-1 where all are).

    `is_violated`: a clearance violation was found in that piece; otherwise it is undecided.
    """

    is_proven: bool
    piece: int = -1
    is_violated: bool = False


BERNSTEIN_4, BERNSTEIN_3 = to_bernstein(4), to_bernstein(3)


def derivative_bounds(coefficients: Array) -> tuple[Array, Array]:
    """
    Return bounds of |dq/du| and |d2q/du2| of quintic pieces over u in [0, 1].

    coefficients (n, 6, dof): as from `piece_coefficients` [rad]. Both bounds (n, dof) [rad]; as in
    `quintics.bound`.
    """
    n, _, dof = coefficients.shape
    speed, curvature = np.empty((2, n, dof))
    bound(np.ascontiguousarray(coefficients), BERNSTEIN_4, BERNSTEIN_3, speed, curvature)
    return speed, curvature


def certify(trajectory: Trajectory, world: World, begin: float = 0.0) -> Certificate:
    """
    Return the certificate of a quintic-interpolated trajectory against the world's boxes.

    Each piece is checked continuously by `kernels.collision.arm_validity.prove_curve`, with
    second-order bounds and the numbers that the trajectory holds, from the time `begin` on [s].
    """
    check_type(trajectory, Trajectory, 'trajectory')
    check_type(world, World, 'world')
    check_dof(trajectory.positions, world.bounds.shape[1], 'trajectory')
    begin = float_number(begin, 'begin', 's')
    if len(trajectory.times) == 1 or begin >= trajectory.duration:
        is_free = world.is_free(trajectory.positions[-1])
        return Certificate(is_proven=is_free, piece=-1 if is_free else 0, is_violated=not is_free)
    first, share = 0, 0.0
    if begin > 0.0:
        times = trajectory.times
        first = int(times.searchsorted(begin, side='right')) - 1
        share = (begin - float(times[first])) / float(times[first + 1] - times[first])
    motion, resolution = piece_coefficients(trajectory), FINENESS * world.resolution
    surroundings = (world.chain, world.robot, world.obstacles)
    found = prove_pieces(motion, *bounds_of(trajectory), first, share, resolution, *surroundings)
    if found < 0:
        return Certificate(is_proven=True)
    return Certificate(is_proven=False, piece=found // 2, is_violated=bool(found % 2))


def are_pieces_proven(pieces: Sequence[Array], world: World, obstacles: Array) -> bool:
    """
    Return whether some pieces of a motion are proven free of obstacles in place of the world's.

    pieces: coefficients (n, 6, dof), as from `piece_coefficients`, and both `derivative_bounds` of
    them, (n, dof) [rad]; obstacles: of the shape of `World.obstacles`.
    """
    resolution = FINENESS * world.resolution
    return prove_pieces(*pieces, 0, 0.0, resolution, world.chain, world.robot, obstacles) < 0


@functools.lru_cache(maxsize=8)
def bounds_of(trajectory: Trajectory) -> tuple[Array, Array]:
    """Return `derivative_bounds` of a trajectory's pieces; cached for a running motion."""
    return derivative_bounds(piece_coefficients(trajectory))


def least_clearance(trajectory: Trajectory, world: World, begin: float = 0.0) -> float:
    """Return the least distance from the world's boxes from a time on, every 10 ms [m]."""
    check_dof(trajectory.positions, world.bounds.shape[1], 'trajectory')
    if len(trajectory.times) == 1 or begin >= trajectory.duration:
        return float(world.clearances(trajectory.positions[-1]).min(initial=np.inf))
    n = math.ceil((trajectory.duration - begin) / CLEARANCE_PERIOD) + 1
    motion = (piece_coefficients(trajectory), trajectory.times)
    surroundings = (world.chain, world.robot, world.obstacles)
    return float(least_along(*motion, max(begin, 0.0), n, *surroundings))
