# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Taut paths that lean on boxes, moved along them to where the way round is shortest."""

from numba.core.types import float64, int64, void
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.collision.edge_contacts import GAP, PRESSED, SHARE, SLOPES
from rrth_planner.kernels.jit import (
    CHAIN,
    CONTACTS,
    EDGE_CHECK,
    kernel,
    MAT,
    OUT_INTS,
    OUT_MAT,
    OUT_VEC,
    VEC,
)
from rrth_planner.kernels.search.shortcut import ENOUGH, MOVES, pull_taut, SPACING
from rrth_planner.kernels.vectors import copy, distance, path_length

# Gap that a path is left with, for the proof of its edges to succeed [m].
LEFT = 1e-4
# Most corners and contacts of a path that are moved; sweeps of the balance.
MAX_CORNERS, MAX_CONTACTS, MAX_SWEEPS = 16, 96, 30
# Tries of a move, each of a shorter one, and corrections of each.
N_TRIES, SHORTER, N_CORRECTIONS = 3, 0.3, 4
SQUARE = MAX_CORNERS * MAX_CORNERS
# How far beyond a joint's limit a move may end before it is corrected; it is cut off there [rad].
BEYOND = 1e-9
# A new corner is put no nearer than this to another one [rad].
SHORTEST_BEND = 0.03
# Shorter edges pull no harder than one of this length [rad].
SHORTEST = 1e-3
# What a round must gain to be worth another one, relative.
WORTH = 5e-4


@kernel(void(MAT, int64, OUT_VEC))
def invert_springs(path, n, inverse):
    """
    Write the inverse of the matrix by which the corners of a path pull at one another.

    The sum of lengths l has the majorant sum of (l^2 / l_0 + l_0) / 2 that touches it at the
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


@kernel(void(MAT, int64, OUT_VEC, float64, OUT_MAT))
def relax(path, n, inverse, share, moves):
    """Write a share of the moves (n - 2, dof) by which the corners come to rest without boxes."""
    m = n - 2
    first = 1.0 / max(SHORTEST, distance(path[0], path[1]))
    last = 1.0 / max(SHORTEST, distance(path[n - 2], path[n - 1]))
    for i in range(m):
        for k in range(path.shape[1]):
            rest = inverse[MAX_CORNERS * i] * first * path[0, k]
            rest += inverse[MAX_CORNERS * i + m - 1] * last * path[n - 1, k]
            moves[i, k] = share * (rest - path[i + 1, k])


@kernel(int64(CONTACTS, CHAIN, MAT, MAT, MAT, MAT, int64, OUT_MAT, OUT_INTS, OUT_VEC, int64))
def add_constraints(find, chain, robot, obstacles, path, moved, e, contacts, edges, least, n):
    """
    Append what keeps edge e off the boxes, to first order; return the number of constraints.

    The edge leans where it is in `moved`; the constraints are on the moves from `path`.
    """
    if n >= contacts.shape[0]:
        return n
    n_found = find(moved[e], moved[e + 1], chain, robot, obstacles, contacts[n:])
    for i in range(n, n + n_found):
        share = contacts[i, SHARE]
        edges[i] = e
        least[i] = LEFT - contacts[i, GAP]
        for k in range(path.shape[1]):
            move = (1.0 - share) * (moved[e, k] - path[e, k])
            move += share * (moved[e + 1, k] - path[e + 1, k])
            least[i] += contacts[i, SLOPES + k] * move
    return n + n_found


@kernel(int64(MAT, MAT, int64, MAT, OUT_MAT, OUT_INTS, OUT_VEC, int64))
def add_limits(bounds, path, n, moves, contacts, edges, least, n_found):
    """Append a constraint for each joint limit that the moves pass; return the total."""
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
            contacts[n_found, SLOPES + k] = 1.0 if is_low else -1.0
            at = path[i + 1, k]
            least[n_found] = bounds[0, k] - at if is_low else at - bounds[1, k]
            n_found += 1
    return n_found


@kernel(void(OUT_VEC, OUT_MAT, OUT_INTS, OUT_VEC, int64, int64, OUT_MAT))
def constrain(inverse, contacts, edges, least, n, m, moves):
    """
    Change the moves of m corners, least in the sense of the springs, to keep n constraints.

    Dual ascent, a constraint at a time (Hildreth 1957).
    """
    dof = moves.shape[1]
    for i in range(n):
        contacts[i, PRESSED] = 0.0
    for _ in range(MAX_SWEEPS):
        change = 0.0
        for i in range(n):
            e, share = edges[i], contacts[i, SHARE]
            # Corners before and behind the edge, and what they have to do with each other.
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
                slope = contacts[i, SLOPES + k]
                squared += slope * slope
                if a >= 0:
                    along += (1.0 - share) * slope * moves[a, k]
                if b < m:
                    along += share * slope * moves[b, k]
            own *= squared
            if own < 1e-9:
                continue
            raised = max(0.0, contacts[i, PRESSED] + (least[i] - along) / own)
            step = raised - contacts[i, PRESSED]
            contacts[i, PRESSED] = raised
            for j in range(m):
                lever = 0.0
                if a >= 0:
                    lever += (1.0 - share) * inverse[MAX_CORNERS * j + a]
                if b < m:
                    lever += share * inverse[MAX_CORNERS * j + b]
                for k in range(dof):
                    moves[j, k] += step * lever * contacts[i, SLOPES + k]
            change = max(change, abs(step) * own)
        # Of the gap, in metres.
        if change < 1e-7:
            break


@kernel(float64(MAT, MAT, int64, MAT, OUT_MAT))
def shift(bounds, path, n, moves, moved):
    """Write the path with its corners moved, within the bounds; return its length."""
    for k in range(path.shape[1]):
        moved[0, k], moved[n - 1, k] = path[0, k], path[n - 1, k]
        for i in range(1, n - 1):
            q = path[i, k] + moves[i - 1, k]
            moved[i, k] = min(bounds[1, k], max(bounds[0, k], q))
    return path_length(moved, n)


@kernel(
    int64(EDGE_CHECK, CONTACTS, float64, CHAIN, MAT, MAT, MAT, OUT_MAT, int64, OUT_MAT, OUT_INTS)
)
def lean(
    is_edge_free, find, resolution, chain, robot, obstacles, bounds, path, n, contacts, edges
):
    """
    Move all corners of a path to where it is shorter, without entering a box.

    Springs between the corners pull them straight, the places where edges lean on boxes push
    back; where the moved path finds new such places, they are added and the balance is sought
    again. The new edges are proven before they are taken. Returns the number of contacts that the
    balance knew, less than 0 where no such move was found.
    """
    m, length = n - 2, path_length(path, n)
    inverse, least = scratch.floats(SQUARE), scratch.floats(MAX_CONTACTS)
    moves, moved = np.empty((m, path.shape[1])), np.empty((n, path.shape[1]))
    invert_springs(path, n, inverse)
    n_found = 0
    for e in range(n - 1):
        n_found = add_constraints(
            find, chain, robot, obstacles, path, path, e, contacts, edges, least, n_found
        )
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
            is_free = True
            for e in range(n - 1):
                if not is_edge_free(moved[e], moved[e + 1], resolution, chain, robot, obstacles):
                    is_free = False
                    n_found = add_constraints(
                        find,
                        chain,
                        robot,
                        obstacles,
                        path,
                        moved,
                        e,
                        contacts,
                        edges,
                        least,
                        n_found,
                    )
            if is_free:
                for i in range(1, n - 1):
                    copy(moved[i], path[i])
                return n_found
        # The images of the boxes bend away: of a shorter move with the square of its length.
        share *= SHORTER
    return -1 - n_found


@kernel(int64(OUT_MAT, int64, MAT, OUT_INTS, int64))
def bend(path, n, contacts, edges, n_found):
    """
    Put a corner where the path presses hardest within an edge; return the new number of waypoints.

    A straight edge cannot give way to what presses on its middle, two edges can.
    """
    hardest, row = 0.0, -1
    for i in range(n_found):
        share = contacts[i, SHARE]
        if edges[i] + 1 >= n:
            continue
        length = distance(path[edges[i]], path[edges[i] + 1])
        is_inside = min(share, 1.0 - share) * length > SHORTEST_BEND
        if is_inside and contacts[i, PRESSED] > hardest:
            hardest, row = contacts[i, PRESSED], i
    if row < 0 or n >= min(path.shape[0], MAX_CORNERS + 2):
        return n
    e, share = edges[row], contacts[row, SHARE]
    for i in range(n, e + 1, -1):
        copy(path[i - 1], path[i])
    for k in range(path.shape[1]):
        path[e + 1, k] = path[e, k] + share * (path[e + 2, k] - path[e, k])
    return n + 1


@kernel(int64(EDGE_CHECK, CONTACTS, float64, CHAIN, MAT, MAT, MAT, OUT_MAT, int64, VEC))
def tighten(is_edge_free, find, resolution, chain, robot, obstacles, bounds, path, n, how):
    """
    Pull a path taut and let it lean, in turn, until it gets no shorter (`SHORTEN`).

    how: settings by the indices of `taut`.
    """
    spacing, enough = how[SPACING], how[ENOUGH]
    n = pull_taut(is_edge_free, resolution, chain, robot, obstacles, path, n, spacing, enough)
    contacts = np.empty((MAX_CONTACTS, SLOPES + path.shape[1]))
    edges = np.empty(MAX_CONTACTS, np.int64)
    length, is_bent = path_length(path, n), False
    for _ in range(int64(how[MOVES])):
        if n < 3 or n > MAX_CORNERS + 2:
            break
        n_found = lean(
            is_edge_free,
            find,
            resolution,
            chain,
            robot,
            obstacles,
            bounds,
            path,
            n,
            contacts,
            edges,
        )
        if n_found >= 0:
            n = pull_taut(
                is_edge_free, resolution, chain, robot, obstacles, path, n, spacing, enough
            )
        shorter = path_length(path, n)
        is_done = shorter > length * (1.0 - WORTH)
        length = shorter
        if not is_done:
            is_bent = False
            continue
        # It leans as well as it can with these corners: one more try with another corner.
        if is_bent:
            break
        n_before = n
        n = bend(path, n, contacts, edges, n_found if n_found >= 0 else -1 - n_found)
        is_bent = n > n_before
        if not is_bent:
            break
    if is_bent:
        # A corner that brought nothing goes again.
        n = pull_taut(is_edge_free, resolution, chain, robot, obstacles, path, n, spacing, enough)
    return n
