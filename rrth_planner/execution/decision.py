# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What follows from an event: the next watch, and what is to be published and said."""

from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import Optional

from rrth_planner.execution.event import Event
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.watch import Level, MonitorRules, Watch
from rrth_planner.model.frozen import changed


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """
    A motion to be published.

    Parameters
    ----------
    begin : float
        When it begins [s]; 0: on reception.
    rules : MonitorRules
        Of its plan.
    within : float
        A commitment that was found later than this after the event is not published [s].

    """

    motion: ExecutingMotion
    begin: float
    rules: MonitorRules
    within: float = math.inf


@dataclass(frozen=True, slots=True)
class Line:
    """
    A line of the log.

    is_timed: it is to end with how long after the event the command was published.
    """

    level: Level
    text: str
    is_timed: bool = False


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Decision:
    """
    What follows from an event.

    Parameters
    ----------
    watch : Watch
        Once the command is published.
    command : Command or None
        None: there is nothing to publish.
    otherwise : Decision or None
        What follows where the command was not published; None: the watch stays as it was.
    next : Event or None
        What is to be decided then, at once, at a moment of its own.
    is_look_due : bool
        Whether the remaining motion is to be checked at once, with the last body.
    lines : tuple of Line
        To be logged.
    age : float or None
        Of the body with which the remaining motion was checked [s]; None: it was not.
    is_free : bool
        Whether that is proven free of the wearer.
    is_stop : bool
        Whether the arm was commanded to stop, or is left on what comes to rest by itself.

    """

    watch: Watch
    command: Command | None = None
    otherwise: Optional['Decision'] = None
    next: Event | None = None
    is_look_due: bool = False
    lines: tuple[Line, ...] = ()
    age: float | None = None
    is_free: bool = False
    is_stop: bool = False

    @property
    def is_silent(self) -> bool:
        """Whether nothing follows but what is known then."""
        return (
            self.command is None
            and self.otherwise is None
            and self.next is None
            and not self.lines
            and self.age is None
            and not (self.is_look_due or self.is_free or self.is_stop)
        )


def followed_by(first: Decision, step: Callable[[Watch], Decision]) -> Decision:
    """Return a decision with what follows from its watch; one of both may have a command."""
    after = step(first.watch)
    if first.is_silent:
        return after
    assert first.command is None or after.command is None
    otherwise = after.otherwise and changed(
        after.otherwise, lines=first.lines + after.otherwise.lines, age=first.age
    )
    return changed(
        after,
        command=first.command or after.command,
        otherwise=first.otherwise or otherwise,
        next=first.next or after.next,
        is_look_due=first.is_look_due or after.is_look_due,
        lines=first.lines + after.lines,
        age=first.age if after.age is None else after.age,
        is_free=first.is_free or after.is_free,
        is_stop=first.is_stop or after.is_stop,
    )
