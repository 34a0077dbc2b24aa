# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Wait for an arm that brakes."""

from collections.abc import Callable
import time

import numpy as np
from rrth_planner.model.trajectory import REST_SPEED
from rrth_planner.ros.interface.inputs import Input
from rrth_planner.ros.messages.joint_state import JointReading

# So much longer than its stop_duration an arm may need to come to rest [s].
LONGEST_SETTLING = 1.0


class Rest:
    """
    The rest that an arm comes to when it has braked.

    Parameters
    ----------
    joints : Input
        Where the arm is.
    clock : callable
        Returns the time by which its readings are dated [s].
    stop_duration : float
        How long it brakes from now on; what was read before says nothing of its rest [s].

    """

    def __init__(
        self, joints: Input[JointReading | None], clock: Callable[[], float], stop_duration: float
    ) -> None:
        """Begin to stop_duration."""
        self._joints, self._begin = joints, clock() + stop_duration
        # A simulated clock may stand still.
        self._end = time.monotonic() + stop_duration + LONGEST_SETTLING

    def is_over(self) -> bool:
        """Return whether the arm is at rest, or the time for that is over."""
        if time.monotonic() >= self._end:
            return True
        reading = self._joints.value
        return (
            reading is not None
            and reading.received >= self._begin
            and bool((np.abs(reading.velocities) <= REST_SPEED).all())
        )
