# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Penetration depths of the arm in the boxes, and the proof that a motion escapes from them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from rrth_planner.collision.certificate import are_pieces_proven, bounds_of, certify
from rrth_planner.collision.world import without_ray, World
from rrth_planner.kernels.collision.bar_box import depths
from rrth_planner.kernels.layout import (
    ALLOWED_BITS,
    BAR_SIZE,
    BOX_ALLOWED,
    BOX_HALF,
    BOX_ROWS,
    LANES,
)
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import (
    cut_at,
    piece_coefficients,
    positions_at,
    Trajectory,
)

# Time intervals, within each of which the arm gets no deeper than at its start.
N_INTERVALS = 12
# Tolerance of that depth: the certificate needs a gap, however small [m].
DEPTH_TOLERANCE = 1e-6
# A bar this near to the middle of a box may as well be on its other side, as far as joints and
# boxes are known. So bars escape only from boxes that, shrunk by their depth, have more than this
# from the middle to each face [m].
LEAST_HALF = 1e-3
# A bar this near to a grown box counts as in it there [m].
CONTACT_DISTANCE = 1e-5


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
    places = np.empty((len(np.atleast_2d(q)), world.stride))
    rays = np.full(len(places), world.ray_length) if ray_lengths is None else ray_lengths
    for i, one in enumerate(np.atleast_2d(q)):
        world.chain(np.ascontiguousarray(one), float(rays[i]), places[i], 0)
    bars = np.ascontiguousarray(places[:, : BAR_SIZE * n_bars]).reshape(-1, n_bars, BAR_SIZE)
    found = np.empty((len(bars), n_bars, rows.shape[1]))
    depths(np.ascontiguousarray(rows), bars, found)
    found[:, ~_is_checked(world)] = -np.inf
    return found if np.ndim(q) == 2 else found[0]


def _is_checked(world: World) -> NDArray[np.bool_]:
    """Return which bars must keep clear of which boxes, (n_bars, m)."""
    rows, lanes = _places(world)
    obstacles = world.obstacles.reshape(len(world.obstacles), BOX_ROWS, LANES)
    number, bit = np.divmod(np.arange(len(world.bar_names))[:, None], ALLOWED_BITS)
    allowed = obstacles[rows, BOX_ALLOWED + number, lanes].astype(np.int64)
    checked: NDArray[np.bool_] = (allowed >> bit) % 2 == 0
    return checked


def escape_depths(world: World, q: Array) -> Array:
    """
    Return the penetration depths in the grown boxes of the bars, the greatest, and of the ray.

    The bars are those without the pointing ray, but with its beginning, the tool. (2, m) [m], as
    `box_depths`; q (n, dof) or (dof,): of n configurations the result is (n, 2, m) [rad].
    """
    every = np.atleast_2d(q)
    bars = box_depths(world, every, np.zeros(len(every))).max(axis=1)
    found = np.stack([bars, box_depths(world, every)[:, -1]], axis=1)
    return found if np.ndim(q) == 2 else found[0]


def relaxed(world: World, by: Array) -> World:
    """Return the world with its boxes shrunk on every side by (m,) [m]; some may vanish."""
    return replace(world, obstacles=_shrunk(world, by[None])[0])


def _shrunk(world: World, by: Array) -> Array:
    """Return the obstacles with their boxes shrunk by each row of (k, m) [m], k of them."""
    obstacles = world.obstacles.reshape(1, len(world.obstacles), BOX_ROWS, LANES)
    obstacles = obstacles.repeat(len(by), axis=0)
    rows, lanes = _places(world)
    # The groups above bound the larger boxes, hence the smaller ones too.
    halves = obstacles[:, rows, BOX_HALF:BOX_ALLOWED, lanes] - by.T[:, :, None]
    is_left = (halves > 0.0).all(axis=2, keepdims=True)
    obstacles[:, rows, BOX_HALF:BOX_ALLOWED, lanes] = np.where(is_left, halves, -np.inf)
    return obstacles.reshape(len(by), *world.obstacles.shape)


def _places(world: World) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return in which group of the obstacles, and in which of its lanes, each box is."""
    lanes = np.asarray(world.lanes, np.int64)
    return (len(world.obstacles) - 1) // LANES + lanes // LANES, lanes % LANES


def half_widths(world: World) -> Array:
    """Return by how much each grown box may shrink until it vanishes, (m,) [m]."""
    rows, lanes = _places(world)
    obstacles = world.obstacles.reshape(len(world.obstacles), BOX_ROWS, LANES)
    halves: Array = obstacles[rows, BOX_HALF:BOX_ALLOWED, lanes].min(axis=1)
    return halves


def may_escape(world: World, depths: Array) -> NDArray[np.bool_]:
    """
    Return whether bars that deep in boxes may escape from each, (..., m) [m].

    Not where a bar is near the middle of the box, or beyond: then no side is known to be the one
    that it is on, and the escape could lead through the wearer.
    """
    left = half_widths(world) - depths
    found: NDArray[np.bool_] = (depths < -CONTACT_DISTANCE) | (left > LEAST_HALF + DEPTH_TOLERANCE)
    return found


def leads_out(
    trajectory: Trajectory, world: World, margin: float, end: float, begin: float = 0.0
) -> bool:
    """
    Return whether a motion is proven to escape from the boxes that the arm is in.

    The time is cut into intervals; from one to the next the penetration depth may increase in no
    box, neither that of the bars nor that of the pointing ray. Within an interval both are proven
    free of the boxes shrunk by their depth at its start; a box that they are not in, or have left,
    is not shrunk. At the end both are clear of all boxes. So the arm enters no other box, and
    nowhere gets deeper by more than `DEPTH_TOLERANCE` than at the start of the interval. No bar is
    near the middle of a box: see `may_escape`.

    The ray has no body: where it is deeper than the margin, and therefore in the wearer already,
    that box does not count for it.

    The world has its boxes grown by the margin [m]; end: when the arm has to be clear, begin:
    start of the part that is checked [s].
    """
    times = np.linspace(min(max(begin, 0.0), end), end, N_INTERVALS + 1)
    deep = escape_depths(world, positions_at(trajectory, times))
    if deep.size == 0:
        return True
    allowed = np.where(deep[0] > -DEPTH_TOLERANCE, _allowed_depths(deep), 0.0)
    # The grown box vanishes where it does not count for the ray.
    allowed[:, 1] = np.where(deep[:, 1] > margin, half_widths(world), allowed[:, 1])
    of_bars, of_arm = allowed[:, 0], allowed.max(axis=1)
    if (
        (deep[-1] > 0.0).any()
        or (np.diff(allowed, axis=0) > 0.0).any()
        or not may_escape(world, deep[:, 0]).all()
    ):
        return False
    # Pieces, each of which is within an interval; the first ones of each.
    part, first = cut_at(trajectory, times)
    motion, bars = (piece_coefficients(part), *bounds_of(part)), without_ray(world)
    for_arm, for_bars = _shrunk(world, of_arm), _shrunk(world, of_bars)
    for i in range(N_INTERVALS):
        # Once the arm is clear of all boxes, the remaining time is one interval.
        is_out = not of_arm[i].any()
        pieces = [rows[first[i] : None if is_out else first[i + 1]] for rows in motion]
        if not are_pieces_proven(pieces, world, for_arm[i]):
            return False
        if (of_bars[i] < of_arm[i]).any() and not are_pieces_proven(pieces, bars, for_bars[i]):
            return False
        if is_out:
            break
    return True


def gets_no_deeper(trajectory: Trajectory, world: World, begin: float) -> bool:
    """
    Return whether a motion is proven to get no deeper into any box than it is at a time [s].

    Nor into the wearer with the ray: only where that is so deep that a box shrunk by its depth
    vanishes does the box not count. What has left a box may come back as deep as it was.
    """
    deep = escape_depths(world, positions_at(trajectory, [begin])[0]).max(axis=0)
    return certify(trajectory, relaxed(world, _allowed_depths(deep)), begin).is_proven


def _allowed_depths(deep: Array) -> Array:
    """Return how deep parts may be that are so deep in boxes, of any shape [m]."""
    allowed: Array = np.where(
        deep > -DEPTH_TOLERANCE, np.maximum(deep + DEPTH_TOLERANCE, 0.0), 0.0
    )
    return allowed
