# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Section `adversary`: parts of the wearer that leave to intercept the arm, as fast as they may.

What is seen, lost and wrong in between is the perception's, which section `perception` varies.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rrth_planner.collision.reference_checker import bar_ends_at
from rrth_planner.execution.commitment import path_state
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.remaining_motion import is_remaining_free
from rrth_planner.io.wearer_file import load_body
from rrth_planner.kernels.layout import SIZE
from rrth_planner.model.arm import bars_of
from rrth_planner.model.arrays import Array
from rrth_planner.model.body_reach import Lines
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import governing_reach, SeparationRules
from rrth_planner.model.trajectory import positions_at, Trajectory
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.rehearsal.contacts import (
    AT_REST,
    box_distances,
    classes_of,
    distances_to,
    FAST,
    SLOW,
    worst_class,
)

from benchmarks.separation.lockstep import (
    Controller,
    Eyes,
    instants,
    PATIENCE,
    Planner,
    Timing,
)
from benchmarks.separation.reaching import (
    EARLIEST,
    FASTEST,
    HORIZON,
    interception,
    Reaching,
    STEP,
)
from benchmarks.separation.setting import (
    Case,
    FOLDED,
    MARGIN,
    random_plans,
    required,
    separation_of,
    the_arm,
)

# A further hand is such a cube, at a distance from the way of the arm from the first to the second
# [m]; so many places are tried.
HAND, EDGE, NEAR, FAR, TRIES = 'hand', 0.1, 0.05, 0.6, 30
# Share of the hands, of forearms, and of the head that moves; the rest are heads that turn.
SHARES = (0.55, 0.25, 0.1)
# Share of the parts that leave right after a frame was taken.
RIGHT_AFTER = 1.0 / 3.0
# A part that is not seen leaves at most so long after it was seen last [s].
UNSEEN = 0.5
# A part moves for so long [s]. One leaves so late at the latest, however slow the arm is [s].
REACHES, LATEST = 1.0, 10.0
# Hands of a chain of motions, the first of which begins folded.
CHAIN = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """
    What is wrong with what is seen.

    Parameters
    ----------
    lost : float
        Share of the frames that are lost.
    gone : float
        How long the part that leaves is not seen, about then [s]; inf: never again.
    noise : float
        Greatest error of the place of a box [m].
    understated : float
        How much older frames are than they say [s].

    """

    lost: float = 0.0
    gone: float = 0.0
    noise: float = 0.0
    understated: float = 0.0


def seen_at_once(names: tuple[str, ...], rows: Array, _: np.random.Generator) -> Eyes:
    """Return eyes that are shown the boxes themselves; they know the wearer at rest."""
    # Whoever knew him at rest knows him as long as he pleases.
    return Eyes(names, rows, np.zeros(len(rows)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """
    What hands are tried with.

    Parameters
    ----------
    case : Case
    timing : Timing
    scale : float
        How far the part that leaves gets, over what is assumed of it [-].
    is_steady : bool
        Whether it goes on for ever at its greatest speed, which is assumed of it for an instant
        only.
    is_separate : bool
        Whether motions are given as commitments; else they are monitored as a whole.
    faults : Faults
    shares : (float, float, float)
        As `SHARES`.
    eyes : callable
        Makes those of the planner, of the names and rows of a wearer at rest and a generator.

    """

    case: Case = Case()
    timing: Timing = Timing()
    scale: float = 1.0
    is_steady: bool = False
    is_separate: bool = True
    faults: Faults = Faults()
    shares: tuple[float, float, float] = SHARES
    eyes: Callable[[tuple[str, ...], Array, np.random.Generator], Eyes] = seen_at_once

    @property
    def is_honest(self) -> bool:
        """Whether all that is assumed is so: then nothing faster than v_c may be met."""
        is_within = self.scale <= 1.0 and not self.is_steady
        return self.is_separate and is_within and self.faults.understated == 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Hand:
    """
    What became of one part that left.

    Parameters
    ----------
    seed, number : int
        Of the chain, and within it.
    part : str
    word : str
        The worst class of contact, empty: none.
    is_near : bool
        Whether a place of the arm that was faster than the contact speed was within the margin.
    speed : float
        The greatest one of the arm in a contact of the class FAST [m/s].
    gap : float
        The least distance of a fast place from any box [m].
    was_moving : bool
        Whether the arm moved when the part left.
    is_noticed : bool
        Whether the planner knew that the part was further than assumed before it met the arm, or,
        where it did not, at all.

    """

    seed: int
    number: int
    part: str
    word: str
    is_near: bool
    speed: float
    gap: float
    was_moving: bool
    is_noticed: bool


@dataclass(frozen=True, slots=True)
class Chain:
    """The hands of a chain, and how many motions could not begin beside them."""

    hands: tuple[Hand, ...]
    n_blocked: int


def chain_of_hands(trial: Trial, n: int, seed: int) -> Chain:
    """Return what becomes of some hands, each reaching for another motion of the arm."""
    rng = np.random.default_rng(seed)
    q, hands, n_blocked = FOLDED, [], 0
    while len(hands) < n:
        scene, part, is_turning = _draw_part(rng, trial.shares)
        plan = next(random_plans(rng, scene, q, trial.case if trial.is_separate else None), None)
        if plan is None:
            q = FOLDED
            continue
        assert plan.trajectory is not None
        if part is None:
            hand = _hand_beside(rng, plan.trajectory)
            if hand is None:
                continue
            scene, part = Scene((*scene.boxes, hand)), len(scene.boxes)
            whole = ExecutingMotion(
                trajectory=plan.trajectory, start_time=0.0, target_distance=plan.target_distance
            )
            # One that is in the way even at rest, of the ray say, would stop every arm.
            if not is_remaining_free(whole, 0.0, required(), scene):
                continue
        lines = way_lines(trial, separation_of(trial.case).rules, scene.boxes[part].name)
        wearer = Reaching(scene, part, lines, is_turning)
        episode = _Episode(trial, plan, q, wearer, rng)
        if not episode.run():
            n_blocked += 1
            continue
        hands.append(episode.judged(seed, len(hands)))
        q = episode.place()
    return Chain(tuple(hands), n_blocked)


def way_lines(trial: Trial, rules: SeparationRules, name: str) -> Lines:
    """Return lines the least of which says how far a part gets since it left."""
    lines = governing_reach(rules, name)[1]
    if trial.is_steady:
        lines = tuple((c, w) for c, w in lines if c == 0.0)
    return tuple((trial.scale * c, trial.scale * w) for c, w in lines)


def _draw_part(
    rng: np.random.Generator, shares: tuple[float, float, float]
) -> tuple[Scene, int | None, bool]:
    """Return the wearer, which part is going to leave, None: a further hand, and if it turns."""
    scene, draw = load_body(), rng.random()
    names = [box.name for box in scene.boxes]
    if draw < shares[0]:
        return scene, None, False
    if draw < sum(shares[:2]):
        return scene, names.index(rng.choice(['left forearm', 'right forearm'])), False
    return scene, names.index('head'), bool(draw >= sum(shares))


def _hand_beside(rng: np.random.Generator, motion: Trajectory) -> Box | None:
    """Return a hand at rest from NEAR to FAR from the way of the arm, anywhere round it."""
    arm = the_arm()
    q = positions_at(motion, np.linspace(0.0, motion.duration, 60))
    ends = bar_ends_at(arm, q, 0.0)[:, : len(bars_of(arm)) - 1]
    s = np.linspace(0.0, 1.0, 20)[:, None, None, None]
    points = (ends[:, :, 0] + s * (ends[:, :, 1] - ends[:, :, 0])).reshape(-1, 3)
    greatest = max(bar.radius for bar in bars_of(arm)[:-1])
    for _ in range(TRIES):
        direction = rng.standard_normal(3)
        away = rng.uniform(NEAR, FAR + 0.5 * EDGE)
        center = rng.choice(points) + away * direction / np.linalg.norm(direction)
        hand = Box(HAND, center, np.full(3, EDGE), rotation_matrix(rng.standard_normal(4)))
        gap = box_distances(points[None], hand.numbers[None]).min() - greatest
        if NEAR <= gap <= FAR:
            return hand
    return None


class _Episode:
    """One motion, and the part that leaves for it."""

    def __init__(
        self,
        trial: Trial,
        plan: MotionPlan,
        q: Array,
        wearer: Reaching,
        rng: np.random.Generator,
    ) -> None:
        """Draw how the part is going to leave."""
        assert plan.trajectory is not None
        self.trial, self.plan, self.wearer, self.rng = trial, plan, wearer, rng
        self.motion = plan.trajectory
        self.settings = separation_of(trial.case)
        self.controller = Controller(q)
        self.planner = Planner(
            self.settings, trial.timing, rng, self.controller, is_separate=trial.is_separate
        )
        self.eyes = trial.eyes(wearer.names, wearer.scene.numbers, rng)
        self.share = rng.uniform(0.0, 0.95)
        self.is_right_after = bool(rng.random() < RIGHT_AFTER)
        self.aim = str(rng.choice([EARLIEST, FASTEST]))
        self.aims_again, self.looks_at_plan = (bool(rng.random() < 0.5) for _ in range(2))
        self.leaves, self.was_moving, self.noticed = np.inf, False, np.inf
        self.gone_from = np.inf

    def run(self) -> bool:
        """Run it until a while after the part has left; return whether the motion began."""
        timing, faults, planner = self.trial.timing, self.trial.faults, self.planner
        planner.begin(self.plan)
        k = 0
        while (time := k * timing.period) < PATIENCE:
            k += 1
            if time > self.leaves + REACHES + HORIZON:
                return True
            if not np.isfinite(self.leaves):
                if planner.cannot_begin(time):
                    return False
                self._choose(time)
            self._aim(time)
            if self.rng.random() >= faults.lost or k == 1:
                self._see(time)
                planner.frame(time, self.eyes)
                if planner.n_further and self.noticed == np.inf:
                    self.noticed = time
        return False

    def _choose(self, time: float) -> None:
        """Have the part leave between this frame and the next where the arm is there by then."""
        period = self.trial.timing.period
        if (
            self.planner.progress(time + period) < self.share * self.motion.duration
            and time < LATEST
        ):
            return
        if self.gone_from == np.inf and self.trial.faults.gone > 0.0:
            self.gone_from = time + self.rng.uniform(0.0, 0.1)
            self.leaves = self.gone_from + self.rng.uniform(
                0.0, min(self.trial.faults.gone, UNSEEN)
            )
            return
        if self.is_right_after:
            # Some frame shows him as he was at this time minus a multiple of the period.
            self.leaves = time + (-self.trial.timing.age) % period + 1e-6
        else:
            self.leaves = time + self.rng.uniform(0.0, period)

    def _aim(self, time: float) -> None:
        """Have the part leave, or, where it aims again, turn to where the arm is going to be."""
        wearer = self.wearer
        if not self.leaves < time + self.trial.timing.period:
            return
        if not wearer.begins:
            at = self.leaves
            _, v = self._states(np.array([at]))
            self.was_moving = bool(np.abs(v).max() > 1e-3)
            if wearer.is_turning:
                wearer.head_for(np.zeros(3), at)
                return
        elif not self.aims_again or wearer.is_turning or time > self.leaves + REACHES:
            return
        else:
            at = time
        ahead = np.arange(0.0, HORIZON, STEP)
        q, v = self._expected(at, ahead)
        direction = interception(
            self.settings.arm,
            q,
            v,
            wearer.rows(np.array([at]))[0, wearer.part],
            wearer.ways_ahead(at, ahead),
            self.settings.rules.contact_speed,
            self.aim,
        )
        if direction is None and not wearer.begins:
            direction = self.rng.standard_normal(3)
            direction /= np.linalg.norm(direction)
        if direction is not None:
            wearer.head_for(direction, at)

    def _expected(self, time: float, ahead: Array) -> tuple[Array, Array]:
        """Return what the part expects of the arm: what it was given, or that it goes on."""
        if not self.looks_at_plan or not self.trial.is_separate or not self.planner.is_under_way:
            return self._states(time + ahead)
        state = _path_state(self.planner, time - self.trial.timing.lag)
        if state is None:
            return self._states(time + ahead)
        # It goes on at the present rate.
        tau, rate, _ = state
        places = np.minimum(tau + rate * ahead, self.motion.duration)
        q = positions_at(self.motion, places)
        return q, np.gradient(q, STEP, axis=0)

    def _see(self, time: float) -> None:
        """Show the planner the wearer as he was."""
        timing, faults, wearer = self.trial.timing, self.trial.faults, self.wearer
        shown = time - timing.age - faults.understated
        rows = wearer.rows(np.array([shown]))[0]
        if faults.noise > 0.0:
            error = self.rng.standard_normal((len(rows), 3))
            error *= faults.noise / np.linalg.norm(error, axis=1)[:, None]
            rows[:, :SIZE] += self.rng.uniform(0.0, 1.0, (len(rows), 1)) ** (1.0 / 3.0) * error
        seen = np.ones(len(rows), dtype=bool)
        seen[wearer.part] = not self.gone_from <= shown < self.gone_from + faults.gone
        self.eyes.see(rows, time - timing.age, seen)

    def _states(self, times: Array) -> tuple[Array, Array]:
        return self.controller.states(times - self.trial.timing.lag)

    def judged(self, seed: int, number: int) -> Hand:
        """Return what became of the part."""
        times = instants(self.leaves, self.leaves + REACHES)
        q, v = self._states(times)
        found = distances_to(
            self.settings.arm,
            q,
            v,
            self.wearer.names,
            self.wearer.rows(times),
            self.settings.rules.contact_speed,
            0.3,
        )
        classes = classes_of(found)
        # When it first met a fast place of the arm.
        met = times[(classes == FAST).any(axis=(1, 2))]
        return Hand(
            seed=seed,
            number=number,
            part=self.wearer.scene.boxes[self.wearer.part].name,
            word=worst_class(classes),
            is_near=bool((found.fast < MARGIN).any()),
            speed=float(found.speeds[classes == FAST].max(initial=0.0)),
            gap=float(found.fast.min()),
            was_moving=self.was_moving,
            is_noticed=bool(self.noticed < (met[0] if len(met) else np.inf)),
        )

    def place(self) -> Array:
        """Return where the arm comes to rest."""
        return self.planner.place()


def _path_state(planner: Planner, time: float) -> tuple[float, float, float] | None:
    """Return where within the motion the arm is, and at which rate; None: it was stopped."""
    index = max(0, planner.controller.index_at(time))
    message = planner.controller.trajectories[index]
    sent = zip(planner.commitments, planner.messages, strict=True)
    one = next((c for c, m in reversed(list(sent)) if m is message), None)
    if one is None:
        return None
    tau, rate, slope = path_state(one, time)
    return float(tau), float(rate), float(slope)


HEADER = (
    '| what | v_c [m/s] | stop | parts that left | arm in motion then | contacts, arm faster than '
    'v_c | before the part was noticed | slower | at rest | faster within the margin | fastest '
    'contact [m/s] | least distance of a fast place [mm] | motions that could not begin |'
)


def line_of(what: str, trial: Trial, chains: Sequence[Chain]) -> str:
    """Return a line of the table."""
    hands = [hand for chain in chains for hand in chain.hands]
    counts, n = Counter(hand.word for hand in hands), max(1, len(hands))
    moving = [hand for hand in hands if hand.was_moving]
    cells = (
        what,
        f'{trial.case.contact_speed:g}',
        trial.case.stop,
        len(hands),
        len(moving),
        f'{counts[FAST]} ({100.0 * counts[FAST] / n:.1f} %)',
        sum(hand.word == FAST and not hand.is_noticed for hand in hands),
        counts[SLOW],
        counts[AT_REST],
        sum(hand.is_near for hand in hands),
        f'{max((hand.speed for hand in hands), default=0.0):.2f}',
        f'{1e3 * min((hand.gap for hand in hands), default=np.inf):.1f}',
        sum(chain.n_blocked for chain in chains),
    )
    return f'| {" | ".join(map(str, cells))} |'


def trials() -> dict[str, Trial]:
    """Return the trials of the section by what they are called."""
    strict = Case(contact_speed=0.0, stop='10/400')
    usual = Trial()
    return {
        'as far as assumed': usual,
        'as far as assumed, stop 10/400': replace(usual, case=Case(stop='10/400')),
        'as far as assumed, strict': replace(usual, case=strict),
        'for ever at the greatest speed': replace(usual, is_steady=True),
        'for ever at the greatest speed, stop 10/400': replace(
            usual, is_steady=True, case=Case(stop='10/400')
        ),
        'power: 1.5 times as far': replace(usual, scale=1.5),
        'power: 1.5 times as far, stop 10/400': replace(
            usual, scale=1.5, case=Case(stop='10/400')
        ),
        'power: 1.5 times as far, strict': replace(usual, scale=1.5, case=strict),
        'power: separation off, monitored': replace(usual, is_separate=False),
    }
