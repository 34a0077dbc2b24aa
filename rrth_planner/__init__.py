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

__version__ = '0.1.0'

_HOME = {
    'ArmModel': 'model.arm',
    'arm_from_mapping': 'io.arm_file',
    'forward_kinematics': 'model.arm',
    'tool_pose': 'model.arm',
    'Box': 'model.scene',
    'Scene': 'model.scene',
    'PointingGoal': 'model.goal',
    'load_body': 'io.wearer_file',
    'RRTHOptions': 'planning.options',
    'RRTOptions': 'planning.options',
    'RRTStarOptions': 'planning.options',
    'InformedRRTStarOptions': 'planning.options',
    'RRTStarSmartOptions': 'planning.options',
    'PrintedRRTHOptions': 'planning.options',
    'World': 'collision.world',
    'arm_world': 'collision.world',
    'goal_configurations': 'planning.pointing_goals',
    'pointing_problem': 'planning.pointing_goals',
    'BoxMap': 'planning.box_map',
    'map_from_mapping': 'io.map_file',
    'map_problem': 'planning.box_map',
    'map_world': 'planning.box_map',
    'load_map': 'io.map_file',
    'PlanningProblem': 'planning.problem',
    'PlanResult': 'planning.result',
    'plan': 'planning.planner',
    'PlanStatus': 'model.status',
    'Path': 'model.path',
    'MotionLimits': 'model.trajectory',
    'Trajectory': 'model.trajectory',
    'sample': 'model.trajectory',
    'parameterize': 'timing.parameterization',
    'certify': 'collision.certificate',
    'brake': 'timing.braking',
    'certify_braking': 'timing.braking',
    'load_arm': 'io.arm_file',
    'plan_motion': 'pipeline.plan_motion',
    'warm_up': 'pipeline.plan_motion',
    'load_settings': 'io.settings',
    'MotionPlan': 'pipeline.motion_plan',
    'PlanSettings': 'io.settings',
    'MotionState': 'model.trajectory',
    'StartState': 'model.trajectory',
    'RrthError': 'model.errors',
}

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
