# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How fast the tool of an arm gets."""

import itertools

import numpy as np
from rrth_planner.model.arm import ArmModel, forward_kinematics
from rrth_planner.model.arrays import Array

POSTURES = 256


def top_tool_speed(arm: ArmModel, max_velocity: Array) -> float:
    """
    Return how fast the tool gets when every joint moves at its limit [m/s].

    It is the greatest of many random postures, the same ones each time.
    """
    q = random_postures(arm)
    poses = forward_kinematics(arm, q)
    axes, tool = poses[:, :-1, :3, 2], poses[:, -1:, :3, 3]
    turns = np.cross(axes, tool - poses[:, :-1, :3, 3])
    columns = np.where(np.array(arm.is_prismatic)[:, None], axes, turns) * max_velocity[:, None]
    signs = np.array([(1.0, *rest) for rest in itertools.product((1.0, -1.0), repeat=arm.dof - 1)])
    return float(np.linalg.norm(signs @ columns, axis=-1).max())


def random_postures(arm: ArmModel) -> Array:
    """Return random configurations, the same ones each time, (n, dof) [rad or m]."""
    share = np.random.default_rng(0).random((POSTURES, arm.dof))
    postures: Array = arm.bounds[0] + share * (arm.bounds[1] - arm.bounds[0])
    return postures
