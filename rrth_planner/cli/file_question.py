# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The question that files and arguments ask a planner, and its answer."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rrth_planner.cli.program import say
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings, PlanSettings
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.pipeline.request import PlanQuestion

if TYPE_CHECKING:
    from rrth_planner.pipeline.motion_plan import MotionPlan


def folded() -> list[float]:
    """Return where the packaged arm starts in the playback: folded, (4,) [rad]."""
    file = load_yaml(resource_path('config/playback.yaml'))
    return list(file['/**']['ros__parameters']['initial_positions'])


def new_seed(seed: int) -> int:
    """Return the seed; for -1 a new one."""
    return int(np.random.default_rng().integers(2**31)) if seed == -1 else seed


def settings_of(arm: ArmModel, file: Path | None, **changes: float | None) -> PlanSettings:
    """Return the settings of a file, or those of the package, with the changes that are given."""
    given = {name: value for name, value in changes.items() if value is not None}
    return load_settings(arm.dof, file, **given)


def question_of(
    arm: ArmModel,
    scene: Scene,
    q_start: Array,
    target: Array,
    settings: PlanSettings,
    seed: int,
) -> PlanQuestion:
    """
    Return the question for a motion from q_start, (dof,) [rad], to a target, (3,) [m].

    Scene and target are in the base frame. The settings' own seed does not count, `seed` does.
    """
    return PlanQuestion(
        arm=arm,
        scene=scene,
        q_start=q_start,
        goal=PointingGoal(target),
        limits=settings.limits,
        options=settings.options,
        margin=settings.margin,
        ray_guard_length=settings.ray_guard_length,
        seed=seed,
        escape_depth=settings.escape_depth,
        reserve=settings.reserve,
        second_checker=settings.second_checker,
    )


def plan_of(question: PlanQuestion, name: str) -> 'MotionPlan':
    """Return the answer to a question; the named command says so if kernels must be compiled."""
    # Not for --help: loading the planner takes seconds, and compiling it, once, minutes.
    from rrth_planner.kernels.precompile import prepare_kernels

    prepare_kernels(partial(say, name))
    from rrth_planner.pipeline.plan_motion import plan_question, warm_up

    # Compiling and loading do not count as planning time.
    warm_up(question.arm, question.options, question.second_checker)
    return plan_question(question)
