# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What is called with every body, for hours, keeps no memory."""

import gc
import tracemalloc

from numba import types
import numpy as np
import pytest
from rrth_planner.collision.world import world_of
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.expected_wearer import expected_scene, is_expected_free
from rrth_planner.execution.remaining_motion import (
    box_in_ray,
    escapes_by_continuing,
    is_place_free,
    is_remaining_free,
)
from rrth_planner.kernels.jit import kernel, OUT_MAT
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.trajectory import Trajectory
from worlds import FOLDED, table_1_arm, wearer

REQUIRED, WEARER = RequiredClearance(table_1_arm(), 0.02, 1.0), wearer()
MOTION = ExecutingMotion(
    trajectory=Trajectory(
        times=[0.0, 1.0],
        positions=[FOLDED, FOLDED - 0.2],
        velocities=np.zeros((2, 4)),
        accelerations=np.zeros((2, 4)),
    ),
    start_time=0.0,
)
# What is kept of so many calls is at least so large, if each keeps one array [bytes].
N, LEAST = 200, 20_000


@pytest.mark.parametrize(
    'call',
    [
        lambda: is_place_free(FOLDED, REQUIRED, WEARER),
        lambda: is_remaining_free(MOTION, 0.1, REQUIRED, WEARER),
        lambda: is_expected_free(MOTION, 0.1, REQUIRED, WEARER),
        lambda: escapes_by_continuing(MOTION, 0.1, REQUIRED, WEARER),
        lambda: box_in_ray(FOLDED, REQUIRED, WEARER),
        lambda: expected_scene(WEARER, WEARER, 0.1),
        lambda: world_of(REQUIRED, WEARER).is_edge_valid(FOLDED, FOLDED - 0.2),
        lambda: world_of(REQUIRED, WEARER).clearances(FOLDED),
    ],
    ids=['place', 'remaining', 'expected', 'escape', 'ray', 'forecast', 'edge', 'clearances'],
)
def test_a_check_keeps_no_memory(call):
    # What is kept for the next call, caches of a few worlds among it, is kept by then.
    for _ in range(50):
        call()
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        for _ in range(N):
            call()
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < LEAST


@pytest.mark.parametrize('kind', [OUT_MAT, types.Tuple([types.float64, OUT_MAT])])
def test_a_kernel_that_returns_an_array_is_rejected(kind):
    with pytest.raises(TypeError, match='returns an array, which its caller may not free'):

        @kernel(kind(OUT_MAT))
        def given(matrix):
            return matrix
