# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Contacts of the arm with the wearer as he really is, instant by instant, in plain numpy.

It uses the kinematics of the reference checker, and nothing of the proof.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rrth_planner.collision.reference_checker import (
    bar_ends_at,
    fast_parts,
    ROUNDING,
    TINY,
)
from rrth_planner.kernels.layout import ROTATION, SIZE
from rrth_planner.model.arm import ArmModel, bars_of, is_called
from rrth_planner.model.arrays import Array
from rrth_planner.wearer.hands import hand_distances

# A part of a bar is looked at in so many places, and once more in so many round the nearest one.
PLACES, ROUNDS = 33, 2
# Classes of contacts: a place of the arm in a box is faster than the contact speed, slower, or the
# whole arm is at rest, that is slower than this in every joint [rad/s].
FAST, SLOW, AT_REST = 'faster', 'slower', 'at rest'
REST = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Distances:
    """
    How far the bars were from the boxes, (n, n_bars, m) [m]; infinite where that was far.

    Parameters
    ----------
    whole, fast : ndarray
        Of the whole bar, and of the part that is faster than the contact speed.
    speeds : ndarray
        How fast the nearest place of that part was [m/s]; 0 where there is none.
    is_at_rest : ndarray, shape (n,)

    """

    whole: Array
    fast: Array
    speeds: Array
    is_at_rest: NDArray[np.bool_]


def distances_to(
    arm: ArmModel,
    q: Array,
    v: Array,
    names: tuple[str, ...],
    rows: Array,
    contact_speed: float,
    within: float,
    hands: Collection[str] = (),
) -> Distances:
    """
    Return how far the arm was from boxes that move.

    q, v (n, dof): states [rad, rad/s]; rows (n, m, 15): the boxes then; within: what is further
    away is not measured [m]; hands: which boxes are those of `wearer.hands.round_wrists`, of which
    only what may be flesh counts. The flesh round a place of the axis of a bar is taken to be as
    fast as the place and its radius times the sum of the speeds of the joints that turn the bar.
    """
    bars, n, m = bars_of(arm)[:-1], len(q), rows.shape[1]
    ends, velocities = moving_bars(arm, q, v)
    whole, fast = np.full((n, len(bars), m), np.inf), np.full((n, len(bars), m), np.inf)
    speeds = np.zeros((n, len(bars), m))
    for b, bar in enumerate(bars):
        turns = np.abs(v[:, : bar.body]) @ ~np.array(arm.is_prismatic[: bar.body])
        parts = fast_parts(velocities[:, b], contact_speed + ROUNDING - bar.radius * turns)
        middle = ends[:, b].mean(axis=1)
        half = np.linalg.norm(ends[:, b, 1] - middle, axis=1)
        everything = np.tile([0.0, 1.0], (n, 1))
        for k, name in enumerate(names):
            if any(part == bar.name and is_called(name, box) for part, box in arm.allowed):
                continue
            gaps_of = hand_distances if name in hands else box_distances
            gaps = gaps_of(middle[:, None], rows[:, k])[:, 0] - half - bar.radius
            near = np.flatnonzero(gaps <= within)
            if not len(near):
                continue
            whole[near, b, k] = _least(ends[near, b], everything[near], rows[near, k], gaps_of)[0]
            whole[near, b, k] -= bar.radius
            for part in (0, 1):
                some = near[parts[near, part, 0] <= parts[near, part, 1]]
                least, at = _least(ends[some, b], parts[some, part], rows[some, k], gaps_of)
                least -= bar.radius
                moved = velocities[some, b]
                pace = np.linalg.norm(
                    moved[:, 0] + at[:, None] * (moved[:, 1] - moved[:, 0]), axis=1
                )
                pace += bar.radius * turns[some]
                is_nearer = least < fast[some, b, k]
                speeds[some, b, k] = np.where(is_nearer, pace, speeds[some, b, k])
                fast[some, b, k] = np.where(is_nearer, least, fast[some, b, k])
    is_at_rest: NDArray[np.bool_] = np.all(np.abs(v) < REST, axis=1)
    return Distances(whole, fast, speeds, is_at_rest)


def moving_bars(arm: ArmModel, q: Array, v: Array) -> tuple[Array, Array]:
    """
    Return the ends of the bars but the pointing ray, and their velocities [m, m/s].

    q, v (n, dof) -> (n, n_bars - 1, 2, 3) each, both from one chain of complex positions, as
    `reference_checker.bar_velocities` has them.
    """
    found: Any = bar_ends_at(arm, np.asarray(q + 1j * TINY * v), 0.0)[:, : len(bars_of(arm)) - 1]
    return found.real, found.imag / TINY


def box_distances(points: Array, rows: Array) -> Array:
    """Return the distances of points from a box each, 0 inside, (n, k, 3), (n, 15) -> (n, k)."""
    rotation = rows[:, ROTATION:].reshape(-1, 3, 3)
    local = (points - rows[:, None, :SIZE]) @ rotation
    outside = np.maximum(np.abs(local) - 0.5 * rows[:, None, SIZE:ROTATION], 0.0)
    result: Array = np.linalg.norm(outside, axis=-1)
    return result


def _least(
    ends: Array, part: Array, rows: Array, gaps_of: Callable[[Array, Array], Array]
) -> tuple[Array, Array]:
    """Return the least distance of a part of each line from its box [m], and where that is."""
    index, u = np.arange(len(ends)), np.linspace(0.0, 1.0, PLACES)
    begin, end = part[:, 0], part[:, 1]
    least, place = np.full(len(ends), np.inf), begin
    for _ in range(ROUNDS):
        s = begin[:, None] + (end - begin)[:, None] * u
        points = ends[:, None, 0] + s[..., None] * (ends[:, None, 1] - ends[:, None, 0])
        found = gaps_of(points, rows)
        best = found.argmin(axis=1)
        place = np.where(found[index, best] < least, s[index, best], place)
        least = np.minimum(least, found[index, best])
        begin = s[index, np.maximum(best - 1, 0)]
        end = s[index, np.minimum(best + 1, PLACES - 1)]
    return least, place


def classes_of(found: Distances) -> Array:
    """Return the class of each contact, (n, n_bars, m): FAST, SLOW, AT_REST, or empty: none."""
    slower = np.where(found.is_at_rest[:, None, None], AT_REST, SLOW)
    slower = np.where(found.whole <= 0.0, slower, '')
    return np.where(found.fast <= 0.0, FAST, slower)


def worst_class(classes: Array) -> str:
    """Return the worst class of some contacts; empty: none."""
    return next((name for name in (FAST, SLOW, AT_REST) if (classes == name).any()), '')
