# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How deep the arm is in the boxes, and the proof that a motion leads out of them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.world import World
from rrth_planner.kernels.collision.penetration import depths
from rrth_planner.kernels.jit import BOX_HALF, BOX_ROWS, LANES
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import part_of, positions_at, Trajectory

# Stretches of time in each of which the arm gets no deeper than it is at the beginning.
STRETCHES = 12
# What it may get deeper all the same: the proof needs a gap, however small [m].
GAP = 1e-6


def box_depths(world: World, q: Array, ray_lengths: Array | None = None) -> Array:
    """
    Return how deep the bars are in the grown boxes, (n_bars, m) [m]; < 0: apart.

    The depth is by how much a box would have to be smaller on every side for the bar to be clear
    of it: that much less of a margin would do. Separating axes, as the proof of an edge.

    Parameters
    ----------
    world : World
    q : ndarray, shape (n, dof) or (dof,)
        Of n configurations the result is (n, n_bars, m) [rad].
    ray_lengths : ndarray, shape (n,), optional
        Of the pointing ray in each of them; without, the world's [m].

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
    """Return the world with each box smaller on every side, (m,) [m]; None where one vanishes."""
    obstacles = world.obstacles.reshape(len(world.obstacles), BOX_ROWS, LANES).copy()
    lanes = np.asarray(world.lanes, np.int64)
    # The groups above bound what was larger, and so what is smaller.
    rows = (len(obstacles) - 1) // LANES + lanes // LANES
    for side in range(BOX_HALF, BOX_ROWS):
        obstacles[rows, side, lanes % LANES] -= by
        if (obstacles[rows, side, lanes % LANES] <= 0.0).any():
            return None
    return replace(world, obstacles=obstacles.reshape(world.obstacles.shape))


def leads_out(trajectory: Trajectory, world: World, end: float, begin: float = 0.0) -> bool:
    """
    Return whether a motion is proven to lead out of the boxes that the arm is in.

    The time is cut into stretches, and from one to the next the arm may get no deeper in any box.
    Within a stretch it is proven free of the boxes as much smaller as the arm was deep in them at
    its beginning; of a box that it is not in, or not any more, of all of it. At the end the arm
    is out. So the arm enters no box that it is not in, and is in none deeper, by more than `GAP`,
    than it was at the beginning of the stretch.

    Parameters
    ----------
    trajectory : Trajectory
    world : World
        Its boxes grown by the whole margin.
    end : float
        When the arm is to be out [s].
    begin : float
        What comes before this time is over [s].

    """
    times = np.linspace(min(max(begin, 0.0), end), end, STRETCHES + 1)
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
        # Once it is out of all boxes, the rest of the way is one stretch.
        is_out = not by.any()
        if not certify(
            part_of(trajectory, 0.0, end if is_out else stop), smaller, start
        ).is_proven:
            return False
        if is_out:
            break
    return True
