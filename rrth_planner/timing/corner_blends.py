# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Corner blends: curves that pass a waypoint without stopping."""

from dataclasses import dataclass, replace

import numpy as np
from rrth_planner.collision.world import World
from rrth_planner.kernels.collision import arm_validity
from rrth_planner.model.arrays import Array, check_dof
from rrth_planner.model.frozen import Frozen
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import MotionLimits

# Largest share of an edge for a blend, so that a straight part remains between two neighbours.
EDGE_SHARE = 0.45
# Each try is this much smaller than the last, down to the smallest that still saves time [rad].
SHRINK, SMALLEST = 0.6, 1e-3
# Least half length of a blend, for corners that hardly turn [rad].
LEAST_HALF_LENGTH = 0.01
# Least divisor of a length.
TINY = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Blend(Frozen):
    """
    A quartic from `half_length` before a corner to as much after it, in tau from 0 to 1.

    q(tau) = corner - d u1 + 2 d (u1 tau + (u2 - u1) (tau^3 - tau^4 / 2)): its derivative turns
    from u1 to u2 by a smooth step, and its curvature vanishes at both ends, so it meets the
    straight edges with two continuous derivatives.

    Parameters
    ----------
    corner, u_in, u_out : ndarray, shape (dof,)
        The waypoint [rad], and the unit directions of the edges before and after it.
    half_length : float
        d [rad]; 0 where the corner cannot be rounded.

    """

    corner: Array
    u_in: Array
    u_out: Array
    half_length: float

    def coefficients(self) -> Array:
        """Return the polynomial in tau, lowest power first, shape (5, dof) [rad]."""
        d, turn = self.half_length, self.u_out - self.u_in
        zero = np.zeros_like(turn)
        return np.stack(
            [self.corner - d * self.u_in, 2 * d * self.u_in, zero, 2 * d * turn, -d * turn]
        )

    def derivative_bounds(self) -> tuple[Array, Array]:
        """Return bounds of |dq/dtau| and |d2q/dtau2| of each joint, shapes (dof,) [rad]."""
        d = self.half_length
        speed = 2 * d * np.maximum(np.abs(self.u_in), np.abs(self.u_out))
        return speed, 3 * d * np.abs(self.u_out - self.u_in)


def round_corners(path: Path, world: World, limits: MotionLimits) -> tuple[Blend, ...]:
    """
    Return a blend for each inner waypoint, as large as can be certified in the world.

    A blend is no larger than needed to pass it at full speed.
    """
    q = path.waypoints
    check_dof(q, world.bounds.shape[1], 'path')
    lengths = np.linalg.norm(np.diff(q, axis=0), axis=1)
    # An edge of length 0 has no direction.
    directions = np.diff(q, axis=0) / np.maximum(lengths, TINY)[:, None]
    blends = []
    for i in range(1, len(q) - 1):
        room = EDGE_SHARE * min(lengths[i - 1], lengths[i])
        whole = Blend(q[i], directions[i - 1], directions[i], float(room))
        blends.append(_largest_free(whole, world, limits))
    return tuple(blends)


def _largest_free(whole: Blend, world: World, limits: MotionLimits) -> Blend:
    """Return the largest blend of a corner, no larger than the given one, that is proven free."""
    cap = min(limits.velocity / np.maximum(np.abs(whole.u_in), np.abs(whole.u_out)).clip(1e-9))
    turn = np.abs(whole.u_out - whole.u_in)
    enough = max(
        float((0.75 * turn * cap**2 / limits.acceleration).max()),
        float(np.sqrt(1.5 * turn * cap**3 / limits.jerk).max()),
    )
    half_length = min(whole.half_length, max(enough, LEAST_HALF_LENGTH))
    while half_length > SMALLEST:
        blend = replace(whole, half_length=half_length)
        curve = blend.coefficients(), *blend.derivative_bounds()
        place = world.resolution, world.chain, world.robot, world.obstacles
        if arm_validity.prove_curve(*curve, *place) == 1:
            return blend
        half_length *= SHRINK
    return replace(whole, half_length=0.0)
