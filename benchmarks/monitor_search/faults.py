# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Faults that are put into the monitor, by name, to see whether the search finds them.

Each holds as long as its context, in this process only.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, ExitStack
from dataclasses import replace
import math
from typing import Any
from unittest.mock import patch

import numpy as np
from rrth_planner.execution import (
    body_motion,
    command,
    commitment,
    commitments,
    decide as deciding,
    event as events,
    fail_safe_stop as stops,
    step,
)
from rrth_planner.execution.decision import Command, Decision
from rrth_planner.execution.monitor import Monitor
from rrth_planner.execution.tracked_motion import tracked_phase
from rrth_planner.model.trajectory import part_of, Trajectory
from rrth_planner.rehearsal.world import World
from rrth_planner.timing.fast_stop import fast_stop as fast_stop_of

from benchmarks.monitor_search.episode import Episode
from benchmarks.monitor_search.judge import Found

Patches = list[tuple[Any, str, Any]]


def _stop_not_repeated() -> Patches:
    """Leave an arm that has missed a stop on its motion."""
    return [(stops, 'missed_stop', lambda tracked, reading, now: (tracked, None))]


def _stop_from_reading() -> Patches:
    """Begin stops where the arm is, not where it is commanded to be."""
    former = stops.stop_of

    def stop_of(watch: Any, at: Any, running: Any, phase: float) -> Any:
        measured = tracked_phase(watch.tracked, at.reading, at.now)
        if measured is None or running is not watch.running:
            return former(watch, at, running, phase)
        rules = watch.rules
        return command.stop_along(
            running, measured, at.now, rules.stop_limits, rules.execution.controller_delay
        )

    return [(stops, 'stop_of', stop_of), (deciding, 'stop_of', stop_of)]


def _stop_cut_off() -> Patches:
    """End stops a little before they are at rest."""
    former = fast_stop_of

    def fast_stop(*given: Any) -> Trajectory:
        stop = former(*given)
        return part_of(stop, 0.0, 0.9 * stop.duration)

    return [(command, 'fast_stop', fast_stop)]


def _commitment_cut_off() -> Patches:
    """Publish commitments without the end of their stops."""
    former = command.led

    def led(lead: Any, after: Any) -> Any:
        motion = former(lead, after)
        curve = motion.trajectory
        return replace(motion, trajectory=part_of(curve, 0.0, 0.95 * curve.duration))

    return [(commitments, 'led', led)]


def _commitment_unproven() -> Patches:
    """Publish commitments whose stop is not proven separate from the wearer."""
    return [(commitment, 'first_unproven', lambda *given, **words: None)]


def _late_commitment_published() -> Patches:
    """Publish commitments however late they are found."""

    def made(motion: Any, begin: float, rules: Any, within: float = math.inf) -> Command:
        return Command(motion, begin, rules, 1e3 if within < math.inf else math.inf)

    return [(deciding, 'Command', made)]


def _delay_ignored() -> Patches:
    """Take controllers to be without a delay where a message leaves the one before."""

    def ahead(delay: float) -> float:
        return command.CYCLE

    return [(module, 'ahead', ahead) for module in (command, commitments)]


def _join_unchecked() -> Patches:
    """Begin motions wherever the one before them is, and lead them in with no part of it."""

    def lead_in(before: Trajectory, begin: float, end: float) -> Trajectory:
        return part_of(before, *(min(max(end + 0.02, 0.0), before.duration),) * 2)

    def continues(lead: Any, after: Any) -> bool:
        return True

    names = (deciding, commitments)
    patches: Patches = [(module, 'continues', continues) for module in (*names, command)]
    return [*patches, *((module, 'lead_in', lead_in) for module in names)]


def _other_command_continued() -> Patches:
    """Begin a handover from another motion than the one that it was planned from."""

    def yes(*_: Any) -> bool:
        return True

    modules = (deciding, commitments, command)
    return [(deciding, 'is_same', yes), *((module, 'continues', yes) for module in modules)]


def _age_ignored() -> Patches:
    """Take the wearer to be where he was seen last."""
    former = body_motion.body_at

    def body_at(body: Any, time: float, rules: Any) -> Any:
        return former(replace(body, measured=np.full(len(body.measured), time)), time, rules)

    return [(commitments, 'body_at', body_at)]


def _lost_part_is_fresh() -> Patches:
    """Take a part that no frame shows any more to be as new as the others."""
    former = commitments.observe

    def observe(known: Any, scene: Any, measured: Any, separation: Any, now: float) -> Any:
        newest = np.full(len(measured), np.max(measured))
        return former(known, scene, newest, separation, now)

    return [(commitments, 'observe', observe)]


def _news_ignored() -> Patches:
    """Go on with the whole rest of a motion though a part is new."""

    def check_news(known: Any, now: float) -> Any:
        return replace(known, is_news=False)

    return [(commitments, 'check_news', check_news)]


def _older_body_taken() -> Patches:
    """Take a body that was measured before the last one."""
    return [(World, 'is_new', lambda self, measured: True)]


def _stale_inputs_ignored() -> Patches:
    """Go on though no body comes any more."""
    former = World.moment
    return [(World, 'moment', lambda self, *later: replace(former(self, *later), overdue=''))]


def _fault_without_effect() -> Patches:
    """Begin motions after a fault without a reset."""
    return [(commitments, 'fail', lambda known, why: known)]


def _reset_without_effect() -> Patches:
    """Keep a fault for ever."""
    return [(commitments, 'reset', lambda known: replace(known, is_reset=True))]


def _exception_swallowed() -> Patches:
    """Let nothing follow from an error of the monitor."""

    def take(self: Monitor, event: Any, waited: float = 0.0) -> None:
        try:
            self.begin(event)
        except Exception:
            return

    return [(Monitor, 'take', take)]


def _unsent_is_kept() -> Patches:
    """Take a message that could not be published for one that was."""
    former = World.send

    def send(self: World, command: Command) -> None:
        try:
            former(self, command)
        except ConnectionError:
            return

    return [(World, 'send', send)]


def _pending_stop_forgotten() -> Patches:
    """Forget a stop that could not be published."""
    former = stops.stop_pending

    def stop_pending(watch: Any, at: Any) -> Decision:
        found = former(watch, at)
        return replace(found, otherwise=Decision(watch=replace(watch, pending=None)))

    return [(stops, 'stop_pending', stop_pending)]


def _clock_step_ignored() -> Patches:
    """Go on though the clock was set."""
    former = deciding.decide

    def decide(watch: Any, event: Any) -> Decision:
        is_step = isinstance(event, events.ClockStepped)
        return Decision(watch=watch) if is_step else former(watch, event)

    return [(step, 'decide', decide)]


def _stop_is_not_tracked() -> Patches:
    """Take the arm to be on its motion still after a stop was published."""
    return [(stops, 'track_stop', lambda tracked, stop: tracked)]


FAULTS: dict[str, Callable[[], Patches]] = {
    made.__name__.removeprefix('_'): made
    for made in (
        _stop_not_repeated,
        _stop_from_reading,
        _stop_cut_off,
        _stop_is_not_tracked,
        _commitment_cut_off,
        _commitment_unproven,
        _late_commitment_published,
        _delay_ignored,
        _join_unchecked,
        _other_command_continued,
        _age_ignored,
        _lost_part_is_fresh,
        _news_ignored,
        _older_body_taken,
        _stale_inputs_ignored,
        _fault_without_effect,
        _reset_without_effect,
        _exception_swallowed,
        _unsent_is_kept,
        _pending_stop_forgotten,
        _clock_step_ignored,
    )
}


@contextmanager
def _held(patches: Patches) -> Iterator[None]:
    with ExitStack() as stack:
        for owner, name, value in patches:
            stack.enter_context(patch.object(owner, name, value))
        yield


def put_back(name: str) -> AbstractContextManager[None]:
    """Put a fault into the monitor, by its name; '': none."""
    return _held(FAULTS[name]() if name else [])


def found_of(fault: str, seed: int) -> Found:
    """Return what the episode of a seed shows, with a fault in the monitor; '': none."""
    with put_back(fault):
        return Episode(seed).run()
