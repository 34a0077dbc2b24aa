# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plan a motion of the arm round its wearer to a posture that aims at a target."""

import numpy as np
from rrth_planner.aiming import goal_configurations, pointing_problem
from rrth_planner.goal import PointingGoal
from rrth_planner.options import RRTHOptions
from rrth_planner.planner import plan
from rrth_planner.resources import load_arm
from rrth_planner.scene import Box, Scene
from rrth_planner.world import arm_world

# The wearer: name, centre and size [m] in the base frame (x forward, y left, z up).
TORSO = Box('torso', [0.0, 0.0, 0.0], [0.3, 0.46, 0.6], np.eye(3))
HEAD = Box('head', [0.02, 0.0, 0.45], [0.26, 0.24, 0.3], np.eye(3))
RIGHT_ARM = Box('right arm', [0.0, -0.31, 0.08], [0.16, 0.16, 0.38], np.eye(3))
FOLDED = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])

arm, goal = load_arm(), PointingGoal([1.5, 0.1, 0.3])
world = arm_world(arm, Scene((TORSO, HEAD, RIGHT_ARM)), margin=0.02, ray_guard_length=1.0)
goals = goal_configurations(arm, goal, world, FOLDED, n_draws=128)
problem = pointing_problem(arm, goal, world, FOLDED, goals)
result = plan(problem, RRTHOptions(), np.random.default_rng(seed=0))

print(f'{len(goals.q_goals)} free postures aim at the target; {result.status.value}')
if result.path is not None:
    print(f'length {result.path.length:.2f} rad in {1e3 * result.planning_time:.1f} ms:')
    print(result.path.waypoints.round(3))
