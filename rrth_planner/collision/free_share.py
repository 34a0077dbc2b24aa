# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How many configurations of an arm are free, and one of them to start from."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from rrth_planner.collision.world import World
from rrth_planner.model.arrays import Array
from rrth_planner.model.frozen import Frozen

# Random configurations, always the same.
N_SAMPLES, SEED = 1000, 0
# A start has so many decimals, as one types it [rad or m].
DECIMALS = 3
# How far a pointing ray must reach to aim at something [m].
SIGHT = 1.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FreeShare(Frozen):
    """
    What random configurations of an arm meet.

    Parameters
    ----------
    share : float
        Of them that are free [-].
    start : ndarray, shape (dof,), or None
        A free configuration [rad or m]: all joints at 0, or as near to it as they get, if that is
        free, or else the one of them that is farthest from the wearer. None: none is free.
    aim : ndarray, shape (dof,), or None
        The free one of them next to the start whose pointing ray is free for `SIGHT`, too.
    causes : tuple of (str, str)
        What collides, the most frequent first: a part of the arm, and another part or a box.

    """

    share: float
    start: Array | None
    aim: Array | None
    causes: tuple[tuple[str, str], ...]


def free_share(world: World) -> FreeShare:
    """Return how many of `N_SAMPLES` configurations of an arm are free in its world."""
    low, high = world.bounds
    samples = np.random.default_rng(SEED).uniform(low, high, (N_SAMPLES, len(low)))
    free = [q for q in samples if world.is_valid(q)]
    rest = np.clip(np.zeros(len(low)), low, high)
    start = rest if world.is_valid(rest) else None
    if start is None and free:
        start = _rounded(world, max(free, key=lambda q: _clearance(world, q)))
    aims = [q for q in free if world.is_valid(q, SIGHT)]
    causes: Counter[tuple[str, str]] = Counter()
    if not free:
        for q in samples:
            causes.update(_collisions(world, q))
    return FreeShare(
        share=len(free) / N_SAMPLES,
        start=start,
        aim=min(aims, key=lambda q: float(np.linalg.norm(q - start)), default=None),
        causes=tuple(pair for pair, _ in causes.most_common()),
    )


def _clearance(world: World, q: Array) -> float:
    return float(world.clearances(q).min(initial=np.inf))


def _rounded(world: World, q: Array) -> Array:
    """Return a configuration with few decimals where that is free, too."""
    rounded = np.asarray(np.clip(np.round(q, DECIMALS), *world.bounds))
    return rounded if world.is_valid(rounded) else q


def _collisions(world: World, q: Array) -> list[tuple[str, str]]:
    found = [
        (world.bar_names[i], world.box_names[j])
        for i, j in np.argwhere(world.clearances(q) <= 0.0).tolist()
    ]
    itself = world.colliding_bars(q)
    return list(dict.fromkeys(found)) + ([itself] if itself else [])
