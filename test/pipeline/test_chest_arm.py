# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm of six joints on the chest: it is that of its URDF, and plans round a seated wearer."""

import numpy as np
import pytest
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.reference_checker import first_contact
from rrth_planner.collision.world import arm_world
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import pointing_error, tool_pose
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import positions_at

URDF, ARM, BODY = (
    f'config/examples/{name}' for name in ('chest_arm.urdf', 'chest_arm.yaml', 'seated_body.yaml')
)
# On either side of the table, above it, and low behind the arm rests.
TARGETS = (
    (1.0, 0.5, 0.0),
    (0.3, -1.2, -0.6),
    (0.3, 1.2, -0.6),
    (1.5, 0.0, 1.0),
    (0.2, 1.5, 0.1),
    (0.2, -1.5, 0.1),
    (0.9, 0.9, -0.4),
    (0.6, -0.3, -0.05),
)
SEED = 0


def test_the_file_is_what_read_urdf_makes_of_the_urdf(tmp_path):
    pytest.importorskip('yourdfpy')
    from rrth_planner.cli import read_urdf

    made, there = tmp_path / 'arm.yaml', resource_path(ARM)
    options = ['--ray', '+x', '--radius', '0.025', '--max-turns', '0.5', '--output', str(made)]
    assert read_urdf.main([str(resource_path(URDF)), *options]) == 0
    assert made.read_text() == there.read_text()


def test_it_is_of_the_size_that_it_should_be():
    arm = load_arm(resource_path(ARM))
    low, high = arm.bounds
    q = np.random.default_rng(1).uniform(low, high, (2000, arm.dof))
    reach = np.linalg.norm(tool_pose(arm, q)[:, :3, 3] - arm.T_base_mount[:3, 3], axis=1).max()
    assert 0.4 < reach < 0.5


def test_it_plans_round_the_seated_wearer_without_contact():
    pipeline = pytest.importorskip('rrth_planner.pipeline.plan_motion', exc_type=ImportError)
    arm, scene = load_arm(resource_path(ARM)), load_body(resource_path(BODY))
    settings = load_settings(arm.dof, improve_time=1000.0, time_limit=1000.0)
    ray, margin = settings.ray_guard_length, settings.margin
    world = arm_world(arm, scene, margin, ray)
    q, n_bent = np.zeros(arm.dof), 0
    for target in np.array(TARGETS):
        plan = pipeline.plan_motion(
            arm,
            scene,
            q,
            PointingGoal(target),
            settings.limits,
            settings.options,
            margin=margin,
            ray_guard_length=ray,
            seed=SEED,
        )
        # What pipeline returns solved python-fcl has found free.
        assert plan.status is PlanStatus.SOLVED, plan.sentence
        n_bent += len(plan.path.waypoints) > 2
        trajectory = plan.trajectory
        assert certify(trajectory, world).is_proven
        times = np.linspace(0.0, trajectory.duration, 2000)
        states = positions_at(trajectory, times)
        assert np.array_equal(states[0], q)
        assert first_contact(arm, scene, states, ray, margin) is None
        assert (
            first_contact(arm, scene, states[-1:], max(ray, plan.target_distance), margin) is None
        )
        q = trajectory.positions[-1]
        assert pointing_error(arm, q, target) < 1e-6
    assert n_bent >= 2
