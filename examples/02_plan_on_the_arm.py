# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plan a motion of the arm round its wearer to a posture that aims at a target."""

import numpy as np
import rrth_planner as rrth

# The wearer: name, centre and size [m] in the base frame (x forward, y left, z up).
TORSO = rrth.Box('torso', [0.0, 0.0, 0.0], [0.3, 0.46, 0.6], np.eye(3))
HEAD = rrth.Box('head', [0.02, 0.0, 0.45], [0.26, 0.24, 0.3], np.eye(3))
RIGHT_ARM = rrth.Box('right arm', [0.0, -0.31, 0.08], [0.16, 0.16, 0.38], np.eye(3))
FOLDED = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])

arm, wearer = rrth.load_arm(), rrth.Scene((TORSO, HEAD, RIGHT_ARM))
world = rrth.arm_world(arm, wearer, margin=0.02, ray_guard_length=1.0)
problem = rrth.pointing_problem(arm, rrth.PointingGoal([1.5, 0.1, 0.3]), world, FOLDED)
result = rrth.plan(problem, rrth.RRTHOptions(), np.random.default_rng(seed=0))

print(f'{len(problem.q_goals)} free postures aim at the target; {result.status.value}')
if result.path is not None:
    print(f'length {result.path.length:.2f} rad in {1e3 * result.planning_time:.1f} ms:')
    print(result.path.waypoints.round(3))
