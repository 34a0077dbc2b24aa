# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Motion planning for body-mounted pointing arms that keep clear of their wearer.

The public names are imported when they are first used: the kernels behind the planner take a
second to load, and what needs only an arm or a trajectory shall not wait for them.
"""

from importlib import import_module
from typing import Any, TYPE_CHECKING

# What type checkers read in place of `_HOME`.
if TYPE_CHECKING:
    from rrth_planner.collision.certificate import certify as certify
    from rrth_planner.collision.world import arm_world as arm_world, World as World
    from rrth_planner.io.arm_file import arm_from_mapping as arm_from_mapping, load_arm as load_arm
    from rrth_planner.io.map_file import load_map as load_map, map_from_mapping as map_from_mapping
    from rrth_planner.io.settings import (
        load_settings as load_settings,
        PlanSettings as PlanSettings,
    )
    from rrth_planner.io.wearer_file import load_body as load_body
    from rrth_planner.model.arm import (
        ArmModel as ArmModel,
        forward_kinematics as forward_kinematics,
        tool_pose as tool_pose,
    )
    from rrth_planner.model.errors import RrthError as RrthError
    from rrth_planner.model.goal import PointingGoal as PointingGoal
    from rrth_planner.model.path import Path as Path
    from rrth_planner.model.scene import Box as Box, Scene as Scene
    from rrth_planner.model.status import PlanStatus as PlanStatus
    from rrth_planner.model.trajectory import (
        MotionLimits as MotionLimits,
        MotionState as MotionState,
        sample as sample,
        StartState as StartState,
        Trajectory as Trajectory,
    )
    from rrth_planner.pipeline.motion_plan import MotionPlan as MotionPlan
    from rrth_planner.pipeline.plan_motion import plan_motion as plan_motion, warm_up as warm_up
    from rrth_planner.planning.box_map import (
        BoxMap as BoxMap,
        map_problem as map_problem,
        map_world as map_world,
    )
    from rrth_planner.planning.options import (
        InformedRRTStarOptions as InformedRRTStarOptions,
        PrintedRRTHOptions as PrintedRRTHOptions,
        RRTHOptions as RRTHOptions,
        RRTOptions as RRTOptions,
        RRTStarOptions as RRTStarOptions,
        RRTStarSmartOptions as RRTStarSmartOptions,
    )
    from rrth_planner.planning.planner import plan as plan
    from rrth_planner.planning.pointing_goals import (
        goal_configurations as goal_configurations,
        pointing_problem as pointing_problem,
    )
    from rrth_planner.planning.problem import PlanningProblem as PlanningProblem
    from rrth_planner.planning.result import PlanResult as PlanResult
    from rrth_planner.timing.braking import brake as brake, certify_braking as certify_braking
    from rrth_planner.timing.parameterization import parameterize as parameterize

__version__ = '1.0.0'

# The names of each module.
_PUBLIC = {
    'collision.certificate': 'certify',
    'collision.world': 'World arm_world',
    'io.arm_file': 'arm_from_mapping load_arm',
    'io.map_file': 'load_map map_from_mapping',
    'io.settings': 'PlanSettings load_settings',
    'io.wearer_file': 'load_body',
    'model.arm': 'ArmModel forward_kinematics tool_pose',
    'model.errors': 'RrthError',
    'model.goal': 'PointingGoal',
    'model.path': 'Path',
    'model.scene': 'Box Scene',
    'model.status': 'PlanStatus',
    'model.trajectory': 'MotionLimits MotionState StartState Trajectory sample',
    'pipeline.motion_plan': 'MotionPlan',
    'pipeline.plan_motion': 'plan_motion warm_up',
    'planning.box_map': 'BoxMap map_problem map_world',
    'planning.options': 'InformedRRTStarOptions PrintedRRTHOptions RRTHOptions RRTOptions '
    'RRTStarOptions RRTStarSmartOptions',
    'planning.planner': 'plan',
    'planning.pointing_goals': 'goal_configurations pointing_problem',
    'planning.problem': 'PlanningProblem',
    'planning.result': 'PlanResult',
    'timing.braking': 'brake certify_braking',
    'timing.parameterization': 'parameterize',
}
_HOME = {name: module for module, names in _PUBLIC.items() for name in names.split()}

__all__ = sorted(_HOME)


if not TYPE_CHECKING:
    # To a type checker a name that is none shall be an error.
    def __getattr__(name: str) -> Any:
        """Import a public name from its module (PEP 562)."""
        if name not in _HOME:
            raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
        return getattr(import_module(f'{__name__}.{_HOME[name]}'), name)


def __dir__() -> list[str]:
    """Return the public names."""
    return [*__all__, '__version__']
