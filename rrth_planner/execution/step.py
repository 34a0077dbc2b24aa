# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A step of the monitor: what is decided about an event is published, and something may follow."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
import math
import traceback

from rrth_planner.execution.decide import decide, LONGEST_WAIT
from rrth_planner.execution.decision import Command, Decision, Line
from rrth_planner.execution.event import (
    BodyCame,
    BodyWaited,
    CommitmentTook,
    Event,
    Look,
    Moment,
)
from rrth_planner.execution.watch import Level, Watch
from rrth_planner.model.frozen import changed


class Fate(IntEnum):
    """What became of a decision."""

    # Published, if there was anything to publish, and kept.
    KEPT = 0
    # Its command was too late, or could not be published.
    OTHERWISE = 1
    # There was none, or it was not kept: an error.
    NONE = 2
    # Nor was there a stop: one is to be published.
    PENDING = 3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Step:
    """
    What became of an event.

    Parameters
    ----------
    event : Event
    decision : Decision
        What is kept: its watch is what is known from now on.
    fate : Fate
        KEPT, or OTHERWISE.
    found : Command or None
        What was to be published; None: nothing.
    took : float
        How long it took to decide [s].

    """

    event: Event
    decision: Decision
    fate: Fate
    found: Command | None
    took: float

    @property
    def published(self) -> Command | None:
        """What was published; None: nothing."""
        return self.found if self.fate is Fate.KEPT else None


def step_of(
    watch: Watch, event: Event, took: Callable[[], float], publish: Callable[[Command], None]
) -> Step:
    """
    Decide about an event, and publish what is commanded; return what became of it.

    After an error the watch that was known before still holds, but a stop that could not be
    published stays pending: it is tried again at the next check.

    Parameters
    ----------
    took : callable
        Returns how long the decision took, once there is one [s].
    publish : callable
        Publishes a command; raises where it cannot.

    """
    decision = decide(watch, event)
    seconds, command, fate = took(), decision.command, Fate.KEPT
    if command is not None and seconds > command.within:
        assert decision.otherwise is not None
        decision, fate = decision.otherwise, Fate.OTHERWISE
    elif command is not None:
        try:
            publish(command)
        except Exception:
            if decision.otherwise is None or command.within < math.inf:
                raise
            line = Line(Level.ERROR, traceback.format_exc())
            decision, fate = changed(decision.otherwise, lines=(line,)), Fate.OTHERWISE
    return Step(event=event, decision=decision, fate=fate, found=command, took=seconds)


def following(
    step: Step,
    moment: Callable[[], Moment],
    look: Callable[[Moment], Look | None],
    waited: Callable[[], float],
) -> Iterator[Callable[[], Event]]:
    """
    Yield what makes the events that follow a step, each to be taken before the next one.

    Parameters
    ----------
    moment : callable
        Returns the present, with what is known then.
    look : callable
        Returns the wearer beside the running motion.
    waited : callable
        Returns how long ago the body came that the step is about [s].

    """
    event, decision, found = step.event, step.decision, step.found
    if found is not None and found.within < math.inf:
        # Also of a commitment that was too late to be published.
        yield lambda: CommitmentTook(event.at, step.took)
    then = decision.next
    if then is not None:
        yield lambda: changed(then, at=moment())
    if decision.is_look_due:
        yield lambda: _looked(moment(), look)
    if decision.age is not None and (seconds := waited()) > LONGEST_WAIT:
        yield lambda: BodyWaited(moment(), seconds)


def _looked(at: Moment, look: Callable[[Moment], Look | None]) -> BodyCame:
    return BodyCame(at, None, look(at))
