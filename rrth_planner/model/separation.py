# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Separation from a wearer who moves: what is assumed of him, and where his parts may be."""

from collections.abc import Sequence
from dataclasses import dataclass
import functools
import re

import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array, frozen_array
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
# Faster than any part of a body [m/s].
FASTEST = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SeparationRules:
    """
    What a commanded motion has to keep clear of, and how fast a part of the arm is at rest.

    Parameters
    ----------
    contact_speed : float
        No faster point of the arm may meet the wearer; 0: none that moves at all [m/s].
    body_speeds : sequence of (str, float)
        Greatest speed [m/s] of the parts of the body whose names have some words, as `speed_bound`
        reads them; no words: of any other part.
    body_error : float
        Greatest error of a box [m].
    controller_delay : float
        The arm executes a motion at most so late [s].

    Raises
    ------
    OptionsError
        A value that is negative or not a number, or body speeds without one for any other part.

    """

    contact_speed: float = 0.1
    body_speeds: tuple[tuple[str, float], ...] = BODY_SPEEDS
    body_error: float = 0.01
    controller_delay: float = 0.01

    def __post_init__(self) -> None:
        """Validate."""
        object.__setattr__(self, 'body_speeds', tuple((w, float(v)) for w, v in self.body_speeds))
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
    """Return the greatest speed that is assumed of a part of the body, by its name [m/s]."""
    return governing_speed(rules, name)[1]


# The same names come with each body.
@functools.lru_cache(maxsize=4096)
def governing_speed(rules: SeparationRules, name: str) -> tuple[str, float]:
    """
    Return the words of the rules that say how fast a part of the body is, and that speed [m/s].

    A name is read for the worse. Words fit it where they are whole words of it, one after the
    other: spaces, underscores, hyphens, digits and the capitals of LeftUpperArm separate words,
    capitals count as small letters. A speed of 0 fits only a name that has no other word. Where
    no words fit, the speed of any other part counts; words that merely occur in a name make it
    faster, never slower. Of all that count the greatest is taken. Nothing fits a name with a
    slash, as `torso/0` of a marker without a text, nor one that was cut short.
    """
    text = _INDEX.sub('', name)
    given = _words(text)
    whole = [] if '/' in text or text.endswith(CUT) else given
    counted, does_fit = [], False
    for words, speed in rules.body_speeds:
        entry = _words(words)
        if entry and ''.join(entry) in ''.join(given):
            counted.append((words, speed))
            does_fit |= whole == entry or (speed > 0.0 and _is_within(entry, whole))
    if not does_fit:
        counted += [(ANY_OTHER, speed) for words, speed in rules.body_speeds if not words]
    return max(counted, key=lambda item: item[1])


def _is_within(entry: list[str], name: list[str]) -> bool:
    """Return whether words stand one after the other in a name."""
    return f' {" ".join(entry)} ' in f' {" ".join(name)} '


def _words(name: str) -> list[str]:
    """Return the words of a name in small letters."""
    return _BORDERS.sub(' ', name).lower().split()


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
    speeds : array_like, shape (m,)
        Greatest speed of each box since then [m/s].

    Raises
    ------
    SceneError
        Not one age and speed >= 0 for each box.

    """

    scene: Scene
    ages: Array
    speeds: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        for name, unit in (('ages', 's'), ('speeds', 'm/s')):
            shape = (len(self.scene.boxes),)
            value = frozen_array(getattr(self, name), shape, name, unit, SceneError)
            if not (value >= 0.0).all():
                raise SceneError(f'{name}: {value.tolist()}, expected values >= 0 [{unit}]')
            object.__setattr__(self, name, value)


def seen_body(scene: Scene, ages: float | Sequence[float], rules: SeparationRules) -> SeenBody:
    """Return a body seen some time ago, one age for all boxes or one each [s], >= 0."""
    speeds = np.array([speed_bound(rules, name) for name in scene.names])
    return SeenBody(
        scene, np.broadcast_to(np.asarray(ages, dtype=np.float64), len(speeds)), speeds
    )


def growth_at(body: SeenBody, rules: SeparationRules, margin: float, time: float) -> Array:
    """
    Return by how much each box has to be grown at a time after the instant of the body, (m,) [m].

    margin + error + speed (time + delay - when it was seen): a part of the arm that keeps further
    away than this is clear of whatever the body does meanwhile (`docs/algorithms.md`).
    """
    elapsed = time + rules.controller_delay + body.ages
    grown: Array = margin + rules.body_error + body.speeds * np.maximum(elapsed, 0.0)
    return grown
