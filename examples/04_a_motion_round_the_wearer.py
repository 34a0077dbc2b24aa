# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plan a motion of the arm round its wearer: timed, proven and checked, as the node does."""

import numpy as np
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.settings import load_settings
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.goal import PointingGoal
from rrth_planner.pipeline.plan_motion import plan_motion, warm_up

arm, wearer = load_arm(), load_body()
settings = load_settings(arm.dof)
# What compiling and loading take is not planning time.
warm_up(arm, settings.options)
plan = plan_motion(
    arm,
    wearer,
    np.array([0.0, -0.35, np.pi / 2, np.pi / 2]),
    PointingGoal([1.5, 0.1, 0.3]),
    settings.limits,
    settings.options,
    margin=0.02,
    ray_guard_length=1.0,
    seed=0,
)
print(f'{plan.status.value}: {plan.sentence}')
if plan.trajectory is not None:
    print(plan.trajectory.times, plan.trajectory.positions)
