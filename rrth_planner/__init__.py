# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Motion planning for body-mounted pointing arms that never touch their wearer.

The public names are imported when they are first used: the kernels behind the planner take a
second to load, and what needs only an arm or a trajectory shall not wait for them.
"""

from importlib import import_module
from typing import Any

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
    'RrthError': 'model.errors',
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    """Import a public name from its module (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOME[name]}'), name)


def __dir__() -> list[str]:
    """Return the public names."""
    return list(__all__)
