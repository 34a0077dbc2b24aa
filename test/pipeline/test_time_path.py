# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A path gets a motion also where its corners have no room."""

from dataclasses import replace
import functools

import numpy as np
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.reference_checker import first_contact
from rrth_planner.collision.world import arm_world, grown
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.pipeline import time_path as path_timing
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.pipeline.time_path import BLEND_CLEARANCE, time_path
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.timing.corner_blends import round_corners
from worlds import FOLDED, free_configuration, limits, MARGIN, RAY, table_1_arm, wearer

ARM, WEARER = table_1_arm(), wearer()
WORLD = arm_world(ARM, WEARER, MARGIN, RAY)


@functools.cache
def paths_without_room():
    """Return paths round the body, shortcut in the very world in which they are timed."""
    rng, found = np.random.default_rng(8), []
    options = RRTHOptions(time_limit=60.0, improve_time=60.0, club_attempts=0)
    while len(found) < 100:
        goal = free_configuration(rng, WORLD)
        if WORLD.is_edge_valid(FOLDED, goal):
            continue
        problem = PlanningProblem(world=WORLD, q_start=FOLDED, q_goals=[goal])
        path = plan(problem, options, rng).path
        if path is not None and len(path.waypoints) > 2:
            found.append(path)
    return found


def timed(path):
    """Return the motion of a path; its goal is on the part of the ray that is kept clear."""
    T = tool_pose(ARM, path.waypoints[-1])
    goal = PointingGoal(T[:3, 3] + 0.9 * RAY * T[:3, 2])
    question = PlanQuestion(
        arm=ARM,
        scene=WEARER,
        q_start=path.waypoints[0],
        goal=goal,
        limits=limits(),
        options=RRTHOptions(),
        margin=MARGIN,
        ray_guard_length=RAY,
        seed=0,
    )
    return time_path(question, WORLD, path, None, None, 0.9 * RAY, lambda: False)


def test_a_corner_without_room_is_a_stop_and_no_failure():
    n_sharp = 0
    # One in twenty has such a corner.
    for path in paths_without_room():
        blends = round_corners(path, grown(WORLD, BLEND_CLEARANCE), limits())
        sharp = [blend.corner for blend in blends if blend.half_length == 0.0]
        motion = timed(path)
        assert isinstance(motion, Trajectory)
        assert certify(motion, WORLD).is_proven
        if not sharp:
            continue
        q, v, _ = sample(motion, np.arange(0.0, motion.duration, 5e-4))
        assert first_contact(ARM, WEARER, q, RAY, MARGIN) is None
        for corner in sharp:
            nearest = np.argmin(np.linalg.norm(motion.positions - corner, axis=1))
            np.testing.assert_allclose(motion.positions[nearest], corner, atol=1e-9)
            assert np.abs(motion.velocities[nearest]).max() < 1e-2
        n_sharp += len(sharp)
    assert n_sharp > 0


def test_a_motion_that_is_not_proven_with_rounded_corners_stops_at_each(monkeypatch):
    roomy = arm_world(ARM, WEARER, MARGIN - 0.005, RAY)
    monkeypatch.setattr(path_timing, 'grown', lambda world, by: roomy)
    asked = []

    def reject_the_first(trajectory, world, escape_time):
        asked.append(trajectory)
        found = certify(trajectory, world, escape_time)
        return replace(found, is_proven=False) if len(asked) == 1 else found

    monkeypatch.setattr(path_timing, 'certify', reject_the_first)
    for path in paths_without_room()[:20]:
        asked.clear()
        motion = timed(path)
        assert isinstance(motion, Trajectory)
        assert len(asked) == 2
        assert motion is asked[1]
        assert motion.duration >= asked[0].duration
        assert (
            first_contact(
                ARM, WEARER, sample(motion, np.arange(0.0, motion.duration, 5e-4))[0], RAY, MARGIN
            )
            is None
        )
