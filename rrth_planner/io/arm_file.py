# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm as a YAML file, laid out as `config/arm.yaml`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.io.entries import mapping, number, sequence
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import naming_file, parse_yaml, read_text, to_yaml
from rrth_planner.model.arm import ArmModel, ROW
from rrth_planner.model.arrays import Array, FARTHEST, frozen_array
from rrth_planner.model.errors import ModelError, printable, shown
from rrth_planner.model.rotation import pose_matrix, quaternion_xyzw

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
    (lower, upper), radii = arm.bounds.tolist(), arm.radii.tolist()
    joints = []
    for k, joint in enumerate(arm.joint_names):
        kind = 'prismatic' if arm.is_prismatic[k] else 'revolute'
        limits = {'lower': lower[k], 'upper': upper[k]}
        joints.append({'name': joint, 'type': kind, **rows[k], **limits, 'radius': radii[k]})
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


def arm_from_mapping(data: Mapping[str, Any]) -> ArmModel:
    """
    Return the arm that a mapping describes, laid out as in `config/arm.yaml`.

    Raises
    ------
    ModelError
        Something is missing, has another name or describes no arm.

    """
    given = mapping(data, 'arm', ('joints', 'tool', 'mount'), ModelError, ('name',))
    printable(given.get('name', 'arm'), 'arm: name', ModelError)
    joints = [
        _joint(i, joint) for i, joint in enumerate(sequence(given['joints'], 'joints', ModelError))
    ]
    mount = mapping(given['mount'], 'mount', ('position', 'quaternion_xyzw'), ModelError)
    position = frozen_array(mount['position'], (3,), 'mount position', 'm', ModelError)
    quaternion = frozen_array(
        mount['quaternion_xyzw'], (4,), 'mount quaternion_xyzw', '-', ModelError, FARTHEST
    )
    if np.linalg.norm(quaternion) < 1e-6:
        raise ModelError('mount quaternion_xyzw: all zero, expected a unit quaternion [-]')
    rows = [*joints, _tool(given['tool'])]
    return ArmModel(
        joint_names=tuple(joint['name'] for joint in joints),
        is_prismatic=tuple(joint['type'] == 'prismatic' for joint in joints),
        dh=np.array([[row[key] for key in ROW] for row in rows]),
        bounds=np.array([[joint[key] for joint in joints] for key in ('lower', 'upper')]),
        radii=np.array([row['radius'] for row in rows]),
        T_base_mount=pose_matrix(position, quaternion),
    )


def _joint(index: int, data: Any) -> dict[str, Any]:
    """Return what an arm's file says of a joint, its radius included."""
    wanted = ('name', 'type', *ROW, 'lower', 'upper')
    given = {'radius': 0.0, **mapping(data, f'joint {index}', wanted, ModelError, ('radius',))}
    label = f'joint "{printable(given["name"], f"joint {index}: name", ModelError)}"'
    kind = given['type']
    if kind not in ('revolute', 'prismatic'):
        raise ModelError(f'{label}: type {shown(kind)}, expected revolute or prismatic')
    limit = 'm' if kind == 'prismatic' else 'rad'
    return given | _numbers(given, label, {**ROW, 'lower': limit, 'upper': limit, 'radius': 'm'})


def _tool(data: Any) -> dict[str, Any]:
    """Return the row of the tool, its radius and a `d` of 0 included."""
    wanted = ('alpha', 'a', 'offset')
    given = mapping(data, 'tool', wanted, ModelError, ('d', 'radius'))
    row = _numbers({'d': 0.0, 'radius': 0.0, **given}, 'tool', {**ROW, 'radius': 'm'})
    if row['d'] != 0.0:
        raise ModelError(f'tool: d = {row["d"]}, expected none: the ray begins at the frame [m]')
    return row


def _numbers(given: Mapping[str, Any], label: str, units: Mapping[str, str]) -> dict[str, float]:
    return {
        key: number(given[key], f'{label}: {key}', unit, ModelError) for key, unit in units.items()
    }


def load_arm(path: str | Path | None = None) -> ArmModel:
    """
    Return the arm that a YAML file describes; None or empty: the packaged one, `config/arm.yaml`.

    Raises
    ------
    ModelError
        The file cannot be read, or describes no arm.

    """
    file = Path(path) if path else resource_path('config/arm.yaml')
    text = read_text(file)
    if text.lstrip().startswith('<'):
        raise ModelError(
            f'file {file}: XML, as a URDF is, expected an arm laid out as config/arm.yaml; '
            'read_urdf writes one from a URDF'
        )
    data = parse_yaml(text, f'file {file}')
    with naming_file(file, ModelError):
        return arm_from_mapping(data)
