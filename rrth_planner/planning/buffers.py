# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Buffers in which trees grow: allocated once per thread, and reused from plan to plan."""

import threading

import numpy as np
from rrth_planner.kernels.search import rrt_h

MAX_WAYPOINTS = 4096
# Points of the path club, and improvements of the best path, that are kept.
MAX_CLUB, MAX_HISTORY = 4096, 1024
# Nodes that a tree has room for, at most.
MAX_NODES = 200_000

_local = threading.local()


class Workspace:
    """
    Arrays for the kernels of one thread; their content is valid during one plan.

    Parameters
    ----------
    capacity : int
        Nodes that each tree has room for.

    """

    def __init__(self, dof: int, capacity: int) -> None:
        """Allocate the arrays; memory is committed on first write."""
        self.dof, self.capacity = dof, capacity
        # Two pairs of trees: the growing one, and the one that gave the best path.
        self.tree_q = np.empty((2, 2, capacity, dof))
        self.parents = np.empty((2, 2, capacity), dtype=np.int64)
        self.sizes = np.zeros((2, 4), dtype=np.int64)
        self.meeting = np.full(2, -1, dtype=np.int64)
        self.club = np.empty((MAX_CLUB, dof))
        self.paths = np.empty((3, MAX_WAYPOINTS, dof))
        self.state = np.zeros(rrt_h.STATE_SIZE, dtype=np.int64)
        self.history = np.empty((MAX_HISTORY, 3))


def workspace(dof: int, capacity: int) -> Workspace:
    """Return the workspace of this thread, cleared."""
    kept: Workspace | None = getattr(_local, 'kept', None)
    if kept is None or kept.dof != dof or kept.capacity < capacity:
        kept = _local.kept = Workspace(dof, capacity)
    kept.state[:] = 0
    kept.meeting[:] = -1
    return kept
