# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Times as stamps: whole numbers of nanoseconds."""

import math

NANOSECONDS = 1_000_000_000


def stamp_of(seconds: float) -> int:
    """Return the stamp of a time [s], as a whole number [ns]."""
    # Nanoseconds since 1970 as one float would be 256 ns apart: a kink of 0.2 rad/s^2 at 1 kHz.
    whole = math.floor(seconds)
    return whole * NANOSECONDS + round((seconds - whole) * NANOSECONDS)
