# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Certified edges of an arm with capsules, checked densely against boxes and itself."""

import numpy as np
from rrth_planner.collision.world import World
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene

from benchmarks.common import dense_checker
from benchmarks.common.numpy_checker import SPACING
from benchmarks.common.random_draws import random_edges
from benchmarks.planners import loops

# Edges that are drawn at once; lengths, whose logarithm is uniform [rad].
BATCH, SHORTEST, LONGEST = 20_000, 0.03, 3.0
# Pairs that collide in each of so many configurations are made so.
N_TRIED = 300


def count_colliding(
    rng: np.random.Generator, arm: ArmModel, scene: Scene, world: World, margin: float, n: int
) -> tuple[int, int, int]:
    """Return how many random edges were drawn, certified, and of those collide: at least n."""
    pairs = checked_pairs(rng, arm, world.ray_length)
    n_drawn = n_certified = n_colliding = 0
    while n_certified < n:
        starts = rng.uniform(*world.bounds, (BATCH, arm.dof))
        lengths = SHORTEST * (LONGEST / SHORTEST) ** rng.random(BATCH)
        first, last = random_edges(rng, world, starts, lengths)
        flags = np.empty(len(first), dtype=np.bool_)
        loops.check_edges(world, first, last, flags)
        certified = first[flags], last[flags]
        colliding = dense_checker.colliding_edges(
            arm, scene, world.ray_length, margin, certified, SPACING, pairs
        )
        n_drawn += len(first)
        n_certified += len(certified[0])
        n_colliding += int(colliding.sum())
    return n_drawn, n_certified, n_colliding


def checked_pairs(rng: np.random.Generator, arm: ArmModel, ray_length: float) -> Array:
    """
    Return the pairs of `dense_checker.bars_in_frames` that must not collide, (m, 2).

    Not those of one link or of neighbours, but for the ray, nor those that may meet or always do.
    """
    bars = dense_checker.bars_in_frames(arm, ray_length)
    ray, allowed = len(bars.frames) - 1, {frozenset(pair) for pair in arm.allowed}
    pairs = []
    for i in range(len(bars.frames)):
        for j in range(i):
            between = abs(int(bars.bodies[i]) - int(bars.bodies[j]))
            is_checked = between > 1 or (between == 1 and i == ray)
            if is_checked and frozenset((bars.names[i], bars.names[j])) not in allowed:
                pairs.append((j, i))
    # Edges of length 0, far from all boxes.
    q = rng.uniform(*arm.bounds, (N_TRIED, arm.dof))
    return np.array(
        [
            pair
            for pair in pairs
            if not dense_checker.colliding_edges(
                arm, Scene(()), ray_length, 0.0, (q, q), SPACING, np.array([pair])
            ).all()
        ]
    )
