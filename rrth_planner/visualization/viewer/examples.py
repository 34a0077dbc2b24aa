# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies, targets and a start from the example messages, read as plain YAML, without ROS."""

import numpy as np
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError, SceneError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene

BODIES = ('body', 'body_arm_raised')
TARGETS = ('front', 'left', 'high', 'behind', 'low')


def example_body(name: str) -> Scene:
    """Return the wearer of `msg_examples/NAME.yaml`."""
    return load_body(resource_path(f'msg_examples/{name}.yaml'))


def example_target(name: str) -> Array:
    """Return the target of `msg_examples/target_NAME.yaml`, (3,) in the base frame [m]."""
    file = resource_path(f'msg_examples/target_{name}.yaml')
    try:
        point = load_yaml(file)['point']
        return PointingGoal(np.array([point[axis] for axis in 'xyz'])).target
    except (KeyError, TypeError) as problem:
        raise SceneError(f'file {file}: {problem!r}; expected a point with x, y, z') from problem


def start_of(arm: ArmModel) -> Array:
    """Return the folded configuration of the examples; for other arms the mid-range, (dof,)."""
    try:
        state = load_yaml(resource_path('msg_examples/joint_states_folded.yaml'))
        positions = dict(zip(state['name'], state['position'], strict=True))
        q = np.array([float(positions[name]) for name in arm.joint_names])
    except (RrthError, KeyError, TypeError, ValueError):
        return np.asarray(arm.bounds.mean(axis=0))
    is_within = bool(((arm.bounds[0] <= q) & (q <= arm.bounds[1])).all())
    return q if is_within else np.asarray(arm.bounds.mean(axis=0))
