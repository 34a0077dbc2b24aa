# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm, its wearer at rest, and what commitments are proven with; random motions of the arm."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.settings import load_settings, PlanSettings
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Scene
from rrth_planner.model.separation import Separation, SeparationRules
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.plan_motion import plan_motion

from benchmarks.common.random_draws import random_target

MARGIN, RAY = 0.02, 1.0
# Of what a frame of the tracker shows [s].
AGE = 0.03
# Where a chain of motions begins [rad].
FOLDED = np.array([0.0, -0.35, 0.5 * np.pi, 0.5 * np.pi])
# Stop limits by name: those of motions, and more [rad/s^2, rad/s^3].
STOPS = {'4/40': (4.0, 40.0), '10/400': (10.0, 400.0)}
# So many targets are drawn before an arm is taken to be stuck.
DRAWS = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """
    What is assumed and allowed.

    Parameters
    ----------
    contact_speed : float
        [m/s].
    stop : str
        A name of STOPS.
    controller_delay : float
        [s].

    """

    contact_speed: float = 0.1
    stop: str = '4/40'
    controller_delay: float = 0.01


@cache
def the_arm() -> ArmModel:
    """Return the packaged arm."""
    return load_arm()


@cache
def the_settings() -> PlanSettings:
    """Return the packaged settings of plans."""
    return load_settings(the_arm().dof)


@cache
def required() -> RequiredClearance:
    """Return what stays clear of the wearer."""
    return RequiredClearance(the_arm(), MARGIN, RAY)


@cache
def separation_of(case: Case) -> Separation:
    """Return what commitments of a case are proven with."""
    arm, limits = the_arm(), the_settings().limits
    acceleration, jerk = (np.full(arm.dof, value) for value in STOPS[case.stop])
    rules = SeparationRules(
        contact_speed=case.contact_speed, controller_delay=case.controller_delay
    )
    return Separation(
        arm=arm,
        rules=rules,
        margin=MARGIN,
        limits=limits,
        stop_limits=MotionLimits(velocity=limits.velocity, acceleration=acceleration, jerk=jerk),
    )


def planned(
    scene: Scene, q_start: Array, target: Array, seed: int, case: Case | None = None
) -> MotionPlan:
    """Return the plan from a place at rest to a target [m]; case: where the arm separates."""
    settings = the_settings()
    separation = None if case is None else separation_of(case)
    return plan_motion(
        the_arm(),
        scene,
        q_start,
        PointingGoal(target),
        settings.limits,
        settings.options,
        margin=MARGIN,
        ray_guard_length=RAY,
        seed=seed,
        reserve=settings.reserve,
        rules=None if separation is None else separation.rules,
        stop_limits=None if separation is None else separation.stop_limits,
        body_age=AGE,
    )


def random_plans(
    rng: np.random.Generator, scene: Scene, q_start: Array, case: Case | None = None
) -> Iterator[MotionPlan]:
    """Yield solved plans from a place to random targets in all directions, DRAWS at most."""
    for _ in range(DRAWS):
        plan = planned(scene, q_start, random_target(rng), int(rng.integers(2**31)), case)
        if plan.trajectory is not None and plan.escape_time == 0.0:
            yield plan
