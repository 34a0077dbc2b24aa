# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Every algorithm plans the arm's motions, and every motion passes the same judges."""

import numpy as np
import pytest

pytest.importorskip('fcl')

from rrth_planner.goal import PointingGoal  # noqa: E402
from rrth_planner.inspection import inspect_motion  # noqa: E402
from rrth_planner.options import (  # noqa: E402
    InformedRRTStarOptions,
    RRTHOptions,
    RRTOptions,
    RRTStarOptions,
    RRTStarSmartOptions,
)
from rrth_planner.pipeline import plan_motion  # noqa: E402
from rrth_planner.status import PlanStatus  # noqa: E402
import worlds  # noqa: E402

FOLDED = np.array([0.0, -0.35, 1.5707963267948966, 1.5707963267948966])
TARGETS = ([1.0, 0.5, -1.0], [0.3, 0.0, -0.3], [-0.4, 1.2, 0.3])
STAR = {'max_samples': 800, 'improve_time': 30.0, 'time_limit': 30.0}


@pytest.mark.parametrize('is_bidirectional', [False, True])
@pytest.mark.parametrize(
    'kind',
    [RRTOptions, RRTStarOptions, InformedRRTStarOptions, RRTStarSmartOptions, RRTHOptions],
)
def test_each_algorithm_plans_motions_that_pass_the_judges(kind, is_bidirectional):
    arm, scene, limits = worlds.table_1_arm(), worlds.wearer(), worlds.limits()
    options = kind(
        is_bidirectional=is_bidirectional,
        **(STAR if issubclass(kind, RRTStarOptions) else {'time_limit': 30.0}),
    )
    for target in TARGETS:
        plan = plan_motion(
            arm,
            scene,
            FOLDED,
            PointingGoal(target),
            limits,
            options,
            margin=0.02,
            ray_guard_length=1.0,
            seed=1,
        )
        assert plan.status is PlanStatus.SOLVED, plan.sentence
        inspect_motion(
            arm,
            scene,
            plan.trajectory,
            limits,
            q_present=FOLDED,
            target=np.array(target),
            margin=0.02,
            ray_guard_length=1.0,
        )
