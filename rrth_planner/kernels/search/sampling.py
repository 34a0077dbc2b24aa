# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Draws: uniform in the bounds, and uniform in the ellipsoid of better paths."""

import math

from numba.core.types import boolean, float64, void
from rrth_planner.kernels.jit import kernel, MAT, OUT_VEC, RNG, VEC
from rrth_planner.kernels.search.random import normal, uniform
from rrth_planner.kernels.vectors import distance

# Least distance of draws near an end, as a share of the distance to the other end.
NEAREST = 0.1


@kernel(void(MAT, RNG, OUT_VEC))
def draw_uniform(bounds, rng, q):
    """Draw a configuration uniformly within the bounds (2, dof)."""
    for k in range(q.shape[0]):
        q[k] = bounds[0, k] + (bounds[1, k] - bounds[0, k]) * uniform(rng)


@kernel(void(VEC, float64, MAT, RNG, OUT_VEC))
def draw_ball(centre, radius, bounds, rng, q):
    """Draw uniformly from a ball, moved to the bounds where it sticks out."""
    norm = 0.0
    for k in range(q.shape[0]):
        q[k] = normal(rng)
        norm += q[k] * q[k]
    scale = radius * uniform(rng) ** (1.0 / q.shape[0]) / math.sqrt(norm)
    for k in range(q.shape[0]):
        q[k] = min(bounds[1, k], max(bounds[0, k], centre[k] + scale * q[k]))


@kernel(boolean(VEC, VEC, float64, MAT, RNG, OUT_VEC))
def draw_near(q_end, q_far, best_cost, bounds, rng, q):
    """
    Draw at any scale around one end of a path, for starts and goals in narrow places.

    The logarithm of the distance is uniform, up to the distance of the other end. False where 8
    draws all fell outside the bounds, or beyond what could shorten a path of best_cost.
    """
    span = distance(q_end, q_far)
    for _ in range(8):
        norm = 0.0
        for k in range(q.shape[0]):
            q[k] = normal(rng)
            norm += q[k] * q[k]
        scale = span * NEAREST ** uniform(rng) / math.sqrt(norm)
        is_inside = True
        for k in range(q.shape[0]):
            q[k] = q_end[k] + scale * q[k]
            is_inside &= (q[k] >= bounds[0, k]) & (q[k] <= bounds[1, k])
        if is_inside and distance(q, q_end) + distance(q, q_far) < best_cost:
            return True
    return False


@kernel(boolean(MAT, VEC, VEC, float64, RNG, OUT_VEC))
def draw_informed(bounds, q_start, q_goal, best_cost, rng, q):
    """
    Draw uniformly from the ellipsoid of points through which a shorter path could lead.

    A point of the unit ball is stretched and turned onto the foci (Gammell, Srinivasa and Barfoot
    2014, algorithm 2); the turn is the reflection that maps the first axis onto the line of the
    foci, for an ellipsoid of revolution as good as a rotation. False where 32 draws all fell
    outside the bounds, or where no point can be better.
    """
    dof = q.shape[0]
    focal = 0.0
    for k in range(dof):
        focal += (q_goal[k] - q_start[k]) ** 2
    focal = math.sqrt(focal)
    if best_cost <= focal or focal == 0.0:
        return False
    minor = 0.5 * math.sqrt(best_cost * best_cost - focal * focal)
    for _ in range(32):
        norm = 0.0
        for k in range(dof):
            q[k] = normal(rng)
            norm += q[k] * q[k]
        radius = uniform(rng) ** (1.0 / dof) / math.sqrt(norm)
        # Reflection across the plane square to v = line - e_0; |v|^2 = 2 (1 - line_0).
        along, v_squared = 0.0, 0.0
        for k in range(dof):
            q[k] *= radius * (0.5 * best_cost if k == 0 else minor)
            v = (q_goal[k] - q_start[k]) / focal - (1.0 if k == 0 else 0.0)
            along += v * q[k]
            v_squared += v * v
        is_inside = True
        for k in range(dof):
            v = (q_goal[k] - q_start[k]) / focal - (1.0 if k == 0 else 0.0)
            if v_squared > 1e-18:
                q[k] -= 2.0 * along / v_squared * v
            q[k] += 0.5 * (q_start[k] + q_goal[k])
            is_inside &= (q[k] >= bounds[0, k]) & (q[k] <= bounds[1, k])
        if is_inside:
            return True
    return False
