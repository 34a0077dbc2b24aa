# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The same course in virtual time: what came, and how late everything was, is as recorded."""

from bisect import bisect_left
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
import math
from typing import Any

import numpy as np
from rrth_planner.execution import event as events
from rrth_planner.execution.command import ahead
from rrth_planner.execution.flight_recorder import FlightRecorder, read_flight, replay, Replayed
from rrth_planner.execution.handover import LATE, LEADS
from rrth_planner.io.settings import load_settings
from rrth_planner.model.goal import PointingGoal
from rrth_planner.pipeline.in_process_planner import InProcessPlanner
from rrth_planner.rehearsal.parameters import rehearsed_parameters
from rrth_planner.rehearsal.virtual_ends import LastWord, MonitorEnd, NoPublishers, VirtualInputs
from rrth_planner.rehearsal.virtual_host import VirtualHost
from rrth_planner.rehearsal.world import Wire, World
from rrth_planner.requests.outcome import Outcome
from rrth_planner.requests.request_queue import AGAIN, PERIOD, PlanQueue

from benchmarks.two_times.real import Course, SEED

# How long a request takes to the planner where nothing says it [s].
WAY = 0.002
# An attempt of the planner is the recorded one that began within so long [s].
NEAR = 0.02
# What differs by less is the same time [s].
SAME = 1e-6
# How long a plan takes that was not recorded [s].
USUAL = 0.02
KEEP_LOST = 2.0
# A timer of the node is up to so late [s].
LATE_TIMER = 0.008


@dataclass(frozen=True, slots=True)
class Attempt:
    """One plan: when it was begun, and when its motion, or nothing, followed [s]."""

    begin: float
    end: float


def attempts_of(recorded: Sequence[Replayed], delay: float) -> list[Attempt]:
    """Return when plans were begun and ended, by the events of the monitor."""
    found, begin = [], math.nan
    for one in recorded:
        event = one.event
        is_hold = isinstance(event, events.Hold)
        if not math.isnan(begin) and (
            isinstance(event, events.Begin) or (is_hold and event.until < math.inf)
        ):
            found.append(Attempt(begin, event.at.now))
            begin = math.nan
        if is_hold and math.isfinite(event.until):
            # The longer leads are for what took too long.
            starts = [event.until - LATE - ahead(delay) - lead for lead in LEADS]
            begin = min(starts, key=lambda start: abs(start - event.at.now))
    return found


def again(
    course: Course, seed: int = SEED, new_seed: Callable[[], int] = lambda: 0
) -> tuple[list[Replayed], list[Outcome]]:
    """
    Return what the monitor decides in virtual time, and how requests end there.

    seed: of all plans; -1: each has a new one.
    """
    rules, recorded = course.rules, course.events
    delay = rules.execution.controller_delay
    arm = rules.required.arm
    settings = load_settings(arm.dof, seed=seed)
    parameters = rehearsed_parameters(
        *(settings, arm, rules.stop_limits, rules.execution, KEEP_LOST)
    )
    took = _decided_in(recorded)
    first = recorded[0].event.at
    reading = next(one.event.at.reading for one in recorded if one.event.at.reading is not None)
    flight = FlightRecorder(math.inf)
    world = World(
        *(parameters, Nobody(), reading.positions, 0, Wire(keep_lost=KEEP_LOST)),
        begin=first.now - 1.0,
        is_drawn=False,
        deciding=lambda: took.get(world.timeline.now, 0.0),
        flight=flight,
    )
    timeline, attempts = world.timeline, attempts_of(recorded, delay)
    begins = [one.begin for one in attempts]

    ended = math.nan

    def latency() -> float:
        nonlocal ended
        # The plan was asked for a moment ago.
        now, k = timeline.now, bisect_left(begins, timeline.now)
        near = min(attempts[max(0, k - 1) : k + 1], key=lambda one: abs(one.begin - now))
        # One attempt may be two plans: the first one has taken all of its time.
        if abs(now - ended) < SAME and abs(near.begin - now) > SAME:
            return 0.0
        is_known = abs(near.begin - now) < NEAR
        took = max(near.end - now, 0.0) if is_known else USUAL
        ended = now + took
        return took

    host = VirtualHost(
        *(timeline, InProcessPlanner(), latency),
        read=world.read,
        new_seed=new_seed,
        checking=0.0,
    )
    queue = PlanQueue(
        *(host, VirtualInputs(world), LastWord(parameters), NoPublishers(), MonitorEnd(world))
    )
    _schedule(world, recorded)
    outcomes: list[Outcome] = []

    async def ask(goal: PointingGoal) -> None:
        outcomes.append(await queue.respond(goal))

    for sent, target in course.asked:
        came = _came(sent, begins)
        timeline.at(came, partial(_begin, host, ask, PointingGoal(target)))
    for time in _follow_ups(recorded, begins):
        timeline.at(time, queue.follow_up)
    timeline.run(recorded[-1].event.at.now)
    return list(replay(read_flight(flight.to_bytes()))), outcomes


def _came(sent: float, begins: Sequence[float]) -> float:
    """Return when a request came that was sent at a time, by when plans were begun [s]."""
    k = bisect_left(begins, sent)
    if k == len(begins):
        return sent + WAY
    if begins[k] < sent + 10.0 * WAY:
        return begins[k]
    # It waited for its turn, or for a clear ray, which is looked at every so often.
    return begins[k] - AGAIN * int((begins[k] - sent) / AGAIN)


def _begin(
    host: VirtualHost,
    ask: Callable[[PointingGoal], Coroutine[Any, Any, None]],
    goal: PointingGoal,
) -> None:
    host.begin(ask(goal))


def _decided_in(recorded: Sequence[Replayed]) -> dict[float, float]:
    """Return how long decisions took, by when they were begun, as far as that shows [s]."""
    found: dict[float, float] = {}
    for one, after in pairwise(recorded):
        event, then = one.event, after.event
        if isinstance(then, events.CommitmentTook):
            found[event.at.now] = then.took
        elif isinstance(then, events.StopFor | events.StopUnproven | events.BodyWaited):
            found.setdefault(event.at.now, then.at.now - event.at.now)
    return found


def _follow_ups(recorded: Sequence[Replayed], begins: Sequence[float]) -> list[float]:
    """
    Return when requests were followed up: every `PERIOD`, and known where something came of it.

    begins: of plans [s].
    """
    taken = [o.event.at.now for o in recorded if isinstance(o.event, events.StopsTaken)]
    first, last = (recorded[k].event.at.now for k in (0, -1))
    if taken:
        first += math.fmod(taken[0] - first, PERIOD)
    found = []
    for time in np.arange(first, last, PERIOD):
        # A timer is a little late now and then.
        near = [one for one in (*taken, *begins) if abs(one - time) < LATE_TIMER]
        found.append(min(near, default=float(time)))
    return found


class Nobody:
    """Whoever is seen is recorded."""

    names: tuple[str, ...] = ()

    def rows_at(self, time: float) -> np.ndarray:
        """Return no box."""
        return np.zeros((0, 15))


def _schedule(world: World, recorded: Sequence[Replayed]) -> None:
    """Have happen what was recorded, but for what the planner did by itself."""
    taken = -math.inf
    for one in recorded:
        event = one.event
        reading = event.at.reading
        if reading is not None and reading.taken > taken:
            taken = reading.taken
            world.timeline.at(reading.received, partial(world.joints_came, reading))
        if isinstance(event, events.BodyCame) and event.sight is not None:
            boxes, measured = event.sight.scene.boxes, float(event.sight.measured.max())
            # Of bodies that came together the newest is checked.
            is_newest = event.look is not None or one.watch.running is None
            come = partial(world.frame_came, boxes, measured, is_newest)
            world.timeline.at(event.at.now, come)
        elif isinstance(event, events.Tick):
            world.timeline.at(event.at.now, world.check)
