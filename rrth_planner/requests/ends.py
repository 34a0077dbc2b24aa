# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What requests end in: a monitor that executes motions, publishers, and a report."""

from collections.abc import Callable
import math
from pathlib import Path
from typing import Protocol

from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.flight_recorder import FlightRecorder
from rrth_planner.execution.watch import MonitorRules, Stop, Watch
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.status import ErrorCode
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.requests.answer import Answer
from rrth_planner.requests.outcome import Outcome
from rrth_planner.requests.parameters import RequestParameters


class MotionMonitor(Protocol):
    """What executes motions, watches over them and stops them."""

    @property
    def watch(self) -> Watch:
        """What is known of what the arm was given, and of what became of that."""

    @property
    def flight(self) -> FlightRecorder:
        """Its last events."""

    def check_clock(self) -> None:
        """Stop the arm where the clock has stepped."""

    def begin(
        self,
        planned: ExecutingMotion,
        goal: PointingGoal,
        parameters: MonitorRules,
        n_stops: int,
        n_faults: int,
        publish: Callable[[], None] = lambda: None,
        joins: float | None = math.inf,
        planned_from: ExecutingMotion | None = None,
    ) -> None:
        """
        Have a motion executed, or raise RequestError.

        n_stops, n_faults: as in `execution.event.Begin`; publish: shows the planned motion.
        """

    def hold(self, until: float) -> ExecutingMotion | None:
        """Return what the arm is commanded, which does not change until a time [s]."""

    def take_stops(self) -> list[Stop]:
        """Return the stops published since the last call."""

    def report_hold(self, why: str) -> None:
        """Report that the arm stays where it came to rest."""

    def close(self) -> None:
        """Stop the arm, and end monitoring."""


class Publishers(Protocol):
    """What of a request is published beside its motion."""

    @property
    def motion_topic(self) -> str:
        """On which the controller is to listen."""

    def has_listener(self) -> bool:
        """Return whether anybody listens there."""

    def prepared(
        self, trajectory: Trajectory, parameters: MonitorRules
    ) -> Callable[[float], None]:
        """Return what publishes a planned motion that begins at a time [s]."""

    def publish_answer(self, answer: Answer) -> None:
        """Publish an answer with its figures."""

    def withdraw_whole(self) -> None:
        """Withdraw the last whole motion, once commitments are published."""

    def is_view_subscribed(self) -> bool:
        """Return whether anybody looks at `publish_view`."""

    def publish_view(
        self, trajectory: Trajectory, parameters: MonitorRules, scene: Scene, target: Array
    ) -> None:
        """Publish what shows a motion."""


class Report(Protocol):
    """What is said of requests; it has the parameters in effect."""

    @property
    def parameters(self) -> RequestParameters:
        """Those of a request that begins now."""

    def body_used(self, age: float) -> None:
        """Take note of how old the body of a motion was [s]."""

    def pursued(self, request: int) -> None:
        """Take note of the request whose goal the arm pursues now."""

    def given_up(self, why: str) -> None:
        """Report that this goal is given up."""

    def ray_blocked_by(self, box: str) -> None:
        """Report what an arm at rest waits for to leave its pointing ray; empty: nothing."""

    def nothing_runs(self) -> None:
        """Take note that the arm executes no motion."""

    def incident(self, file: Path | None) -> None:
        """Count an incident; file: its record, if it could be written."""

    def conclude(self, outcome: Outcome) -> None:
        """Report how a request ended."""

    def revise(self, code: ErrorCode, sentence: str) -> None:
        """Report that it ended otherwise."""
