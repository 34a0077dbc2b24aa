# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer from one sight to the next: how old each part is, and whether it kept its speed."""

from dataclasses import dataclass, replace
import functools

import numpy as np
from numpy.typing import NDArray
from rrth_planner.kernels.collision.boxes import longest_ways
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.separation import FASTEST, SeenBody, SeparationRules, speed_bound

# A part that was faster than assumed is taken to be so fast, and a share more, for so long [s].
SHARE, RAISED = 1.2, 2.0
# Two sights of a part less than this apart do not give its speed [s].
SHORTEST = 2e-3
# Each sight is compared with one up to so long before, too [s]: between neighbouring ones, 120 Hz,
# twice an error of 1 cm hides 2.4 m/s.
WINDOW = 0.1
# Clocks may differ by so much; the age of what was measured later than that [s].
CLOCK_STEP, UNKNOWN_AGE = 0.1, 1e3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BodyMotion:
    """
    The wearer as last seen, and what is assumed of the speeds of his parts.

    Parameters
    ----------
    measured : ndarray, shape (m,)
        When each box of the scene was measured [s].
    earlier : Scene, ndarray
        A sight up to `WINDOW` before, and its `measured`, which the next are compared with too.
    speeds, until : ndarray, shape (m,)
        Greatest speeds of parts that have been faster than assumed [m/s], and until when these
        count [s].
    n_seen, n_faster : int
        Sights of all parts so far, and those of parts that had been faster than assumed.
    faster : tuple of (str, float)
        The parts that were it at the last sight: their names and speeds [m/s].

    """

    scene: Scene
    measured: Array
    earlier: tuple[Scene, Array]
    speeds: Array
    until: Array
    n_seen: int = 0
    n_faster: int = 0
    faster: tuple[tuple[str, float], ...] = ()

    def shifted(self, step: float) -> 'BodyMotion':
        """Return the wearer by a clock that was set forward by a step [s]."""
        scene, measured = self.earlier
        return replace(
            self,
            measured=self.measured + step,
            earlier=(scene, measured + step),
            until=self.until + step,
        )


def first_sight(scene: Scene, measured: Array) -> BodyMotion:
    """Return a wearer who was never seen before, measured (m,) [s]."""
    nothing = np.zeros(len(scene.boxes))
    return BodyMotion(
        scene=scene, measured=measured, earlier=(scene, measured), speeds=nothing, until=nothing
    )


def seen_again(
    before: BodyMotion, scene: Scene, measured: Array, rules: SeparationRules
) -> BodyMotion:
    """
    Return the wearer at his next sight; measured (m,): when each box of the scene was [s].

    A part moved faster than assumed where a corner of its box went further than its greatest speed
    and two errors explain, since the sight before or since an earlier one. Its bound is raised for
    a while then. Parts are known by their names.
    """
    old, names = places_of(before.scene, scene), scene.names
    known = old >= 0
    then, n = old[known], len(names)
    speeds, until = np.zeros(n), np.zeros(n)
    speeds[known], until[known] = before.speeds[then], before.until[then]
    stated, raised = stated_speeds(scene, rules), np.where(measured <= until, speeds, 0.0)
    bound, within, found = np.maximum(stated, raised), 2.0 * rules.body_error, np.zeros(n)
    is_faster, is_raised = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    for since in (before.earlier, (before.scene, before.measured)):
        elapsed, moved = _moved_since(since, scene, measured)
        # A sight that is no newer says nothing.
        is_new = elapsed > SHORTEST
        is_faster |= is_new & (moved > bound * elapsed + within)
        # Its bound stays raised as long as it needs that.
        needs = is_new & (moved > stated * elapsed + within)
        is_raised |= needs
        found[needs] = np.maximum(found, moved / np.maximum(elapsed, SHORTEST))[needs]
    speeds[is_raised] = np.maximum(raised, np.minimum(SHARE * found, FASTEST))[is_raised]
    until[is_raised] = measured[is_raised] + RAISED
    newest, earliest = (float(m.max(initial=-np.inf)) for m in (measured, before.earlier[1]))
    # A clock that was set back begins another window, and so does a wearer who was not there.
    is_within = 0.0 <= newest - earliest < WINDOW
    return BodyMotion(
        scene=scene,
        measured=measured,
        earlier=before.earlier if is_within else (scene, measured),
        speeds=speeds,
        until=until,
        n_seen=before.n_seen + int(is_new.sum()),
        n_faster=before.n_faster + int(is_faster.sum()),
        faster=tuple((names[i], float(found[i])) for i in np.flatnonzero(is_faster)),
    )


def _moved_since(
    before: tuple[Scene, Array], scene: Scene, measured: Array
) -> tuple[Array, Array]:
    """Return how long ago parts were at a sight [s], 0: never, and how far they moved [m]."""
    (then, times), n = before, len(scene.boxes)
    elapsed, moved = np.zeros(n), np.zeros(n)
    if then.names == scene.names:
        longest_ways(then.numbers, scene.numbers, moved)
        return measured - times, moved
    old = places_of(then, scene)
    known = old >= 0
    elapsed[known] = measured[known] - times[old[known]]
    ways = np.empty(int(known.sum()))
    longest_ways(then.numbers[old[known]], scene.numbers[known], ways)
    moved[known] = ways
    return elapsed, moved


def body_at(body: BodyMotion, time: float, rules: SeparationRules) -> SeenBody:
    """Return the wearer at a time, as he was last seen [s]."""
    raised = np.where(time <= body.until, body.speeds, 0.0)
    speeds = np.maximum(stated_speeds(body.scene, rules), raised)
    ages = time - body.measured
    # Measured later than now: the clock was set back, and nobody knows how old that is.
    ages = np.where(ages < -CLOCK_STEP, UNKNOWN_AGE, np.maximum(ages, 0.0))
    return SeenBody(body.scene, ages, speeds)


def stated_speeds(scene: Scene, rules: SeparationRules) -> Array:
    """Return the greatest speeds that are assumed of the boxes of a scene, (m,) [m/s]."""
    return _speeds(scene.names, rules)


@functools.lru_cache(maxsize=16)
def _speeds(names: tuple[str, ...], rules: SeparationRules) -> Array:
    speeds = np.array([speed_bound(rules, name) for name in names])
    speeds.setflags(write=False)
    return speeds


def places_of(before: Scene, after: Scene) -> NDArray[np.intp]:
    """Return which box of a scene is which one of the scene before, -1: none, (m,)."""
    return _matches(before.names, after.names)


@functools.lru_cache(maxsize=64)
def _matches(before: tuple[str, ...], after: tuple[str, ...]) -> NDArray[np.intp]:
    if before == after:
        return np.arange(len(after))
    # Of several parts with one name the first is the first, and so on.
    places: dict[str, list[int]] = {}
    for i, name in enumerate(before):
        places.setdefault(name, []).append(i)
    return np.array([places[n].pop(0) if places.get(n) else -1 for n in after], dtype=np.intp)
