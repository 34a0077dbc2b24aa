# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm as a YAML file, laid out as `config/arm.yaml`."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rrth_planner.arm import ArmModel, ROW
from rrth_planner.arrays import Array
from rrth_planner.rotation import quaternion_xyzw
from rrth_planner.text_files import to_yaml

LAYOUT = (
    'Modified Denavit-Hartenberg parameters (Craig), '
    'T = Rx(alpha) Tx(a) Rz(theta + offset) Tz(d).',
    'Lengths in metres, angles in radians; radius: thickness of the bars of a row.',
    "tool: the frame after the last joint, whose pointing ray leaves along +z; mount: the arm's",
    "base in the wearer's base frame, x forward, y left, z up.",
)


def arm_to_mapping(arm: ArmModel, name: str) -> dict[str, Any]:
    """Return an arm as `arm_from_mapping` reads it."""
    rows = [dict(zip(ROW, row, strict=True)) for row in arm.dh.tolist()]
    radii = arm.radii.tolist()
    joints = [
        {
            'name': joint,
            'type': 'prismatic' if slides else 'revolute',
            **row,
            'lower': lower,
            'upper': upper,
            'radius': radius,
        }
        for joint, slides, row, lower, upper, radius in zip(
            arm.joint_names, arm.is_prismatic, rows[:-1], *arm.bounds.tolist(), radii[:-1],
            strict=True,
        )
    ]  # fmt: skip
    del rows[-1]['d']
    return {
        'name': name,
        'joints': joints,
        'tool': {**rows[-1], 'radius': radii[-1]},
        'mount': {
            'position': _plain(arm.T_base_mount[:3, 3]),
            'quaternion_xyzw': _plain(quaternion_xyzw(arm.T_base_mount[:3, :3])),
        },
    }


def arm_to_yaml(arm: ArmModel, name: str, comments: Sequence[str] = ()) -> str:
    """
    Return the text of an arm's file: comments, what the numbers mean, and a line a joint.

    Rows, limits and radii are read from it to the bit, the mount to 1e-14.
    """
    lines = [f'# {" ".join(line.split())}\n' for line in (*comments, *LAYOUT)]
    return ''.join(lines) + to_yaml(arm_to_mapping(arm, name), width=1000)


def _plain(numbers: Array) -> list[float]:
    """Return numbers without the last digit, which only rounding left."""
    plain: list[float] = (np.round(numbers, 15) + 0.0).tolist()
    return plain
