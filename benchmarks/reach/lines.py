# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Lines c + w t whose least one bounds how far a part gets within a time t."""

from collections.abc import Mapping
from itertools import combinations_with_replacement
import math

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array

# c and w of each line [m, m/s].
Lines = tuple[tuple[float, float], ...]
# Lines that are not through the origin, at most.
N_LINES = 3
# How much is grown counts from one frame to there: where most running motions have ended [s].
COUNTED = 0.6
# Lines are rounded up to multiples of [m], [m/s], and made steeper in steps of [m/s].
ROUND_C, ROUND_W, STEP = 0.01, 0.05, 0.05
# The line through the origin is so much steeper than anybody needs: it counts for the first few
# hundredths of a second only, and costs next to nothing.
STEEPER = 1.5
# Lines through the origin begin there [m].
ORIGIN = 0.0


def growth(lines: Lines, times: Array) -> Array:
    """Return the least of lines at times (n,) [s], (n,) [m]."""
    result: Array = np.min([c + w * times for c, w in lines], axis=0)
    return result


def mean_growth(lines: Lines, times: Array) -> float:
    """Return the mean growth at the times up to `COUNTED` [m]."""
    return float(growth(lines, times[times <= COUNTED]).mean())


def lines_above(times: Array, bound: Array, least_speed: float = 0.0) -> Lines:
    """
    Return lines that are nowhere below a bound, rounded up, with the least mean growth.

    One is through the origin: a box does not grow at once. The others are edges of the upper hull
    of the bound.

    Parameters
    ----------
    times, bound : ndarray, shape (n,)
        Upwards [s]; [m].
    least_speed : float
        No line is less steep [m/s].

    """
    steepest = max(float((bound / times).max()), least_speed)
    edges = _edges(times, bound)
    speeds = sorted({least_speed, *(w for w in edges if w > least_speed)})
    found = [(float((bound - w * times).max()), w) for w in speeds]
    found = [(c, w) for c, w in found if c > ORIGIN]
    choices = [
        ((ORIGIN, steepest), *some)
        for some in combinations_with_replacement(sorted(found), min(N_LINES, len(found)))
    ]
    best = min(choices, key=lambda lines: mean_growth(lines, times))
    return tuple(dict.fromkeys((_up(c, ROUND_C), _up(w, ROUND_W)) for c, w in best))


def _edges(times: Array, bound: Array) -> list[float]:
    """Return the slopes of the upper hull of a bound, those that rise [m/s]."""
    hull: list[tuple[float, float]] = []
    for t, x in zip(times.tolist(), bound.tolist(), strict=True):
        while len(hull) >= 2:
            (t0, x0), (t1, x1) = hull[-2:]
            if (x1 - x0) * (t - t0) > (x - x0) * (t1 - t0):
                break
            hull.pop()
        hull.append((t, x))
    slopes = [(x1 - x0) / (t1 - t0) for (t0, x0), (t1, x1) in zip(hull, hull[1:], strict=False)]
    return [slope for slope in slopes if slope > 0.0]


def steepened(lines: Lines, more: float) -> Lines:
    """Return lines for who may be faster, by a multiple of `STEP` [m/s]."""
    return tuple(
        (c, _up(w * STEEPER, ROUND_W) if c == ORIGIN else round(w + more, 3))
        for c, w in sorted(lines)
    )


def needed(out: Array, lines: Lines, times: Array, error: float) -> Array:
    """
    Return how much steeper lines have to be to hold a part at each frame, (n,) [m/s].

    out (n_times, n): how far it got out of where it was [m]; NaN: not known. Infinite where it is
    further than the line through the origin.
    """
    origin = dict(steepened(lines, 0.0))[ORIGIN] * times[:, None]
    others = [line for line in lines if line[0] != ORIGIN]
    bound = growth(tuple(others), times)[:, None] if others else origin
    excess = np.where(np.isfinite(out), out - error, -np.inf)
    more = np.where(excess > origin, np.inf, (excess - bound) / times[:, None])
    result: Array = more.max(axis=0)
    return result


def _up(value: float, step: float) -> float:
    return round(math.ceil(value / step - 1e-6) * step, 3)


def least_steps(groups: Mapping[object, Mapping[str, Array]], limit: float) -> dict[str, float]:
    """
    Return how much steeper the lines of each kind of part have to be, little in all [m/s].

    From values that nobody needs more than, the one is lowered by a step that costs the fewest
    frames, as long as in each group the share of frames at which a part needs more is within the
    limit. It is a greedy search: no other single step is left.

    Parameters
    ----------
    groups : mapping
        By kind what each of the frames of a group needs, (n,) [m/s]; a kind may be missing.
    limit : float
        Share of frames [-].

    """
    kinds = dict.fromkeys(kind for group in groups.values() for kind in group)
    found = dict.fromkeys(kinds, 0.0)
    for group in groups.values():
        for kind, need in group.items():
            most = float(need[np.isfinite(need)].max(initial=0.0))
            found[kind] = max(found[kind], _up(most, STEP))
    n_over = {
        name: sum(np.isinf(need).astype(np.int64) for need in group.values())
        for name, group in groups.items()
    }
    while True:
        best, least, best_over = None, math.inf, {}
        for kind in kinds:
            lower = round(found[kind] - STEP, 6)
            if lower < 0.0:
                continue
            over: dict[object, NDArray[np.int64]] = {}
            price, is_within = 0.0, True
            for name, group in groups.items():
                if kind not in group:
                    continue
                new = (group[kind] > lower) & (group[kind] <= found[kind])
                over[name] = n_over[name] + new
                share = float((over[name] > 0).mean())
                # Whoever has little left pays more.
                price += (share - float((n_over[name] > 0).mean())) / limit
                is_within &= share <= limit
            # The largest ones first.
            price -= 1e-6 * found[kind]
            if is_within and price < least:
                best, least, best_over = kind, price, over
        if best is None:
            return found
        found[best] = round(found[best] - STEP, 6)
        n_over.update(best_over)
