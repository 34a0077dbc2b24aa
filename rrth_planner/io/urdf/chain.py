# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The serial chain between two links of a URDF."""

from contextlib import suppress
from dataclasses import dataclass
import io
import logging
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from rrth_planner.io.extras import require
from rrth_planner.io.text_file import load_xml
from rrth_planner.io.urdf.tool_link import only_tool, reject_jaw
from rrth_planner.io.urdf.version_1_0 import say_in_version_1_0
from rrth_planner.model.arrays import Array, FARTHEST, frozen_array
from rrth_planner.model.errors import ModelError, printable, shown

# colcon does not install them; an error says so when a file is read.
with suppress(ImportError):
    from trimesh import transformations
    import yourdfpy

TOOLS = ('yourdfpy', 'trimesh')
RAYS = {
    sign + axis: value * np.eye(3)[k]
    for sign, value in (('+', 1.0), ('-', -1.0), ('', 1.0))
    for k, axis in enumerate('xyz')
}
# What the library raises, depending on which part of a file is missing.
NO_URDF = (
    ArithmeticError,
    AttributeError,
    LookupError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
)
# Roll, pitch and yaw this near to right angles are right angles, written with few digits [rad].
SQUARE = 5e-5


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class UrdfChain:
    """
    The joints between two links, all positions at 0, in the frame of the first link.

    Parameters
    ----------
    name, base, tool : str
        Of the robot and of the two links.
    joints, moving : tuple of yourdfpy.Joint
        All from base to tool, as they are in the file, and those that move.
    bounds : ndarray, shape (2, dof)
        [rad or m], one turn, +-pi, for continuous joints.
    points, directions : ndarray, shape (dof + 1, 3)
        The joints' origins [m] and axes; last the tool's origin and its ray.
    x_first : ndarray, shape (3,)
        The x axis of the first joint's frame.
    ray : ndarray, shape (3,)
        The pointing ray in the tool's link.
    robot : yourdfpy.Robot
        All links and joints of the file.
    file : Path
        Where the names of its mesh files begin.

    """

    name: str
    base: str
    tool: str
    joints: tuple[Any, ...]
    moving: tuple[Any, ...]
    bounds: Array
    points: Array
    directions: Array
    x_first: Array
    ray: Array
    robot: Any
    file: Path

    def tool_pose(self, q: Array) -> Array:
        """
        Return the tool link's pose in the base link, (dof,) [rad or m] -> (4, 4) [m].

        Computed from the URDF itself, origin after origin, without DH parameters.
        """
        T = np.eye(4)
        values = iter(np.asarray(q).tolist())
        for joint in self.joints:
            if joint.origin is not None:
                T = T @ joint.origin
            if joint.type != 'fixed':
                T = T @ joint_motion(joint, next(values))
        return np.asarray(T)


def read_chain(
    path: str | Path,
    base: str | None = None,
    tool: str | None = None,
    ray: str = '+z',
    *,
    takes_jaw: bool = True,
) -> UrdfChain:
    """
    Return the chain of a URDF file, whose meshes are not looked for.

    Parameters
    ----------
    base, tool : str, optional
        The links that it leads from and to: the root and, where there is only one, the last link.
    ray : str
        Which axis of the tool's link is the pointing ray: +x, -x, +y, -y, +z or -z.
    takes_jaw : bool
        Whether the tool may be what looks like the jaw of a gripper.

    Raises
    ------
    ModelError, NotInstalledError
        No URDF, no chain of joints that an arm may have; what reads it is missing.

    """
    require('tools', *TOOLS)
    if ray not in RAYS:
        raise ModelError(f'ray: {ray!r}, expected one of +x, -x, +y, -y, +z, -z')
    model = urdf_model(load_xml(path), f'file {path}')
    joints, base, tool = _between(model, base, tool, takes_jaw)
    T, frames, moving = np.eye(4), [], []
    for joint in joints:
        if joint.origin is not None:
            T = T @ squared(joint.origin)
        if joint.type != 'fixed':
            moving.append(joint)
            frames.append(T)
    if not moving:
        raise ModelError(
            f'URDF {path}: no joint moves between "{base}" and "{tool}", expected one'
        )
    axes = [R[:3, :3] @ joint_axis(joint) for R, joint in zip(frames, moving, strict=True)]
    limits = [joint_limits(joint) for joint in moving]
    return UrdfChain(
        name=str(model.robot.name),
        base=base,
        tool=tool,
        joints=tuple(joints),
        moving=tuple(moving),
        bounds=np.array(limits).T,
        points=np.array([T_joint[:3, 3] for T_joint in (*frames, T)]),
        directions=np.array([*axes, T[:3, :3] @ RAYS[ray]]),
        x_first=frames[0][:3, 0],
        ray=RAYS[ray],
        robot=model.robot,
        file=Path(path),
    )


def urdf_model(root: ElementTree.Element, label: str) -> Any:
    """Return the robot of a URDF without meshes, or raise ModelError naming it by a label."""
    logging.getLogger('yourdfpy').setLevel(logging.CRITICAL)
    text = urdf_text(root, label)
    try:
        model = yourdfpy.URDF.load(text, build_scene_graph=False, load_meshes=False)
    except NO_URDF as problem:
        said = ' '.join(f'{type(problem).__name__}: {problem}'.split())
        raise ModelError(f'{label}: no URDF ({said}), expected one') from problem
    for element in (model.robot, *model.robot.links, *model.robot.joints):
        printable(element.name, 'name', ModelError)
    return model


def urdf_text(root: ElementTree.Element, label: str) -> io.BytesIO:
    """Return a URDF as yourdfpy reads it, or raise ModelError naming it by a label."""
    # Strictly, where yourdfpy would make something of any file.
    if any('xacro' in element.tag for element in root.iter()):
        raise ModelError(f'{label}: a xacro file, expected a URDF (xacro FILE > arm.urdf)')
    say_in_version_1_0(root, label)
    return io.BytesIO(ElementTree.tostring(root))


def _between(
    model: Any, base: str | None, tool: str | None, takes_jaw: bool
) -> tuple[list[Any], str, str]:
    """Return the joints that lead from one link to another, and the two links."""
    links = {link.name: link for link in model.robot.links}
    above = {joint.child: joint for joint in model.robot.joints}
    parents = {joint.parent for joint in model.robot.joints}
    for joint in model.robot.joints:
        for which, link in (('parent', joint.parent), ('child', joint.child)):
            if link not in links:
                raise ModelError(
                    f'joint "{joint.name}": its {which} link "{link}" is not declared, expected '
                    f'one of {shown(list(links))}'
                )
    if len(above) < len(model.robot.joints):
        raise ModelError('URDF: two joints lead to the same link, expected a tree of links')
    if base is None:
        base = _root([link for link in links if link not in above])
    if tool is None and base in links:
        ends = [link for link in links if link not in parents]
        tool = only_tool(model.robot, base, ends, takes_jaw)
    for option, link in (('base', base), ('tool', tool)):
        if link not in links:
            raise ModelError(
                f'--{option} {link}: no link of the URDF, expected one of {shown(list(links))}'
            )
    assert tool is not None
    joints: list[Any] = []
    link = tool
    while link != base:
        if link not in above or len(joints) > len(links):
            raise ModelError(f'links "{base}" and "{tool}": no chain of joints from first to last')
        joints.insert(0, above[link])
        link = joints[0].parent
    if not takes_jaw:
        reject_jaw(model.robot, joints, tool)
    for joint in joints:
        if joint.type not in ('revolute', 'continuous', 'prismatic', 'fixed'):
            raise ModelError(
                f'joint "{joint.name}": {joint.type}, expected revolute, continuous, prismatic or '
                'fixed ones between base and tool'
            )
        if joint.mimic is not None:
            raise ModelError(
                f'joint "{joint.name}": moves with "{joint.mimic.joint}", expected joints that '
                'move by themselves between base and tool'
            )
    return joints, base, tool


def _root(links: list[str]) -> str:
    if not links:
        raise ModelError('URDF: no link to which no joint leads, expected one, the root')
    if len(links) > 1:
        raise ModelError(
            f'give --base LINK: no joint leads to {len(links)} links, {shown(links)}, expected one'
        )
    return links[0]


def joint_axis(joint: Any) -> Array:
    """Return the unit axis of a joint, or raise ModelError."""
    label = f'joint "{joint.name}": axis'
    axis = frozen_array(joint.axis, (3,), label, '-', ModelError, FARTHEST)
    length = float(np.linalg.norm(axis))
    if not length > 1e-9:
        raise ModelError(f'{label} {axis.tolist()}, expected three numbers, not all 0 [-]')
    return np.asarray(axis / length)


def joint_motion(joint: Any, value: float) -> Array:
    """Return the pose that a joint at a position [rad or m] gives what it moves, (4, 4) [m]."""
    axis = joint_axis(joint)
    if joint.type == 'prismatic':
        return np.asarray(transformations.translation_matrix(value * axis))
    return np.asarray(transformations.rotation_matrix(value, axis))


def joint_limits(joint: Any) -> tuple[float, float]:
    """Return how far a joint moves, +-pi if it is continuous [rad or m], or raise ModelError."""
    if joint.type == 'continuous':
        return -math.pi, math.pi
    limit, unit = joint.limit, 'm' if joint.type == 'prismatic' else 'rad'
    if limit is None or limit.lower is None or limit.upper is None:
        raise ModelError(f'joint "{joint.name}": no limits, expected lower and upper [{unit}]')
    if not -math.inf < limit.lower < limit.upper < math.inf:
        raise ModelError(
            f'joint "{joint.name}": limits {limit.lower} and {limit.upper}, expected '
            f'lower < upper [{unit}]'
        )
    soft_lower, soft_upper = soft_limits(joint)
    lower, upper = max(limit.lower, soft_lower), min(limit.upper, soft_upper)
    if not lower < upper:
        raise ModelError(
            f'joint "{joint.name}": soft limits {soft_lower} and {soft_upper} of '
            f'safety_controller, expected a range within its limits, {limit.lower} to '
            f'{limit.upper} [{unit}]'
        )
    return lower, upper


def soft_limits(joint: Any) -> tuple[float, float]:
    """
    Return between which positions a safety_controller keeps a joint [rad or m].

    +-inf where it does not. Both 0 is what URDF 1.0 takes where none are given.
    """
    given = joint.safety_controller
    if given is None or not (given.soft_lower_limit or given.soft_upper_limit):
        return -math.inf, math.inf
    lower, upper = (
        end if value is None else value
        for value, end in (
            (given.soft_lower_limit, -math.inf),
            (given.soft_upper_limit, math.inf),
        )
    )
    if math.isnan(lower) or math.isnan(upper):
        raise ModelError(
            f'joint "{joint.name}": soft limits {lower} and {upper} of safety_controller, '
            'expected numbers [rad or m]'
        )
    return lower, upper


def squared(T: Array) -> Array:
    """Return the origin of a joint with angles that were meant to be right angles made right."""
    angles = np.array(transformations.euler_from_matrix(T))
    right = 0.5 * np.pi * np.round(angles / (0.5 * np.pi))
    meant = np.where(np.abs(angles - right) < SQUARE, right, angles)
    squared = np.array(transformations.euler_matrix(*meant))
    squared[:3, 3] = T[:3, 3]
    return squared
