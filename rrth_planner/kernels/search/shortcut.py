# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Path shortcutting by the three steps of RRT-H (Zou et al. 2024, section 2, corrected)."""

from numba.core.types import float64, int64, void
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import kernel, OUT_MAT, SPACE
from rrth_planner.kernels.search.space import is_free
from rrth_planner.kernels.vectors import copy, distance, path_length

# Entries of the settings of `shorten` (kernels.jit.SHORTEN): k of the paper [rad], most
# iterations of the elastic band, least relative gain of a round of shortcuts.
SPACING, MOVES, ENOUGH = range(3)
# Least relative gain in length that counts.
LEAST_GAIN = 1e-5
# Rounds of the three steps; they stop by themselves when nothing is gained.
MAX_ROUNDS = 100


@kernel(int64(OUT_MAT, int64, int64), is_inner=True)
def remove_waypoint(path, n, i):
    """Remove waypoint i; return how many are left."""
    for j in range(i, n - 1):
        copy(path[j + 1], path[j])
    return n - 1


@kernel(void(OUT_MAT, int64), is_inner=True)
def reverse_path(path, n):
    """Reverse the first n waypoints."""
    for i in range(n // 2):
        for k in range(path.shape[1]):
            path[i, k], path[n - 1 - i, k] = path[n - 1 - i, k], path[i, k]


@kernel(int64(SPACE, OUT_MAT, int64, float64))
def shortcut_forward(space, path, n, spacing):
    """
    Do step 1 of RRT-H in place: slide P_i+1 along P_i+1 -> P_i+2 while P_i -> P_i+1 is free.

    Where P_i -> P_i+2 is free, P_i+1 is removed and P_i stays for the next pair (moving on, as
    printed, leaves corners). The farthest free P_T is found by bisection, to `spacing`.
    Step 2 is the same on the reversed path.
    """
    dof = path.shape[1]
    q_free, q_try = np.empty(dof), np.empty(dof)
    i = 0
    while i + 2 < n:
        if is_free(space, path[i], path[i + 2]):
            n = remove_waypoint(path, n, i + 1)
            continue
        length = distance(path[i + 1], path[i + 2])
        low, high = 0.0, 1.0
        while (high - low) * length > spacing:
            share = 0.5 * (low + high)
            for k in range(dof):
                q_try[k] = path[i + 1, k] + share * (path[i + 2, k] - path[i + 1, k])
            # The rest of the old segment becomes an edge of its own, so it is checked too.
            if is_free(space, path[i], q_try) and is_free(space, q_try, path[i + 2]):
                low = share
                copy(q_try, q_free)
            else:
                high = share
        if low > 0.0:
            copy(q_free, path[i + 1])
        i += 1
    return n


@kernel(int64(SPACE, OUT_MAT, int64, float64), is_inner=True)
def cut_corners(space, path, n, spacing):
    """
    Do step 3 of RRT-H in place, from both sides: replace each corner by its largest free chord.

    The chord's two ends lie equally far from the corner, then the one on the longer side moves on
    alone. Bisection to half of `spacing`, the paper's k: a shorter cut is not worth a waypoint.
    """
    dof = path.shape[1]
    q_in, q_out = np.empty(dof), np.empty(dof)
    share, lengths = scratch.floats(2), scratch.floats(2)
    i = 1
    while i < n - 1:
        lengths[0], lengths[1] = distance(path[i - 1], path[i]), distance(path[i], path[i + 1])
        shorter = min(lengths[0], lengths[1])
        if shorter < 1e-9:
            n = remove_waypoint(path, n, i)
            continue
        # Phase 0 moves both ends, phases 1 and 2 one of them.
        share[0] = share[1] = 0.0
        for phase in range(3):
            low = 0.0 if phase == 0 else share[phase - 1]
            high, unit = 1.0, shorter if phase == 0 else lengths[phase - 1]
            at = 0.5 * (low + high) if phase == 0 else high
            while (high - low) * unit > 0.5 * spacing:
                s_in = at * shorter / lengths[0] if phase == 0 else share[0]
                s_out = at * shorter / lengths[1] if phase == 0 else share[1]
                if phase == 1:
                    s_in = at
                elif phase == 2:
                    s_out = at
                for k in range(dof):
                    q_in[k] = path[i, k] + s_in * (path[i - 1, k] - path[i, k])
                    q_out[k] = path[i, k] + s_out * (path[i + 1, k] - path[i, k])
                # The chord, and what is left of both edges.
                if (
                    is_free(space, q_in, q_out)
                    and is_free(space, path[i - 1], q_in)
                    and is_free(space, q_out, path[i + 1])
                ):
                    low = at
                    share[0], share[1] = s_in, s_out
                else:
                    high = at
                if low == high:
                    break
                at = 0.5 * (low + high)
            if phase == 0 and share[0] * lengths[0] < 0.5 * spacing:
                break
        if share[0] == 0.0 or n >= path.shape[0]:
            i += 1
            continue
        for k in range(dof):
            q_in[k] = path[i, k] + share[0] * (path[i - 1, k] - path[i, k])
            q_out[k] = path[i, k] + share[1] * (path[i + 1, k] - path[i, k])
        for j in range(n, i + 1, -1):
            copy(path[j - 1], path[j])
        copy(q_in, path[i])
        copy(q_out, path[i + 1])
        n += 1
        i += 2
    return n


@kernel(int64(SPACE, OUT_MAT, int64, float64, float64))
def shortcut_path(space, path, n, spacing, enough):
    """
    Repeat the three steps until the path gets no shorter; return its number of waypoints.

    spacing: k of the paper [rad]. enough: least relative gain of a round for another one; at
    least LEAST_GAIN. Every edge that enters the path has been proven by the edge
    check; the path never gets longer.
    """
    length = path_length(path, n)
    for _ in range(MAX_ROUNDS):
        if n < 3:
            break
        n = shortcut_forward(space, path, n, spacing)
        reverse_path(path, n)
        n = shortcut_forward(space, path, n, spacing)
        reverse_path(path, n)
        n = cut_corners(space, path, n, spacing)
        shorter = path_length(path, n)
        if shorter > length * (1.0 - enough):
            break
        length = shorter
    return n
