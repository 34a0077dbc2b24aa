# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Which bars of an arm can collide, and must not."""

from dataclasses import dataclass
import functools

import numpy as np
from rrth_planner.collision.reference_checker import bar_distances, bar_ends_at
from rrth_planner.model.arm import ArmModel, Bar, bars_of, Capsule, mount_bars
from rrth_planner.model.arrays import Array
from rrth_planner.model.joint_range import start_bounds, turns_near
from rrth_planner.model.reach import reach_table

# Pairs with so many joints between them at most are proven never to collide, if they do not, with
# so many cells of the joints' ranges.
MOST_JOINTS, MOST_CELLS = 2, 3000
# Random configurations in each of which pairs collide that are made so.
N_TRIED = 300
# What is called apart is that, beyond rounding [m].
SLACK = 1e-6


@dataclass(frozen=True, slots=True)
class BarPair:
    """
    Two bars that must not collide.

    Parameters
    ----------
    inner, outer : int
        Their indices in `arm.bars_of`, and `arm.mount_bars` after them.
    body : int
        How many joints move the link from which the inner one is seen.

    """

    inner: int
    outer: int
    body: int


@functools.lru_cache(maxsize=16)
def pairs_of(arm: ArmModel) -> tuple[BarPair, ...]:
    """
    Return the pairs of bars that must not collide.

    Left out are bars of the same link and of neighbours, pairs that may meet (`arm.allowed`),
    those that are proven never to, and those that collide in each of many random configurations:
    they are made so. The pointing ray counts beside its neighbour too.
    """
    bars = (*bars_of(arm), *mount_bars(arm))
    ray, length = len(bars_of(arm)) - 1, _farthest(arm)
    allowed = {frozenset(pair) for pair in arm.allowed}
    low, high = arm.bounds
    q = np.random.default_rng(0).uniform(low, high, (N_TRIED, arm.dof))
    ends = bar_ends_at(arm, q, length)
    pairs = []
    for i, one in enumerate(bars):
        for j in range(i + 1, len(bars)):
            inner, outer = (i, j) if one.body <= bars[j].body else (j, i)
            between = bars[outer].body - bars[inner].body
            is_beside = between == 1 and ray in (i, j)
            if between == 0 or (between == 1 and not is_beside):
                continue
            if frozenset((one.name, bars[j].name)) in allowed:
                continue
            pair = BarPair(inner, outer, _seen_from(arm, bars[inner]))
            share = float((_gaps(pair, bars, ends) <= SLACK).mean())
            is_apart = share == 0.0 and between <= MOST_JOINTS
            if share < 1.0 and not (is_apart and _never_collide(arm, pair, bars, length)):
                pairs.append(pair)
    return tuple(pairs)


def pair_names(arm: ArmModel, pair: BarPair) -> tuple[str, str]:
    """Return what messages call the two bars of a pair."""
    bars = (*bars_of(arm), *mount_bars(arm))
    return bars[pair.inner].name, bars[pair.outer].name


def _farthest(arm: ArmModel) -> float:
    """Return a length of the pointing ray beyond which it meets no part of the arm [m]."""
    ends = [np.linalg.norm(c.ends, axis=1).max() + c.radius for c in arm.capsules]
    slides = np.array(arm.is_prismatic)
    lengths = np.abs(start_bounds(arm)[:, slides]).max(axis=0)
    offsets = np.abs(arm.dh[:, [1, 3]]).sum() + lengths.sum()
    return float(offsets + max(ends, default=0.0) + max(arm.radii.max(), 0.0) + arm.radii[-1])


def _seen_from(arm: ArmModel, bar: Bar) -> int:
    """Return how many joints move the link that a bar is fixed to, or slides in."""
    if isinstance(bar.source, Capsule):
        return bar.body
    row, end = bar.source
    slides = end == 'd' and row < arm.dof and arm.is_prismatic[row]
    return bar.body - 1 if slides else bar.body


def _joints(arm: ArmModel, pair: BarPair, bars: tuple[Bar, ...]) -> range:
    """Return the joints that move the two bars of a pair to each other."""
    return range(pair.body, bars[pair.outer].body)


def _gaps(pair: BarPair, bars: tuple[Bar, ...], ends: Array) -> Array:
    """Return the distances of a pair where the bars end so, (n, n_bars, 2, 3) -> (n,) [m]."""
    radii = bars[pair.inner].radius + bars[pair.outer].radius
    return bar_distances(ends[:, pair.inner], ends[:, pair.outer]) - radii


def _never_collide(arm: ArmModel, pair: BarPair, bars: tuple[Bar, ...], length: float) -> bool:
    """
    Return whether a pair is proven never to collide.

    In a cell of the ranges of the joints between no point of the outer bar, seen from the inner
    one, is further from where it is in the middle of the cell than the sum of the half widths
    times the reaches round these joints.
    """
    joints = list(_joints(arm, pair, bars))
    # A bar that slides may move, too.
    reaches = reach_table(arm, length)[[pair.inner, pair.outer]].max(axis=1).sum(axis=0)[joints]
    # Each turn of a continuous joint is as any other.
    low, high = turns_near(arm, start_bounds(arm), arm.bounds.mean(axis=0), 1)[:, joints]
    middles, halves = 0.5 * (low + high)[None], 0.5 * (high - low)[None]
    n_cells = 1
    while len(middles):
        q = np.tile(arm.bounds.mean(axis=0), (len(middles), 1))
        q[:, joints] = middles
        gaps = _gaps(pair, bars, bar_ends_at(arm, q, length))
        if (gaps <= SLACK).any():
            return False
        is_open = gaps - SLACK <= halves @ reaches
        middles, halves = middles[is_open], halves[is_open]
        n_cells += 2 * len(middles)
        if n_cells > MOST_CELLS:
            return False
        # Each is cut across the joint that matters most.
        rows, widest = np.arange(len(middles)), (halves * reaches).argmax(axis=1)
        halves[rows, widest] *= 0.5
        shift = np.zeros_like(halves)
        shift[rows, widest] = halves[rows, widest]
        middles = np.concatenate([middles - shift, middles + shift])
        halves = np.concatenate([halves, halves])
    return True
