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
    'ArmModel': 'arm',
    'arm_from_mapping': 'arm_file',
    'forward_kinematics': 'arm',
    'tool_pose': 'arm',
    'Box': 'scene',
    'Scene': 'scene',
    'PointingGoal': 'goal',
    'load_body': 'wearer_file',
    'RRTHOptions': 'options',
    'RRTOptions': 'options',
    'RRTStarOptions': 'options',
    'InformedRRTStarOptions': 'options',
    'RRTStarSmartOptions': 'options',
    'PrintedRRTHOptions': 'options',
    'World': 'world',
    'arm_world': 'world',
    'goal_configurations': 'aiming',
    'pointing_problem': 'aiming',
    'BoxMap': 'box_map',
    'map_from_mapping': 'map_file',
    'map_problem': 'box_map',
    'map_world': 'box_map',
    'load_map': 'map_file',
    'PlanningProblem': 'problem',
    'PlanResult': 'planner',
    'plan': 'planner',
    'PlanStatus': 'status',
    'Path': 'path',
    'MotionLimits': 'trajectory',
    'Trajectory': 'trajectory',
    'sample': 'trajectory',
    'parameterize': 'timing',
    'certify': 'certificate',
    'brake': 'braking',
    'certify_braking': 'braking',
    'load_arm': 'arm_file',
    'RrthError': 'errors',
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
