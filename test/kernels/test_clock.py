# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The clock of the kernels is that of Python."""

import time

from rrth_planner.kernels.clock import now
from rrth_planner.planning.deadline import Deadline

# Both convert the same counter, by different roundings [s].
ROUNDING = 1e-6


def test_the_clock_of_the_kernels_is_the_performance_counter():
    for _ in range(1000):
        before = time.perf_counter()
        between = now()
        after = time.perf_counter()
        assert before - ROUNDING <= between <= after + ROUNDING


def test_the_clock_never_goes_back():
    times = [now() for _ in range(10000)]
    assert all(a <= b for a, b in zip(times[:-1], times[1:], strict=True))
    assert times[-1] > times[0]


def test_a_deadline_speaks_of_the_same_clock():
    deadline = Deadline(1000.0, lambda: False)
    assert abs(now() - deadline.start) < 100.0
    assert deadline.within(5.0) > now()
    assert Deadline(0.0, lambda: False).within(5.0) <= now() + ROUNDING
