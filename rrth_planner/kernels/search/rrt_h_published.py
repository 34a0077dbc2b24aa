# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT-H's three steps as printed (Zou et al. 2024, section 2), to reproduce the paper."""

from numba.core.types import float64, int64
import numpy as np
from rrth_planner.kernels.jit import kernel, OUT_MAT, SPACE, VEC
from rrth_planner.kernels.search.shortcut import remove_waypoint, reverse_path, SPACING
from rrth_planner.kernels.search.space import is_free
from rrth_planner.kernels.vectors import copy, distance

MAX_CUTS = 1000


@kernel(float64(SPACE, VEC, VEC, float64))
def first_contact(space, q_from, q_to, spacing):
    """Return the share of the line at which the first check point P_C collides; 2: none does."""
    dof = q_from.shape[0]
    n = int64(distance(q_from, q_to) / spacing) + 1
    q = np.empty(dof)
    for m in range(1, n + 1):
        for k in range(dof):
            q[k] = q_from[k] + m / n * (q_to[k] - q_from[k])
        # An edge of length zero: the configuration itself.
        if not is_free(space, q, q):
            return m / n
    return 2.0


@kernel(int64(SPACE, OUT_MAT, int64, float64, float64))
def shortcut_forward(space, path, n, targets, checks):
    """
    Do step 1 in place: the lines from P_i to the points P_T on P_i+1 -> P_i+2, one by one.

    All free: P_i+1 is deleted. First collision at P_T(n): P_T(n-1) becomes P_i+1. i moves on.
    """
    dof = path.shape[1]
    q = np.empty(dof)
    i = 0
    while i + 2 < n:
        m = int64(distance(path[i + 1], path[i + 2]) / targets) + 1
        blocked = 0
        for t in range(1, m + 1):
            for k in range(dof):
                q[k] = path[i + 1, k] + t / m * (path[i + 2, k] - path[i + 1, k])
            if first_contact(space, path[i], q, checks) <= 1.0:
                blocked = t
                break
        if blocked == 0:
            n = remove_waypoint(path, n, i + 1)
        else:
            for k in range(dof):
                path[i + 1, k] += (blocked - 1) / m * (path[i + 2, k] - path[i + 1, k])
        i += 1
    return n


@kernel(int64(SPACE, OUT_MAT, int64, float64, float64, float64))
def cut_corners(space, path, n, targets, checks, least):
    """
    Do step 3 in place: a corner where the line of sight is first blocked, two lines back.

    The first collision at P_C(m) of the line to P_T(n): the point at P_C(m)'s place on the line to
    P_T(n-2) becomes the new P_i, P_T(n) the new P_i+1, and the three are treated again. Where P_i
    and P_i+1 are nearer than `least` (the paper's k), i moves on. Nothing checks the new edges.
    """
    dof = path.shape[1]
    q, corner = np.empty(dof), np.empty(dof)
    i, n_cuts = 0, 0
    while i + 2 < n:
        m = int64(distance(path[i + 1], path[i + 2]) / targets) + 1
        blocked, share = 0, 2.0
        for t in range(1, m + 1):
            for k in range(dof):
                q[k] = path[i + 1, k] + t / m * (path[i + 2, k] - path[i + 1, k])
            share = first_contact(space, path[i], q, checks)
            if share <= 1.0:
                blocked = t
                break
        if blocked == 0:
            n = remove_waypoint(path, n, i + 1)
            continue
        back = max(0, blocked - 2) / m
        for k in range(dof):
            seen = path[i + 1, k] + back * (path[i + 2, k] - path[i + 1, k])
            corner[k] = path[i, k] + share * (seen - path[i, k])
        if (
            distance(path[i], corner) < least
            or distance(path[i], path[i + 1]) < least
            or n >= path.shape[0]
            or n_cuts >= MAX_CUTS
        ):
            i += 1
            continue
        for j in range(n, i + 1, -1):
            copy(path[j - 1], path[j])
        n += 1
        copy(corner, path[i + 1])
        copy(q, path[i + 2])
        n_cuts += 1
        i += 1
    return n


@kernel(int64(SPACE, OUT_MAT, int64, VEC))
def shorten(space, path, n, how):
    """
    Do steps 1, 2 and 3 once each, in place; return the number of waypoints.

    how (5,): k of the paper, two entries not used, distance between points P_T, between points P_C
    [rad].
    """
    least, targets, checks = how[SPACING], how[3], how[4]
    n = shortcut_forward(space, path, n, targets, checks)
    reverse_path(path, n)
    n = shortcut_forward(space, path, n, targets, checks)
    reverse_path(path, n)
    return cut_corners(space, path, n, targets, checks, least)
