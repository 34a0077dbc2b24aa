# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The handover from a running motion to a new one: where it begins, and when to publish it."""

from dataclasses import dataclass

from rrth_planner.execution.command import ahead
from rrth_planner.execution.executing_motion import ExecutingMotion, LONGEST_LEAD
from rrth_planner.model.trajectory import StartState

# How far ahead a handover is planned for, beyond the delay of the controller; the second value,
# where the first was too short [s].
LEADS = (0.05, LONGEST_LEAD)
# The motion is published this share of the lead before the controller has to have it; not where
# the present motion is unknown: then the arm is checked as late as possible.
EARLY = 0.5
# A motion may be published so late where the present motion is unknown [s].
LATE = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Handover:
    """
    Where and when a new motion replaces the running one.

    Parameters
    ----------
    time : float
        [s].
    lead : float
        How long before that it was planned [s].
    start_state : StartState
        The state of the arm then.
    running : ExecutingMotion or None
        The last commanded motion.
    delay : float
        Greatest delay of the controller [s].
    is_commanded : bool
        Whether the arm executes that as it is commanded, and the new motion continues it.

    """

    time: float
    lead: float
    start_state: StartState
    running: ExecutingMotion | None
    delay: float
    is_commanded: bool

    @property
    def publish_ahead(self) -> float:
        """How long before it begins the motion is published [s]."""
        if self.start_state.running is None:
            return 0.0
        return EARLY * self.lead + ahead(self.delay)

    @property
    def deadline(self) -> float:
        """Until when the motion may be published [s]."""
        if self.is_commanded:
            return self.time - ahead(self.delay)
        return self.time + (LATE if self.start_state.running is None else 0.0)

    @property
    def before(self) -> ExecutingMotion | None:
        """What has to be commanded still when the motion is published; None: anything."""
        return self.running if self.is_commanded else None

    @property
    def joins(self) -> float | None:
        """The time within the commanded motion at which it begins [s]; None: not by its time."""
        if not self.is_commanded or self.running is None:
            return None
        # At rest after its end the state is that of the end.
        at, duration = self.start_state.time, self.running.trajectory.duration
        return at if at < duration else self.time - self.running.start_time
