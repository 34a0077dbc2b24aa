# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Boxes as numbers: where markers put them, and the groups of them that the judges read."""

import math

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import (
    CUBE,
    kernel,
    MAT,
    OUT_INTS,
    OUT_MAT,
    OUT_VEC,
    READ_INTS,
)
from rrth_planner.kernels.layout import (
    ALLOWED_BITS,
    ANY_ALLOWED,
    BOX_ALLOWED,
    BOX_HALF,
    BOX_OFFSET,
    LANES,
    ORTHOGONAL,
    ROTATION,
    SIZE,
)

# Numbers of a marker: position, quaternion x y z w, scale, and a point in its own axes.
QUATERNION, SCALE, POINT, POSED = 3, 7, 10, 13
# The bits of one number of BOX_ALLOWED.
LOW_BITS = (1 << ALLOWED_BITS) - 1
# A bound holds its boxes with this to spare [m].
SPARE = 1e-9


@kernel(void(MAT, READ_INTS, CUBE, OUT_MAT), is_short=True)
def place(markers, which, frames, boxes):
    """
    Write the boxes of markers into the base frame.

    markers (n, 13) as above; which (n,): the frame of each; frames (k, 4, 4): poses of the frames
    in the base frame [m]; boxes (n, 15).
    """
    own = np.empty((3, 3))
    for i in range(markers.shape[0]):
        x, y, z = markers[i, QUATERNION], markers[i, QUATERNION + 1], markers[i, QUATERNION + 2]
        w = markers[i, QUATERNION + 3]
        n = math.sqrt(x * x + y * y + z * z + w * w)
        x, y, z, w = x / n, y / n, z / n, w / n
        own[0, 0], own[0, 1] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w)
        own[0, 2], own[1, 0] = 2 * (x * z + y * w), 2 * (x * y + z * w)
        own[1, 1], own[1, 2] = 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
        own[2, 0], own[2, 1] = 2 * (x * z - y * w), 2 * (y * z + x * w)
        own[2, 2] = 1 - 2 * (x * x + y * y)
        T, box = frames[which[i]], boxes[i]
        for r in range(3):
            box[r], box[SIZE + r] = T[r, 3], markers[i, SCALE + r]
            for c in range(3):
                at = markers[i, c]
                for k in range(3):
                    at += own[c, k] * markers[i, POINT + k]
                box[r] += T[r, c] * at
                turned = 0.0
                for k in range(3):
                    turned += T[r, k] * own[k, c]
                box[ROTATION + 3 * r + c] = turned


@kernel(int64(MAT, float64), is_short=True)
def first_bad(boxes, farthest):
    """
    Return which of (n, 15) numbers are the first that are no box; -1: all are boxes.

    A box is no farther from the origin, and no larger, than that [m]; NaN is none.
    """
    for i in range(boxes.shape[0]):
        box, r = boxes[i], boxes[i, ROTATION:]
        is_box = True
        for k in range(3):
            is_box &= abs(box[k]) <= farthest and 0.0 < box[SIZE + k] <= farthest
            for j in range(3):
                product = 0.0
                for c in range(3):
                    product += r[3 * k + c] * r[3 * j + c]
                is_box &= abs(product - (1.0 if k == j else 0.0)) <= ORTHOGONAL
        volume = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6])
        if not (is_box and volume + r[2] * (r[3] * r[7] - r[4] * r[6]) > 0.0):
            return i
    return -1


@kernel(void(MAT, READ_INTS, MAT, float64, OUT_MAT), is_short=True)
def rows_of(boxes, allowed, T_arm_base, growth, rows):
    """
    Write the rows of boxes, (18, n), each grown by that much on every side [m].

    boxes (n, 15) in the base frame; allowed (n,): which bars may meet each, bit k for bar k. A
    box's column: its axes in the arm's frame row by row, the position of that frame in them, its
    half extents, the bars that may meet it, as in `kernels.layout`, and 1 where there are some.
    """
    for i in range(boxes.shape[0]):
        for k in range(3):
            # Axis k of the box, and its centre, in the arm's frame.
            offset = 0.0
            for r in range(3):
                along, center = 0.0, T_arm_base[r, 3]
                for c in range(3):
                    along += T_arm_base[r, c] * boxes[i, ROTATION + 3 * c + k]
                    center += T_arm_base[r, c] * boxes[i, c]
                rows[3 * k + r, i] = along
                offset -= along * center
            rows[BOX_OFFSET + k, i] = offset
            rows[BOX_HALF + k, i] = 0.5 * boxes[i, SIZE + k] + growth
        for n in range(2):
            rows[BOX_ALLOWED + n, i] = (allowed[i] >> ALLOWED_BITS * n) & LOW_BITS
        rows[ANY_ALLOWED, i] = 0.0 if allowed[i] == 0 else 1.0


@kernel(boolean(MAT, int64, int64))
def may_meet(rows, box, bar):
    """Return whether a bar may meet a box, column of `rows`."""
    bars = int64(rows[BOX_ALLOWED + bar // ALLOWED_BITS, box])
    return (bars >> bar % ALLOWED_BITS) & 1 != 0


@kernel(void(MAT, READ_INTS, int64, int64, OUT_MAT, int64, int64), is_inner=True)
def write_bound(rows, order, begin, end, groups, g, lane):
    """
    Write the smallest bound of the boxes order[begin:end] into a lane of a group.

    Its axes are those of one of the first few boxes, since boxes cut from one another share them,
    or those of the arm's frame.
    """
    best = math.inf
    low, high, axes = scratch.floats(3), scratch.floats(3), np.empty((3, 3))
    for candidate in range(begin, min(end, begin + LANES) + 1):
        is_last = candidate == min(end, begin + LANES)
        for k in range(3):
            low[k], high[k] = math.inf, -math.inf
            for r in range(3):
                axes[k, r] = float64(r == k) if is_last else rows[3 * k + r, order[candidate]]
            for n in range(begin, end):
                i = order[n]
                middle, reach = 0.0, 0.0
                for axis in range(3):
                    cosine = 0.0
                    for r in range(3):
                        cosine += axes[k, r] * rows[3 * axis + r, i]
                    # The centre has minus the offset as its coordinates along the box's own axes.
                    middle -= cosine * rows[BOX_OFFSET + axis, i]
                    reach += abs(cosine) * rows[BOX_HALF + axis, i]
                low[k], high[k] = min(low[k], middle - reach), max(high[k], middle + reach)
        volume = (high[0] - low[0]) * (high[1] - low[1]) * (high[2] - low[2])
        if volume < best:
            best = volume
            for k in range(3):
                for r in range(3):
                    groups[g, LANES * (3 * k + r) + lane] = axes[k, r]
                groups[g, LANES * (BOX_OFFSET + k) + lane] = -0.5 * (low[k] + high[k])
                groups[g, LANES * (BOX_HALF + k) + lane] = 0.5 * (high[k] - low[k]) + SPARE


@kernel(float64(MAT, int64, int64), is_inner=True)
def center_of(rows, i, r):
    """Return coordinate r of a box's centre in the arm's frame."""
    at = 0.0
    for axis in range(3):
        at -= rows[3 * axis + r, i] * rows[BOX_OFFSET + axis, i]
    return at


@kernel(void(MAT, OUT_INTS, int64, int64, OUT_VEC), is_inner=True)
def sort_widest(rows, order, begin, end, keys):
    """Sort order[begin:end] by the boxes' centres along the axis that these spread most along."""
    widest = -1.0
    axis = 0
    for r in range(3):
        low, high = math.inf, -math.inf
        for n in range(begin, end):
            at = center_of(rows, order[n], r)
            low, high = min(low, at), max(high, at)
        if high - low > widest:
            widest, axis = high - low, r
    for n in range(begin, end):
        keys[n] = center_of(rows, order[n], axis)
    # Shell's sort (1959): what numpy offers takes longer to compile than all the rest of this.
    gap = (end - begin) // 2
    while gap > 0:
        for n in range(begin + gap, end):
            key, box, at = keys[n], order[n], n
            while at >= begin + gap and keys[at - gap] > key:
                keys[at], order[at] = keys[at - gap], order[at - gap]
                at -= gap
            keys[at], order[at] = key, box
        gap //= 2


@kernel(void(MAT, int64, OUT_MAT, OUT_INTS))
def pack(rows, depth, groups, lanes):
    """
    Write the tree of groups of boxes, and which lane of its last level holds box i.

    rows (18, n) as from `rows_of`; depth: levels of the tree; groups (n_groups, 8 * 18) as in
    `kernels.layout`; lanes (n,). On every level the boxes are halved three times, each time along
    the axis that their centres spread most along.
    """
    n = rows.shape[1]
    groups[:] = 0.0
    groups[:, LANES * BOX_HALF : LANES * BOX_ALLOWED] = -math.inf
    order, keys = np.empty(n, dtype=np.int64), np.empty(n)
    for i in range(n):
        order[i] = i
    # Ends of the parts of the present level, each a group of it.
    ends = np.empty(1, dtype=np.int64)
    ends[0] = n
    first = 0
    for _ in range(depth - 1):
        for _ in range(3):
            halves = np.empty(2 * len(ends), dtype=np.int64)
            begin = 0
            for p in range(len(ends)):
                if ends[p] - begin > 1:
                    sort_widest(rows, order, begin, ends[p], keys)
                halves[2 * p] = (begin + ends[p] + 1) // 2
                halves[2 * p + 1] = begin = ends[p]
            ends = halves
        begin = 0
        for p in range(len(ends)):
            if ends[p] > begin:
                write_bound(rows, order, begin, ends[p], groups, first + p // LANES, p % LANES)
            begin = ends[p]
        first = LANES * first + 1
    begin = 0
    for p in range(len(ends)):
        for k in range(begin, ends[p]):
            lane = k - begin
            lanes[order[k]] = LANES * p + lane
            for row in range(ANY_ALLOWED):
                groups[first + p, LANES * row + lane] = rows[row, order[k]]
            groups[first + p, LANES * ANY_ALLOWED] += rows[ANY_ALLOWED, order[k]]
        begin = ends[p]
