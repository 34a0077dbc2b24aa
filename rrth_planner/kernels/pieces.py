# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The pieces of a timed motion, one after the other: what is left of it is proven in one go."""

from numba.core.types import float64, int64, void
import numpy as np
from rrth_planner.kernels.arm_validity import prove_curve
from rrth_planner.kernels.jit import CHAIN, CUBE, kernel, MAT, OUT_MAT


@kernel(void(MAT, float64, OUT_MAT))
def shift(curve, begin, rest):
    """
    Write the rest of a polynomial from a share of it on, over u from 0 to 1 again.

    curve, rest (degree + 1, dof), lowest power first. By Horner's scheme: q(begin + w u), w = 1 -
    begin (Taylor shift). Bounds of the derivatives of the whole hold for its rest, which is
    shorter.
    """
    n, dof = curve.shape
    for k in range(dof):
        for i in range(n):
            rest[i, k] = curve[i, k]
        for i in range(n - 1):
            for j in range(n - 2, i - 1, -1):
                rest[j, k] += begin * rest[j + 1, k]
        scale = 1.0
        for i in range(n):
            rest[i, k] *= scale
            scale *= 1.0 - begin


@kernel(int64(CUBE, MAT, MAT, int64, float64, float64, CHAIN, MAT, MAT))
def prove_pieces(curves, speeds, bends, first, begin, resolution, chain, robot, boxes):
    """
    Return -1 where all pieces from `first` on are proven free, else 2 i + 1 or 2 i.

    i is the first piece that is not: seen to touch (+ 1), or left undecided. curves (n, degree +
    1, dof), speeds and bends (n, dof): as `prove_curve`. Of the first piece only what comes after
    the share `begin` of it counts.
    """
    rest = np.empty((curves.shape[1], curves.shape[2]))
    for i in range(first, curves.shape[0]):
        if i == first and begin > 0.0:
            shift(curves[i], begin, rest)
            proof = prove_curve(rest, speeds[i], bends[i], resolution, chain, robot, boxes)
        else:
            proof = prove_curve(curves[i], speeds[i], bends[i], resolution, chain, robot, boxes)
        if proof != 1:
            return 2 * i + (1 if proof == 0 else 0)
    return -1
