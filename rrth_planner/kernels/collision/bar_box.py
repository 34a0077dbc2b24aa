# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Bars against boxes: contact, signed distance, hull of a moving bar, penetration depth."""

import math

from numba.core.types import float64, int64, void
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import CUBE, kernel, MAT, OUT_CUBE, OUT_VEC
from rrth_planner.kernels.layout import (
    ALLOWED_BITS,
    ANY_ALLOWED,
    BOX_ALLOWED,
    BOX_HALF,
    BOX_OFFSET,
    LANES,
)

# Bars nearer than this are in contact [m].
CONTACT = 1e-12
# Least sine for a cross axis: a bar parallel to an axis of the box has none.
PARALLEL = 1e-12
# Up to four points in the axes of LANES boxes.
LOCAL_ROOM = 12 * LANES


@kernel(int64(MAT, int64, int64, int64), is_inner=True)
def without_allowed(boxes, g, bar, lanes):
    """Return those of some boxes of a last group that a bar must keep clear of, looked up."""
    first, bit = LANES * (BOX_ALLOWED + bar // ALLOWED_BITS), bar % ALLOWED_BITS
    for j in range(LANES):
        if (int64(boxes[g, first + j]) >> bit) & 1:
            lanes &= ~(1 << j)
    return lanes


@kernel(int64(MAT, int64, int64, int64), is_inlined=True, is_inner=True)
def checked_lanes(boxes, g, bar, lanes):
    """Return those of some boxes of a last group that a bar must keep clear of."""
    # Mostly no bar may meet any box: one number says so.
    if boxes[g, LANES * ANY_ALLOWED] != 0.0:
        lanes = without_allowed(boxes, g, bar, lanes)
    return lanes


@kernel(int64(OUT_VEC, int64, MAT, int64), is_inlined=True)
def contact_lanes(points, at, boxes, g):
    """
    Return the boxes of group g in contact with a bar, bit l for lane l.

    The bar runs from points[at] to points[at + 4], its radius stands behind the latter. Separating
    axes (Gottschalk, Lin and Manocha 1996): three face normals and the bar's cross products with
    them; for a segment and a box these six decide exactly.
    """
    local = scratch.floats(LOCAL_ROOM)
    ax, ay, az = points[at], points[at + 1], points[at + 2]
    bx, by, bz, radius = points[at + 4], points[at + 5], points[at + 6], points[at + 7]
    ex, ey, ez = 0.5 * (bx - ax), 0.5 * (by - ay), 0.5 * (bz - az)
    mx, my, mz = 0.5 * (bx + ax), 0.5 * (by + ay), 0.5 * (bz + az)
    hit = 0
    for j in range(LANES):
        is_apart = False
        for r in range(3):
            i = 3 * r * LANES + j
            x, y, z = boxes[g, i], boxes[g, i + LANES], boxes[g, i + 2 * LANES]
            e = x * ex + y * ey + z * ez
            m = boxes[g, (9 + r) * LANES + j] + x * mx + y * my + z * mz
            local[r * LANES + j], local[(3 + r) * LANES + j] = e, m
            is_apart |= abs(m) > boxes[g, (12 + r) * LANES + j] + radius + abs(e)
        hit |= (0 if is_apart else 1) << j
    if hit == 0:
        return 0
    apart = 0
    for j in range(LANES):
        e0, e1, e2 = local[j], local[LANES + j], local[2 * LANES + j]
        m0, m1, m2 = local[3 * LANES + j], local[4 * LANES + j], local[5 * LANES + j]
        f0, f1, f2 = abs(e0), abs(e1), abs(e2)
        h0 = boxes[g, 12 * LANES + j] + radius
        h1 = boxes[g, 13 * LANES + j] + radius
        h2 = boxes[g, 14 * LANES + j] + radius
        is_apart = (
            (abs(m1 * e2 - m2 * e1) > h1 * f2 + h2 * f1)
            | (abs(m2 * e0 - m0 * e2) > h2 * f0 + h0 * f2)
            | (abs(m0 * e1 - m1 * e0) > h0 * f1 + h1 * f0)
        )
        apart |= (1 if is_apart else 0) << j
    return hit & ~apart


@kernel(float64(OUT_VEC, OUT_VEC, OUT_VEC, float64), is_inner=True)
def _derivative(start, step, half, t):
    """Return half the derivative by t of the squared distance of start + t step from a box."""
    total = 0.0
    for k in range(3):
        p = start[k] + t * step[k]
        excess = max(abs(p) - half[k], 0.0)
        total += math.copysign(excess, p) * step[k]
    return total


@kernel(float64(OUT_VEC, OUT_VEC, OUT_VEC))
def bar_box_distance(start, step, half):
    """
    Return the signed distance of a bar from a box, in the box's own axes [m]; < 0 inside.

    Apart: the squared distance of the point start + t step is convex and piecewise quadratic in
    t, so its derivative is monotone and piecewise linear, with breaks where a coordinate crosses a
    face: the zero between two breaks is exact. In contact: the least overlap over the separating
    axes, which is the depth of penetration of two convex polytopes.
    """
    low, high = 0.0, 1.0
    if _derivative(start, step, half, 0.0) >= 0.0:
        high = 0.0
    elif _derivative(start, step, half, 1.0) <= 0.0:
        low = 1.0
    else:
        for k in range(3):
            if step[k] != 0.0:
                for side in (-1.0, 1.0):
                    t = (side * half[k] - start[k]) / step[k]
                    if low < t < high:
                        if _derivative(start, step, half, t) < 0.0:
                            low = t
                        else:
                            high = t
        at_low = _derivative(start, step, half, low)
        at_high = _derivative(start, step, half, high)
        if at_high > at_low:
            low = low - at_low * (high - low) / (at_high - at_low)
    t = low
    squared = 0.0
    for k in range(3):
        excess = max(abs(start[k] + t * step[k]) - half[k], 0.0)
        squared += excess * excess
    # Rounding alone can leave a bar right through the box some 1e-17 m outside.
    if squared > CONTACT * CONTACT:
        return math.sqrt(squared)
    overlap = math.inf
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        middle, f = start[k] + 0.5 * step[k], 0.5 * abs(step[k])
        overlap = min(overlap, half[k] + f - abs(middle))
        norm = math.hypot(step[i], step[j])
        if norm > 0.0:
            reach = (half[i] * abs(step[j]) + half[j] * abs(step[i])) / norm
            offset = abs(start[i] * step[j] - start[j] * step[i]) / norm
            overlap = min(overlap, reach - offset)
    return -max(overlap, 0.0)


@kernel(float64(OUT_VEC, int64, MAT, int64, int64, float64))
def nearer(points, at, boxes, g, j, least):
    """
    Return the signed distance of a bar from lane j of group g, where it is less than `least` [m].

    Mostly a face of the box already shows that it is not; an unused lane is infinitely far. The
    bar is at points[at] as in `contact_lanes`.
    """
    start, step, half = scratch.floats(3), scratch.floats(3), scratch.floats(3)
    gap, radius = -math.inf, points[at + 7]
    for r in range(3):
        at_start = at_end = boxes[g, LANES * (BOX_OFFSET + r) + j]
        for c in range(3):
            cosine = boxes[g, LANES * (3 * r + c) + j]
            at_start += cosine * points[at + c]
            at_end += cosine * points[at + 4 + c]
        start[r], step[r] = at_start, at_end - at_start
        half[r] = boxes[g, LANES * (BOX_HALF + r) + j]
        gap = max(gap, min(at_start, at_end) - half[r], -max(at_start, at_end) - half[r])
    if gap > 0.0 and gap - radius >= least:
        return least
    return min(least, bar_box_distance(start, step, half) - radius)


@kernel(int64(OUT_VEC, int64, int64, float64, float64, MAT, int64), is_inlined=True)
def open_lanes(points, a, b, bow_start, bow_end, boxes, g):
    """
    Return the boxes of group g not proven apart from the hull of a bar at two instants.

    Bit l stands for lane l. The bar runs from points[a] to points[a + 4] at the one instant, from
    points[b] to points[b + 4] at the other; its radius stands behind the end. The hull is
    thickened by `bow_start` round the first end and by `bow_end` round the second: how far each
    may stray from the chord of its motion (`docs/algorithms.md`, section 3). Axes: the face
    normals, and their cross products with the mean direction of the bar.
    """
    local = scratch.floats(LOCAL_ROOM)
    ax, ay, az = points[a], points[a + 1], points[a + 2]
    bx, by, bz = points[a + 4], points[a + 5], points[a + 6]
    cx, cy, cz = points[b], points[b + 1], points[b + 2]
    dx, dy, dz, radius = points[b + 4], points[b + 5], points[b + 6], points[b + 7]
    first, last = bow_start + radius, bow_end + radius
    left = 0
    for j in range(LANES):
        is_apart = False
        for r in range(3):
            i = 3 * r * LANES + j
            x, y, z = boxes[g, i], boxes[g, i + LANES], boxes[g, i + 2 * LANES]
            offset, half = boxes[g, (9 + r) * LANES + j], boxes[g, (12 + r) * LANES + j]
            p = offset + x * ax + y * ay + z * az
            q = offset + x * bx + y * by + z * bz
            s = offset + x * cx + y * cy + z * cz
            t = offset + x * dx + y * dy + z * dz
            local[r * LANES + j], local[(3 + r) * LANES + j] = p, q
            local[(6 + r) * LANES + j], local[(9 + r) * LANES + j] = s, t
            is_apart |= min(min(p, s) - first, min(q, t) - last) > half
            is_apart |= max(max(p, s) + first, max(q, t) + last) < -half
        left |= (0 if is_apart else 1) << j
    if left == 0:
        return 0
    apart = 0
    for j in range(LANES):
        a0, a1, a2 = local[j], local[LANES + j], local[2 * LANES + j]
        b0, b1, b2 = local[3 * LANES + j], local[4 * LANES + j], local[5 * LANES + j]
        c0, c1, c2 = local[6 * LANES + j], local[7 * LANES + j], local[8 * LANES + j]
        d0, d1, d2 = local[9 * LANES + j], local[10 * LANES + j], local[11 * LANES + j]
        h0 = boxes[g, 12 * LANES + j] + radius
        h1 = boxes[g, 13 * LANES + j] + radius
        h2 = boxes[g, 14 * LANES + j] + radius
        e0, e1, e2 = (b0 - a0) + (d0 - c0), (b1 - a1) + (d1 - c1), (b2 - a2) + (d2 - c2)
        f0, f1, f2 = abs(e0), abs(e1), abs(e2)
        # The thickening along an axis that is not of unit length grows with its norm, which the
        # sum of its components bounds.
        reach, u, v = h1 * f2 + h2 * f1, bow_start * (f1 + f2), bow_end * (f1 + f2)
        p, q, s, t = a1 * e2 - a2 * e1, b1 * e2 - b2 * e1, c1 * e2 - c2 * e1, d1 * e2 - d2 * e1
        is_apart = min(min(p, s) - u, min(q, t) - v) > reach
        is_apart |= max(max(p, s) + u, max(q, t) + v) < -reach
        reach, u, v = h2 * f0 + h0 * f2, bow_start * (f2 + f0), bow_end * (f2 + f0)
        p, q, s, t = a2 * e0 - a0 * e2, b2 * e0 - b0 * e2, c2 * e0 - c0 * e2, d2 * e0 - d0 * e2
        is_apart |= min(min(p, s) - u, min(q, t) - v) > reach
        is_apart |= max(max(p, s) + u, max(q, t) + v) < -reach
        reach, u, v = h0 * f1 + h1 * f0, bow_start * (f0 + f1), bow_end * (f0 + f1)
        p, q, s, t = a0 * e1 - a1 * e0, b0 * e1 - b1 * e0, c0 * e1 - c1 * e0, d0 * e1 - d1 * e0
        is_apart |= min(min(p, s) - u, min(q, t) - v) > reach
        is_apart |= max(max(p, s) + u, max(q, t) + v) < -reach
        apart |= (1 if is_apart else 0) << j
    return left & ~apart


@kernel(void(MAT, CUBE, OUT_CUBE), is_short=True)
def depths(boxes, points, found):
    """
    Write by how much each box would have to shrink on every side for each bar to be clear.

    boxes (15, m): a column for each box, its axes, offset and half sizes as from `boxes.rows_of`;
    points (n, n_bars, 8): the bars of the arm in n configurations, each its start, half its length
    (not read), its end and its radius [m]; found (n, n_bars, m) [m], < 0: apart.
    """
    middle, along, half = scratch.floats(3), scratch.floats(3), scratch.floats(3)
    for k in range(points.shape[0]):
        for bar in range(points.shape[1]):
            p, q = points[k, bar, :4], points[k, bar, 4:]
            for j in range(boxes.shape[1]):
                depth = math.inf
                for i in range(3):
                    begin = boxes[BOX_OFFSET + i, j]
                    end = begin
                    for c in range(3):
                        begin += boxes[3 * i + c, j] * p[c]
                        end += boxes[3 * i + c, j] * q[c]
                    middle[i], along[i] = 0.5 * (end + begin), 0.5 * (end - begin)
                    half[i] = boxes[BOX_HALF + i, j] + q[3]
                    depth = min(depth, half[i] + abs(along[i]) - abs(middle[i]))
                for i in range(3):
                    r, s = (i + 1) % 3, (i + 2) % 3
                    a, b = abs(along[r]), abs(along[s])
                    if a + b > PARALLEL:
                        offset = abs(middle[r] * along[s] - middle[s] * along[r])
                        depth = min(depth, (half[r] * b + half[s] * a - offset) / (a + b))
                found[k, bar, j] = depth
