# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Contacts of an edge: where the arm passes close to boxes, and the gradient of the gap."""

import math

from numba.core.types import float64, int64, void
from rrth_planner.kernels import scratch
from rrth_planner.kernels.collision.arm_validity import ENDS_ROOM, MAX_GROUPS
from rrth_planner.kernels.collision.bar_box import checked_lanes
from rrth_planner.kernels.jit import CHAIN, kernel, MAT, OUT_MAT, OUT_POOL, OUT_VEC, VEC
from rrth_planner.kernels.layout import BAR_SIZE, D, LANES, MAX_DOF
from rrth_planner.kernels.vectors import distance

# A gap smaller than this counts as contact [m].
CLOSE = 0.03
# Spacing of the samples of an edge [rad]; near its minimum the gap is quadratic.
SPACING = 0.04
# Step of the finite differences of the gradient [rad or m].
STEP = 1e-6
# Entries of a contact: where on the edge (0 to 1), gap [m], multiplier of its constraint, then the
# gradient of the gap by the joints.
SHARE, GAP, MULTIPLIER, GRADIENT = range(4)
# The golden section, and its iterations: to 0.5 % of the spacing.
GOLDEN, N_GOLDEN = 0.6180339887498949, 10
# Most pairs of a bar and a box in contact along an edge.
MAX_PAIRS = 64
PAIRS_ROOM = 4 * MAX_PAIRS


@kernel(void(OUT_VEC, int64, MAT, int64, OUT_VEC))
def bar_gaps(points, at, boxes, g, gaps):
    """
    Write the greatest gap between a bar and each box of a group over the separating axes [m].

    A lower bound of their distance, exact where face or edge are nearest; < 0 in contact.
    """
    ax, ay, az = points[at], points[at + 1], points[at + 2]
    bx, by, bz, radius = points[at + 4], points[at + 5], points[at + 6], points[at + 7]
    ex, ey, ez = 0.5 * (bx - ax), 0.5 * (by - ay), 0.5 * (bz - az)
    mx, my, mz = 0.5 * (bx + ax), 0.5 * (by + ay), 0.5 * (bz + az)
    for j in range(LANES):
        x, y, z = boxes[g, j], boxes[g, LANES + j], boxes[g, 2 * LANES + j]
        e0 = x * ex + y * ey + z * ez
        m0 = boxes[g, 9 * LANES + j] + x * mx + y * my + z * mz
        x, y, z = boxes[g, 3 * LANES + j], boxes[g, 4 * LANES + j], boxes[g, 5 * LANES + j]
        e1 = x * ex + y * ey + z * ez
        m1 = boxes[g, 10 * LANES + j] + x * mx + y * my + z * mz
        x, y, z = boxes[g, 6 * LANES + j], boxes[g, 7 * LANES + j], boxes[g, 8 * LANES + j]
        e2 = x * ex + y * ey + z * ez
        m2 = boxes[g, 11 * LANES + j] + x * mx + y * my + z * mz
        f0, f1, f2 = abs(e0), abs(e1), abs(e2)
        h0 = boxes[g, 12 * LANES + j] + radius
        h1 = boxes[g, 13 * LANES + j] + radius
        h2 = boxes[g, 14 * LANES + j] + radius
        gap = max(abs(m0) - h0 - f0, max(abs(m1) - h1 - f1, abs(m2) - h2 - f2))
        # The cross products of the bar with the box's axes, made of unit length.
        norm = 1.0 / math.sqrt(f1 * f1 + f2 * f2 + 1e-24)
        gap = max(gap, (abs(m1 * e2 - m2 * e1) - h1 * f2 - h2 * f1) * norm)
        norm = 1.0 / math.sqrt(f2 * f2 + f0 * f0 + 1e-24)
        gap = max(gap, (abs(m2 * e0 - m0 * e2) - h2 * f0 - h0 * f2) * norm)
        norm = 1.0 / math.sqrt(f0 * f0 + f1 * f1 + 1e-24)
        gaps[j] = max(gap, (abs(m0 * e1 - m1 * e0) - h0 * f1 - h1 * f0) * norm)


@kernel(
    float64(VEC, VEC, float64, float64, CHAIN, MAT, int64, int64, int64, OUT_VEC, OUT_VEC),
    is_inner=True,
)
def gap_at(q_from, q_to, share, ray_length, chain, boxes, bar, g, j, q, points):
    """Return the gap of one bar and one box at a share of the edge [m]."""
    for k in range(q_from.shape[0]):
        q[k] = q_from[k] + share * (q_to[k] - q_from[k])
    chain(q, ray_length, points, 0)
    gaps = scratch.floats(LANES)
    bar_gaps(points, BAR_SIZE * bar, boxes, g, gaps)
    return gaps[j]


@kernel(
    int64(VEC, VEC, float64, float64, float64, CHAIN, MAT, OUT_POOL, OUT_MAT, int64), is_inner=True
)
def add_contact(q_from, q_to, share, spacing, ray_length, chain, boxes, pair, contacts, n):
    """
    Append the contact of one pair, at its least gap near a share of the edge; return the total.

    The minimum is found by golden section (Kiefer 1953), the gradient by differences.
    """
    if n >= contacts.shape[0]:
        return n
    q, points = scratch.floats(MAX_DOF), scratch.floats(ENDS_ROOM)
    bar, g, j = int64(pair[0]), int64(pair[1]), int64(pair[2])
    low, high = max(0.0, share - spacing), min(1.0, share + spacing)
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_left = gap_at(q_from, q_to, left, ray_length, chain, boxes, bar, g, j, q, points)
    at_right = gap_at(q_from, q_to, right, ray_length, chain, boxes, bar, g, j, q, points)
    for _ in range(N_GOLDEN):
        if at_left < at_right:
            high, right, at_right = right, left, at_left
            left = high - GOLDEN * (high - low)
            at_left = gap_at(q_from, q_to, left, ray_length, chain, boxes, bar, g, j, q, points)
        else:
            low, left, at_left = left, right, at_right
            right = low + GOLDEN * (high - low)
            at_right = gap_at(q_from, q_to, right, ray_length, chain, boxes, bar, g, j, q, points)
    share = 0.5 * (low + high)
    contacts[n, SHARE], contacts[n, MULTIPLIER] = share, 0.0
    contacts[n, GAP] = gap_at(q_from, q_to, share, ray_length, chain, boxes, bar, g, j, q, points)
    gaps = scratch.floats(LANES)
    for i in range(q_from.shape[0]):
        here = q[i]
        q[i] = here + STEP
        chain(q, ray_length, points, 0)
        bar_gaps(points, BAR_SIZE * bar, boxes, g, gaps)
        ahead = gaps[j]
        q[i] = here - STEP
        chain(q, ray_length, points, 0)
        bar_gaps(points, BAR_SIZE * bar, boxes, g, gaps)
        q[i] = here
        contacts[n, GRADIENT + i] = (ahead - gaps[j]) / (2.0 * STEP)
    return n + 1


@kernel(int64(VEC, VEC, CHAIN, MAT, MAT, OUT_MAT))
def edge_contacts(q_from, q_to, chain, robot, boxes, contacts):
    """
    Write the contacts of an edge with boxes; return their number.

    contacts (capacity, 3 + dof): for each pair of bar and box, the local minima of their gap along
    the edge, the gap there [m], and its gradient by the joints [m/rad].
    """
    dof, n, n_pairs = q_from.shape[0], 0, 0
    points, q = scratch.floats(ENDS_ROOM), scratch.floats(MAX_DOF)
    # Bar, group, lane and last sample of each pair that came close; its gap then; is it falling?
    pairs, gaps = scratch.ints(PAIRS_ROOM), scratch.floats(MAX_PAIRS)
    now = scratch.floats(LANES)
    falling, waiting = scratch.ints(MAX_PAIRS), scratch.ints(MAX_GROUPS)
    ray_length = robot[dof, D]
    n_samples = int64(distance(q_from, q_to) / SPACING) + 2
    spacing = 1.0 / (n_samples - 1)
    for sample in range(n_samples):
        for k in range(dof):
            q[k] = q_from[k] + sample * spacing * (q_to[k] - q_from[k])
        n_bars = chain(q, ray_length, points, 0)
        for bar in range(n_bars):
            n_waiting, waiting[0] = 1, 0
            while n_waiting > 0:
                n_waiting -= 1
                g = int64(waiting[n_waiting])
                bar_gaps(points, BAR_SIZE * bar, boxes, g, now)
                for j in range(LANES):
                    gap = now[j]
                    # Also for NaN: a lane without a box.
                    if not gap < CLOSE:
                        continue
                    if LANES * g + 1 < boxes.shape[0]:
                        waiting[n_waiting] = LANES * g + j + 1
                        n_waiting += 1
                        continue
                    if checked_lanes(boxes, g, bar, 1 << j) == 0:
                        continue
                    row = 0
                    while row < n_pairs and not (
                        pairs[4 * row] == bar
                        and pairs[4 * row + 1] == g
                        and pairs[4 * row + 2] == j
                    ):
                        row += 1
                    if row == MAX_PAIRS:
                        continue
                    if row == n_pairs:
                        n_pairs += 1
                        pairs[4 * row], pairs[4 * row + 1], pairs[4 * row + 2] = bar, g, j
                        falling[row], gaps[row] = 1, math.inf
                    elif falling[row] and (pairs[4 * row + 3] < sample - 1 or gap > gaps[row]):
                        share = pairs[4 * row + 3] * spacing
                        n = add_contact(
                            q_from,
                            q_to,
                            share,
                            spacing,
                            ray_length,
                            chain,
                            boxes,
                            pairs[4 * row : 4 * row + 3],
                            contacts,
                            n,
                        )
                        falling[row] = 0
                    if gap < gaps[row] or pairs[4 * row + 3] < sample - 1:
                        falling[row] = 1
                    gaps[row], pairs[4 * row + 3] = gap, sample
    for row in range(n_pairs):
        if falling[row]:
            share = pairs[4 * row + 3] * spacing
            pair = pairs[4 * row : 4 * row + 3]
            n = add_contact(
                q_from, q_to, share, spacing, ray_length, chain, boxes, pair, contacts, n
            )
    return n


@kernel(int64(VEC, VEC, CHAIN, MAT, MAT, OUT_MAT))
def no_contacts(q_from, q_to, chain, robot, boxes, contacts):
    """Find no contacts: on a map with plane walls shortcuts are enough."""
    return 0
