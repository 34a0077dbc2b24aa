# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A million certified edges, checked densely: no certificate may be wrong."""

import numpy as np
from rrth_planner.model.arrays import Array

from benchmarks.common import dense_checker
from benchmarks.common.numpy_checker import is_arm_path_free, SPACING
from benchmarks.common.queries import table_1_arm, wearer, wearer_world
from benchmarks.common.random_draws import random_edges
from benchmarks.common.size import Extent
from benchmarks.common.task import figure_row, Row, Task
from benchmarks.planners import loops

# Edges in one task.
BATCH = 50_000
# Lengths are drawn from these, their logarithm uniform [rad].
SHORTEST, LONGEST = 0.03, 3.0


def tasks(extent: Extent) -> list[Task]:
    """Return the measurements of this section."""
    n_batches = -(-extent.n_certified // BATCH)
    n_judged = -(-extent.n_judged // n_batches)
    return [
        Task(
            section='proof',
            name=f'batch {i}',
            measure=lambda i=i: _batch(i, min(BATCH, extent.n_certified - i * BATCH), n_judged),
        )
        for i in range(n_batches)
    ]


def _batch(seed: int, n: int, n_judged: int) -> list[Row]:
    world, arm, scene = wearer_world(), table_1_arm(), wearer()
    starts, ends = certified_edges(np.random.default_rng([seed, 9]), n)
    flags = dense_checker.colliding_edges(
        arm, scene, world.ray_length, 0.0, (starts, ends), SPACING
    )
    judged = [
        is_arm_path_free(arm, scene, np.array(edge), world.ray_length, 0.0)
        for edge in zip(starts[:n_judged], ends[:n_judged], strict=True)
    ]
    counts = {
        'certified edges': n,
        'certified edges that collide': int(flags.sum()),
        'certified edges sampled': len(judged),
        'certified edges that collide by the reference checker': len(judged) - sum(judged),
    }
    return [figure_row(name, value, '', seed=seed) for name, value in counts.items()]


def certified_edges(rng: np.random.Generator, n: int) -> tuple[Array, Array]:
    """Return random edges that the edge check certifies, each (n, dof) [rad]."""
    world = wearer_world()
    starts, ends = [], []
    count = 0
    while count < n:
        draws = rng.uniform(*world.bounds, (2 * n, world.bounds.shape[1]))
        lengths = SHORTEST * (LONGEST / SHORTEST) ** rng.random(len(draws))
        first, last = random_edges(rng, world, draws, lengths)
        flags = np.empty(len(first), dtype=np.bool_)
        loops.check_edges(world, first, last, flags)
        starts.append(first[flags])
        ends.append(last[flags])
        count += int(flags.sum())
    return np.concatenate(starts)[:n], np.concatenate(ends)[:n]
