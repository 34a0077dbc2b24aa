# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Penetration depths of bars in boxes, by separating axes."""

import math

from numba.core.types import void
import numpy as np
from rrth_planner.kernels.jit import BOX_HALF, BOX_OFFSET, CUBE, kernel, MAT, OUT_CUBE

# Least sine for a cross axis: a bar parallel to an axis of the box has none.
PARALLEL = 1e-12


@kernel(void(MAT, CUBE, OUT_CUBE), is_short=True)
def depths(boxes, points, found):
    """
    Write by how much each box would have to shrink on every side for each bar to be clear.

    boxes (15, m): a column for each box, its axes, offset and half sizes as in `obstacles`;
    points (n, n_bars + 1, 4): the corners of the arm in n configurations, each with the radius of
    the bar that ends there [m]; found (n, n_bars, m) [m], < 0: apart.
    """
    middle, along, half = np.empty(3), np.empty(3), np.empty(3)
    for k in range(points.shape[0]):
        for bar in range(points.shape[1] - 1):
            p, q = points[k, bar], points[k, bar + 1]
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
