# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies, targets and a start from the example messages, read as plain YAML, without ROS."""

from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.arm import ArmModel
from rrth_planner.arrays import Array
from rrth_planner.body_file import load_body, scene_from_mapping
from rrth_planner.errors import RrthError, SceneError
from rrth_planner.goal import PointingGoal
from rrth_planner.resources import load_yaml, resource_path
from rrth_planner.scene import Scene

BODIES = ('body', 'body_arm_raised')
TARGETS = ('front', 'left', 'high', 'behind', 'low')
# The type of a marker that is a box, and the action that adds it.
CUBE, ADD = 1, 0


def load_wearer(path: str | Path | None = None) -> Scene:
    """
    Return the wearer of a YAML file: laid out as `config/body.yaml`, or an example message.

    Parameters
    ----------
    path : str or Path, optional
        None: `config/body.yaml`.

    Raises
    ------
    ModelError, SceneError
        The file cannot be read, or describes no body.

    """
    data = None if path is None else load_yaml(path)
    if not isinstance(data, dict) or 'markers' not in data:
        return load_body(path)
    try:
        return scene_from_mapping({'boxes': [_box(m) for m in data['markers'] if _is_box(m)]})
    except SceneError as problem:
        raise SceneError(f'file {path}: {problem}') from problem
    except (AttributeError, KeyError, TypeError) as problem:
        raise SceneError(
            f'file {path}: {problem!r}; expected markers as in msg_examples/body.yaml'
        ) from problem


def example_body(name: str) -> Scene:
    """Return the wearer of `msg_examples/NAME.yaml`."""
    return load_wearer(resource_path(f'msg_examples/{name}.yaml'))


def example_target(name: str) -> Array:
    """Return the target of `msg_examples/target_NAME.yaml`, (3,) in the base frame [m]."""
    file = resource_path(f'msg_examples/target_{name}.yaml')
    try:
        point = load_yaml(file)['point']
        return PointingGoal(np.array([point[axis] for axis in 'xyz'])).target
    except (KeyError, TypeError) as problem:
        raise SceneError(f'file {file}: {problem!r}; expected a point with x, y, z') from problem


def start_of(arm: ArmModel) -> Array:
    """Return the folded posture of the examples; for an arm it is not of, mid-range, (dof,)."""
    try:
        state = load_yaml(resource_path('msg_examples/joint_states_folded.yaml'))
        positions = dict(zip(state['name'], state['position'], strict=True))
        q = np.array([float(positions[name]) for name in arm.joint_names])
    except (RrthError, KeyError, TypeError, ValueError):
        return np.asarray(arm.bounds.mean(axis=0))
    is_within = bool(((arm.bounds[0] <= q) & (q <= arm.bounds[1])).all())
    return q if is_within else np.asarray(arm.bounds.mean(axis=0))


def _is_box(marker: Any) -> bool:
    return bool(marker.get('type') == CUBE and marker.get('action', ADD) == ADD)


def _box(marker: Any) -> dict[str, Any]:
    pose = marker['pose']
    return {
        'name': marker.get('text') or marker['ns'],
        'center': [pose['position'][axis] for axis in 'xyz'],
        'size': [marker['scale'][axis] for axis in 'xyz'],
        'quaternion_xyzw': [pose['orientation'][axis] for axis in 'xyzw'],
    }
