# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Elastic band (Quinlan and Khatib 1993): corners move along contacts while the path shortens."""

from numba.core.types import float64, int64, void
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.collision.edge_contacts import GAP, GRADIENT, MULTIPLIER, SHARE
from rrth_planner.kernels.jit import (
    as_chain,
    as_contacts,
    CHAIN_AT,
    CONTACTS_AT,
    kernel,
    MAT,
    OUT_INTS,
    OUT_MAT,
    OUT_VEC,
    SPACE,
    VEC,
)
from rrth_planner.kernels.search.shortcut import ENOUGH, MOVES, shortcut_path, SPACING
from rrth_planner.kernels.search.space import is_free
from rrth_planner.kernels.vectors import copy, distance, path_length

# Gap that is left at contacts, for the edge checks to succeed [m].
LEFT = 1e-4
# Most corners and contacts of a path, and sweeps of the dual ascent.
MAX_CORNERS, MAX_CONTACTS, MAX_SWEEPS = 16, 96, 30
# Attempts at a move, each shorter by a factor, and corrections of each.
N_TRIES, SHORTER, N_CORRECTIONS = 3, 0.3, 4
SQUARE = MAX_CORNERS * MAX_CORNERS
# How far beyond a joint's limit a move may end before it is corrected; it is cut off there [rad].
BEYOND = 1e-9
# Least distance of a new corner from its neighbours [rad].
LEAST_EDGE = 0.03
# Shorter edges are as stiff as one of this length [rad].
SHORTEST = 1e-3
# Least relative gain of an iteration for another one.
WORTH = 5e-4


@kernel(void(MAT, int64, OUT_VEC), is_inner=True)
def invert_springs(path, n, inverse):
    """
    Write the inverse of the stiffness matrix of the corners of a path.

    The sum of lengths l has the majorant sum of (l^2 / l_0 + l_0) / 2 that equals it at the
    present path (as in Weiszfeld 1937): springs of stiffness 1 / l_0. Row i of the inverse stands
    at MAX_CORNERS i. Gauss and Jordan; the matrix is tridiagonal and positive.
    """
    m = n - 2
    work = scratch.floats(SQUARE)
    for i in range(m):
        for j in range(m):
            work[MAX_CORNERS * i + j] = 0.0
            inverse[MAX_CORNERS * i + j] = 1.0 if i == j else 0.0
    for e in range(n - 1):
        stiffness = 1.0 / max(SHORTEST, distance(path[e], path[e + 1]))
        # Edge e ends at the corners e - 1 and e, counted without the start.
        if e >= 1:
            work[MAX_CORNERS * (e - 1) + e - 1] += stiffness
        if e < m:
            work[MAX_CORNERS * e + e] += stiffness
        if 1 <= e < m:
            work[MAX_CORNERS * e + e - 1] -= stiffness
            work[MAX_CORNERS * (e - 1) + e] -= stiffness
    for i in range(m):
        pivot = 1.0 / work[MAX_CORNERS * i + i]
        for j in range(m):
            work[MAX_CORNERS * i + j] *= pivot
            inverse[MAX_CORNERS * i + j] *= pivot
        for k in range(m):
            factor = work[MAX_CORNERS * k + i]
            if k != i and factor != 0.0:
                for j in range(m):
                    work[MAX_CORNERS * k + j] -= factor * work[MAX_CORNERS * i + j]
                    inverse[MAX_CORNERS * k + j] -= factor * inverse[MAX_CORNERS * i + j]


@kernel(void(MAT, int64, OUT_VEC, float64, OUT_MAT), is_inner=True)
def relax(path, n, inverse, share, moves):
    """Write a share of the moves (n - 2, dof) to the equilibrium of the corners without boxes."""
    m = n - 2
    first = 1.0 / max(SHORTEST, distance(path[0], path[1]))
    last = 1.0 / max(SHORTEST, distance(path[n - 2], path[n - 1]))
    for i in range(m):
        for k in range(path.shape[1]):
            rest = inverse[MAX_CORNERS * i] * first * path[0, k]
            rest += inverse[MAX_CORNERS * i + m - 1] * last * path[n - 1, k]
            moves[i, k] = share * (rest - path[i + 1, k])


@kernel(int64(SPACE, MAT, MAT, int64, OUT_MAT, OUT_INTS, OUT_VEC, int64), is_inner=True)
def add_constraints(space, path, moved, e, contacts, edges, least, n):
    """
    Append the linearized contact constraints of edge e; return the number of constraints.

    Contacts are those of the edge in `moved`; the constraints apply to the moves from `path`.
    """
    if n >= contacts.shape[0]:
        return n
    find, chain = as_contacts(space.functions[CONTACTS_AT]), as_chain(space.functions[CHAIN_AT])
    free = contacts[n:]
    n_found = find(moved[e], moved[e + 1], chain, space.robot, space.obstacles, free)
    for i in range(n, n + n_found):
        share = contacts[i, SHARE]
        edges[i] = e
        least[i] = LEFT - contacts[i, GAP]
        for k in range(path.shape[1]):
            move = (1.0 - share) * (moved[e, k] - path[e, k])
            move += share * (moved[e + 1, k] - path[e + 1, k])
            least[i] += contacts[i, GRADIENT + k] * move
    return n + n_found


@kernel(int64(MAT, MAT, int64, MAT, OUT_MAT, OUT_INTS, OUT_VEC, int64), is_inner=True)
def add_limits(bounds, path, n, moves, contacts, edges, least, n_found):
    """Append a constraint for each joint limit that the moves exceed; return the total."""
    for i in range(n - 2):
        for k in range(path.shape[1]):
            q = path[i + 1, k] + moves[i, k]
            is_low = q < bounds[0, k] - BEYOND
            if n_found >= contacts.shape[0] or not (is_low or q > bounds[1, k] + BEYOND):
                continue
            for column in range(contacts.shape[1]):
                contacts[n_found, column] = 0.0
            # At the end of the edge before: the corner itself.
            edges[n_found], contacts[n_found, SHARE] = i, 1.0
            contacts[n_found, GRADIENT + k] = 1.0 if is_low else -1.0
            at = path[i + 1, k]
            least[n_found] = bounds[0, k] - at if is_low else at - bounds[1, k]
            n_found += 1
    return n_found


@kernel(void(OUT_VEC, OUT_MAT, OUT_INTS, OUT_VEC, int64, int64, OUT_MAT), is_inner=True)
def constrain(inverse, contacts, edges, least, n, m, moves):
    """
    Correct the moves of m corners, by the least change in the spring norm, to keep n constraints.

    Dual ascent, a constraint at a time (Hildreth 1957).
    """
    dof = moves.shape[1]
    for i in range(n):
        contacts[i, MULTIPLIER] = 0.0
    for _ in range(MAX_SWEEPS):
        change = 0.0
        for i in range(n):
            e, share = edges[i], contacts[i, SHARE]
            # Corners before and after the edge, and their coupling.
            a, b = e - 1, e
            own = along = 0.0
            if a >= 0:
                own += (1.0 - share) ** 2 * inverse[MAX_CORNERS * a + a]
            if b < m:
                own += share**2 * inverse[MAX_CORNERS * b + b]
            if a >= 0 and b < m:
                own += 2.0 * share * (1.0 - share) * inverse[MAX_CORNERS * a + b]
            squared = 0.0
            for k in range(dof):
                gradient = contacts[i, GRADIENT + k]
                squared += gradient * gradient
                if a >= 0:
                    along += (1.0 - share) * gradient * moves[a, k]
                if b < m:
                    along += share * gradient * moves[b, k]
            own *= squared
            if own < 1e-9:
                continue
            raised = max(0.0, contacts[i, MULTIPLIER] + (least[i] - along) / own)
            step = raised - contacts[i, MULTIPLIER]
            contacts[i, MULTIPLIER] = raised
            for j in range(m):
                lever = 0.0
                if a >= 0:
                    lever += (1.0 - share) * inverse[MAX_CORNERS * j + a]
                if b < m:
                    lever += share * inverse[MAX_CORNERS * j + b]
                for k in range(dof):
                    moves[j, k] += step * lever * contacts[i, GRADIENT + k]
            change = max(change, abs(step) * own)
        # Of the gap, in metres.
        if change < 1e-7:
            break


@kernel(float64(MAT, MAT, int64, MAT, OUT_MAT), is_inner=True)
def shift(bounds, path, n, moves, moved):
    """Write the path with its corners moved, within the bounds; return its length."""
    for k in range(path.shape[1]):
        moved[0, k], moved[n - 1, k] = path[0, k], path[n - 1, k]
        for i in range(1, n - 1):
            q = path[i, k] + moves[i - 1, k]
            moved[i, k] = min(bounds[1, k], max(bounds[0, k], q))
    return path_length(moved, n)


@kernel(int64(SPACE, OUT_MAT, int64, OUT_MAT, OUT_INTS), is_inner=True)
def relax_band(space, path, n, contacts, edges):
    """
    Move all corners of a path to where it is shorter, without entering a box.

    Springs between the corners straighten the path, contacts of edges with boxes constrain it.
    New contacts of the moved path are added, and the equilibrium is solved again. New edges are
    checked before they are accepted. Returns the number of contacts, less than 0 where no such
    move was found.
    """
    m, length, bounds = n - 2, path_length(path, n), space.bounds
    inverse, least = scratch.floats(SQUARE), scratch.floats(MAX_CONTACTS)
    moves, moved = np.empty((m, path.shape[1])), np.empty((n, path.shape[1]))
    invert_springs(path, n, inverse)
    n_found = 0
    for e in range(n - 1):
        n_found = add_constraints(space, path, path, e, contacts, edges, least, n_found)
    if n_found == 0:
        return -1
    n_own, share = n_found, 1.0
    for _ in range(N_TRIES):
        n_found = n_own
        for _ in range(1 + N_CORRECTIONS):
            relax(path, n, inverse, share, moves)
            constrain(inverse, contacts, edges, least, n_found, m, moves)
            n_before = n_found
            n_found = add_limits(bounds, path, n, moves, contacts, edges, least, n_found)
            if n_found > n_before:
                continue
            if shift(bounds, path, n, moves, moved) > length * (1.0 - 1e-6):
                break
            is_allowed = True
            for e in range(n - 1):
                if not is_free(space, moved[e], moved[e + 1]):
                    is_allowed = False
                    n_found = add_constraints(
                        space, path, moved, e, contacts, edges, least, n_found
                    )
            if is_allowed:
                for i in range(1, n - 1):
                    copy(moved[i], path[i])
                return n_found
        # The error of the linearized contacts grows with the square of the move.
        share *= SHORTER
    return -1 - n_found


@kernel(int64(OUT_MAT, int64, MAT, OUT_INTS, int64), is_inner=True)
def insert_corner(path, n, contacts, edges, n_found):
    """
    Insert a corner at the contact within an edge with the greatest multiplier; return the new n.

    A straight edge cannot deform at a contact in its middle, two edges can.
    """
    greatest, row = 0.0, -1
    for i in range(n_found):
        share = contacts[i, SHARE]
        if edges[i] + 1 >= n:
            continue
        length = distance(path[edges[i]], path[edges[i] + 1])
        is_inside = min(share, 1.0 - share) * length > LEAST_EDGE
        if is_inside and contacts[i, MULTIPLIER] > greatest:
            greatest, row = contacts[i, MULTIPLIER], i
    if row < 0 or n >= min(path.shape[0], MAX_CORNERS + 2):
        return n
    e, share = edges[row], contacts[row, SHARE]
    for i in range(n, e + 1, -1):
        copy(path[i - 1], path[i])
    for k in range(path.shape[1]):
        path[e + 1, k] = path[e, k] + share * (path[e + 2, k] - path[e, k])
    return n + 1


@kernel(int64(SPACE, OUT_MAT, int64, VEC))
def shorten(space, path, n, how):
    """
    Alternate shortcuts and the elastic band until a path gets no shorter (`SHORTEN`).

    how: settings, entries as in `shortcut`.
    """
    spacing, enough = how[SPACING], how[ENOUGH]
    n = shortcut_path(space, path, n, spacing, enough)
    contacts = np.empty((MAX_CONTACTS, GRADIENT + path.shape[1]))
    edges = np.empty(MAX_CONTACTS, np.int64)
    length, has_new_corner = path_length(path, n), False
    for _ in range(int64(how[MOVES])):
        if n < 3 or n > MAX_CORNERS + 2:
            break
        n_found = relax_band(space, path, n, contacts, edges)
        if n_found >= 0:
            n = shortcut_path(space, path, n, spacing, enough)
        shorter = path_length(path, n)
        is_done = shorter > length * (1.0 - WORTH)
        length = shorter
        if not is_done:
            has_new_corner = False
            continue
        # Converged with these corners: try once more with another one.
        if has_new_corner:
            break
        n_before = n
        n = insert_corner(path, n, contacts, edges, n_found if n_found >= 0 else -1 - n_found)
        has_new_corner = n > n_before
        if not has_new_corner:
            break
    if has_new_corner:
        # A corner without a gain is removed again.
        n = shortcut_path(space, path, n, spacing, enough)
    return n
