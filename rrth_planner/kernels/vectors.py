# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Small vectors: copies, sorting, bounds, distances, lengths of paths."""

import math

from numba.core.types import boolean, float64, int64, void
from rrth_planner.kernels.jit import kernel, MAT, OUT_VEC, VEC


@kernel(void(VEC, OUT_VEC))
def copy(q, to):
    """Write q to another place; an assignment of arrays takes the compiler ten times as long."""
    for k in range(q.shape[0]):
        to[k] = q[k]


@kernel(void(OUT_VEC, int64), is_inner=True)
def sort(values, n):
    """Sort the first n of some values; numpy's sort takes the compiler ten times as long."""
    for i in range(1, n):
        value, k = values[i], i
        while k > 0 and values[k - 1] > value:
            values[k] = values[k - 1]
            k -= 1
        values[k] = value


@kernel(float64(VEC, VEC))
def distance(p, q):
    """Return the length of the straight edge between two configurations."""
    total = 0.0
    for k in range(p.shape[0]):
        total += (p[k] - q[k]) ** 2
    return math.sqrt(total)


@kernel(boolean(VEC, MAT), is_short=True)
def is_within(q, bounds):
    """Return whether a configuration is within bounds, (2, dof): lower, upper; no NaN is."""
    found = True
    for k in range(q.shape[0]):
        found &= bounds[0, k] <= q[k] <= bounds[1, k]
    return found


@kernel(void(VEC, VEC, float64, OUT_VEC))
def between(q_from, q_to, share, q):
    """Write the configuration at a share of an edge."""
    for k in range(q_from.shape[0]):
        q[k] = q_from[k] + share * (q_to[k] - q_from[k])


@kernel(float64(MAT, int64))
def path_length(path, n):
    """Return the length of the first n waypoints of a path."""
    total = 0.0
    for i in range(n - 1):
        total += distance(path[i], path[i + 1])
    return total
