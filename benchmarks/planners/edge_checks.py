# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What one check costs: of a configuration, of an edge, among many boxes, for other arms."""

import numpy as np
from rrth_planner.collision.world import arm_world, World

from benchmarks.common.clock import repeated
from benchmarks.common.queries import table_1_arm, wearer, wearer_world
from benchmarks.common.random_draws import free_configurations, random_edges, split_boxes
from benchmarks.common.size import Extent
from benchmarks.common.task import figure_row, Row, Task
from benchmarks.planners import loops
from benchmarks.planners.arms import NAMES, other_arm

# Length of the edges along which batches of configurations are checked: a whole number of checks
# with room for rounding [rad].
BATCH_LENGTH = 0.99
LENGTHS = (0.3, 1.0, 3.0)


def tasks(extent: Extent) -> list[Task]:
    """Return the measurements of this section."""
    named = {
        'configurations': lambda: _configurations(extent),
        'edges': lambda: _edges(extent),
        'boxes': lambda: _boxes(extent),
        'arms': lambda: _arms(extent),
    }
    return [Task(section='checks', name=n, measure=call) for n, call in named.items()]


def _configurations(extent: Extent) -> list[Row]:
    rng, world = np.random.default_rng(1), wearer_world()
    costs = _configuration_costs(world, extent)
    starts = free_configurations(rng, world, 8 * extent.n_edges)
    starts, ends = random_edges(rng, world, starts, np.full(len(starts), BATCH_LENGTH))
    is_free = np.empty(len(starts), dtype=np.bool_)
    loops.check_batches(world, starts, ends, is_free)
    starts, ends = starts[is_free], ends[is_free]
    flags = np.empty(len(starts), dtype=np.bool_)
    times = repeated(lambda: loops.check_batches(world, starts, ends, flags), extent.repeats)
    n_checks = len(starts) * loops.batch_size(BATCH_LENGTH)
    return [
        *(figure_row('configuration, single', cost, 'ns', seed=i) for i, cost in enumerate(costs)),
        *(
            figure_row('configuration, batch', 1e9 * time / n_checks, 'ns', seed=i)
            for i, time in enumerate(times)
        ),
    ]


def _edges(extent: Extent) -> list[Row]:
    world, rows = wearer_world(), []
    for length in LENGTHS:
        rng = np.random.default_rng(2)
        starts = free_configurations(rng, world, extent.n_edges)
        # Long edges leave the limits more often than not.
        while True:
            kept, ends = random_edges(rng, world, starts, np.full(len(starts), length))
            if len(kept) >= extent.n_edges // 4:
                break
            starts = np.concatenate([starts, starts])
        flags = np.empty(len(kept), dtype=np.bool_)
        times = repeated(
            lambda k=kept, e=ends, f=flags: loops.check_edges(world, k, e, f), extent.repeats
        )
        rows += [
            figure_row(
                f'edge of {length:g} rad',
                1e6 * time / len(kept),
                'us',
                seed=i,
                detail=f'{flags.mean():.3f} certified',
            )
            for i, time in enumerate(times)
        ]
    return rows


def _boxes(extent: Extent) -> list[Row]:
    rows = []
    for per_axis in (1, 2, 4):
        scene = split_boxes(wearer(), per_axis)
        costs = _configuration_costs(arm_world(table_1_arm(), scene, 0.0, 1.0), extent)
        name = f'configuration, {len(scene.boxes)} boxes'
        rows += [figure_row(name, cost, 'ns', seed=i) for i, cost in enumerate(costs)]
    return rows


def _arms(extent: Extent) -> list[Row]:
    own = np.median(_configuration_costs(wearer_world(), extent)) / table_1_arm().dof
    rows = []
    for name in NAMES:
        arm = other_arm(name)
        costs = _configuration_costs(arm_world(arm, wearer(), 0.0, 1.0), extent)
        rows += [
            figure_row(
                f'cost per joint, {name}',
                cost / arm.dof / own,
                '',
                seed=i,
                detail=f'{cost:.0f} ns',
            )
            for i, cost in enumerate(costs)
        ]
    return rows


def _configuration_costs(world: World, extent: Extent) -> list[float]:
    """Return what a random configuration costs in each of the repeats [ns]."""
    rng = np.random.default_rng(0)
    positions = rng.uniform(*world.bounds, (extent.n_edges, world.bounds.shape[1]))
    flags = np.empty(len(positions), dtype=np.bool_)
    times = repeated(lambda: loops.check_configurations(world, positions, flags), extent.repeats)
    return [1e9 * time / len(positions) for time in times]
