# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How far boxes get out of where they were seen before, and whether that was to be expected."""

import math

from numba.core.types import float64, void
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import CUBE, kernel, MAT, OUT_VEC, VEC
from rrth_planner.kernels.layout import NUMBERS, ROTATION, SIZE

# A sight of a box: its numbers, and when it was measured [s].
MEASURED, SIGHT = NUMBERS, NUMBERS + 1


@kernel(float64(VEC, VEC), is_exact=True)
def protrusion(before, after):
    """
    Return how far a box gets out of an earlier one: what that has to grow by to contain it [m].

    before, after (15 or more): the two. The distance from a box is convex, so no point of the
    later one is further from the earlier one than one of its corners.
    """
    # The centre of the later box, and half its edges, as seen from the earlier one.
    center, edges = scratch.floats(3), scratch.floats(9)
    for r in range(3):
        at = 0.0
        for c in range(3):
            at += before[ROTATION + 3 * c + r] * (after[c] - before[c])
        center[r] = at
        for k in range(3):
            along = 0.0
            for c in range(3):
                along += before[ROTATION + 3 * c + r] * after[ROTATION + 3 * c + k]
            edges[3 * r + k] = 0.5 * after[SIZE + k] * along
    furthest = 0.0
    for corner in range(8):
        x = 1.0 if corner & 4 else -1.0
        y = 1.0 if corner & 2 else -1.0
        z = 1.0 if corner & 1 else -1.0
        square = 0.0
        for r in range(3):
            at = center[r] + x * edges[3 * r] + y * edges[3 * r + 1] + z * edges[3 * r + 2]
            beyond = abs(at) - 0.5 * before[SIZE + r]
            # Also for NaN, which counts as far.
            if not beyond <= 0.0:
                square += beyond * beyond
        furthest = furthest if square <= furthest else square
    return math.sqrt(furthest)


@kernel(
    void(CUBE, MAT, MAT, MAT, VEC, float64, float64, float64, OUT_VEC),
    is_short=True,
    is_exact=True,
)
def excesses(earlier, now, offsets, speeds, stated, known_for, shortest, within, found):
    """
    Write by how much each box is further out of any earlier one than it may be, (m,) [m].

    earlier (n, m, 16): sights of the boxes, now (m, 16): the present one; offsets, speeds (m, k)
    and stated (m,): their reach, known up to `known_for`, as of `model.separation.Reach`; within:
    what two errors explain [m]. Sights that are `shortest` apart or less are not compared [s].
    found: greatest excess, 0: none. What the distance of the centres shows to be near enough is
    not measured.
    """
    n, m = earlier.shape[0], earlier.shape[1]
    for box in range(m):
        square = 0.0
        for r in range(3):
            square += now[box, SIZE + r] * now[box, SIZE + r]
        ball, most = 0.5 * math.sqrt(square), 0.0
        for i in range(n):
            elapsed = now[box, MEASURED] - earlier[i, box, MEASURED]
            if not elapsed > shortest:
                continue
            reach = math.inf
            for k in range(offsets.shape[1]):
                reach = min(reach, offsets[box, k] + speeds[box, k] * elapsed)
            if elapsed > known_for:
                reach = max(reach, stated[box] * elapsed)
            reach += within
            # The earlier box contains a ball, and the present one is within a ball.
            thinnest, square = math.inf, 0.0
            for r in range(3):
                thinnest = min(thinnest, earlier[i, box, SIZE + r])
                way = now[box, r] - earlier[i, box, r]
                square += way * way
            near = reach + most + 0.5 * thinnest - ball
            if near > 0.0 and square <= near * near:
                continue
            excess = protrusion(earlier[i, box], now[box]) - reach
            most = most if excess <= most else excess
        found[box] = most
