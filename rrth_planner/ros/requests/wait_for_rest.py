# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Wait until a stopping arm is at rest."""

from collections.abc import Callable
import time

import numpy as np
from rrth_planner.model.trajectory import REST_SPEED
from rrth_planner.ros.interface.inputs import Input
from rrth_planner.ros.messages.joint_state import JointReading

# An arm may come to rest so much later than its commanded stop [s].
LONGEST_SETTLING = 1.0


class Rest:
    """
    The rest of an arm after a commanded stop.

    Parameters
    ----------
    joints : Input
        Where the arm is.
    clock : callable
        Returns the time on the clock of the readings [s].
    stop_duration : float
        Duration of the stop from now on; readings from before its end do not count [s].

    """

    def __init__(
        self, joints: Input[JointReading | None], clock: Callable[[], float], stop_duration: float
    ) -> None:
        """Begin with the stop."""
        self._joints, self._begin = joints, clock() + stop_duration
        # A simulated clock may stand still.
        self._end = time.monotonic() + stop_duration + LONGEST_SETTLING

    def is_over(self) -> bool:
        """Return whether the arm is at rest, or the time for that has passed."""
        if time.monotonic() >= self._end:
            return True
        reading = self._joints.value
        return (
            reading is not None
            and reading.received >= self._begin
            and bool((np.abs(reading.velocities) <= REST_SPEED).all())
        )
