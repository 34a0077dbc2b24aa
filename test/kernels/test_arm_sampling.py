# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of an edge at a spacing: what they say is what a look at each configuration says."""

import numpy as np
import pytest
from rrth_planner.collision.world import arm_world
from rrth_planner.planning.edge_checks import sampled
from worlds import free_configuration, MARGIN, RAY, table_1_arm, varied_body, wearer_world


def is_free_one_by_one(world, q_from, q_to, spacing):
    """Return whether each configuration of the edge but its start is valid."""
    n = int(np.linalg.norm(q_to - q_from) / spacing) + 1
    return all(world.is_valid(q_from + i / n * (q_to - q_from)) for i in range(1, n + 1))


@pytest.mark.parametrize('spacing', [0.005, 0.02, 0.3])
def test_an_edge_sampled_is_free_where_each_of_its_configurations_is(spacing):
    rng = np.random.default_rng(17)
    worlds = [wearer_world()]
    worlds += [arm_world(table_1_arm(), varied_body(rng), MARGIN, RAY) for _ in range(3)]
    n_free = n_blocked = n_unproven = 0
    for world in worlds:
        check = sampled(world, spacing)
        for _ in range(150):
            start = free_configuration(rng, world)
            length = rng.choice([0.05, 0.5, 2.0])
            end = np.clip(start + rng.normal(0.0, length, 4), *world.bounds)
            is_free = is_free_one_by_one(world, start, end, spacing)
            assert check.is_edge_valid(start, end) == is_free
            n_free += is_free
            n_blocked += not is_free
            n_unproven += is_free and not world.is_edge_valid(start, end)
        # A start inside is not looked at.
        inside = next(q for q in rng.uniform(*world.bounds, (10_000, 4)) if not world.is_valid(q))
        near = inside + 1e-4
        assert check.is_edge_valid(inside, near) == is_free_one_by_one(
            world, inside, near, spacing
        )
    assert min(n_free, n_blocked) > 50
    # At a wide spacing there are edges that pass though they touch.
    assert n_unproven > 0 or spacing < 0.3
