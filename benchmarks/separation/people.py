# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Section `people`: the arm beside recorded people, asked for target after target low in front.

Between two recorded frames points of the person move straight: what is true at an instant is that.
"""

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from itertools import groupby
from pathlib import Path
import sys

import numpy as np
from rrth_planner.collision.reference_checker import protrusions
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.model.arm import pointing_error
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import SceneError
from rrth_planner.model.scene import Scene
from rrth_planner.model.separation import reach_at, reach_of
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.rehearsal.contacts import AT_REST, classes_of, distances_to, FAST, SLOW
from rrth_planner.wearer.body_boxes import body_boxes
from rrth_planner.wearer.recorded_person import posture_at, RecordedPerson
from tqdm import tqdm

from benchmarks.separation.lockstep import (
    Controller,
    Eyes,
    INSTANT,
    instants,
    Planner,
    Timing,
)
from benchmarks.separation.setting import (
    Case,
    FOLDED,
    planned,
    separation_of,
    the_arm,
)

# Targets low in front of the wearer, where his hands work: lower and upper corner [m].
LOW_IN_FRONT = np.array([[0.8, -0.6, -0.6], [1.6, 0.6, 0.0]])
# An arm that aims this near to its target has arrived [m].
AIMS = 0.02
# A target that is not reached for so long is not reachable now [s].
PATIENCE = 10.0
# A plan takes so long; where there is none it is tried again a while later, for so long [s].
PLANNING, AGAIN, TRIED = 0.05, 0.1, 2.0
# Recordings but that of the package begin with a T-pose of so long [s].
T_POSE = 0.1
# A chunk of instants that are judged at once [s].
CHUNK = 2.0
# Of targets and latencies.
SEED = 0
# Frames are compared with those of so long before, to count parts that got further than assumed
# [s].
COMPARED = 1.0
# How fast recordings are played, and what is assumed beside them.
RATES = (1.0, 1.5)
CASES = (Case(), Case(stop='10/400'))


@dataclass(frozen=True, slots=True)
class Take:
    """
    A recorded person, played at a rate forwards and backwards.

    Parameters
    ----------
    file : str
        The recording; empty for that of the package.
    rate : float

    """

    file: str
    rate: float

    @property
    def name(self) -> str:
        """What it is called."""
        return Path(self.file).stem if self.file else 'construction work'

    @property
    def skeleton(self) -> str:
        """What makes boxes of it."""
        return 'tum_bvh' if 'tum' in self.name else 'cmu_bvh'

    def names(self) -> tuple[str, ...]:
        """Return the parts that are seen at the beginning."""
        return tuple(box.name for box in self._boxes(0.0))

    def rows(self, time: float) -> Array:
        """Return the boxes at a time, (m, 15); NaN where a part is lost."""
        try:
            found = {box.name: box.numbers for box in self._boxes(time)}
        except SceneError:
            found = {}
        nothing = np.full(15, np.nan)
        return np.array([found.get(name, nothing) for name in parts_of(self)])

    def _boxes(self, time: float) -> Sequence:
        begin = T_POSE if self.file else 0.0
        posture = posture_at(_person(self.file), begin + self.rate * max(time, 0.0))
        return body_boxes(load_skeleton_once(self.skeleton), posture)[0].boxes


@cache
def _person(file: str) -> RecordedPerson:
    return load_person(file or None)


load_skeleton_once = cache(load_skeleton)


@cache
def parts_of(take: Take) -> tuple[str, ...]:
    """Return the names of the parts of a recorded person."""
    return take.names()


@lru_cache(maxsize=200_000)
def _rows_at(take: Take, instant: int) -> Array:
    return take.rows(instant * INSTANT)


@dataclass(slots=True, eq=False)
class Beside:
    """
    What was seen of an arm beside a recorded person.

    Parameters
    ----------
    seconds : float
        How long [s].
    outcomes : Counter
        Of the targets.
    times : list of float
        From asking to arriving, of the targets reached [s].
    n_plans : int
    contacts : Counter
        By class, and whether the part had got no further than assumed since it was seen.
    sentences : list of str
        On contacts of the class FAST.
    n_steps, n_broken : Counter
        Frames after another one, and of these the ones at which a part had got further than
        assumed since any frame of the last second, by part.

    """

    take: Take
    case: Case
    is_separate: bool
    seconds: float = 0.0
    outcomes: Counter = field(default_factory=Counter)
    times: list[float] = field(default_factory=list)
    n_plans: int = 0
    contacts: Counter = field(default_factory=Counter)
    sentences: list[str] = field(default_factory=list)
    n_steps: Counter = field(default_factory=Counter)
    n_broken: Counter = field(default_factory=Counter)


REACHED, NOT_NOW, NO_PLAN = 'reached', 'not reachable now', 'no plan'


class Session:
    """An arm beside a recorded person, frame by frame."""

    def __init__(self, record: Beside, timing: Timing, seed: int) -> None:
        """Begin folded, without a target."""
        self.record, self.timing = record, timing
        # Of its own, so that with separation and without they are the same targets.
        self.targets = np.random.default_rng((seed, 1))
        self.rng = np.random.default_rng(seed)
        self.settings = separation_of(record.case)
        self.names = parts_of(record.take)
        self.reach = reach_of(self.names, self.settings.rules)
        self.controller = Controller(FOLDED)
        self.planner = Planner(
            self.settings, timing, self.rng, self.controller, is_separate=record.is_separate
        )
        rows = record.take.rows(0.0)
        self.eyes = Eyes(self.names, rows, np.zeros(len(rows)))
        self.target: Array | None = None
        self.asked = self.tried = 0.0
        self.plan: MotionPlan | None = None
        self.ready = 0.0

    def run(self, seconds: float) -> None:
        """Run for so long [s]."""
        n = round(seconds / self.timing.period)
        before: deque[Array] = deque(maxlen=round(COMPARED / self.timing.period))
        label = f'{self.record.take.name} {self.record.take.rate:g}'
        for k in tqdm(range(n), desc=label, file=sys.stderr, leave=False, disable=None):
            time = k * self.timing.period
            rows = self.record.take.rows(time - self.timing.age)
            seen = np.isfinite(rows).all(axis=1)
            if before:
                self._count_steps(np.array(before), rows)
            before.append(rows)
            self.eyes.see(rows, time - self.timing.age, seen)
            self._go_on(time)
        self.record.seconds = seconds

    def _count_steps(self, before: Array, rows: Array) -> None:
        """Count the parts that got further than assumed since any frame before, (n, m, 15)."""
        elapsed = self.timing.period * np.arange(len(before), 0, -1.0)
        bounds = reach_at(self.reach, np.repeat(elapsed[:, None], len(self.names), axis=1))
        ways = protrusions(before, rows[None])
        is_out = ways > bounds + 2.0 * self.settings.rules.body_error
        for k, name in enumerate(self.names):
            if np.isfinite(ways[-1, k]):
                self.record.n_steps[name] += 1
                self.record.n_broken[name] += bool(is_out[:, k].any())

    def _next(self, outcome: str, time: float) -> None:
        """Have no target any more."""
        self.record.outcomes[outcome] += 1
        if outcome == REACHED:
            self.record.times.append(time - self.asked)
        self.target = None
        self._drop()

    def _drop(self) -> None:
        """Have no motion any more: the arm rests."""
        self.plan = None
        self.planner.begin(None)

    def _give_up(self, time: float) -> None:
        """Have no target any more if it has taken too long."""
        if self.target is not None and time - self.asked > PATIENCE:
            self._next(NOT_NOW, time)

    def _planned(self, time: float, q: Array, scene: Scene) -> None:
        """Plan for the target, or another one where there is none, if it is time for that."""
        if self.target is None:
            self.target = self.targets.uniform(*LOW_IN_FRONT)
            self.asked = self.tried = self.ready = time
        if self.plan is None and time >= self.ready:
            case = self.record.case if self.record.is_separate else None
            plan = planned(scene, q, self.target, int(self.rng.integers(2**31)), case)
            self.record.n_plans += 1
            if plan.trajectory is None:
                self.ready = time + AGAIN
                if time - self.tried > TRIED:
                    self._next(NO_PLAN, time)
            else:
                self.plan, self.ready = plan, time + PLANNING

    def _aims(self, q: Array) -> bool:
        assert self.target is not None
        return pointing_error(self.settings.arm, q, self.target) < AIMS

    def _go_on(self, time: float) -> None:
        planner = self.planner
        if self.plan is None:
            self._give_up(time)
            self._planned(time, planner.place(), self.eyes.scene())
        plan = self.plan
        if plan is not None and time >= self.ready and planner.plan is not plan:
            planner.begin(plan)
        planner.frame(time, self.eyes)
        if plan is None or planner.plan is not plan:
            return
        is_at_rest = planner.is_at_rest(time)
        if planner.has_arrived(time):
            self._next(REACHED if self._aims(planner.place()) else NOT_NOW, time)
        elif time - self.asked > PATIENCE:
            if is_at_rest:
                self._next(NOT_NOW, time)
            elif not planner.is_stopped:
                planner.brake()
        elif is_at_rest and (planner.is_outdated or planner.is_stopped):
            # The same target, from here.
            self._drop()
            self.ready = self.tried = time
        elif planner.cannot_begin(time):
            self._next(NOT_NOW, time)

    def judge(self) -> None:
        """Count the contacts, instant by instant."""
        found: dict[tuple[int, int], list[tuple[int, str, bool]]] = {}
        numbers = {id(one): i for i, one in enumerate(self.planner.messages)}
        for begin in np.arange(0.0, self.record.seconds, CHUNK):
            times = instants(begin, min(begin + CHUNK, self.record.seconds))
            q, v = self.controller.states(times - self.timing.lag)
            ticks = np.round(times / INSTANT).astype(int)
            rows = np.array([_rows_at(self.record.take, int(tick)) for tick in ticks])
            distances = distances_to(
                *(the_arm(), q, v, self.names, np.nan_to_num(rows, nan=1e3)),
                *(self.settings.rules.contact_speed, 0.0),
            )
            classes = classes_of(distances)
            for i, bar, box in np.argwhere(classes != ''):
                kept = self._kept(float(times[i]), int(box), rows[i, box], numbers)
                word = str(classes[i, bar, box])
                found.setdefault((int(bar), int(box)), []).append((int(ticks[i]), word, kept))
                if word == FAST and kept:
                    self.record.sentences.append(
                        f'{times[i]:.3f} s: bar {bar} at {distances.speeds[i, bar, box]:.2f} m/s '
                        f'and box "{self.names[box]}", which got no further than assumed'
                    )
        for instants_of in found.values():
            # Instants one after the other are one contact.
            for _, run in groupby(enumerate(instants_of), lambda item: item[1][0] - item[0]):
                some = [item[1] for item in run]
                word = next(w for w in (FAST, SLOW, AT_REST) if any(s[1] == w for s in some))
                self.record.contacts[word, any(kept for _, w, kept in some if w == word)] += 1

    def _kept(self, time: float, box: int, row: Array, numbers: dict[int, int]) -> bool:
        """Return whether a part got no further than assumed since what the arm does was proven."""
        controller = self.controller
        index = controller.index_at(time - self.timing.lag)
        number = numbers.get(id(controller.trajectories[index])) if index >= 0 else None
        if number is None:
            taken = time - self.timing.age - self.timing.period
            seen = self.record.take.rows(taken)[box]
        else:
            body = self.planner.bodies[number]
            taken = self.planner.commitments[number].start_time - float(body.ages[box])
            seen = body.scene.boxes[box].numbers
        elapsed = np.full(len(self.names), max(time - taken, 0.0))
        furthest = float(reach_at(self.reach, elapsed)[box]) + self.settings.rules.body_error
        return bool(protrusions(seen, row) <= furthest)


def beside_person(seconds: float, item: tuple[Take, Case, bool]) -> Beside:
    """Return what was seen of an arm beside a recorded person for a time [s]."""
    record = Beside(*item)
    session = Session(record, Timing(), SEED)
    session.run(seconds)
    session.judge()
    return record


HEADER = (
    '| recording | rate | separation | v_c [m/s] | stop | time [s] | targets reached | not '
    'reachable now | no plan | plans | median time of those reached [s] | time per target reached '
    '[s] | contacts, arm faster than v_c: part as far as assumed | part further | slower | at '
    'rest |'
)


def takes(recordings: Sequence[Path]) -> list[Take]:
    """Return the person of the package and recorded ones, at each rate."""
    return [Take(file, rate) for file in ('', *map(str, recordings)) for rate in RATES]


def items(take: Take) -> list[tuple[Take, Case, bool]]:
    """Return what is measured beside a person: without separation, and with it."""
    return [(take, CASES[0], False), *((take, case, True) for case in CASES)]


def line_of(record: Beside) -> str:
    """Return a line of the table."""
    n = record.outcomes[REACHED]
    contacts = record.contacts
    cells = (
        record.take.name,
        f'{record.take.rate:g}',
        'on' if record.is_separate else 'off, monitored',
        f'{record.case.contact_speed:g}',
        record.case.stop if record.is_separate else '–',
        f'{record.seconds:.0f}',
        f'{n} of {sum(record.outcomes.values())}',
        record.outcomes[NOT_NOW],
        record.outcomes[NO_PLAN],
        record.n_plans,
        f'{np.median(record.times):.2f}' if record.times else '–',
        f'{record.seconds / n:.2f}' if n else '–',
        contacts[FAST, True],
        contacts[FAST, False],
        contacts[SLOW, True] + contacts[SLOW, False],
        contacts[AT_REST, True] + contacts[AT_REST, False],
    )
    return f'| {" | ".join(map(str, cells))} |'


def reach_lines(records: Sequence[Beside]) -> list[str]:
    """Return the table of the frames at which a part had got further than assumed."""
    names = list(dict.fromkeys(name for record in records for name in record.n_steps))
    lines = [f'| recording | rate | {" | ".join(names)} |']
    lines.append(f'|{" --- |" * (2 + len(names))}')
    # The same for each case.
    for record in {record.take: record for record in records}.values():
        shares = [
            f'{100.0 * record.n_broken[name] / record.n_steps[name]:.1f} %'
            if record.n_steps[name]
            else '–'
            for name in names
        ]
        lines.append(f'| {record.take.name} | {record.take.rate:g} | {" | ".join(shares)} |')
    return lines
