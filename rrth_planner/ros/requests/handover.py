# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where a motion begins that takes over from another one, and when it is told."""

from collections.abc import Callable
from dataclasses import dataclass
import time

from rrth_planner.execution.executing_motion import ExecutingMotion, LONGEST_LEAD
from rrth_planner.model.start_state import StartState

# How far ahead a motion begins that takes over from one that runs: that long its plan may take,
# and once more with more time [s].
LEADS = (0.05, LONGEST_LEAD)
# So great a share of that before it begins it is told, so that the arm has it in time; not where
# the present motion is unknown, since the arm has to be looked at as late as can be.
EARLY = 0.5
# So late a motion may be told of which nobody knows how the arm moved until then [s].
LATE = 0.02
# Whoever wakes up takes the interpreter from what monitors the arm [s].
LONGEST_SLEEP = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Handover:
    """
    Where a motion of an arm that moves begins.

    Parameters
    ----------
    time : float
        [s].
    lead : float
        So long before that it was planned for [s].
    start_state : StartState
        What the arm does then.
    running : ExecutingMotion or None
        The motion that it was last told to follow.

    """

    time: float
    lead: float
    start_state: StartState
    running: ExecutingMotion | None

    @property
    def publish_ahead(self) -> float:
        """How long before it begins the motion is told, if all goes well [s]."""
        return 0.0 if self.start_state.running is None else EARLY * self.lead

    @property
    def deadline(self) -> float:
        """When the motion can still be told [s]."""
        return self.time + (LATE if self.start_state.running is None else 0.0)

    def wait(self, clock: Callable[[], float], should_stop: Callable[[], bool]) -> None:
        """Return when the motion is to be told, or as soon as it should stop."""
        # A simulated clock may stand still.
        end = time.monotonic() + 2 * LEADS[-1]
        while time.monotonic() < end and not should_stop():
            left = self.time - self.publish_ahead - clock()
            if left <= 0.0:
                return
            time.sleep(min(LONGEST_SLEEP, left))
