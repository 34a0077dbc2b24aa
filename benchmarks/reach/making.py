# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Lines made of recorded people, each of whom is judged by lines that were made without him."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rrth_planner.model.arrays import Array

from benchmarks.reach.lines import (
    growth,
    least_steps,
    Lines,
    lines_above,
    needed,
    ORIGIN,
    ROUND_W,
    steepened,
)
from benchmarks.reach.people import FRAMES, kind_of, STATED, Take

# Of the pairs of frames of a person so many are within the bound that lines are drawn above; what
# is beyond it is judged frame by frame.
COVERED = 0.9999
# Of how far legs get from the trunk so little is known that no line is less steep than their
# stated speeds. Other parts are taken to be as fast as stated at least as far as people got.
LEGS = ('thigh', 'shin', 'foot')
# Boxes of TU Munich's recordings have a pelvis that is fixed to the chest.
FIXED = 1e-3


@dataclass(frozen=True, eq=False)
class Making:
    """
    How lines are made of some takes.

    Parameters
    ----------
    takes : sequence of Take
    made_of : sequence of float
        Rates at which people are played whose lines are made.
    limit : float
        Share of the frames of an unseen person at which a part may have left its bound.

    """

    takes: Sequence[Take]
    made_of: Sequence[float]
    limit: float

    @cached_property
    def times(self) -> Array:
        """The times between two frames [s]."""
        return np.arange(1, len(next(iter(self.takes[0].out.values()))) + 1) / FRAMES

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of parts that move, in the order of their stated speeds."""
        found = {kind_of(part) for take in self.takes for part in take.out}
        return tuple(
            word for word, _ in STATED.body_speeds if word in found and self.people_of(word)
        )

    def unit_of(self, kind: str, take: Take) -> str:
        """Return what is left out together: a person, or a take where there is one person."""
        return take.person if len(self.people_of(kind)) > 1 else take.name

    def people_of(self, kind: str) -> tuple[str, ...]:
        """Return of whom a kind of part was measured."""
        people = (
            take.person for take in self.takes if any(_is_free(x) for x in _outs(take, kind))
        )
        return tuple(dict.fromkeys(people))

    @cached_property
    def _covered(self) -> dict[tuple[str, str], Array]:
        """How far parts get, but for the furthest pairs, by kind and unit, (n_times,) [m]."""
        found: dict[tuple[str, str], list[Array]] = {}
        for take in self.takes:
            if take.rate in self.made_of:
                for kind in self.kinds:
                    outs = [out for out in _outs(take, kind) if _is_free(out)]
                    found.setdefault((kind, self.unit_of(kind, take)), []).extend(outs)
        return {
            key: np.nanquantile(np.concatenate(outs, axis=1), COVERED, axis=1).astype(np.float64)
            for key, outs in found.items()
            if outs
        }

    def base_lines(self, kind: str, without: str = '') -> Lines:
        """Return lines above all units but one, as steep as these need."""
        bounds = [x for (k, unit), x in self._covered.items() if k == kind and unit != without]
        speed = dict(STATED.body_speeds)[kind]
        if not bounds:
            return ((ORIGIN, max(speed, ROUND_W)),)
        bound = np.max(bounds, axis=0)
        if kind in LEGS:
            return lines_above(self.times, bound, speed)
        floor = np.minimum(speed * self.times, bound.max())
        return lines_above(self.times, np.maximum(bound, floor))

    @cached_property
    def steps(self) -> dict[str, float]:
        """How much steeper the lines of each kind are than those recorded need [m/s]."""
        groups: dict[object, dict[str, Array]] = {}
        for person, rate in dict.fromkeys((t.person, t.rate) for t in self.takes):
            if rate in self.made_of:
                some = [t for t in self.takes if (t.person, t.rate) == (person, rate)]
                kinds = [k for k in self.kinds if all(_outs(take, k) for take in some)]
                groups[person, rate] = {
                    kind: np.concatenate([self._needed(kind, take) for take in some])
                    for kind in kinds
                }
        return least_steps(groups, self.limit)

    def _needed(self, kind: str, take: Take) -> Array:
        """Return how much steeper lines that were made without a take have to be, (n_frames,)."""
        base = self.base_lines(kind, self.unit_of(kind, take))
        found: Array = np.max(
            [needed(out, base, self.times, STATED.body_error) for out in _outs(take, kind)], axis=0
        )
        return found

    def lines_without(self, kind: str, take: Take) -> Lines:
        """Return the lines of a kind by which a take is judged."""
        return steepened(self.base_lines(kind, self.unit_of(kind, take)), self.steps[kind])

    @cached_property
    def lines(self) -> dict[str, Lines]:
        """The lines of each kind, and of any other part: where all of these get."""
        found = {k: steepened(self.base_lines(k), self.steps[k]) for k in self.kinds}
        furthest = np.max([growth(lines, self.times) for lines in found.values()], axis=0)
        steepest = max(w for lines in found.values() for c, w in lines if c == ORIGIN)
        others = steepened(lines_above(self.times, furthest), 0.0)[1:]
        return {**found, '': ((ORIGIN, steepest), *others)}


def judged(
    making: Making, take: Take, lines: Mapping[str, Lines] | None = None
) -> tuple[dict[str, tuple[int, int, int]], Array, Array]:
    """
    Return how often parts of a take left their bounds.

    Parameters
    ----------
    lines : mapping, optional
        Of each kind of part; None: those that were made without him.

    Returns
    -------
    dict of (int, int, int)
        By kind: pairs of frames, those broken by corners and stated speeds, those broken by
        containment and lines.
    ndarray, ndarray, shape (n_frames,)
        Whether a part had left its bound at any time before, by the one and by the other.

    """
    pairs: dict[str, tuple[int, int, int]] = {}
    stated, lined = (np.zeros(take.n_frames, dtype=np.bool_) for _ in range(2))
    for part, out in take.out.items():
        kind = kind_of(part)
        if kind not in making.kinds:
            continue
        some = making.lines_without(kind, take) if lines is None else lines[kind]
        bound = growth(some, making.times)[:, None] + STATED.body_error
        with np.errstate(invalid='ignore'):
            is_out = out > bound
        before = pairs.get(kind, (0, 0, 0))
        new = take.n_pairs[part], take.n_faster[part], int(is_out.sum())
        pairs[kind] = (before[0] + new[0], before[1] + new[1], before[2] + new[2])
        stated |= take.is_faster[part]
        lined |= is_out.any(axis=0)
    return pairs, stated, lined


def _outs(take: Take, kind: str) -> list[Array]:
    return [out for part, out in take.out.items() if kind_of(part) == kind]


def _is_free(out: Array) -> bool:
    """Return whether a part moves in the boxes of a recording."""
    return bool(np.nanmax(out) > FIXED)
