# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Separation from a wearer who moves: what is assumed of him, and where his parts may be."""

from collections.abc import Sequence
from dataclasses import dataclass
import functools
import re
from typing import TypeVar

import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.body_reach import (
    BODY_REACH,
    check_lines,
    FASTEST,
    joined,
    KNOWN_FOR,
    least_lines,
    Lines,
)
from rrth_planner.model.errors import CUT, OptionsError, SceneError
from rrth_planner.model.frozen import Frozen
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits

# Greatest speeds of parts of the body by words of their names [m/s], in the frame of the torso: 0
# for what wears the arm.
BODY_SPEEDS = (
    ('torso', 0.0),
    ('chest', 0.0),
    ('head', 1.0),
    ('neck', 1.0),
    ('upper arm', 1.6),
    ('forearm', 2.0),
    ('hand', 2.0),
    ('pelvis', 1.0),
    ('thigh', 1.0),
    ('shin', 2.0),
    ('foot', 2.0),
    ('', 2.0),
)
# Of bodies 120 times a second the next one, or the one after it, is there by then [s].
SHORTEST_STRETCH = 0.018
# What an entry of the rules says of a part.
_Said = TypeVar('_Said')


@dataclass(frozen=True, slots=True, kw_only=True)
class SeparationRules:
    """
    What a commanded motion has to keep clear of, and how fast a part of the arm is at rest.

    A part of the body gets no further from where it was seen than the least of its lines c + w t:
    those of `body_reach`, or, for words that have none there, the line 0 + v t of `body_speeds`.
    More than `KNOWN_FOR` after it was seen it may be as far as its greatest speed takes it, too.

    Parameters
    ----------
    contact_speed : float
        No faster point of the arm may meet the wearer; 0: none that moves at all [m/s].
    body_speeds : sequence of (str, float)
        Greatest speed [m/s] of the parts of the body whose names have some words, as
        `governing_reach` reads them; no words: of any other part.
    body_reach : sequence of (str, lines), or None
        Lines, (c, w) each [m, m/s], of the parts whose names have some words. None: `BODY_REACH`,
        or no entry at all where `body_speeds` are others than `BODY_SPEEDS`.
    body_error : float
        Greatest error of a box [m].
    controller_delay : float
        The arm executes a motion at most so late [s].

    Raises
    ------
    OptionsError
        A value that is negative or not a number, body speeds without one for any other part, or
        lines none of which has c = 0.

    """

    contact_speed: float = 0.1
    body_speeds: tuple[tuple[str, float], ...] = BODY_SPEEDS
    body_reach: tuple[tuple[str, Lines], ...] | None = None
    body_error: float = 0.01
    controller_delay: float = 0.01

    def __post_init__(self) -> None:
        """Validate."""
        object.__setattr__(self, 'body_speeds', tuple((w, float(v)) for w, v in self.body_speeds))
        if self.body_reach is not None:
            given = tuple(
                (words, tuple((float(c), float(w)) for c, w in lines))
                for words, lines in self.body_reach
            )
            object.__setattr__(self, 'body_reach', given)
        for name, unit, greatest in (
            ('contact_speed', 'm/s', FASTEST),
            ('body_error', 'm', 10.0),
            ('controller_delay', 's', 10.0),
        ):
            value = getattr(self, name)
            if not 0.0 <= value <= greatest:
                raise OptionsError(f'{name}: {value}, expected 0 to {greatest:g} [{unit}]')
        for words, speed in self.body_speeds:
            if not 0.0 <= speed <= FASTEST:
                raise OptionsError(
                    f'body_speeds: "{words}: {speed}", expected 0 to {FASTEST:g} [m/s]'
                )
        if not any(words == '' for words, _ in self.body_speeds):
            raise OptionsError(
                'body_speeds: none for any other part of the body, expected ": 2.0" or the like'
            )
        for words, lines in self.body_reach or ():
            check_lines(words, lines)

    @property
    def reach(self) -> tuple[tuple[str, Lines], ...]:
        """The lines of parts by words of their names: speeds of one's own have none by default."""
        if self.body_reach is not None:
            return self.body_reach
        return BODY_REACH if self.body_speeds == BODY_SPEEDS else ()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Separation:
    """
    What commitments are proven with.

    Parameters
    ----------
    margin : float
        [m].
    limits, stop_limits : MotionLimits
        Of the motion, and of the stop that ends a commitment.
    stretch : float
        How long a commitment goes on before its stop begins: by then the next one is there [s].

    """

    arm: ArmModel
    rules: SeparationRules
    margin: float
    limits: MotionLimits
    stop_limits: MotionLimits
    stretch: float = SHORTEST_STRETCH


# What a part is called that no words fit, in sentences.
ANY_OTHER = 'any other part'
# The number of a box of a CUBE_LIST, which is no part of its name.
_INDEX = re.compile(r'\[\d+\]$')
# A name of several words, as LeftUpperArm, and digits, which are words of their own.
_BORDERS = re.compile(r'(?<=[a-z])(?=[A-Z])|(?<=\d)(?=\D)|(?<=\D)(?=\d)|[\s_-]')


def speed_bound(rules: SeparationRules, name: str) -> float:
    """Return the greatest speed that is stated of a part of the body, by its name [m/s]."""
    return max(speed for _, speed in _counting(rules, rules.body_speeds, name))


# The same names come with each body.
@functools.lru_cache(maxsize=4096)
def governing_reach(rules: SeparationRules, name: str) -> tuple[str, Lines]:
    """
    Return the words of the rules that say how far a part of the body gets, and its lines.

    A name is read for the worse. Words fit it where they are whole words of it, one after the
    other: spaces, underscores, hyphens, digits and the capitals of LeftUpperArm separate words,
    capitals count as small letters. What wears the arm, by a greatest speed of 0, fits only a name
    that has no other word. Where no words fit, what is said of any other part counts; words that
    merely occur in a name make it get further, never less far. Of all that count none is exceeded.
    Nothing fits a name with a slash, as `torso/0` of a marker without a text, nor one that was cut
    short.
    """
    counted = _counting(rules, _entries(rules), name)
    lines = functools.reduce(joined, (lines for _, lines in counted))
    # One that says it all is named alone.
    alone = [words for words, own in counted if own == lines][:1]
    return ', '.join(alone or [words for words, _ in counted]), lines


@functools.lru_cache(maxsize=64)
def _entries(rules: SeparationRules) -> tuple[tuple[str, Lines], ...]:
    """Return what the rules say by words: lines, and of words without lines the speeds."""
    reach = tuple((words, least_lines(lines)) for words, lines in rules.reach)
    known = {tuple(_words(words)) for words, _ in reach}
    speeds = ((w, ((0.0, v),)) for w, v in rules.body_speeds if tuple(_words(w)) not in known)
    return (*reach, *speeds)


@functools.lru_cache(maxsize=64)
def _worn_words(rules: SeparationRules) -> tuple[list[str], ...]:
    """Return the words of what wears the arm: whatever else has them need not stand still."""
    still = [words for words, speed in rules.body_speeds if speed == 0.0]
    still += [words for words, lines in rules.reach if least_lines(lines) == ((0.0, 0.0),)]
    return tuple(_words(words) for words in still)


def _counting(
    rules: SeparationRules, entries: Sequence[tuple[str, _Said]], name: str
) -> list[tuple[str, _Said]]:
    """Return the entries that count for a name, as `governing_reach` reads it."""
    text = _INDEX.sub('', name)
    given = _words(text)
    whole = [] if '/' in text or text.endswith(CUT) else given
    counted, does_fit = [], False
    for words, said in entries:
        entry = _words(words)
        if entry and ''.join(entry) in ''.join(given):
            counted.append((words, said))
            is_worn = entry in _worn_words(rules)
            does_fit |= whole == entry or (not is_worn and _is_within(entry, whole))
    if not does_fit:
        counted += [(ANY_OTHER, said) for words, said in entries if not _words(words)]
    return counted


def _is_within(entry: list[str], name: list[str]) -> bool:
    """Return whether words stand one after the other in a name."""
    return f' {" ".join(entry)} ' in f' {" ".join(name)} '


def _words(name: str) -> list[str]:
    """Return the words of a name in small letters."""
    return _BORDERS.sub(' ', name).lower().split()


@dataclass(frozen=True, slots=True, eq=False)
class Reach(Frozen):
    """
    How far boxes may get from where they were seen: the least of lines c + w t.

    Parameters
    ----------
    offsets, speeds : array_like, shape (m, n)
        c [m] and w [m/s] of the lines of each box.
    stated : array_like, shape (m,)
        Greatest speeds, which count from `KNOWN_FOR` on, too [m/s].

    Raises
    ------
    SceneError
        Other shapes, or a number that is negative or not finite.

    """

    offsets: Array
    speeds: Array
    stated: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        m: int | None = None
        n: int | None = None
        for name, unit in (('offsets', 'm'), ('speeds', 'm/s'), ('stated', 'm/s')):
            shape = (m,) if name == 'stated' else (m, n)
            value = frozen_array(getattr(self, name), shape, name, unit, SceneError)
            if not (value >= 0.0).all():
                raise SceneError(f'{name}: {value.tolist()}, expected values >= 0 [{unit}]')
            object.__setattr__(self, name, value)
            m, n = self.offsets.shape

    def raised(self, by: Array) -> 'Reach':
        """Return the reach of boxes that get further by so much, (m,) [m]."""
        return Reach(self.offsets + by[:, None], self.speeds, self.stated)


# The same names come with each body.
@functools.lru_cache(maxsize=64)
def reach_of(names: tuple[str, ...], rules: SeparationRules) -> Reach:
    """Return how far the boxes of some names may get."""
    found = [governing_reach(rules, name)[1] for name in names]
    n = max((len(lines) for lines in found), default=1)
    # The last line of each stands for those that it lacks.
    rows = [lines + lines[-1:] * (n - len(lines)) for lines in found]
    numbers = np.array(rows).reshape(len(names), n, 2)
    stated = np.array([speed_bound(rules, name) for name in names])
    return Reach(numbers[..., 0], numbers[..., 1], stated)


def reach_at(reach: Reach, elapsed: Array) -> Array:
    """Return how far boxes may get within a time each, (..., m) [s] -> (..., m) [m]."""
    least = (reach.offsets + reach.speeds * elapsed[..., None]).min(axis=-1)
    beyond = np.where(elapsed > KNOWN_FOR, reach.stated * elapsed, 0.0)
    found: Array = np.maximum(least, beyond)
    return found


@dataclass(frozen=True, slots=True, eq=False)
class SeenBody(Frozen):
    """
    The wearer as he was last seen, at some instant.

    Parameters
    ----------
    scene : Scene
        The boxes as they were seen.
    ages : array_like, shape (m,)
        How long before the instant each box was seen [s].
    reach : Reach
        How far each box may have got since then.

    Raises
    ------
    SceneError
        Not one age >= 0 and one row of lines for each box.

    """

    scene: Scene
    ages: Array
    reach: Reach

    def __post_init__(self) -> None:
        """Validate and freeze."""
        m = len(self.scene.boxes)
        ages = frozen_array(self.ages, (m,), 'ages', 's', SceneError)
        if not (ages >= 0.0).all():
            raise SceneError(f'ages: {ages.tolist()}, expected values >= 0 [s]')
        object.__setattr__(self, 'ages', ages)
        if len(self.reach.stated) != m:
            raise SceneError(f'reach: of {len(self.reach.stated)} boxes, expected {m}')


def seen_body(scene: Scene, ages: float | Sequence[float], rules: SeparationRules) -> SeenBody:
    """Return a body seen some time ago, one age for all boxes or one each [s], >= 0."""
    each = np.broadcast_to(np.asarray(ages, dtype=np.float64), len(scene.boxes))
    return SeenBody(scene, each, reach_of(scene.names, rules))


def growth_at(body: SeenBody, rules: SeparationRules, margin: float, time: float) -> Array:
    """
    Return by how much each box has to be grown at a time after the instant of the body, (m,) [m].

    margin + error + D(time + delay + age), D: how far it may get within a time. A part of the arm
    that keeps further away than this is clear of whatever the body does meanwhile
    (`docs/algorithms.md`).
    """
    elapsed = np.maximum(time + rules.controller_delay + body.ages, 0.0)
    grown: Array = margin + rules.body_error + reach_at(body.reach, elapsed)
    return grown


def growth_lines(
    body: SeenBody, rules: SeparationRules, margin: float, until: float
) -> tuple[Array, Array]:
    """
    Return lines g + w t whose least bounds `growth_at` from 0 to a time [s], (m, n) [m, m/s].

    They are those of the boxes; of a box whose reach is not known for so long none is less steep
    than its greatest speed.
    """
    reach, since = body.reach, rules.controller_delay + body.ages
    speeds, is_unknown = reach.speeds, since + until > KNOWN_FOR
    if is_unknown.any():
        speeds = np.maximum(speeds, np.where(is_unknown, reach.stated, 0.0)[:, None])
    return margin + rules.body_error + reach.offsets + speeds * since[:, None], speeds
