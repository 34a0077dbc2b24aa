# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The clock that kernels read: that of `time.perf_counter`."""

import time

from numba import config
from numba.core import types
from numba.core.types import float64
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import kernel

if config.DISABLE_JIT:
    now = time.perf_counter
else:
    MONOTONIC = time.CLOCK_MONOTONIC
    _read = types.ExternalFunction(
        'clock_gettime', types.int32(types.int32, types.CPointer(types.int64))
    )

    @kernel(float64())
    def now():
        """Return the time [s]."""
        spec = scratch.longs(2)
        _read(MONOTONIC, spec.ctypes)
        return spec[0] + 1e-9 * spec[1]
