# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the playback."""

from collections.abc import Sequence

import numpy as np
from rclpy.node import Node
from rrth_planner.execution.playback import PlaybackRules
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.joint_range import start_bounds
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.ros.middleware.parameter_declaration import ARM, declare, reject_unknown, Setting

FOLDED = [0.0, -0.35, np.pi / 2, np.pi / 2]
EACH = 'a value for each joint, or one for all'

SETTINGS = (
    ARM,
    Setting('base_frame', 'torso', 'frame id', 'frame of the tool pose', is_read_only=True),
    Setting('rate', 100.0, 'Hz', 'joint states per second', 1.0, 1000.0, True),
    Setting(
        'initial_positions', FOLDED, 'rad', 'where each joint is at the start', -1e4, 1e4, True
    ),
    Setting(
        'max_velocity', [1.5], 'rad/s', f'a faster motion is rejected; {EACH}', 1e-3, 1e6, True
    ),
    Setting(
        'max_acceleration',
        [4.0],
        'rad/s^2',
        f'a motion with more is rejected, stops keep to it; {EACH}',
        1e-3,
        1e6,
        True,
    ),
    Setting('max_jerk', [40.0], 'rad/s^3', f'stops keep to it; {EACH}', 1e-2, 1e8, True),
    Setting(
        'time_scale',
        1.0,
        '-',
        'seconds of a motion per second, from the next motion on; 0.1: slow motion',
        0.01,
        1.0,
    ),
    Setting(
        'start_tolerance',
        0.01,
        'rad and rad/s',
        'greatest distance of a new motion from the present state',
        1e-6,
        0.1,
    ),
    Setting(
        'lag',
        0.0,
        's',
        'of the arm behind its command: joint states are those that it had so long before',
        0.0,
        1.0,
        True,
    ),
)


def declare_playback_parameters(node: Node) -> ArmModel:
    """
    Declare all parameters on a node and return its arm.

    Raises
    ------
    RrthError
        A value that the node was started with is rejected, or describes no arm.

    """
    reject_unknown(node, SETTINGS)
    declare(node, SETTINGS)
    arm = load_arm(node.get_parameter(ARM.name).value)
    playback_rules(node, arm)
    return arm


def playback_rules(node: Node, arm: ArmModel) -> PlaybackRules:
    """Return the rules that a node's parameters are now, or raise OptionsError."""
    return PlaybackRules(
        start_tolerance=node.get_parameter('start_tolerance').value,
        time_scale=node.get_parameter('time_scale').value,
        limits=MotionLimits(
            **{
                name: of_each_joint(node, arm, f'max_{name}')
                for name in ('velocity', 'acceleration', 'jerk')
            }
        ),
    )


def initial_positions(node: Node, arm: ArmModel) -> Sequence[float]:
    """Return where a node's arm is at the start, (dof,) [rad], or raise OptionsError."""
    q = node.get_parameter('initial_positions').value
    if len(q) != arm.dof:
        raise OptionsError(
            f'initial_positions: {len(q)} values, expected {arm.dof}, one for each of '
            f'{list(arm.joint_names)} [rad]'
        )
    for name, value, low, high in zip(arm.joint_names, q, *start_bounds(arm), strict=True):
        if not low <= value <= high:
            raise OptionsError(
                f'initial_positions: {name} at {value}, expected {low:.4f} to {high:.4f} [rad]'
            )
    return list(q)


def of_each_joint(node: Node, arm: ArmModel, name: str) -> Array:
    """Return what a parameter says of each joint, (dof,), or raise OptionsError."""
    values = node.get_parameter(name).value
    if len(values) not in (1, arm.dof):
        raise OptionsError(
            f'{name}: {len(values)} values, expected {arm.dof}, one for each of '
            f'{list(arm.joint_names)}, or one for all'
        )
    return np.broadcast_to(np.asarray(values, dtype=np.float64), (arm.dof,))
