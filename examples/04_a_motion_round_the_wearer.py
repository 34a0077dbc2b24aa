# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plan a motion of the arm round its wearer: timed, proven and checked, as the node does."""

import numpy as np
import rrth_planner as rrth

arm, wearer = rrth.load_arm(), rrth.load_body()
settings = rrth.load_settings(arm.dof)
# What compiling and loading take is not planning time.
rrth.warm_up(arm, settings.options)
plan = rrth.plan_motion(
    arm,
    wearer,
    np.array([0.0, -0.35, np.pi / 2, np.pi / 2]),
    rrth.PointingGoal([1.5, 0.1, 0.3]),
    settings.limits,
    settings.options,
    margin=0.02,
    ray_guard_length=1.0,
    seed=0,
)
print(f'{plan.status.value}: {plan.sentence}')
if plan.trajectory is not None:
    print(plan.trajectory.times, plan.trajectory.positions)
