# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Load what the first body of the first motion would have to wait for."""

import numpy as np
from rrth_planner.execution.body_motion import body_at, first_sight
from rrth_planner.execution.commitment import Commitment, extended, first_commitment
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.remaining_motion import escapes_by_continuing, is_remaining_free
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import Separation
from rrth_planner.model.trajectory import MotionLimits, Trajectory
from rrth_planner.timing.fast_stop import fast_stop

# A box beside the arm and one far away, at which commitments end in a stop, and not [m].
DISTANCES = (1.0, 100.0)
# When a commitment is extended: within its stretch, and later [s].
INSTANTS = (0.01, 0.05)


def warm_up(
    required: RequiredClearance, stop_limits: MotionLimits, separation: Separation | None
) -> None:
    """Monitor a motion in the middle of the joint limits once; all of it as in a motion."""
    arm = required.arm
    q, still = arm.bounds.mean(axis=0), np.zeros((2, arm.dof))
    ends = np.array([q, q + 0.1 * (arm.bounds[1] - arm.bounds[0])])
    motion = Trajectory(np.array([0.0, 1.0]), ends, still, still)
    running = ExecutingMotion(trajectory=motion, start_time=0.0)
    T = tool_pose(arm, q)
    for distance in DISTANCES:
        scene = Scene((Box('near', T[:3, 3] + distance * T[:3, 0], np.full(3, 0.1), np.eye(3)),))
        for check in (is_remaining_free, escapes_by_continuing):
            check(running, 0.1, required, scene)
        fast_stop(motion, 0.1, stop_limits)
        if separation is not None:
            seen = body_at(first_sight(scene, np.zeros(1), 0.0), 0.0, separation.rules)
            found = first_commitment(motion, 0.0, seen, separation)
            if isinstance(found, Commitment):
                for instant in INSTANTS:
                    extended(found, instant, seen, separation)
