# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The question that files and arguments ask a planner, and its answer."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np
from rrth_planner.cli.joint_values import joint_values
from rrth_planner.cli.program import say
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings, PlanSettings, required_clearance
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.arm import ArmModel, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.rotation import pose_matrix
from rrth_planner.model.scene import Scene
from rrth_planner.pipeline.request import PlanQuestion

if TYPE_CHECKING:
    from rrth_planner.collision.free_share import FreeShare
    from rrth_planner.pipeline.motion_plan import MotionPlan

# A seed is less than this.
SEEDS = 2**31
# Where an arm may be worn: farther and farther behind the back, x y z [m] and qx qy qz qw. It has
# room where more than this share of its configurations is free.
PLACES = [(-far, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0) for far in (0.3, 0.5, 0.8, 1.2, 2.0)]
ROOM = 0.1


def folded() -> list[float]:
    """Return where the packaged arm starts in the playback: folded, (4,) [rad]."""
    file = load_yaml(resource_path('config/playback.yaml'))
    return list(file['/**']['ros__parameters']['initial_positions'])


def start_of(
    given: Sequence[float] | None, label: str, arm: ArmModel, *, is_packaged: bool
) -> Array:
    """
    Return the start configuration that is given, (dof,) [rad or m], or that of the arm.

    The packaged arm starts folded, others where all joints are 0, or as near to it as they get.
    """
    if given is not None:
        return joint_values(given, label, arm.joint_names)
    if is_packaged:
        return np.array(folded())
    return np.asarray(np.clip(np.zeros(arm.dof), *arm.bounds))


def free_share_of(arm: ArmModel, scene: Scene, settings: PlanSettings, name: str) -> 'FreeShare':
    """Return how freely an arm moves beside a wearer; as `plan_of`, it compiles what it needs."""
    from rrth_planner.kernels.precompile import prepare_kernels

    prepare_kernels(partial(say, name))
    from rrth_planner.collision.free_share import free_share
    from rrth_planner.collision.world import world_of

    return free_share(world_of(required_clearance(arm, settings), scene))


def free_start_of(
    arm: ArmModel, scene: Scene, settings: PlanSettings, arm_at: Callable[[Array], ArmModel]
) -> Array:
    """Return a free start of an arm, (dof,) [rad or m], or raise; arm_at as of `nothing_free`."""
    found = free_share_of(arm, scene, settings, 'plan')
    if found.start is None:
        raise OptionsError(nothing_free(found, scene, settings, arm_at))
    return found.start


def nothing_free(
    found: 'FreeShare', scene: Scene, settings: PlanSettings, arm_at: Callable[[Array], ArmModel]
) -> str:
    """Return what to do where none is free; arm_at: the arm mounted at a pose, (4, 4) [m]."""
    most, there = 0.0, found
    for place in PLACES:
        there = free_share_of(arm_at(pose_matrix(place[:3], place[3:])), scene, settings, 'plan')
        if there.share > most:
            most, mount = there.share, ' '.join(f'{value:g}' for value in place)
        if most > ROOM:
            break
    worn = {box.name for box in scene.boxes}
    # Where nothing is free far from the wearer either, it may be the arm itself.
    itself = tuple(pair for pair in there.causes if pair[1] not in worn)
    causes = found.causes
    if most > 0.0:
        where = 'where it has room' if most > ROOM else f'where {100.0 * most:.1f} % are free'
        remedy = f'give --mount X Y Z QX QY QZ QW, {where}, such as --mount {mount}'
    elif itself:
        causes = itself
        remedy = (
            'let pairs of its parts meet that cannot in truth (allowed in the file of the arm; '
            '--srdf of read_urdf)'
        )
    else:
        remedy = 'give --mount X Y Z QX QY QZ QW farther away than 2 m, or smaller capsules'
    cause = ' and '.join(f'"{part}"' for part in causes[0]) if causes else 'its parts'
    return (
        f'{remedy}: none of 1000 configurations is free of the wearer and of the arm itself; most '
        f'often {cause} collide'
    )


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


def figures_of(arm: ArmModel, q_start: Array, plan: 'MotionPlan') -> dict[str, Any]:
    """Return the figures of a plan; the names end with their units."""
    figures: dict[str, Any] = {
        'status': plan.status.value,
        'sentence': plan.sentence,
        'start': _ray(arm, q_start),
    }
    if plan.path is not None and plan.trajectory is not None:
        figures |= {
            'waypoints': len(plan.path.waypoints),
            'duration_s': plan.trajectory.duration,
            'length_rad': plan.path.length,
            'clearance_m': plan.clearance,
            'reach_m': plan.target_distance,
            'escape_time_s': plan.escape_time,
            'end': _ray(arm, plan.trajectory.positions[-1]),
        }
    return figures | {'planning_time_s': plan.planning_time, 'seed': plan.seed}


def _ray(arm: ArmModel, q: Array) -> dict[str, list[float]]:
    """Return a configuration, and origin and direction of the pointing ray there."""
    T = tool_pose(arm, q)
    return {'q': q.tolist(), 'ray_from_m': T[:3, 3].tolist(), 'ray': T[:3, 2].tolist()}
