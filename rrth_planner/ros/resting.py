# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Wait for an arm that brakes."""

from collections.abc import Callable
import time

import numpy as np
from rrth_planner.ros.inputs import Input
from rrth_planner.ros.joints import JointReading
from rrth_planner.takeover import REST_SPEED

# So much longer than its brake an arm may need to come to rest [s].
LONGEST_SETTLING = 1.0
# How often the arm is looked at [s].
PERIOD = 5e-3


def wait_for_rest(
    joints: Input[JointReading | None],
    clock: Callable[[], float],
    brake: float,
    should_stop: Callable[[], bool],
) -> None:
    """
    Return when an arm has come to rest, or the time for that is over.

    Parameters
    ----------
    joints : Input
        Where the arm is.
    clock : callable
        Returns the time by which its readings are dated [s].
    brake : float
        How long it brakes; what was read before says nothing of its rest [s].
    should_stop : callable
        Polled; True ends the waiting.

    """
    # A simulated clock may stand still.
    end = time.monotonic() + brake + LONGEST_SETTLING
    begin = clock()
    while time.monotonic() < end and not should_stop():
        reading = joints.value
        if (
            reading is not None
            and reading.received >= begin + brake
            and (np.abs(reading.velocities) <= REST_SPEED).all()
        ):
            return
        time.sleep(PERIOD)
