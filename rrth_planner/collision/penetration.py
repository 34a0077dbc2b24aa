# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Penetration depths of the arm in the boxes, and the proof that a motion escapes from them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.world import World
from rrth_planner.kernels.collision.bar_box import depths
from rrth_planner.kernels.layout import BOX_HALF, BOX_ROWS, LANES
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import part_of, positions_at, Trajectory

# Time intervals, within each of which the arm gets no deeper than at its start.
INTERVALS = 12
# Tolerance of that depth: the certificate needs a gap, however small [m].
GAP = 1e-6


def box_depths(world: World, q: Array, ray_lengths: Array | None = None) -> Array:
    """
    Return the penetration depths of the bars in the grown boxes, (n_bars, m) [m]; < 0: apart.

    The depth is by how much a box would have to shrink on every side for the bar to be clear of
    it, or the margin with it. Found by separating axes, as in the edge check.

    q (n, dof) or (dof,): of n configurations the result is (n, n_bars, m) [rad]. ray_lengths (n,):
    of the pointing ray in each; default: the world's [m].
    """
    rows = world.obstacles[(len(world.obstacles) - 1) // LANES :].reshape(-1, BOX_ROWS, LANES)
    rows = rows.transpose(1, 0, 2).reshape(BOX_ROWS, -1)[:, np.asarray(world.lanes, np.int64)]
    n_bars = len(world.bar_names)
    points = np.empty((len(np.atleast_2d(q)), n_bars + 1, 4))
    rays = np.full(len(points), world.ray_length) if ray_lengths is None else ray_lengths
    for i, one in enumerate(np.atleast_2d(q)):
        world.chain(np.ascontiguousarray(one), float(rays[i]), points[i].reshape(-1), 0)
    found = np.empty((len(points), n_bars, rows.shape[1]))
    depths(np.ascontiguousarray(rows), points, found)
    return found if np.ndim(q) == 2 else found[0]


def relaxed(world: World, by: Array) -> World | None:
    """Return the world with boxes shrunk on every side, (m,) [m]; None where one vanishes."""
    obstacles = world.obstacles.reshape(len(world.obstacles), BOX_ROWS, LANES).copy()
    lanes = np.asarray(world.lanes, np.int64)
    # The groups above bound the larger boxes, hence the smaller ones too.
    rows = (len(obstacles) - 1) // LANES + lanes // LANES
    for side in range(BOX_HALF, BOX_ROWS):
        obstacles[rows, side, lanes % LANES] -= by
        if (obstacles[rows, side, lanes % LANES] <= 0.0).any():
            return None
    return replace(world, obstacles=obstacles.reshape(world.obstacles.shape))


def leads_out(trajectory: Trajectory, world: World, end: float, begin: float = 0.0) -> bool:
    """
    Return whether a motion is proven to escape from the boxes that the arm is in.

    The time is cut into intervals; from one to the next the penetration depth may increase in no
    box. Within an interval the motion is proven free of the boxes shrunk by the depth at its
    start; a box that the arm is not in, or has left, is not shrunk. At the end the arm is clear.
    So the arm enters no other box, and nowhere gets deeper by more than `GAP` than at the start
    of the interval.

    The world has its boxes grown by the whole margin; end: when the arm has to be clear, begin:
    start of the part that is checked [s].
    """
    times = np.linspace(min(max(begin, 0.0), end), end, INTERVALS + 1)
    deep = box_depths(world, positions_at(trajectory, times)).max(axis=1, initial=-np.inf)
    if deep.size == 0:
        return True
    is_in = deep[0] > -GAP
    if (deep[-1] > 0.0).any():
        return False
    allowed = np.where(is_in, np.maximum(deep + GAP, 0.0), 0.0)
    if (np.diff(allowed, axis=0) > 0.0).any():
        return False
    for by, (start, stop) in zip(allowed, pairwise(times.tolist()), strict=False):
        if stop <= start:
            continue
        smaller = relaxed(world, by)
        if smaller is None:
            return False
        # Once the arm is clear of all boxes, the remaining time is one interval.
        is_out = not by.any()
        part = part_of(trajectory, 0.0, end if is_out else stop)
        if not certify(part, smaller, start).is_proven:
            return False
        if is_out:
            break
    return True
