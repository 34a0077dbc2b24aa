# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The monitor in virtual time: the node's decisions, carried out as the node carries them out."""

from collections.abc import Callable
from dataclasses import replace
import hashlib
import math

from rrth_planner.execution.decide import decide, LONGEST_WAIT
from rrth_planner.execution.decision import Command, Decision
from rrth_planner.execution.event import (
    BodyCame,
    BodyWaited,
    CommitmentTook,
    Event,
    Fail,
    Look,
    Moment,
)
from rrth_planner.execution.fail_safe_stop import pending
from rrth_planner.execution.flight_recorder import digest_of
from rrth_planner.execution.watch import MonitorRules, Watch


class VirtualMonitor:
    """
    Takes events, and sends what is decided.

    Parameters
    ----------
    moment : callable
        Returns the present, with what is known now.
    look : callable
        Returns the wearer beside the running motion.
    send : callable
        Publishes a command; raises where it cannot.
    takes : callable
        Returns how long a decision takes [s].

    """

    def __init__(
        self,
        rules: MonitorRules,
        moment: Callable[[], Moment],
        look: Callable[[], Look | None],
        send: Callable[[Command], None],
        takes: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """Begin with no motion."""
        self.watch = Watch(rules=rules, motion_topic='/joint_trajectory')
        self._moment, self._look, self._send, self._takes = moment, look, send, takes
        self._digest = hashlib.sha256()
        self.n_events = self.n_commands = self.n_stops = 0

    @property
    def digest(self) -> str:
        """What two runs have in common that took the same decisions."""
        return self._digest.hexdigest()

    def take(self, event: Event, waited: float = 0.0) -> None:
        """
        Take an event; any error in that ends in a stop.

        waited: how long ago the body came that it is about [s].
        """
        try:
            self._take(event, waited)
        except Exception as problem:
            self.fail(f'the monitor failed, {type(problem).__name__}', is_replanned=False)

    def begin(self, event: Event) -> None:
        """Take the event of a motion that is to begin; raise RequestError where it cannot."""
        self._take(event, 0.0)

    def fail(self, why: str, is_replanned: bool = True, is_fault: bool | None = None) -> None:
        """Stop the arm, if it moves."""
        is_fault = not is_replanned if is_fault is None else is_fault
        event, before = Fail(self._moment(), why, is_replanned, is_fault), self.watch
        try:
            self._take(event, 0.0)
        except Exception:
            if self.watch is before:
                self.watch = pending(before, event)

    def _take(self, event: Event, waited: float) -> None:
        self.n_events += 1
        took, decision = self._takes(), decide(self.watch, event)
        # Also of one that is too late to be published.
        command = decision.command
        decision = self._carried_out(decision, took)
        self.watch = decision.watch
        self._note(event, decision)
        if took and command is not None and command.within < math.inf:
            self._take(CommitmentTook(event.at, took), 0.0)
        if decision.next is not None:
            self._take(replace(decision.next, at=self._moment()), waited)
        if decision.is_look_due:
            self._take(BodyCame(self._moment(), None, self._look()), 0.0)
        if decision.age is not None and waited + took > LONGEST_WAIT:
            self._take(BodyWaited(self._moment(), waited + took), 0.0)

    def _carried_out(self, decision: Decision, took: float) -> Decision:
        command = decision.command
        if command is None:
            return decision
        if took > command.within:
            assert decision.otherwise is not None
            return decision.otherwise
        try:
            self._send(command)
        except Exception:
            if decision.otherwise is None or command.within < math.inf:
                raise
            # A stop: it is tried again at the next check.
            return decision.otherwise
        return decision

    def _note(self, event: Event, decision: Decision) -> None:
        self.n_stops += decision.is_stop
        self._digest.update(f'{type(event).__name__} {decision.watch.state.value}\n'.encode())
        if decision.command is not None:
            self.n_commands += 1
            self._digest.update(digest_of(decision.command))
