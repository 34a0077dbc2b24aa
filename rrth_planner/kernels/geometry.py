# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Bars against boxes: exact contact, signed distance, and the hull of a moving bar."""

import math

from numba.core.types import boolean, float64, int64
import numpy as np
from rrth_planner.kernels.jit import BOX_HALF, BOX_OFFSET, kernel, MAT, OUT_VEC

# Bars nearer than this are in contact [m].
CONTACT = 1e-12


@kernel(boolean(float64, float64, float64, float64, float64, float64, float64, MAT))
def bar_touches_boxes(ax, ay, az, bx, by, bz, radius, boxes):
    """
    Return whether the bar a-b touches any box grown by `radius` on every side.

    Separating axes (Gottschalk, Lin and Manocha 1996): three face normals and the bar's cross
    products with them; for a segment and a box these six decide exactly. No branch, no division.
    """
    n_touched = 0
    ex, ey, ez = 0.5 * (bx - ax), 0.5 * (by - ay), 0.5 * (bz - az)
    mx, my, mz = 0.5 * (bx + ax), 0.5 * (by + ay), 0.5 * (bz + az)
    for j in range(boxes.shape[1]):
        e0 = boxes[0, j] * ex + boxes[1, j] * ey + boxes[2, j] * ez
        e1 = boxes[3, j] * ex + boxes[4, j] * ey + boxes[5, j] * ez
        e2 = boxes[6, j] * ex + boxes[7, j] * ey + boxes[8, j] * ez
        m0 = boxes[9, j] + boxes[0, j] * mx + boxes[1, j] * my + boxes[2, j] * mz
        m1 = boxes[10, j] + boxes[3, j] * mx + boxes[4, j] * my + boxes[5, j] * mz
        m2 = boxes[11, j] + boxes[6, j] * mx + boxes[7, j] * my + boxes[8, j] * mz
        h0, h1, h2 = boxes[12, j] + radius, boxes[13, j] + radius, boxes[14, j] + radius
        f0, f1, f2 = abs(e0), abs(e1), abs(e2)
        is_apart = (
            (abs(m0) > h0 + f0)
            | (abs(m1) > h1 + f1)
            | (abs(m2) > h2 + f2)
            | (abs(m1 * e2 - m2 * e1) > h1 * f2 + h2 * f1)
            | (abs(m2 * e0 - m0 * e2) > h2 * f0 + h0 * f2)
            | (abs(m0 * e1 - m1 * e0) > h0 * f1 + h1 * f0)
        )
        n_touched += 0 if is_apart else 1
    return n_touched > 0


@kernel(float64(OUT_VEC, OUT_VEC, OUT_VEC, float64))
def _slope(start, step, half, t):
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
    t, so its slope is monotone and piecewise linear, with breaks where a coordinate crosses a
    face: the zero between two breaks is exact. In contact: the least overlap over the separating
    axes, which is the depth of penetration of two convex polytopes.
    """
    low, high = 0.0, 1.0
    if _slope(start, step, half, 0.0) >= 0.0:
        high = 0.0
    elif _slope(start, step, half, 1.0) <= 0.0:
        low = 1.0
    else:
        for k in range(3):
            if step[k] != 0.0:
                for side in (-1.0, 1.0):
                    t = (side * half[k] - start[k]) / step[k]
                    if low < t < high:
                        if _slope(start, step, half, t) < 0.0:
                            low = t
                        else:
                            high = t
        at_low = _slope(start, step, half, low)
        at_high = _slope(start, step, half, high)
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


@kernel(float64(MAT, int64, int64, MAT, int64))
def bar_distance(points, row, column, boxes, j):
    """Return the signed distance of the bar at points[row, column:] from box j [m]."""
    start, step, half = np.empty(3), np.empty(3), np.empty(3)
    for r in range(3):
        at_start = at_end = boxes[BOX_OFFSET + r, j]
        for c in range(3):
            at_start += boxes[3 * r + c, j] * points[row, column + c]
            at_end += boxes[3 * r + c, j] * points[row, column + 3 + c]
        start[r], step[r], half[r] = at_start, at_end - at_start, boxes[BOX_HALF + r, j]
    return bar_box_distance(start, step, half)


@kernel(boolean(MAT, int64, int64, int64, float64, float64, float64, MAT, int64))
def hull_is_apart(points, row_a, row_b, column, bow_start, bow_end, radius, boxes, j):
    """
    Return whether the hull of a bar at two instants is proven apart from box j.

    The bar starts at points[row, column:] and ends three columns on. The hull is thickened by
    `bow_start` round the first end and by `bow_end` round the second: how far each may stray from
    the chord of its motion (`docs/algorithms.md`, section 3). Axes: the face normals, and their
    cross products with the mean direction of the bar. True is a proof, False is none.
    """
    r00, r01, r02 = boxes[0, j], boxes[1, j], boxes[2, j]
    r10, r11, r12 = boxes[3, j], boxes[4, j], boxes[5, j]
    r20, r21, r22 = boxes[6, j], boxes[7, j], boxes[8, j]
    o0, o1, o2 = boxes[BOX_OFFSET, j], boxes[BOX_OFFSET + 1, j], boxes[BOX_OFFSET + 2, j]
    h0 = boxes[BOX_HALF, j] + radius
    h1 = boxes[BOX_HALF + 1, j] + radius
    h2 = boxes[BOX_HALF + 2, j] + radius
    x, y, z = points[row_a, column], points[row_a, column + 1], points[row_a, column + 2]
    a0 = o0 + r00 * x + r01 * y + r02 * z
    a1 = o1 + r10 * x + r11 * y + r12 * z
    a2 = o2 + r20 * x + r21 * y + r22 * z
    x, y, z = points[row_a, column + 3], points[row_a, column + 4], points[row_a, column + 5]
    b0 = o0 + r00 * x + r01 * y + r02 * z
    b1 = o1 + r10 * x + r11 * y + r12 * z
    b2 = o2 + r20 * x + r21 * y + r22 * z
    x, y, z = points[row_b, column], points[row_b, column + 1], points[row_b, column + 2]
    c0 = o0 + r00 * x + r01 * y + r02 * z
    c1 = o1 + r10 * x + r11 * y + r12 * z
    c2 = o2 + r20 * x + r21 * y + r22 * z
    x, y, z = points[row_b, column + 3], points[row_b, column + 4], points[row_b, column + 5]
    d0 = o0 + r00 * x + r01 * y + r02 * z
    d1 = o1 + r10 * x + r11 * y + r12 * z
    d2 = o2 + r20 * x + r21 * y + r22 * z
    is_apart = (
        (min(min(a0, c0) - bow_start, min(b0, d0) - bow_end) > h0)
        | (max(max(a0, c0) + bow_start, max(b0, d0) + bow_end) < -h0)
        | (min(min(a1, c1) - bow_start, min(b1, d1) - bow_end) > h1)
        | (max(max(a1, c1) + bow_start, max(b1, d1) + bow_end) < -h1)
        | (min(min(a2, c2) - bow_start, min(b2, d2) - bow_end) > h2)
        | (max(max(a2, c2) + bow_start, max(b2, d2) + bow_end) < -h2)
    )
    e0, e1, e2 = (b0 - a0) + (d0 - c0), (b1 - a1) + (d1 - c1), (b2 - a2) + (d2 - c2)
    f0, f1, f2 = abs(e0), abs(e1), abs(e2)
    # The thickening along an axis that is not of unit length grows with its norm, which the sum
    # of its components bounds.
    reach, s, t = h1 * f2 + h2 * f1, bow_start * (f1 + f2), bow_end * (f1 + f2)
    a, b, c, d = a1 * e2 - a2 * e1, b1 * e2 - b2 * e1, c1 * e2 - c2 * e1, d1 * e2 - d2 * e1
    is_apart |= min(min(a, c) - s, min(b, d) - t) > reach
    is_apart |= max(max(a, c) + s, max(b, d) + t) < -reach
    reach, s, t = h2 * f0 + h0 * f2, bow_start * (f2 + f0), bow_end * (f2 + f0)
    a, b, c, d = a2 * e0 - a0 * e2, b2 * e0 - b0 * e2, c2 * e0 - c0 * e2, d2 * e0 - d0 * e2
    is_apart |= min(min(a, c) - s, min(b, d) - t) > reach
    is_apart |= max(max(a, c) + s, max(b, d) + t) < -reach
    reach, s, t = h0 * f1 + h1 * f0, bow_start * (f0 + f1), bow_end * (f0 + f1)
    a, b, c, d = a0 * e1 - a1 * e0, b0 * e1 - b1 * e0, c0 * e1 - c1 * e0, d0 * e1 - d1 * e0
    is_apart |= min(min(a, c) - s, min(b, d) - t) > reach
    is_apart |= max(max(a, c) + s, max(b, d) + t) < -reach
    return is_apart
