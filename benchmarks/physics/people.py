# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Section `people`: a simulated arm beside recorded people, with separation, in lock-step.

The planner and what it sees are those of `benchmarks.separation`; its commitments are executed by
an arm with masses and servos, and the person is there as capsules that can be met.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
import math

import numpy as np
from rrth_planner.execution.joint_reading import JointReading, with_earlier
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.model.arm import pointing_error
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.simulation.contacts import ContactEvent
from rrth_planner.simulation.moving_body import MovingBody, recorded_body
from rrth_planner.simulation.simulated_arm import SimulatedArm, STEP_PERIOD

from benchmarks.physics.setting import arm_of, points_of, Setup
from benchmarks.separation.lockstep import Controller, Timing
from benchmarks.separation.people import (
    Beside,
    load_skeleton_once,
    REACHED,
    SEED,
    Session,
    T_POSE,
    Take,
)
from benchmarks.separation.setting import Case, FOLDED, the_arm

# By servo: what the planner has to assume of it [s].
CASES = (
    (Setup(0.002), Case(controller_delay=0.01)),
    (Setup(0.01, 0.005, 1.3), Case(controller_delay=0.02)),
    (Setup(0.03, 0.005, 0.7), Case(controller_delay=0.05)),
    (Setup(0.01, 0.005, 1.3), Case(controller_delay=0.02, stop='10/400')),
)


@dataclass(slots=True, eq=False)
class PhysicalController(Controller):
    """A controller whose arm has masses and servos."""

    arm: SimulatedArm | None = None
    # What is on its way: when it comes [s], what, and when that begins [s].
    letters: deque[tuple[float, Trajectory, float]] = field(default_factory=deque)
    n_steps: int = 0
    error: float = 0.0

    def give(self, trajectory: Trajectory, begin: float, came: float) -> None:
        """Send it a newer one."""
        # Named: slots make the class anew.
        Controller.give(self, trajectory, begin, came)
        while self.letters and self.letters[-1][0] >= came:
            self.letters.pop()
        self.letters.append((came, trajectory, begin))

    def measured(self, time: float, lag: float, before: JointReading | None) -> JointReading:
        """Return what the encoders of the arm have at a time [s], however late that is."""
        assert self.arm is not None
        state = self.arm.reading
        q, taken = state.positions, state.time
        return JointReading(
            q, state.velocities, taken, time, math.inf, with_earlier(q, taken, before)
        )

    def advance(self, time: float) -> None:
        """Let the arm go on to a time [s]."""
        arm = self.arm
        assert arm is not None
        while arm.time < time - 0.5 * STEP_PERIOD:
            while self.letters and self.letters[0][0] <= arm.time:
                _, trajectory, begin = self.letters.popleft()
                arm.execute(points_of(trajectory), begin)
            arm.step()
            self.n_steps += 1
            state = arm.reading
            gap = float(np.abs(state.wanted.positions - state.true_positions).max())
            self.error = max(self.error, gap)


class PhysicalSession(Session):
    """An arm with masses beside a recorded person, frame by frame."""

    def __init__(self, record: Beside, timing: Timing, setup: Setup, seed: int) -> None:
        """Begin folded, without a target."""
        super().__init__(record, timing, seed)
        take = record.take
        arm = arm_of(
            setup,
            FOLDED,
            _body_of(take),
            seed,
            body_begin=-T_POSE / take.rate if take.file else 0.0,
        )
        self.physical = PhysicalController(FOLDED, arm=arm)
        self.controller = self.planner.controller = self.physical
        # By how much the ray missed the targets that were reached [m].
        self.misses: list[float] = []

    def _go_on(self, time: float) -> None:
        self.physical.advance(time)
        super()._go_on(time)

    def _next(self, outcome: str, time: float) -> None:
        if outcome == REACHED and self.target is not None:
            arm = self.physical.arm
            assert arm is not None
            place = arm.reading.true_positions
            self.misses.append(pointing_error(the_arm(), place, self.target))
        super()._next(outcome, time)


@cache
def _body_of(take: Take) -> MovingBody:
    body = recorded_body(load_person(take.file or None), load_skeleton_once(take.skeleton))
    return replace(body, rate=take.rate * body.rate)


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """
    What was seen beside a person.

    Parameters
    ----------
    events : tuple of ContactEvent
    error : float
        Of a joint, at most [rad].
    misses : tuple of float
        [m].

    """

    setup: Setup
    record: Beside
    events: tuple[ContactEvent, ...]
    error: float
    misses: tuple[float, ...]


def beside_person(seconds: float, item: tuple[Take, Setup, Case]) -> Found:
    """Return what was seen of a simulated arm beside a recorded person for a time [s]."""
    take, setup, case = item
    record = Beside(take, case, True)
    session = PhysicalSession(record, Timing(), setup, SEED)
    session.run(seconds)
    arm = session.physical.arm
    assert arm is not None
    events = (*arm.ended, *arm.events)
    return Found(setup, record, events, session.physical.error, tuple(session.misses))


HEADER = (
    '| lag of the tool [mm] | delay [ms] | payload | controller_delay [s] | stop | time [s] | '
    'targets reached | ray off them, median [mm] | joint off at most [rad] | contacts | arm '
    'faster than v_c in them | greatest speed of the arm in them [m/s] | greatest force [N] |'
)


def line_of(found: Sequence[Found]) -> str:
    """Return a line of the table: one arm beside all people."""
    one = found[0]
    events = [event for each in found for event in each.events]
    v_c = one.record.case.contact_speed
    reached = sum(each.record.outcomes[REACHED] for each in found)
    asked = sum(sum(each.record.outcomes.values()) for each in found)
    misses = [miss for each in found for miss in each.misses]
    cells = (
        f'{1e3 * one.setup.lag:g}',
        f'{1e3 * one.setup.delay:g}',
        f'{100.0 * one.setup.payload:.0f} %',
        f'{one.record.case.controller_delay:g}',
        one.record.case.stop,
        f'{sum(each.record.seconds for each in found):.0f}',
        f'{reached} of {asked}',
        f'{1e3 * float(np.median(misses)) if misses else math.nan:.1f}',
        f'{max(each.error for each in found):.3f}',
        len(events),
        sum(event.greatest_arm_speed > v_c for event in events),
        f'{max((event.greatest_arm_speed for event in events), default=0.0):.2f}',
        f'{max((event.greatest_force for event in events), default=0.0):.0f}',
    )
    return f'| {" | ".join(map(str, cells))} |'


def sentences_of(found: Found) -> list[str]:
    """Return a sentence on each contact with an arm faster than v_c."""
    record = found.record
    return [
        f'{record.take.name} at rate {record.take.rate:g}: {event.first.bar} and '
        f'{event.first.part} at {event.begin:.2f} s, arm at {event.greatest_arm_speed:.2f} m/s, '
        f'both at {event.greatest_speed:.2f} m/s, {event.greatest_force:.0f} N'
        for event in found.events
        if event.greatest_arm_speed > record.case.contact_speed
    ]
