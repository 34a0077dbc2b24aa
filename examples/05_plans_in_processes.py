# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plan in several processes: problems and results are sent as they are."""

from multiprocessing import Pool

import numpy as np
import rrth_planner as rrth


def plan(job):
    problem, seed = job
    return rrth.plan(problem, rrth.RRTHOptions(), np.random.default_rng(seed))


if __name__ == '__main__':
    arm = rrth.load_arm()
    world = rrth.arm_world(arm, rrth.load_body(), margin=0.02, ray_guard_length=1.0)
    goal = rrth.PointingGoal([1.5, 0.1, 0.3])
    problem = rrth.pointing_problem(arm, goal, world, [0.0, -0.35, 1.57, 1.57])
    with Pool(2) as pool:
        for result in pool.map(plan, [(problem, seed) for seed in range(4)]):
            print(result.status.value, result.path.length)
