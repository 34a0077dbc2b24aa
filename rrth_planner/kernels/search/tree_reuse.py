# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What is left of the trees of an earlier plan, after start or obstacles have changed a little."""

from numba.core.types import float64, int64, void
import numpy as np
from rrth_planner.kernels.jit import (
    kernel,
    MAT,
    N_START,
    OUT_CUBE,
    OUT_INTS,
    OUT_MAT,
    READ_INTS,
    SPACE,
)
from rrth_planner.kernels.search.space import is_free
from rrth_planner.kernels.vectors import copy, distance


@kernel(int64(SPACE, MAT, READ_INTS, int64, OUT_MAT, OUT_INTS))
def transplant(space, old_nodes, old_parents, n_roots, nodes, parents):
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
                if parent < 0 and is_free(space, nodes[root], old_nodes[i]):
                    parent = root
            if moved[i] >= 0 or parent < 0:
                continue
        else:
            parent = moved[old_parents[i]]
            if parent < 0 or not is_free(space, nodes[parent], old_nodes[i]):
                continue
        if n >= nodes.shape[0] - 1:
            return n
        copy(old_nodes[i], nodes[n])
        parents[n] = parent
        moved[i] = n
        n += 1
    return n


@kernel(void(SPACE, float64, OUT_CUBE, OUT_INTS, OUT_INTS))
def join(space, step_size, tree_q, sizes, meeting):
    """Find two nodes of the two trees, within a step, that a free edge joins: `meeting`, or -1."""
    meeting[0] = meeting[1] = -1
    for b in range(sizes[1]):
        for a in range(sizes[N_START]):
            if distance(tree_q[0, a], tree_q[1, b]) <= step_size and is_free(
                space, tree_q[0, a], tree_q[1, b]
            ):
                meeting[0], meeting[1] = a, b
                return
