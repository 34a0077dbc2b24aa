# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The monitor of any arm without ROS: the node's decisions, carried out as the node does."""

from collections.abc import Callable
from functools import partial
import hashlib

from rrth_planner.execution.decision import Command
from rrth_planner.execution.event import Event, Fail, Look, Moment
from rrth_planner.execution.fail_safe_stop import pending
from rrth_planner.execution.flight_recorder import digest_of, FlightRecorder
from rrth_planner.execution.step import Fate, following, Step, step_of
from rrth_planner.execution.watch import MonitorRules, Watch


class Monitor:
    """
    Takes events, and sends what is decided.

    Parameters
    ----------
    moment : callable
        Returns the moment that comes so much later than now [s], with what is known now.
    look : callable
        Returns the wearer beside the running motion.
    send : callable
        Publishes a command; raises where it cannot.
    takes : callable
        Returns how long a decision takes [s].
    flight : FlightRecorder, optional
        Records the events.

    """

    def __init__(
        self,
        rules: MonitorRules,
        moment: Callable[[float], Moment],
        look: Callable[[], Look | None],
        send: Callable[[Command], None],
        takes: Callable[[], float] = lambda: 0.0,
        flight: FlightRecorder | None = None,
    ) -> None:
        """Begin with no motion."""
        self.watch = Watch(rules=rules, motion_topic='/joint_trajectory')
        self._moment, self._look, self._send, self._takes = moment, look, send, takes
        self.flight = flight or FlightRecorder()
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
        event, before = Fail(self._moment(0.0), why, is_replanned, is_fault), self.watch
        try:
            self._take(event, 0.0)
        except Exception:
            if self.watch is before:
                self.watch = pending(before, event)
                self.flight.record(before, event, Fate.PENDING, None)

    def _take(self, event: Event, waited: float, since: float = 0.0) -> None:
        """Take an event that comes so long after now: what led to it took its time [s]."""
        self.n_events += 1
        took, before = self._takes(), self.watch
        try:
            step = step_of(before, event, lambda: took, self._send)
        except Exception:
            self.flight.record(before, event, Fate.NONE, None)
            raise
        self.flight.record(before, event, step.fate, step.published)
        self.watch = step.decision.watch
        self._note(step)
        looked = self._look
        since += took
        moment = partial(self._moment, since)
        for happens in following(step, moment, lambda _: looked(), lambda: waited + since):
            self._take(happens(), waited, since)

    def _note(self, step: Step) -> None:
        decision = step.decision
        self.n_stops += decision.is_stop
        state = decision.watch.state.value
        self._digest.update(f'{type(step.event).__name__} {state}\n'.encode())
        if step.published is not None:
            self.n_commands += 1
            self._digest.update(digest_of(step.published))
