# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The outcome of a hand placed in the path of the arm, by the reference checker."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rrth_planner.collision.reference_checker import first_contact, least_clearance
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory

from benchmarks.common.controller_curve import positions_of
from benchmarks.soak.body import BodyAt, HAND, scene_of_body
from benchmarks.soak.judge import COARSE, MARGIN, RAY, SLACK

BRAKED, WENT_ON = 'stopped', 'not stopped, which was not needed'
LED_AWAY = 'not stopped: the arm was too near when the hand came, and its motion escaped'
MISSED = 'not stopped, though the remaining motion violated the margin'
PUT_ON = 'contact: the hand was put right onto the arm'
TOO_LATE = 'contact: within the stopping distance'
HIT = 'contact otherwise'
RAY_ONLY = 'contact of the pointing ray only'
# The hand came between two of the instants at which a motion is sampled [m].
NEARER = 5e-3
AGAIN, HELD, NOT_OVER = (
    'planned again and continued',
    'held, and reported why',
    'not at rest in time',
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Episode:
    """
    A hand placed in the path of a motion, and what followed.

    Parameters
    ----------
    body : BodyAt
        With the hand.
    motion : Trajectory
        That ran.
    phase : float
        When the hand came, since the motion began [s].
    published : tuple of (int, int)
        When motions were published after that, and when they came [ns].
    followed : tuple of Trajectory
        These motions.
    times, positions : ndarray, shape (n,), (n, dof)
        Of the arm from just before the hand came [ns, rad].
    monitor : str
        The last state of the monitor.

    """

    body: BodyAt
    motion: Trajectory
    phase: float
    published: tuple[tuple[int, int], ...]
    followed: tuple[Trajectory, ...]
    times: NDArray[np.int64]
    positions: Array
    monitor: str


def judge_episode(arm: ArmModel, episode: Episode) -> tuple[str, ...]:
    """Return the words for the outcome of an episode."""
    words = []
    scene = scene_of_body(episode.body)
    if episode.followed:
        words.append(BRAKED)
        if episode.monitor == 'holding':
            words.append(HELD)
        elif episode.monitor == 'no motion':
            words.append(AGAIN)
        else:
            words.append(NOT_OVER)
    else:
        q = positions_of(episode.motion, COARSE)
        left = q[min(len(q) - 1, round(episode.phase / COARSE)) :]
        words.append(word_of_going_on(arm, scene, left))
    contact = contact_word(arm, scene, episode)
    return (*words, contact) if contact else tuple(words)


def word_of_going_on(arm: ArmModel, scene: Scene, left: Array) -> str:
    """Return why an arm was not stopped, from its remaining motion."""
    if first_contact(arm, scene, left, RAY, MARGIN - SLACK) is None:
        return WENT_ON
    gaps = [least_clearance(arm, scene, q[None], RAY) for q in left]
    return LED_AWAY if min(gaps) > gaps[0] - NEARER and gaps[-1] > MARGIN - SLACK else MISSED


def sentence_on(arm: ArmModel, episode: Episode) -> str:
    """Return when a hand came, what was published then, and what the arm collided with."""
    sent = episode.body.sent
    delays = ', '.join(f'{1e-6 * (published - sent):.1f}' for published, _ in episode.published)
    after = episode.times >= sent
    scene, q = scene_of_body(episode.body), episode.positions[after]
    contact = first_contact(arm, scene, q, 0.0, 0.0)
    place = ''
    if contact is not None:
        late = 1e-6 * (episode.times[after][contact.index] - sent)
        place = f'; bar {contact.bar} collides with box "{contact.box}" {late:.1f} ms after it'
    return (
        f'the hand came {episode.phase:.3f} s after the begin of a motion of '
        f'{episode.motion.duration:.3f} s, motions were published {delays or "no"} ms after it'
        f'{place}'
    )


def contact_word(arm: ArmModel, scene: Scene, episode: Episode) -> str:
    """Return the contact of the arm with the body after the hand came; empty where none."""
    after = episode.times >= episode.body.sent
    q = episode.positions[after]
    # A ray has no body: it is reported, but it is no contact of the arm.
    if first_contact(arm, scene, q, 0.0, 0.0) is None:
        return RAY_ONLY if first_contact(arm, scene, q, RAY, 0.0) is not None else ''
    hand = Scene(tuple(box for box in scene.boxes if box.name == HAND))
    before = episode.positions[~after][-1:]
    present = np.concatenate([before, q[:1]])
    if first_contact(arm, hand, present, 0.0, 0.0) is not None:
        return PUT_ON
    if episode.followed:
        braked = positions_of(episode.followed[0], COARSE)
        if first_contact(arm, hand, braked, 0.0, 0.0) is not None:
            return TOO_LATE
    return HIT
