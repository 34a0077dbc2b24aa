# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The robot of a URDF with its meshes, placed where an arm is, for a picture of both."""

from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from rrth_planner.io.extras import require
from rrth_planner.io.text_file import load_xml
from rrth_planner.io.urdf.chain import (
    joint_axis,
    NO_URDF,
    read_chain,
    TOOLS,
    urdf_model,
    UrdfChain,
)
from rrth_planner.io.urdf.geometry import collada_unit, mesh_file
from rrth_planner.model.arm import ArmModel, forward_kinematics
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import ModelError

# colcon does not install it; an error says so when a file is read.
with suppress(ImportError):
    import yourdfpy

# A joint of the URDF this near to that of the arm is the same one [m, rad].
SAME_JOINT = 2e-3
# The types of joints that have an axis.
MOVING = ('revolute', 'continuous', 'prismatic')


@dataclass(frozen=True, slots=True, eq=False)
class PlacedRobot:
    """
    A robot and where it stands.

    Parameters
    ----------
    model : yourdfpy.URDF
        With the meshes that are to be seen.
    T_base_root : ndarray, shape (4, 4)
        Pose of its root link in the wearer's base frame [m].
    columns : tuple of int
        Of the arm's joints among those of the robot.

    """

    model: Any
    T_base_root: Array
    columns: tuple[int, ...]

    def values(self, q: Array) -> Array:
        """Return the values of all joints, where those of the arm are at q, (dof,) [rad or m]."""
        found = np.zeros(len(self.model.actuated_joint_names))
        for k, joint in enumerate(self.model.actuated_joints):
            if joint.limit is not None and joint.limit.lower is not None:
                found[k] = np.clip(0.0, joint.limit.lower, joint.limit.upper)
        found[list(self.columns)] = q
        return found


def place_robot(file: str | Path, arm: ArmModel) -> PlacedRobot:
    """
    Return the robot of a URDF where an arm is that was read from it: by the axes of its joints.

    Raises
    ------
    ModelError, NotInstalledError
        A URDF without the arm's joints, or whose joints have other axes; a mesh that cannot be
        read; what reads it is missing.

    """
    file = Path(file)
    chain, T_base_link = place_chain(file, arm)
    base = chain.base
    model = _with_meshes(file)
    order = list(model.actuated_joint_names)
    columns = tuple(order.index(name) for name in arm.joint_names)
    robot = PlacedRobot(model, T_base_link, columns)
    # Joints between the root and the arm stay where they are here.
    model.update_cfg(robot.values(np.zeros(arm.dof)))
    link = np.asarray(model.get_transform(base, model.base_link))
    return replace(robot, T_base_root=T_base_link @ np.linalg.inv(link))


def place_chain(file: Path, arm: ArmModel) -> tuple[UrdfChain, Array]:
    """
    Return the chain of a URDF from which an arm was read, and where its first link is.

    The link's pose is that in the wearer's base frame, (4, 4) [m].

    Raises
    ------
    ModelError, NotInstalledError
        As `place_robot`.

    """
    require('tools', *TOOLS)
    joints = {
        joint.name: joint for joint in urdf_model(load_xml(file), f'file {file}').robot.joints
    }
    missing = [name for name in arm.joint_names if name not in joints]
    if missing:
        raise ModelError(
            f'file {file}: no joint "{missing[0]}", expected those of the arm, '
            f'{", ".join(arm.joint_names)}'
        )
    base, tool = joints[arm.joint_names[0]].parent, joints[arm.joint_names[-1]].child
    chain = read_chain(file, base, tool)
    names = tuple(joint.name for joint in chain.moving)
    if names != arm.joint_names:
        raise ModelError(
            f'file {file}: joints {", ".join(names)} from link "{base}" to "{tool}", expected '
            f'those of the arm, {", ".join(arm.joint_names)}'
        )
    poses = forward_kinematics(arm, np.zeros(arm.dof))[: arm.dof]
    T_base_link = _fitted(
        (chain.points[:-1], chain.directions[:-1]), (poses[:, :3, 3], poses[:, :3, 2])
    )
    if T_base_link is None:
        raise ModelError(f'file {file}: its joints have other axes than those of the arm')
    return chain, T_base_link


def _with_meshes(file: Path) -> Any:
    """Return the robot of a file with the meshes of its links, or raise ModelError."""
    label = f'file {file}'
    robot = urdf_model(load_xml(file), label).robot
    for joint in robot.joints:
        # yourdfpy moves what slides by the length of its axis.
        if joint.type in MOVING:
            joint.axis = joint_axis(joint)
    for link in robot.links:
        for part in link.visuals:
            mesh = None if part.geometry is None else part.geometry.mesh
            if mesh is not None and mesh.filename:
                mesh.scale = _in_metres(mesh, file, f'link "{link.name}"')
    try:
        return yourdfpy.URDF(
            robot=robot,
            build_scene_graph=True,
            load_meshes=True,
            filename_handler=lambda fname: str(mesh_file(fname, file, 'mesh')),
        )
    except NO_URDF as problem:
        said = ' '.join(f'{type(problem).__name__}: {problem}'.split())
        raise ModelError(f'{label}: {said}; expected meshes that can be read') from problem


def _in_metres(mesh: Any, file: Path, label: str) -> Any:
    """Return the scale of a mesh, with the unit of its file: a number, (3,), or None for 1."""
    path = mesh_file(mesh.filename, file, label)
    if path.suffix.lower() != '.dae':
        return mesh.scale
    try:
        unit = collada_unit(path)
    except (OSError, ValueError, ElementTree.ParseError) as problem:
        raise ModelError(f'{label}: file {path}: {problem}; expected a readable mesh') from problem
    return unit if mesh.scale is None else unit * mesh.scale


def _fitted(lines: tuple[Array, Array], places: tuple[Array, Array]) -> Array | None:
    """
    Return the pose, (4, 4), that takes lines to where they are, or None where none does.

    Lines are points, (n, 3) [m], and directions, (n, 3); a point may be anywhere on its line.
    """
    (points, directions), (targets, axes) = lines, places
    # The rotation, by the method of Kabsch (1976); at least two joints turn about different axes.
    u, _, vt = np.linalg.svd(axes.T @ directions)
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    # Across each axis the points have to agree.
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    turned = points @ rotation.T
    wanted = np.einsum('nij,nj->ni', across, targets - turned).ravel()
    shift, *_ = np.linalg.lstsq(across.reshape(-1, 3), wanted, rcond=None)
    off = np.abs(across.reshape(-1, 3) @ shift - wanted).max()
    tilt = np.abs(directions @ rotation.T - axes).max()
    if not max(off, tilt) < SAME_JOINT:
        return None
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, shift
    return T
