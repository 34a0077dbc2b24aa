# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Nearest nodes, steps towards a point, and ways back to the roots."""

import numpy as np
import pytest
from rrth_planner.kernels.search.tree import CHUNK, nearest, steer, trace_path
from rrth_planner.kernels.vectors import distance, path_length


def test_a_path_without_room_is_not_traced():
    tree_q = np.zeros((2, 8, 2))
    tree_q[0, :5, 0] = np.arange(5)
    tree_q[1, :3, 0] = [7, 6, 5]
    parents = np.array([[-1, 0, 1, 2, 3, -1, -1, -1], [-1, 0, 1, -1, -1, -1, -1, -1]])
    path = np.full((8, 2), np.nan)
    assert trace_path(tree_q, parents, 4, 2, path) == 8
    assert np.array_equal(path[:, 0], np.arange(8))
    assert trace_path(tree_q, parents, 4, 2, np.empty((7, 2))) == 0
    assert trace_path(tree_q, parents, 4, 2, np.empty((4, 2))) == 0
    tree_q[1, 2, 0] = 4
    assert trace_path(tree_q, parents, 4, 2, path) == 7


@pytest.mark.parametrize('dof', [1, 2, 3, 4, 6])
def test_nearest_is_the_least_distance_of_numpy(dof):
    rng = np.random.default_rng(57 + dof)
    nodes = rng.uniform(-1, 1, (3 * CHUNK + 7, dof))
    sizes = [1, 2, CHUNK - 1, CHUNK, CHUNK + 1, 2 * CHUNK, len(nodes)]
    for size in [*sizes, *rng.integers(1, len(nodes), 60)]:
        q = rng.uniform(-1, 1, dof)
        assert nearest(nodes, size, q) == np.argmin(np.linalg.norm(nodes[:size] - q, axis=1))
    # Each node is the nearest to itself; of equal ones it is the first.
    assert all(nearest(nodes, len(nodes), q) == i for i, q in enumerate(nodes))
    twice = np.concatenate([nodes, nodes])
    assert all(nearest(twice, len(twice), q) == i for i, q in enumerate(nodes))


def test_lengths_are_those_of_numpy():
    rng = np.random.default_rng(56)
    for dof in (1, 2, 4, 7):
        path = rng.uniform(-3, 3, (20, dof))
        steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
        assert distance(path[3], path[4]) == pytest.approx(steps[3])
        for n in (0, 1, 2, 20):
            assert path_length(path, n) == pytest.approx(steps[: max(n - 1, 0)].sum())


def test_a_step_is_no_longer_than_allowed_and_leads_straight_on():
    rng = np.random.default_rng(58)
    for _ in range(100):
        q_near, q = rng.uniform(-1, 1, (2, 4))
        q_new = np.empty(4)
        step = rng.uniform(0.01, 3.0)
        steer(q_near, q, step, q_new)
        gap = np.linalg.norm(q - q_near)
        if gap <= step:
            assert np.array_equal(q_new, q)
        else:
            assert np.linalg.norm(q_new - q_near) == pytest.approx(step)
            assert np.linalg.norm(q - q_new) == pytest.approx(gap - step)
