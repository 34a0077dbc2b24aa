# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What came of a hand that was held into the way of the arm, judged by the oracle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rrth_planner.collision.reference_checker import first_contact, least_clearance
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory

from benchmarks.soak.body import BodyAt, HAND, scene_of_body
from benchmarks.soak.judge import COARSE, MARGIN, RAY, SLACK, states_of

BRAKED, WENT_ON = 'braked', 'no brake, none was needed'
LED_AWAY = 'no brake: the arm was too near when the hand came, and its motion led away'
MISSED = 'no brake, though the rest of the motion came too near'
PUT_ON = 'touched: the hand was put right onto the arm'
TOO_LATE = 'touched: within the distance it takes to brake'
TOUCHED = 'touched otherwise'
RAY_ONLY = 'only the pointing ray touched'
# The hand came between two of the instants at which a motion is looked at [m].
NEARER = 5e-3
AGAIN, HELD, NOT_OVER = 'planned again and went on', 'held, and said why', 'not at rest in time'


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Episode:
    """
    A hand that was held into the way of a motion, and what followed.

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
    guard : str
        What the guard did at last.

    """

    body: BodyAt
    motion: Trajectory
    phase: float
    published: tuple[tuple[int, int], ...]
    followed: tuple[Trajectory, ...]
    times: NDArray[np.int64]
    positions: Array
    guard: str


def judge_episode(arm: ArmModel, episode: Episode) -> tuple[str, ...]:
    """Return the words that hold of an episode."""
    words = []
    scene = scene_of_body(episode.body)
    if episode.followed:
        words.append(BRAKED)
        if episode.guard == 'holding':
            words.append(HELD)
        elif episode.guard == 'no motion':
            words.append(AGAIN)
        else:
            words.append(NOT_OVER)
    else:
        q = states_of(episode.motion, COARSE)
        left = q[min(len(q) - 1, round(episode.phase / COARSE)) :]
        words.append(word_of_going_on(arm, scene, left))
    touch = touch_word(arm, scene, episode)
    return (*words, touch) if touch else tuple(words)


def word_of_going_on(arm: ArmModel, scene: Scene, left: Array) -> str:
    """Return how it is that an arm was not stopped, from what was left of its motion."""
    if first_contact(arm, scene, left, RAY, MARGIN - SLACK) is None:
        return WENT_ON
    gaps = [least_clearance(arm, scene, q[None], RAY) for q in left]
    return LED_AWAY if min(gaps) > gaps[0] - NEARER and gaps[-1] > MARGIN - SLACK else MISSED


def sentence_on(arm: ArmModel, episode: Episode) -> str:
    """Return when a hand came, what was published then, and what it touched."""
    sent = episode.body.sent
    told = ', '.join(f'{1e-6 * (published - sent):.1f}' for published, _ in episode.published)
    after = episode.times >= sent
    scene, q = scene_of_body(episode.body), episode.positions[after]
    touch = first_contact(arm, scene, q, 0.0, 0.0)
    contact = ''
    if touch is not None:
        late = 1e-6 * (episode.times[after][touch.index] - sent)
        contact = f'; bar {touch.bar} seen to touch box "{touch.box}" {late:.1f} ms after it'
    return (
        f'the hand came {episode.phase:.3f} s after the begin of a motion of '
        f'{episode.motion.duration:.3f} s, motions were published {told or "no"} ms after it'
        f'{contact}'
    )


def touch_word(arm: ArmModel, scene: Scene, episode: Episode) -> str:
    """Return how the arm touched the body after the hand came; empty where it did not."""
    after = episode.times >= episode.body.sent
    q = episode.positions[after]
    # A ray has no body: it is reported, but it is not the arm that touches.
    if first_contact(arm, scene, q, 0.0, 0.0) is None:
        return RAY_ONLY if first_contact(arm, scene, q, RAY, 0.0) is not None else ''
    hand = Scene(tuple(box for box in scene.boxes if box.name == HAND))
    before = episode.positions[~after][-1:]
    present = np.concatenate([before, q[:1]])
    if first_contact(arm, hand, present, 0.0, 0.0) is not None:
        return PUT_ON
    if episode.followed:
        braked = states_of(episode.followed[0], COARSE)
        if first_contact(arm, hand, braked, 0.0, 0.0) is not None:
            return TOO_LATE
    return TOUCHED
