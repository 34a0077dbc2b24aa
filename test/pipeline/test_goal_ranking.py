# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Beside a wearer who may move the arm aims from where it may be soonest."""

from functools import cache

import numpy as np
import pytest
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.world import arm_world
from rrth_planner.execution.commitment import Commitment, extended, first_commitment
from rrth_planner.model.arm import reach_to
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.separation import seen_body, Separation, SeparationRules
from rrth_planner.pipeline.goal_ranking import permitted_duration
from rrth_planner.pipeline.plan_motion import plan_motion
from rrth_planner.planning.options import RRTHOptions
from worlds import FOLDED, limits, MARGIN, RAY, table_1_arm, wearer

RULES, AGE, PERIOD = SeparationRules(), 0.04, 1.0 / 120.0
ARM = table_1_arm()
SETTINGS = Separation(arm=ARM, rules=RULES, margin=MARGIN, limits=limits(), stop_limits=limits())


def plan(target, scene, q_start=FOLDED, **given):
    return plan_motion(
        *(ARM, scene, q_start, PointingGoal(target), limits(), RRTHOptions()),
        margin=MARGIN,
        ray_guard_length=RAY,
        seed=0,
        body_age=AGE,
        **given,
    )


@cache
def pairs():
    """Return a chain of plans all round, to the nearest goals, and others to the soonest ones."""
    rng, q, found = np.random.default_rng(3), FOLDED, []
    while len(found) < 10:
        target = 1.5 * (direction := rng.normal(size=3)) / np.linalg.norm(direction)
        nearest = plan(target, wearer(), q)
        if nearest.trajectory is not None and not nearest.escape_time:
            found.append((nearest, plan(target, wearer(), q, rules=RULES), target))
            q = nearest.path.waypoints[-1]
    return found


def taken(motion):
    """Return how long commitments take to the end of a motion, the wearer at rest [s]."""
    body = seen_body(wearer(), AGE, RULES)
    now, one = 0.0, first_commitment(motion, 0.0, body, SETTINGS)
    while isinstance(one, Commitment) and not one.is_whole and now < 30.0:
        now += PERIOD
        found = extended(one, now, body, SETTINGS)
        if found is None:
            break
        one = found if isinstance(found, Commitment) else one
    return one.end_time if isinstance(one, Commitment) else np.inf


def test_it_is_estimated_no_later_and_is_in_fact_sooner():
    body = seen_body(wearer(), AGE, RULES)
    before, after = [], []
    for nearest, soonest, _ in pairs():
        estimates = [
            permitted_duration(one.trajectory, body, SETTINGS) for one in (nearest, soonest)
        ]
        assert estimates[1] <= estimates[0] * (1.0 + 1e-9)
        before.append(taken(nearest.trajectory))
        after.append(taken(soonest.trajectory))
    assert sum(after) < 0.95 * sum(before)


def test_what_it_chooses_is_a_plan_as_any_other():
    world = arm_world(ARM, wearer(), MARGIN, RAY)
    changed = 0
    for nearest, soonest, target in pairs():
        assert certify(soonest.trajectory, world).is_proven
        assert np.array_equal(soonest.trajectory.positions[0], nearest.trajectory.positions[0])
        # The ray meets the target, and nothing before it.
        q_end = soonest.path.waypoints[-1]
        reach = reach_to(ARM, target, q_end)
        assert soonest.target_distance == reach
        assert world.is_valid(q_end, ray_length=reach)
        changed += not np.array_equal(nearest.path.waypoints[-1], q_end)
    assert changed


def test_the_same_question_has_the_same_answer():
    one, other = (plan(pairs()[0][2], wearer(), rules=RULES) for _ in range(2))
    assert np.array_equal(one.trajectory.positions, other.trajectory.positions)


def test_without_a_wearer_the_nearest_goal_is_the_soonest():
    target = np.array([1.0, 0.5, 0.3])
    nearest, soonest = plan(target, Scene(())), plan(target, Scene(()), rules=RULES)
    assert soonest.trajectory.duration <= nearest.trajectory.duration


@pytest.mark.parametrize('age', [-1.0, np.nan, np.inf])
def test_an_age_that_is_none_is_rejected(age):
    with pytest.raises(OptionsError, match='body_age: .* expected a number from 0'):
        plan_motion(
            *(ARM, wearer(), FOLDED, PointingGoal((1.0, 0.0, 0.0)), limits(), RRTHOptions()),
            margin=MARGIN,
            ray_guard_length=RAY,
            seed=0,
            rules=RULES,
            body_age=age,
        )
