# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What is left of the trees of an earlier plan, after start or obstacles have changed a little."""

from numba.core.types import float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import (
    CHAIN,
    EDGE_CHECK,
    kernel,
    MAT,
    N_START,
    OUT_CUBE,
    OUT_INTS,
    OUT_MAT,
    READ_INTS,
)
from rrth_planner.kernels.vectors import copy, distance


@kernel(int64(EDGE_CHECK, float64, CHAIN, MAT, MAT, MAT, READ_INTS, int64, OUT_MAT, OUT_INTS))
def transplant(
    is_edge_free,
    resolution,
    chain,
    robot,
    obstacles,
    old_nodes,
    old_parents,
    n_roots,
    nodes,
    parents,
):
    """
    Carry over what can still be reached of an old tree; return the number of nodes.

    nodes[:n_roots] are the new roots. An old root stays where it is one of them, or hangs from the
    first of them that reaches it; every other old node stays with its parent, as long as their
    edge is free (after You, as the paper cites it). Parents come before their children.
    """
    moved = np.full(old_nodes.shape[0], -1, np.int64)
    n = n_roots
    for i in range(old_nodes.shape[0]):
        if old_parents[i] < 0:
            parent = -1
            for root in range(n_roots):
                if distance(nodes[root], old_nodes[i]) == 0.0:
                    moved[i] = root
                    break
                if parent < 0 and is_edge_free(
                    nodes[root], old_nodes[i], resolution, chain, robot, obstacles
                ):
                    parent = root
            if moved[i] >= 0 or parent < 0:
                continue
        else:
            parent = moved[old_parents[i]]
            if parent < 0 or not is_edge_free(
                nodes[parent], old_nodes[i], resolution, chain, robot, obstacles
            ):
                continue
        if n >= nodes.shape[0] - 1:
            return n
        copy(old_nodes[i], nodes[n])
        parents[n] = parent
        moved[i] = n
        n += 1
    return n


@kernel(void(EDGE_CHECK, float64, CHAIN, MAT, MAT, float64, OUT_CUBE, OUT_INTS, OUT_INTS))
def join(is_edge_free, resolution, chain, robot, obstacles, step_size, tree_q, sizes, meeting):
    """Find two nodes of the two trees, within a step, that a free edge joins: `meeting`, or -1."""
    meeting[0] = meeting[1] = -1
    for b in range(sizes[1]):
        for a in range(sizes[N_START]):
            if distance(tree_q[0, a], tree_q[1, b]) <= step_size and is_edge_free(
                tree_q[0, a], tree_q[1, b], resolution, chain, robot, obstacles
            ):
                meeting[0], meeting[1] = a, b
                return
