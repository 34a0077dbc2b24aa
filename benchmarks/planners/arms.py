# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Other arms: of 3, 6 and 7 joints, and with a prismatic one."""

from collections.abc import Mapping

import numpy as np
from rrth_planner.io.arm_file import arm_from_mapping
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.arm import ArmModel

QUARTER = 0.5 * np.pi
# type, alpha [rad], a [m], offset [rad], d [m], lower, upper [rad or m] of each joint; then alpha
# of the tool. Those whose tool has alpha = 0 point along their last axis, and so have no pan and
# tilt unit at their end.
_ARMS: Mapping[
    str, tuple[tuple[tuple[str, float, float, float, float, float, float], ...], float]
] = {
    '3 joints': (
        (
            ('revolute', -QUARTER, 0.0, 0.0, 0.126, -np.pi, np.pi),
            ('revolute', QUARTER, 0.0, 0.0, 0.3, -np.pi, np.pi),
            ('revolute', QUARTER, 0.0, 0.0, 0.038, -np.pi, np.pi),
        ),
        -QUARTER,
    ),
    '6 joints': (
        (
            ('revolute', -QUARTER, 0.0, 0.0, 0.126, -np.pi, np.pi),
            ('revolute', QUARTER, 0.0, -QUARTER, 0.0, -np.pi, 0.0),
            ('revolute', 0.0, 0.21, 0.0, 0.05, -2.6, 2.6),
            ('revolute', 0.0, 0.19, -QUARTER, 0.0, -np.pi, np.pi),
            ('revolute', -QUARTER, 0.0, 0.0, 0.045, -np.pi, np.pi),
            ('revolute', QUARTER, 0.0, 0.0, 0.04, -np.pi, np.pi),
        ),
        0.0,
    ),
    '7 joints': (
        (
            ('revolute', -QUARTER, 0.0, 0.0, 0.126, -np.pi, np.pi),
            ('revolute', QUARTER, 0.0, 0.0, 0.0, -2.1, 2.1),
            ('revolute', -QUARTER, 0.0, 0.0, 0.2, -2.9, 2.9),
            ('revolute', QUARTER, 0.0, 0.0, 0.0, -2.1, 2.1),
            ('revolute', -QUARTER, 0.0, 0.0, 0.186, -2.9, 2.9),
            ('revolute', QUARTER, 0.0, 0.0, 0.0, -2.1, 2.1),
            ('revolute', QUARTER, 0.0, 0.0, 0.038, -np.pi, np.pi),
        ),
        -QUARTER,
    ),
    '4 joints, one prismatic': (
        (
            ('revolute', -QUARTER, 0.0, -QUARTER, 0.126, -np.pi, np.pi),
            ('prismatic', QUARTER, 0.0, 0.0, 0.2, 0.0, 0.3),
            ('revolute', QUARTER, 0.0, 0.0, 0.05, -np.pi, np.pi),
            ('revolute', QUARTER, 0.0, 0.0, 0.038, -np.pi, np.pi),
        ),
        -QUARTER,
    ),
}
NAMES = tuple(_ARMS)


def other_arm(name: str) -> ArmModel:
    """Return an arm by its name, one of NAMES, mounted where the packaged one is."""
    joints, tool_alpha = _ARMS[name]
    keys = ('type', 'alpha', 'a', 'offset', 'd', 'lower', 'upper')
    return arm_from_mapping(
        {
            'name': name,
            'joints': [
                {'name': f'joint_{i + 1}', **dict(zip(keys, joint, strict=True))}
                for i, joint in enumerate(joints)
            ],
            'tool': {'alpha': tool_alpha, 'a': 0.0, 'offset': 0.0},
            'mount': load_yaml(resource_path('config/arm.yaml'))['mount'],
        }
    )
