# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a course took the same decisions in real and in virtual time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rrth_planner.execution.event import Begin, BodyCame, Event, Tick
from rrth_planner.execution.flight_recorder import Replayed
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.requests.outcome import Outcome

from benchmarks.two_times.real import Course

# Two motions are the same where they are never further apart than this [rad]: a plan after a stop,
# which a timer begins, begins up to 3 ms earlier or later, from another state of the arm.
SAME = 5e-3
# Motions that begin within so long of each other are of the same request [s].
TOGETHER = 0.02
# Places at which two motions are compared.
PLACES = 200


@dataclass(frozen=True, slots=True)
class Comparison:
    """
    How many decisions there are, and how many are the same.

    Parameters
    ----------
    n_answers, n_same_answers : int
        Requests, by the code of their answers.
    n_motions, n_same_motions : int
        Motions that began, by their beginning and their course.
    n_checks, n_same_checks : int
        Bodies and ticks, by the state of the monitor after them, and whether something was
        commanded.
    farthest : float
        The same motions are that far apart at most [rad].
    differences : tuple of str
        The first ones.

    """

    n_answers: int
    n_same_answers: int
    n_motions: int
    n_same_motions: int
    n_checks: int
    n_same_checks: int
    farthest: float
    differences: tuple[str, ...]


def compared(
    course: Course, virtual: Sequence[Replayed], outcomes: Sequence[Outcome]
) -> Comparison:
    """Return what a course in real time and one in virtual time have in common."""
    begin = course.events[0].event.at.now
    differences: list[tuple[float, str]] = []
    n_same_answers = 0
    for k, (one, other) in enumerate(zip(course.answers, outcomes, strict=False)):
        n_same_answers += one.code is other.code
        if one.code is not other.code:
            then = course.asked[k][0] - begin
            differences.append((then, f'request {k}: {one.code.name}, {other.code.name}'))
    there = [one for one in virtual if isinstance(one.event, Begin) and one.command]
    here = [one for one in course.events if isinstance(one.event, Begin) and one.command]
    farthest, n_same_motions = 0.0, 0
    for real in here:
        event = real.event
        assert isinstance(event, Begin)
        near = [o for o in there if abs(o.event.at.now - event.at.now) < TOGETHER]
        gap = min((_gap(event, one.event) for one in near), default=np.inf)
        if gap <= SAME:
            n_same_motions, farthest = n_same_motions + 1, max(gap, farthest)
        else:
            differences.append((event.at.now - begin, f'motion: {gap:.3g} rad apart'))
    checks = {_key(one.event): one for one in virtual if isinstance(one.event, BodyCame | Tick)}
    n_checks, n_same_checks = 0, 0
    for real in course.events:
        if not isinstance(real.event, BodyCame | Tick):
            continue
        n_checks += 1
        found = checks.get(_key(real.event))
        is_same = found is not None and (found.watch.state, found.command is None) == (
            real.watch.state,
            real.command is None,
        )
        n_same_checks += is_same
        if not is_same:
            what = f'{type(real.event).__name__}: {_said(real)}, {_said(found)}'
            differences.append((real.event.at.now - begin, what))
    return Comparison(
        *(len(course.answers), n_same_answers, len(here), n_same_motions),
        *(n_checks, n_same_checks, farthest),
        tuple(f'{then:8.3f} s  {what}' for then, what in sorted(differences)),
    )


def _key(event: Event) -> tuple[str, float, bool]:
    return type(event).__name__, event.at.now, isinstance(event, BodyCame) and event.sight is None


def _said(one: Replayed | None) -> str:
    if one is None:
        return 'nothing'
    return f'{one.watch.state.value}{"" if one.command is None else ", commanded"}'


def _gap(one: Event, other: Event) -> float:
    """Return how far apart two motions are at most, each from its begin on [rad]."""
    assert isinstance(one, Begin) and isinstance(other, Begin)
    curves: list[Trajectory] = [one.planned.trajectory, other.planned.trajectory]
    longest = max(curve.duration for curve in curves)
    times = np.linspace(0.0, longest, PLACES)
    places = [sample(curve, np.minimum(times, curve.duration))[0] for curve in curves]
    return float(np.abs(places[0] - places[1]).max())
