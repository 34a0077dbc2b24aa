# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm as a URDF: frames, joints and limits of its DH rows, bars and capsules as cylinders."""

from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
from rrth_planner.model.arm import ArmModel, Capsule, link_poses, NO_BARS
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import ModelError
from rrth_planner.model.rotation import roll_pitch_yaw, turned_to

MOUNT, TOOL = 'mount', 'tool'
# How much of the pointing ray is drawn, and how thick it is beside the bars.
RAY_LENGTH, RAY_WIDTH = 0.15, 0.4
# URDF requires the greatest force of a joint, which the description of an arm does not have.
EFFORT = 0.0
# Shorter bars are none [m].
SHORTEST = 1e-9
# Digits after the point: finer ones are rounding.
DIGITS = 15
COLOURS = {'bar': (0.29, 0.35, 0.42, 1.0), 'ray': (0.9, 0.15, 0.15, 0.6)}
HEADER = """
     Written by write_urdf from the DH rows of the arm; write it again rather than change it.
     Frame 0 of the arm is the link "mount", frame i the link of joint i, the pointing ray the +z
     axis of the link "tool". Metres, radians, seconds; effort 0 stands for unknown.
"""


def arm_to_urdf(
    arm: ArmModel, max_velocity: Array, radius: float, base_frame: str = 'torso', name: str = 'arm'
) -> str:
    """
    Return the URDF of an arm: links, joints with limits, visual bars, capsules; no masses.

    The base frame and the mount are fixed to each other, as are the last joint and the tool. A
    prismatic joint shows as a rod that slides through the place where it begins. Capsules are seen
    and collide: a cylinder and two spheres each.

    Parameters
    ----------
    max_velocity : ndarray, shape (dof,)
        [rad/s or m/s].
    radius : float
        Of the cylinders of bars that have no thickness of their own [m].
    base_frame, name : str
        The link that the arm is mounted on, and the robot.

    Raises
    ------
    ModelError
        A radius, velocity or name that is none, or two links or joints of one name.

    """
    if not 0.0 < radius < np.inf:
        raise ModelError(f'radius: {radius}, expected a length > 0 [m]')
    speeds = frozen_array(max_velocity, (arm.dof,), 'max_velocity', 'rad/s or m/s', ModelError)
    links = [base_frame, MOUNT, *(f'{joint}_link' for joint in arm.joint_names), TOOL]
    joints = [f'{MOUNT}_joint', *arm.joint_names, f'{TOOL}_joint']
    for what, names in (('links', links), ('joints', joints), ('robot', [name])):
        if len(set(names)) != len(names) or not all(n and n.isprintable() for n in names):
            raise ModelError(f'{what}: {names}, expected names, printable and all different')
    robot = ElementTree.Element('robot', name=name)
    robot.append(ElementTree.Comment(HEADER))
    for material, rgba in COLOURS.items():
        colour = ElementTree.SubElement(robot, 'material', name=material)
        ElementTree.SubElement(colour, 'color', rgba=_text(rgba))
    ElementTree.SubElement(robot, 'link', name=links[0])
    _add_joint(robot, joints[0], 'fixed', links[:2], arm.T_base_mount)
    poses = link_poses(arm, np.zeros(arm.dof))
    thickness = [float(r) or radius for r in arm.radii]
    has_bars = arm.radii != NO_BARS
    for i, link in enumerate(links[1:]):
        element = ElementTree.SubElement(robot, 'link', name=link)
        for capsule in arm.capsules:
            if capsule.link == i:
                _add_capsule(element, capsule)
        if i > 0 and has_bars[i - 1]:
            _add_bar(element, _along_z(arm, i - 1), 2, thickness[i - 1], 'bar')
        if i > arm.dof:
            _add_bar(element, (0.0, RAY_LENGTH), 2, RAY_WIDTH * thickness[-1], 'ray')
            break
        a = float(arm.dh[i, 1])
        if has_bars[i]:
            _add_bar(element, (min(0.0, a), max(0.0, a)), 0, thickness[i], 'bar')
        kind = 'fixed'
        if i < arm.dof:
            kind = 'prismatic' if arm.is_prismatic[i] else 'revolute'
            kind = 'continuous' if arm.is_continuous[i] else kind
        joint = _add_joint(robot, joints[i + 1], kind, links[i + 1 :], poses[i])
        if i < arm.dof:
            ElementTree.SubElement(joint, 'axis', xyz='0 0 1')
            lower, upper = arm.bounds[:, i].tolist()
            limit = {'velocity': float(speeds[i]), 'effort': EFFORT}
            if kind != 'continuous':
                limit = {'lower': lower, 'upper': upper, **limit}
            ElementTree.SubElement(joint, 'limit', {key: repr(x) for key, x in limit.items()})
    ElementTree.indent(robot)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(robot, encoding="unicode")}\n'


def _along_z(arm: ArmModel, i: int) -> tuple[float, float]:
    """Return from where to where the bar of row i lies on its own z axis [m]."""
    low = high = float(arm.dh[i, 3])
    if i < arm.dof and arm.is_prismatic[i]:
        low, high = low + float(arm.bounds[0, i]), high + float(arm.bounds[1, i])
    return -max(0.0, high), -min(0.0, low)


def _add_joint(
    robot: ElementTree.Element, name: str, kind: str, links: Sequence[str], pose: Array
) -> ElementTree.Element:
    joint = ElementTree.SubElement(robot, 'joint', name=name, type=kind)
    ElementTree.SubElement(joint, 'parent', link=links[0])
    ElementTree.SubElement(joint, 'child', link=links[1])
    _add_origin(joint, pose[:3, 3], roll_pitch_yaw(pose[:3, :3]))
    return joint


def _add_bar(
    link: ElementTree.Element, ends: tuple[float, float], axis: int, radius: float, material: str
) -> None:
    """Add a cylinder between two places on an axis of a link; cylinders lie along z."""
    length = ends[1] - ends[0]
    if length < SHORTEST:
        return
    visual = ElementTree.SubElement(link, 'visual')
    middle = np.zeros(3)
    middle[axis] = 0.5 * (ends[0] + ends[1])
    _add_origin(visual, middle, [0.0, 0.5 * np.pi if axis == 0 else 0.0, 0.0])
    geometry = ElementTree.SubElement(visual, 'geometry')
    ElementTree.SubElement(geometry, 'cylinder', radius=_text([radius]), length=_text([length]))
    ElementTree.SubElement(visual, 'material', name=material)


def _add_capsule(link: ElementTree.Element, capsule: Capsule) -> None:
    """Add a capsule to a link, once to be seen and once to collide."""
    begin, end = capsule.ends
    length = float(np.linalg.norm(end - begin))
    radius = _text([capsule.radius])
    if capsule.radius == 0.0:
        return
    solids: list[tuple[Array, Array, str, dict[str, str]]] = [
        (centre, np.eye(3), 'sphere', {'radius': radius})
        for centre in (capsule.ends if length > SHORTEST else capsule.ends[:1])
    ]
    if length > SHORTEST:
        size = {'radius': radius, 'length': _text([length])}
        solids.insert(
            0, (0.5 * (begin + end), turned_to((end - begin) / length), 'cylinder', size)
        )
    for tag in ('visual', 'collision'):
        for centre, rotation, solid, size in solids:
            element = ElementTree.SubElement(link, tag)
            _add_origin(element, centre, roll_pitch_yaw(rotation))
            geometry = ElementTree.SubElement(element, 'geometry')
            ElementTree.SubElement(geometry, solid, size)
            if tag == 'visual':
                ElementTree.SubElement(element, 'material', name='bar')


def _add_origin(
    element: ElementTree.Element, xyz: Sequence[float] | Array, rpy: Sequence[float] | Array
) -> None:
    ElementTree.SubElement(element, 'origin', xyz=_text(xyz), rpy=_text(rpy))


def _text(numbers: Sequence[float] | Array) -> str:
    # Adding 0 turns -0 into 0.
    return ' '.join(f'{round(float(x), DIGITS) + 0.0!r}'.removesuffix('.0') for x in numbers)
