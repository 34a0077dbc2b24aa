# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Every algorithm plans the arm's motions, and every motion passes the same checkers."""

from dataclasses import replace
import itertools

import numpy as np
import pytest

pytest.importorskip('fcl')

from rrth_planner.collision.motion_inspection import inspect_motion  # noqa: E402
from rrth_planner.collision.world import arm_world  # noqa: E402
from rrth_planner.model.goal import PointingGoal  # noqa: E402
from rrth_planner.model.scene import Scene  # noqa: E402
from rrth_planner.model.status import PlanStatus  # noqa: E402
from rrth_planner.pipeline.plan_motion import plan_motion  # noqa: E402
from rrth_planner.planning.options import (  # noqa: E402
    InformedRRTStarOptions,
    RRTHOptions,
    RRTOptions,
    RRTStarOptions,
    RRTStarSmartOptions,
)
from rrth_planner.planning.planner import plan  # noqa: E402
from rrth_planner.planning.problem import PlanningProblem  # noqa: E402
import worlds  # noqa: E402

KINDS = (RRTOptions, RRTStarOptions, InformedRRTStarOptions, RRTStarSmartOptions, RRTHOptions)
FOLDED = np.array([0.0, -0.35, 1.5707963267948966, 1.5707963267948966])
TARGETS = ([1.0, 0.5, -1.0], [0.3, 0.0, -0.3], [-0.4, 1.2, 0.3])
STAR = {'max_samples': 800, 'improve_time': 30.0, 'time_limit': 30.0}


@pytest.mark.parametrize('is_bidirectional', [False, True])
@pytest.mark.parametrize('kind', KINDS)
def test_each_algorithm_plans_motions_that_pass_the_checkers(kind, is_bidirectional):
    arm, scene, limits = worlds.table_1_arm(), worlds.wearer(), worlds.limits()
    options = kind(
        is_bidirectional=is_bidirectional,
        **(STAR if issubclass(kind, RRTStarOptions) else {'time_limit': 30.0}),
    )
    for target in TARGETS:
        motion = plan_motion(
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
        assert motion.status is PlanStatus.SOLVED, motion.sentence
        inspect_motion(
            arm,
            scene,
            motion.trajectory,
            limits,
            q_present=FOLDED,
            target=np.array(target),
            margin=0.02,
            ray_guard_length=1.0,
        )


@pytest.mark.parametrize('kind', KINDS)
def test_what_is_still_free_of_the_last_trees_is_reused_when_the_wearer_has_moved(kind):
    arm, rng = worlds.table_1_arm(), np.random.default_rng(3)
    world = worlds.wearer_world()
    moved = Scene([replace(b, center=b.center + [0.01, 0.0, 0.0]) for b in worlds.wearer().boxes])
    moved_world = arm_world(arm, moved, worlds.MARGIN, worlds.RAY)
    options = kind(max_samples=600, time_limit=30.0)
    pairs = []
    for seed in range(20):
        q_start, q_goal = worlds.blocked_pair(rng, moved_world)
        if not (world.is_valid(q_start) and world.is_valid(q_goal)):
            continue
        before = PlanningProblem(world=world, q_start=q_start, q_goals=[q_goal])
        problem = PlanningProblem(world=moved_world, q_start=q_start, q_goals=[q_goal])
        first = plan(before, options, np.random.default_rng(seed))
        if first.status is not PlanStatus.SOLVED:
            continue
        few = replace(options, max_samples=20)
        again = plan(problem, few, np.random.default_rng(seed), previous=first)
        anew = plan(problem, few, np.random.default_rng(seed))
        assert again.status is PlanStatus.SOLVED
        pairs.append((anew, again))
        for tree in again.trees:
            for i in np.flatnonzero(tree.parents >= 0)[::11]:
                edge = tree.nodes[tree.parents[i]], tree.nodes[i]
                assert not worlds.edge_touches(arm, moved, worlds.MARGIN, worlds.RAY, *edge)
        for q_from, q_to in itertools.pairwise(again.path.waypoints):
            assert not worlds.edge_touches(arm, moved, worlds.MARGIN, worlds.RAY, q_from, q_to)
    assert len(pairs) >= 12
    if kind in (RRTOptions, RRTHOptions):
        until = [[(*r.sample_history, r.n_samples)[0] for r in pair] for pair in pairs]
        anew, again = np.mean(until, axis=0)
        assert again < 0.9 * anew
    else:
        lengths = [(a.path.length, b.path.length) for a, b in pairs if a.path is not None]
        anew, again = np.mean(lengths, axis=0)
        assert again < 0.97 * anew
