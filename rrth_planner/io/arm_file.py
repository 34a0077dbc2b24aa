# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm as a YAML file, laid out as `config/arm.yaml`."""

from collections.abc import Mapping, Sequence
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from rrth_planner.io.entries import mapping, number, sequence
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import naming_file, parse_yaml, read_text, to_yaml
from rrth_planner.model.arm import ArmModel, Capsule, NO_BARS, ROW
from rrth_planner.model.arrays import Array, FARTHEST, float_array, frozen_array
from rrth_planner.model.errors import ModelError, printable, shown
from rrth_planner.model.rotation import pose_matrix, quaternion_xyzw

POSE = ('position', 'quaternion_xyzw')
LAYOUT = (
    'Modified Denavit-Hartenberg parameters (Craig), '
    'T = Rx(alpha) Tx(a) Rz(theta + offset) Tz(d).',
    'Lengths in metres, angles in radians; radius: of the bars that the offsets a and d of a row',
    'are; capsules: of the link that the joint moves, in its frame after the row.',
    'type: revolute, prismatic, or continuous: it turns without a stop, so many times either way,',
    'for its cables, as max_turns says; 3 where there is none.',
    "tool: the frame after the last joint, whose pointing ray leaves along +z; mount: the arm's",
    "base in the wearer's base frame, x forward, y left, z up; frame_0: where the first row and",
    'the capsules of the mount begin, in the frame of the mount (without: there).',
)

# Of a continuous joint, either way from 0, where its file says nothing.
MAX_TURNS = 3.0


def arm_to_mapping(arm: ArmModel, name: str, T_base_link: Array | None = None) -> dict[str, Any]:
    """
    Return an arm as `arm_from_mapping` reads it.

    T_base_link: pose of the link that is mounted in the wearer's base frame, (4, 4) [m], where
    that is not the frame in which the first row begins.
    """
    rows = [dict(zip(ROW, row, strict=True)) for row in arm.dh.tolist()]
    (lower, upper), radii = arm.bounds.tolist(), arm.radii.tolist()
    joints = []
    for k, joint in enumerate(arm.joint_names):
        kind = _kind(arm, k)
        limits = {'lower': lower[k], 'upper': upper[k]}
        # Without the last digits, which only rounding left.
        n_turns = round(upper[k] / math.tau, 12)
        if kind == 'continuous' and upper[k] == -lower[k] == math.tau * n_turns:
            limits = {'max_turns': n_turns}
        radius = {} if radii[k] == NO_BARS else {'radius': radii[k]}
        row = {'name': joint, 'type': kind, **rows[k], **limits, **radius}
        joints.append(row | _capsules_of(arm, k + 1))
    del rows[-1]['d']
    mount: dict[str, Any] = _pose(arm.T_base_mount if T_base_link is None else T_base_link)
    if T_base_link is not None:
        mount['frame_0'] = _pose(np.linalg.inv(T_base_link) @ arm.T_base_mount)
    result = {
        'name': name,
        'joints': joints,
        'tool': {**rows[-1], 'radius': radii[-1]} | _capsules_of(arm, arm.dof + 1),
        'mount': mount | _capsules_of(arm, 0),
    }
    return result | ({'allowed': [list(pair) for pair in arm.allowed]} if arm.allowed else {})


def turn_bounds(max_turns: float, name: str = 'max_turns') -> Array:
    """
    Return the limits of a continuous joint that may wind so many turns either way, (2, 1) [rad].

    Raises
    ------
    ModelError
        None or fewer, or more than an angle may have.

    """
    if not 0.0 < max_turns * math.tau <= FARTHEST:
        raise ModelError(
            f'{name}: {max_turns:g}, expected a number above 0, up to '
            f'{int(FARTHEST / math.tau)} [turns]'
        )
    return math.tau * max_turns * np.array([[-1.0], [1.0]])


def _pose(T: Array) -> dict[str, list[float]]:
    return {
        'position': _plain(T[:3, 3]),
        'quaternion_xyzw': _plain(quaternion_xyzw(T[:3, :3])),
    }


def _kind(arm: ArmModel, k: int) -> str:
    if arm.is_continuous[k]:
        return 'continuous'
    return 'prismatic' if arm.is_prismatic[k] else 'revolute'


def _capsules_of(arm: ArmModel, link: int) -> dict[str, Any]:
    """Return the entry with the capsules of a link, if it has any."""
    found = [
        {'name': c.name, 'from': c.ends[0].tolist(), 'to': c.ends[1].tolist(), 'radius': c.radius}
        for c in arm.capsules
        if c.link == link
    ]
    return {'capsules': found} if found else {}


def arm_to_yaml(
    arm: ArmModel, name: str, comments: Sequence[str] = (), T_base_link: Array | None = None
) -> str:
    """
    Return the text of an arm's file: comments, what the numbers mean, and a line a joint.

    T_base_link as of `arm_to_mapping`. Rows, limits and radii are read from it to the bit, the
    mount to 1e-14.
    """
    lines = [f'# {" ".join(line.split())}\n' for line in (*comments, *LAYOUT)]
    return ''.join(lines) + to_yaml(arm_to_mapping(arm, name, T_base_link), width=1000)


def _plain(numbers: Array) -> list[float]:
    """Return numbers without the last digit, which only rounding left."""
    plain: list[float] = (np.round(numbers, 15) + 0.0).tolist()
    return plain


def arm_from_mapping(data: Mapping[str, Any], T_base_link: ArrayLike | None = None) -> ArmModel:
    """
    Return the arm that a mapping describes, laid out as in `config/arm.yaml`.

    T_base_link: pose of what is mounted in the wearer's base frame, (4, 4) [m], if not the mount
    of the mapping.

    Raises
    ------
    ModelError
        Something is missing, has another name or describes no arm.

    """
    wanted = ('joints', 'tool', 'mount')
    given = mapping(data, 'arm', wanted, ModelError, ('name', 'allowed'))
    printable(given.get('name', 'arm'), 'arm: name', ModelError)
    joints = [
        _joint(i, joint) for i, joint in enumerate(sequence(given['joints'], 'joints', ModelError))
    ]
    mount = mapping(given['mount'], 'mount', POSE, ModelError, ('frame_0', 'capsules'))
    if T_base_link is None:
        T_base_mount = _placed(mount, 'mount')
    else:
        T_base_mount = float_array(T_base_link, (4, 4), 'T_base_link', 'm', ModelError)
    if 'frame_0' in mount:
        label = 'mount frame_0'
        frame_0 = mapping(mount['frame_0'], label, POSE, ModelError)
        T_base_mount = T_base_mount @ _placed(frame_0, label)
    rows = [*joints, _tool(given['tool'])]
    capsules = [
        capsule
        for link, row in enumerate([mount, *rows])
        for capsule in _capsules(row.get('capsules', []), link, len(joints))
    ]
    # Where links are made of capsules, offsets are bars only if they say so.
    unsaid = NO_BARS if capsules else 0.0
    return ArmModel(
        joint_names=tuple(joint['name'] for joint in joints),
        is_prismatic=tuple(joint['type'] == 'prismatic' for joint in joints),
        dh=np.array([[row[key] for key in ROW] for row in rows]),
        bounds=np.array([[joint[key] for joint in joints] for key in ('lower', 'upper')]),
        radii=np.array([row.get('radius', unsaid) for row in joints] + [rows[-1]['radius']]),
        T_base_mount=T_base_mount,
        capsules=tuple(capsules),
        allowed=_allowed(given.get('allowed', [])),
        is_continuous=tuple(joint['type'] == 'continuous' for joint in joints),
    )


def _placed(given: Mapping[str, Any], label: str) -> Array:
    """Return a pose, (4, 4) [m], or raise ModelError."""
    position = frozen_array(given['position'], (3,), f'{label} position', 'm', ModelError)
    quaternion = frozen_array(
        given['quaternion_xyzw'], (4,), f'{label} quaternion_xyzw', '-', ModelError, FARTHEST
    )
    if np.linalg.norm(quaternion) < 1e-6:
        raise ModelError(f'{label} quaternion_xyzw: all zero, expected a unit quaternion [-]')
    return pose_matrix(position, quaternion)


def _allowed(data: Any) -> tuple[tuple[str, str], ...]:
    """Return pairs of names, of a part of the arm and of another part or a box, or raise."""
    pairs = []
    for i, pair in enumerate(sequence(data, 'allowed', ModelError)):
        names = sequence(pair, f'allowed[{i}]', ModelError)
        if len(names) != 2 or not all(isinstance(name, str) for name in names):
            raise ModelError(
                f'allowed[{i}]: {shown(pair)}, expected a part of the arm and another part or box'
            )
        pairs.append((names[0], names[1]))
    return tuple(pairs)


def _capsules(data: Any, link: int, dof: int) -> list[Capsule]:
    """Return the capsules of a link; 0: of the mount, dof + 1: of the tool."""
    what = 'mount' if link == 0 else 'tool' if link > dof else f'link {link}'
    found = []
    for i, entry in enumerate(sequence(data, f'{what}: capsules', ModelError)):
        label = f'{what}: capsule {i}'
        given = mapping(entry, label, ('from', 'to', 'radius'), ModelError, ('name',))
        ends = [
            frozen_array(given[key], (3,), f'{label}: {key}', 'm', ModelError, FARTHEST)
            for key in ('from', 'to')
        ]
        radius = number(given['radius'], f'{label}: radius', 'm', ModelError)
        name = printable(given.get('name', what), f'{label}: name', ModelError)
        found.append(Capsule(name=name, link=link, ends=np.array(ends), radius=radius))
    return found


def _joint(index: int, data: Any) -> dict[str, Any]:
    """Return what an arm's file says of a joint, its radius included."""
    limits = ['lower', 'upper']
    is_turning = isinstance(data, Mapping) and data.get('type') == 'continuous'
    is_limited = not is_turning or any(key in data for key in limits)
    wanted = ('name', 'type', *ROW, *(limits if is_limited else ()))
    optional = ('radius', 'capsules', *(() if is_limited else ('max_turns',)))
    given = mapping(data, f'joint {index}', wanted, ModelError, optional)
    label = f'joint "{printable(given["name"], f"joint {index}: name", ModelError)}"'
    kind = given['type']
    if kind not in ('continuous', 'revolute', 'prismatic'):
        raise ModelError(
            f'{label}: type {shown(kind)}, expected continuous, revolute or prismatic'
        )
    limit = 'm' if kind == 'prismatic' else 'rad'
    units = {**ROW, 'lower': limit, 'upper': limit, 'max_turns': 'turns', 'radius': 'm'}
    row = {**given, **_numbers(given, label, units)}
    if not is_limited:
        found = turn_bounds(row.get('max_turns', MAX_TURNS), f'{label}: max_turns')
        (row['lower'],), (row['upper'],) = found.tolist()
    return row


def _tool(data: Any) -> dict[str, Any]:
    """Return the row of the tool, its radius and a `d` of 0 included."""
    wanted = ('alpha', 'a', 'offset')
    given = mapping(data, 'tool', wanted, ModelError, ('d', 'radius', 'capsules'))
    row = {'d': 0.0, 'radius': 0.0, **given}
    row |= _numbers(row, 'tool', {**ROW, 'radius': 'm'})
    if row['d'] != 0.0:
        raise ModelError(f'tool: d = {row["d"]}, expected none: the ray begins at the frame [m]')
    return row


def _numbers(given: Mapping[str, Any], label: str, units: Mapping[str, str]) -> dict[str, float]:
    return {
        key: number(given[key], f'{label}: {key}', unit, ModelError)
        for key, unit in units.items()
        if key in given
    }


def load_arm(path: str | Path | None = None, T_base_link: ArrayLike | None = None) -> ArmModel:
    """
    Return the arm that a YAML file describes; None or empty: the packaged one, `config/arm.yaml`.

    T_base_link as of `arm_from_mapping`.

    Raises
    ------
    ModelError
        The file cannot be read, or describes no arm.

    """
    file = Path(path) if path else resource_path('config/arm.yaml')
    return arm_from_text(read_text(file), file, T_base_link)


def arm_from_text(text: str, file: str | Path, T_base_link: ArrayLike | None = None) -> ArmModel:
    """Return the arm that the text of a YAML file describes, as `load_arm` does."""
    if text.lstrip().startswith('<'):
        raise ModelError(
            f'file {file}: XML, as a URDF is, expected an arm laid out as config/arm.yaml; '
            'read_urdf writes one from a URDF'
        )
    data = parse_yaml(text, f'file {file}')
    with naming_file(file, ModelError):
        return arm_from_mapping(data, T_base_link)
