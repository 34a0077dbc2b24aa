# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Result of planning: the path, if any, the trees, and the cost history."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import RrthError
from rrth_planner.model.frozen import Frozen
from rrth_planner.model.path import Path
from rrth_planner.model.status import PlanStatus


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tree(Frozen):
    """
    Configurations and their parents.

    Parameters
    ----------
    nodes : array_like, shape (n, dof)
        [rad].
    parents : array_like of int, shape (n,)
        Index of the parent, before its children; -1 for a root.

    """

    nodes: Array
    parents: NDArray[np.int64]

    def __post_init__(self) -> None:
        """Freeze."""
        nodes = frozen_array(self.nodes, (None, None), 'nodes', 'rad', RrthError)
        parents = np.array(self.parents, dtype=np.int64)
        parents.setflags(write=False)
        # A parent that is out of place is greater than its own index, or as great.
        if len(parents) != len(nodes) or np.count_nonzero(parents >= np.arange(len(nodes))):
            raise RrthError('parents: expected for each node the index of an earlier one, or -1')
        object.__setattr__(self, 'nodes', nodes)
        object.__setattr__(self, 'parents', parents)


class GrownTrees(Sequence[Tree]):
    """
    Trees copied from the buffers of a kernel; each is converted on access.

    Where rewiring has left a parent behind its child the nodes are put in the order of depth.

    Parameters
    ----------
    rows : iterable of (ndarray, ndarray)
        Nodes (n, dof) [rad] and parents (n,) of each tree, in arrays that will be used again.

    """

    def __init__(self, rows: Iterable[tuple[Array, NDArray[np.int64]]]) -> None:
        """Copy."""
        self._rows = tuple([(nodes.copy(), parents.copy()) for nodes, parents in rows])

    def __len__(self) -> int:
        """Return how many trees there are."""
        return len(self._rows)

    @overload
    def __getitem__(self, index: int) -> Tree: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Tree, ...]: ...

    def __getitem__(self, index: int | slice) -> Tree | tuple[Tree, ...]:
        """Return a tree, or some."""
        if isinstance(index, slice):
            return tuple([_tree(row) for row in self._rows[index]])
        return _tree(self._rows[index])


def _tree(row: tuple[Array, NDArray[np.int64]]) -> Tree:
    nodes, parents = row
    if (parents >= np.arange(len(parents))).any():
        return _ordered(nodes, parents)
    return Tree(nodes=nodes, parents=parents)


def _ordered(nodes: Array, parents: NDArray[np.int64]) -> Tree:
    """Return a tree whose nodes come in the order of their depth, so parents come first."""
    # A root's parent is a node past the last one. In each round all look twice as far up.
    n = len(nodes)
    above = np.append(np.where(parents < 0, n, parents), n)
    depth = (above < n).astype(np.int64)
    while (above < n).any():
        depth += depth[above]
        above = above[above]
    order = np.argsort(depth[:n], kind='stable')
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    old = parents[order]
    return Tree(nodes=nodes[order], parents=np.where(old >= 0, rank[old], -1))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanResult:
    """
    How planning ended.

    Parameters
    ----------
    status : PlanStatus
        SOLVED, TIMEOUT, SAMPLE_LIMIT or CANCELLED.
    path : Path or None
        The best path; None unless solved.
    raw_path : Path or None
        The first path found by growth, before any shortcut; None where a straight edge was one,
        and for RRT* and its relatives.
    trees : sequence of Tree
        From the start and, with two trees, from the goals, as they were last.
    cost_history, sample_history, time_history : tuple of float, of int, of float
        Length of the best path after each improvement [rad], draws and seconds until then.
    n_samples : int
        Draws in all.
    planning_time : float
        [s].
    is_reproducible : bool
        False where a time limit ended the improvement: the path then depends on timing.

    """

    status: PlanStatus
    path: Path | None
    raw_path: Path | None = None
    trees: Sequence[Tree] = ()
    cost_history: tuple[float, ...] = ()
    sample_history: tuple[int, ...] = ()
    time_history: tuple[float, ...] = ()
    n_samples: int = 0
    planning_time: float = 0.0
    is_reproducible: bool = True
