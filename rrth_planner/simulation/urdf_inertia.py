# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Masses and inertias of an arm's links from the URDF that it was read from."""

from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.io.urdf.chain import UrdfChain
from rrth_planner.io.urdf.placed_robot import place_chain
from rrth_planner.model.arm import ArmModel, forward_kinematics
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import ModelError
from rrth_planner.simulation.mechanics import Inertia


def urdf_inertias(file: str | Path, arm: ArmModel) -> tuple[Inertia, ...]:
    """
    Return the inertias of what each joint of an arm moves, up to the next joint, by a URDF.

    Links that hang on others by joints beside the chain are fixed to them, those joints at 0.

    Raises
    ------
    ModelError, NotInstalledError
        A URDF that is not that of the arm, or in which no link that a joint moves has a mass; what
        reads it is missing.

    """
    file = Path(file)
    chain, T_base_link = place_chain(file, arm)
    frames = forward_kinematics(arm, np.zeros(arm.dof))
    masses: list[list[tuple[float, Array, Array]]] = [[] for _ in range(arm.dof)]
    for link, body, T in _moved_links(chain):
        inertial = link.inertial
        if body == 0 or inertial is None or not inertial.mass:
            continue
        own = np.eye(4) if inertial.origin is None else inertial.origin
        pose = np.linalg.inv(frames[body - 1]) @ T_base_link @ T @ own
        tensor = np.zeros((3, 3)) if inertial.inertia is None else np.asarray(inertial.inertia)
        turned = pose[:3, :3] @ tensor @ pose[:3, :3].T
        masses[body - 1].append((float(inertial.mass), pose[:3, 3], turned))
    for name, parts in zip(arm.joint_names, masses, strict=True):
        if not parts:
            raise ModelError(
                f'file {file}: no mass in the links that joint "{name}" moves, expected '
                '<inertial> in at least one of them'
            )
    return tuple(map(_together, masses))


def _together(parts: list[tuple[float, Array, Array]]) -> Inertia:
    """Return the inertia of bodies that are fixed to each other (Steiner's theorem)."""
    mass = sum(m for m, _, _ in parts)
    center = sum((m * c for m, c, _ in parts), np.zeros(3)) / mass
    tensor = np.zeros((3, 3))
    for m, c, own in parts:
        r = c - center
        tensor += own + m * (r @ r * np.eye(3) - np.outer(r, r))
    return Inertia(mass=mass, center=center, tensor=0.5 * (tensor + tensor.T))


def _moved_links(chain: UrdfChain) -> list[tuple[Any, int, Array]]:
    """Return the links from the base on, how many joints of the chain move each, and its pose."""
    links = {link.name: link for link in chain.robot.links}
    moving = [joint.name for joint in chain.moving]
    found = [(links[chain.base], 0, np.eye(4))]
    for link, body, T in found:
        for joint in chain.robot.joints:
            if joint.parent == link.name:
                own = np.eye(4) if joint.origin is None else joint.origin
                after = moving.index(joint.name) + 1 if joint.name in moving else body
                found.append((links[joint.child], after, T @ own))
    return found
