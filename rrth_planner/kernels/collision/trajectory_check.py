# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Continuous collision check of the remaining motion, piece by piece, in one call."""

from numba.core.types import boolean, float64, int64, void
import numpy as np
from rrth_planner.kernels.collision.arm_validity import is_configuration_free, prove_curve
from rrth_planner.kernels.collision.boxes import pack, rows_of
from rrth_planner.kernels.jit import as_chain, CHAIN, CUBE, kernel, MAT, OUT_MAT, READ_INTS, VEC
from rrth_planner.kernels.layout import BOX_ROWS, D, LANES
from rrth_planner.kernels.trajectory.quintics import bound, fit

# Newly received boxes: boxes, the bars that may meet each, T_arm_base, growth, depth. Points of a
# motion: times, positions, velocities, accelerations.
NEW, POINTS = (MAT, READ_INTS, MAT, float64, int64), (VEC, MAT, MAT, MAT)


@kernel(void(MAT, float64, OUT_MAT), is_inner=True)
def shift(curve, begin, rest):
    """
    Write the rest of a polynomial after a share of it, again over u from 0 to 1.

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
def prove_pieces(curves, speeds, curvatures, first, begin, resolution, chain, robot, boxes):
    """
    Return -1 where all pieces from `first` on are proven free, else 2 i + 1 or 2 i.

    i is the first piece that is not: it collides (+ 1), or is undecided. curves (n, degree +
    1, dof), speeds and curvatures (n, dof): as `prove_curve`. Of the first piece only the part
    after the share `begin` is checked.
    """
    rest = np.empty((curves.shape[1], curves.shape[2]))
    for i in range(first, curves.shape[0]):
        shift(curves[i], begin if i == first else 0.0, rest)
        proof = prove_curve(rest, speeds[i], curvatures[i], resolution, chain, robot, boxes)
        if proof != 1:
            return 2 * i + (1 if proof == 0 else 0)
    return -1


@kernel(int64(int64), is_inner=True)
def n_groups(depth):
    """Return how many groups of boxes a tree of a depth has."""
    return (LANES**depth - 1) // (LANES - 1)


@kernel(void(*NEW, OUT_MAT), is_inner=True)
def pack_new(boxes, allowed, T_arm_base, growth, depth, groups):
    """Write newly received boxes (m, 15) as groups, as `rows_of` and `pack` in `boxes` do."""
    n = boxes.shape[0]
    rows, lanes = np.empty((BOX_ROWS, n)), np.empty(n, dtype=np.int64)
    rows_of(boxes, allowed, T_arm_base, growth, rows)
    pack(rows, depth, groups, lanes)


@kernel(boolean(VEC, float64, int64, MAT, *NEW), is_short=True)
def is_place_free(q, ray_length, address, robot, boxes, allowed, T_arm_base, growth, depth):
    """Return whether the arm at q (dof,) is free of newly received boxes and itself, as below."""
    groups = np.empty((n_groups(depth), BOX_ROWS * LANES))
    pack_new(boxes, allowed, T_arm_base, growth, depth, groups)
    return is_configuration_free(q, ray_length, as_chain(address), robot, groups)


@kernel(boolean(*POINTS, float64, float64, float64, int64, MAT, *NEW, MAT, MAT), is_short=True)
def is_remaining_motion_free(
    times,
    positions,
    velocities,
    accelerations,
    begin,
    reach,
    resolution,
    address,
    robot,
    boxes,
    allowed,
    T_arm_base,
    growth,
    depth,
    quartic,
    cubic,
):
    """
    Return whether the remaining motion is proven free of newly received boxes.

    In one call, since it decides about a stop. At the end a ray of length `reach` has to be free
    too [m]. times (n,) [s], positions, velocities and accelerations (n, dof), n > 1: points of
    the motion, of which only what comes after `begin` counts [s]; address: of the chain; boxes
    (m, 15), allowed (m,), T_arm_base (4, 4), growth [m] and depth as for `rows_of` and `pack` in
    `boxes`; quartic and cubic as for `quintics.bound`.
    """
    n_pieces, dof, chain = positions.shape[0] - 1, positions.shape[1], as_chain(address)
    curves = np.empty((n_pieces, 6, dof))
    fit(times, positions, velocities, accelerations, curves)
    groups = np.empty((n_groups(depth), BOX_ROWS * LANES))
    pack_new(boxes, allowed, T_arm_base, growth, depth, groups)
    q_end = np.empty(dof)
    for k in range(dof):
        q_end[k] = 0.0
        for power in range(6):
            q_end[k] += curves[n_pieces - 1, power, k]
    if not is_configuration_free(q_end, max(robot[dof, D], reach), chain, robot, groups):
        return False
    if begin >= times[n_pieces]:
        return True
    first = 0
    while first < n_pieces - 1 and times[first + 1] <= begin:
        first += 1
    speeds, curvatures = np.empty((n_pieces, dof)), np.empty((n_pieces, dof))
    bound(curves[first:], quartic, cubic, speeds[first:], curvatures[first:])
    share = max(0.0, (begin - times[first]) / (times[first + 1] - times[first]))
    motion = (curves, speeds, curvatures, first, share)
    return prove_pieces(*motion, resolution, chain, robot, groups) == -1
