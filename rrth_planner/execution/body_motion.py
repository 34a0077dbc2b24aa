# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer from one sight to the next: how old each part is, and whether it kept its reach."""

from dataclasses import dataclass, replace
import functools

import numpy as np
from numpy.typing import NDArray
from rrth_planner.execution.kept_sights import KeptSights, matched, sight_of, with_sight
from rrth_planner.kernels.collision.containment import excesses
from rrth_planner.model.arrays import Array
from rrth_planner.model.body_reach import FURTHEST, KNOWN_FOR
from rrth_planner.model.scene import Scene
from rrth_planner.model.separation import reach_of, SeenBody, SeparationRules

# A part that got further than assumed is taken to get further by so much and a share more, for so
# long [s].
SHARE, RAISED = 1.2, 1.0
# Two sights of a part that are this near to each other are not compared [s].
SHORTEST = 2e-3
# Clocks may differ by so much; the age of what was measured later than that [s].
CLOCK_STEP, UNKNOWN_AGE = 0.1, 1e3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BodyMotion:
    """
    The wearer as last seen, and what is assumed of how far his parts get.

    Parameters
    ----------
    measured : ndarray, shape (m,)
        When each box of the scene was measured [s].
    kept : KeptSights
        Him as he was seen before, and last.
    raised, until : ndarray, shape (m,)
        By how much the reach of parts that got further than assumed is raised [m], and until
        when [s].
    n_seen, n_further : int
        Sights of all parts so far, and those of parts that had got further than assumed.
    further : tuple of (str, float)
        The parts that had at the last sight: their names, and by how much [m].

    """

    scene: Scene
    measured: Array
    kept: KeptSights
    raised: Array
    until: Array
    n_seen: int = 0
    n_further: int = 0
    further: tuple[tuple[str, float], ...] = ()

    def shifted(self, step: float) -> 'BodyMotion':
        """Return the wearer by a clock that was set forward by a step [s]."""
        return replace(
            self,
            measured=self.measured + step,
            kept=self.kept.shifted(step),
            until=self.until + step,
        )


def first_sight(scene: Scene, measured: Array, came: float) -> BodyMotion:
    """Return a wearer who was never seen before, measured (m,), and who came now [s]."""
    nothing = np.zeros(len(scene.boxes))
    kept = with_sight(KeptSights(), sight_of(scene, measured), came, -np.inf)
    return BodyMotion(scene=scene, measured=measured, kept=kept, raised=nothing, until=nothing)


def seen_again(
    before: BodyMotion,
    scene: Scene,
    measured: Array,
    rules: SeparationRules,
    came: float,
    since: float = -np.inf,
) -> BodyMotion:
    """
    Return the wearer at his next sight, which came now [s].

    measured (m,): when each box of the scene was [s]. A part got further than assumed where its
    box is further out of one that was seen before than its reach and two errors explain. Its reach
    is raised for a while then. It is compared with all kept sights that came since a time [s]:
    what goes on and on is within its reach of the last one, and leaves that of an older one. Parts
    are known by their names.
    """
    names, n = scene.names, len(scene.boxes)
    raised, until, kept = before.raised, before.until, before.kept
    last = before.measured
    if before.scene.names != names:
        old = places_of(before.scene, scene)
        known, kept = old >= 0, matched(kept, old)
        then = old[known]
        raised, until, last = np.zeros(n), np.zeros(n), np.full(n, np.inf)
        raised[known], until[known] = before.raised[then], before.until[then]
        last[known] = before.measured[then]
    sight, reach = sight_of(scene, measured), reach_of(names, rules)
    found, excess = np.empty(n), np.zeros(n)
    for earlier in kept.since(since):
        excesses(
            earlier,
            sight,
            reach.offsets,
            reach.speeds,
            reach.stated,
            KNOWN_FOR,
            SHORTEST,
            2.0 * rules.body_error,
            found,
        )
        np.maximum(excess, found, out=excess)
    further: tuple[tuple[str, float], ...] = ()
    if excess.any():
        raised = np.where(measured <= until, raised, 0.0)
        which = np.flatnonzero(excess > raised).tolist()
        further = tuple((names[i], float(excess[i])) for i in which)
        # Its reach stays raised as long as it needs that.
        raised = np.maximum(raised, np.minimum(SHARE * excess, FURTHEST))
        until = np.where(excess > 0.0, measured + RAISED, until)
    return BodyMotion(
        scene=scene,
        measured=measured,
        kept=with_sight(kept, sight, came, since),
        raised=raised,
        until=until,
        n_seen=before.n_seen + int((measured - last > SHORTEST).sum()),
        n_further=before.n_further + len(further),
        further=further,
    )


def body_at(body: BodyMotion, time: float, rules: SeparationRules) -> SeenBody:
    """Return the wearer at a time, as he was last seen [s]."""
    reach, is_raised = reach_of(body.scene.names, rules), time <= body.until
    if is_raised.any():
        reach = reach.raised(np.where(is_raised, body.raised, 0.0))
    ages = time - body.measured
    # Measured later than now: the clock was set back, and nobody knows how old that is.
    ages = np.where(ages < -CLOCK_STEP, UNKNOWN_AGE, np.maximum(ages, 0.0))
    return SeenBody(body.scene, ages, reach)


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
