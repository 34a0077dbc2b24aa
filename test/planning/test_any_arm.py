# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""From a body and a target to a motion, for arms that do not end in a pan and tilt unit."""

import numpy as np
import pytest
from rrth_planner.collision.reference_checker import first_contact
from rrth_planner.collision.world import arm_world
from rrth_planner.model.arm import ArmModel, pointing_error, tool_pose
from rrth_planner.model.errors import ModelError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import sample
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.pointing_goals import check_pointing_arm, numerical, pointing_kernels
from worlds import free_configuration, limits, MARGIN, QUARTER

pipeline = pytest.importorskip('rrth_planner.pipeline.plan_motion', exc_type=ImportError)
OPTIONS = RRTHOptions(club_attempts=2, improve_time=1000.0, time_limit=1000.0, max_samples=4000)
RAY = 0.5
# alpha, a, offset, d of each joint and of the tool; where a joint slides.
PAN_TILT_SLIDE = (
    (
        (0.0, 0.0, 0.0, 0.1),
        (QUARTER, 0.05, 0.0, 0.0),
        (QUARTER, 0.1, 0.0, 0.2),
        (1.0, 0.0, 0.0, 0.0),
    ),
    (2,),
)
# A shoulder, an elbow, and a wrist whose last joint only rolls the ray.
SIX = (
    (0.0, 0.0, 0.0, 0.1),
    (QUARTER, 0.0, QUARTER, 0.0),
    (0.0, 0.3, 0.0, 0.0),
    (0.0, 0.25, 0.0, 0.08),
    (QUARTER, 0.0, 0.0, 0.08),
    (-QUARTER, 0.0, 0.0, 0.05),
)
ROLLING_WRIST = ((*SIX, (0.0, 0.0, 0.0, 0.0)), ())
# The same on a rail, its ray at an angle.
ON_A_RAIL = (
    ((QUARTER, 0.0, 0.0, 0.0), (-QUARTER, 0.0, 0.0, 0.1), *SIX[1:], (0.5, 0.02, 0.0, 0.0)),
    (0,),
)


def make_arm(dh, slides):
    """Return an arm beside the body; joints turn by 3 rad, slide by 0.25 m either way."""
    dof = len(dh) - 1
    reach = np.full(dof, 3.0)
    reach[list(slides)] = 0.25
    T = np.eye(4)
    T[:3, 3] = (-0.2, 0.0, 0.25)
    return ArmModel(
        joint_names=tuple(f'j{i}' for i in range(dof)),
        is_prismatic=tuple(i in slides for i in range(dof)),
        dh=np.array(dh),
        bounds=np.array([-reach, reach]),
        radii=np.full(dof + 1, 0.01),
        T_base_mount=T,
    )


def small_body():
    """Return a trunk and a head."""
    return Scene(
        (
            Box('trunk', np.zeros(3), np.array([0.2, 0.3, 0.4]), np.eye(3)),
            Box('head', np.array([0.05, 0.0, 0.33]), np.array([0.16, 0.14, 0.2]), np.eye(3)),
        )
    )


@pytest.mark.parametrize('shape', [PAN_TILT_SLIDE, ROLLING_WRIST, ON_A_RAIL], ids=['3', '6', '7'])
def test_motions_of_any_arm_never_collide_and_end_on_target(shape):
    arm, scene = make_arm(*shape), small_body()
    check_pointing_arm(arm)
    assert pointing_kernels(arm) is numerical()
    world = arm_world(arm, scene, MARGIN, RAY)
    rng = np.random.default_rng(61)
    n_solved = n_bent = 0
    for seed in range(40):
        if seed >= 8 and n_bent:
            break
        q_start = free_configuration(rng, world)
        target = rng.uniform((-1.0, -1.0, -0.6), (1.5, 1.0, 1.2))
        plan = pipeline.plan_motion(
            arm,
            scene,
            q_start,
            PointingGoal(target),
            limits(arm.dof),
            OPTIONS,
            margin=MARGIN,
            ray_guard_length=RAY,
            seed=seed,
        )
        if plan.status is not PlanStatus.SOLVED:
            continue
        n_solved += 1
        n_bent += len(plan.path.waypoints) > 2
        trajectory = plan.trajectory
        times = np.append(np.arange(0.0, trajectory.duration, 1e-3), trajectory.duration)
        q, _, _ = sample(trajectory, times)
        assert np.array_equal(q[0], q_start)
        assert first_contact(arm, scene, q, RAY, MARGIN) is None
        reach = np.linalg.norm(target - tool_pose(arm, q[-1])[:3, 3])
        assert first_contact(arm, scene, q[-1:], max(RAY, reach), MARGIN) is None
        assert plan.target_distance == pytest.approx(reach, abs=1e-9)
        assert pointing_error(arm, q[-1], target) < 1e-6
        assert ((q >= arm.bounds[0] - 1e-9) & (q <= arm.bounds[1] + 1e-9)).all()
    assert n_solved >= 6
    assert n_bent >= 1


def test_an_arm_that_cannot_point_is_rejected_before_the_first_plan():
    arm = make_arm(((0.0, 0.0, 0.0, 0.1), (0.0, 0.3, 0.0, 0.0), (QUARTER, 0.3, 0.0, 0.0)), ())
    with pytest.raises(ModelError, match='surface'):
        pipeline.warm_up(arm, OPTIONS)
