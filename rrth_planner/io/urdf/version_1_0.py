# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
A URDF of version 1.1 or 1.2, said in the words of 1.0, which is all that yourdfpy reads.

1.1 adds `quat_xyzw` to origins and `<capsule>` to geometries; 1.2 adds limits of acceleration,
deceleration and jerk, which are left as they are (README of urdfdom 6.0).
"""

from copy import deepcopy
import math
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from rrth_planner.model.arrays import Array, FARTHEST, frozen_array
from rrth_planner.model.errors import ModelError, shown
from rrth_planner.model.rotation import roll_pitch_yaw, rotation_matrix

# The version that has quaternions and capsules.
SINCE = (1, 1)


def say_in_version_1_0(root: Element, label: str) -> None:
    """
    Change the elements of a URDF that has been read; label: what sentences call the file.

    The orientation of an origin becomes roll, pitch and yaw; a capsule becomes a cylinder between
    two spheres, each with an origin of its own.

    Raises
    ------
    ModelError
        An origin that is none, a capsule without a size, or one of them where the version of the
        file has none: urdfdom ignores it there.

    """
    version = _version(root)
    for owner in root.iter():
        for origin in owner.findall('origin'):
            what = f'{label}: origin of {_name_of(owner)}'
            if origin.get('quat_xyzw') is not None:
                _demand(version, what, 'quat_xyzw')
                _turn_by_rpy(origin, what)
            for name, unit in (('xyz', 'm'), ('rpy', 'rad')):
                _numbers(origin.get(name, '0 0 0'), 3, f'{what}: {name}', unit)
    for link in root.iter('link'):
        for kind in ('collision', 'visual'):
            for part in link.findall(kind):
                capsule = part.find('geometry/capsule')
                if capsule is None:
                    continue
                what = f'{label}: capsule of link {shown(link.get("name"))}'
                _demand(version, what, '<capsule>')
                place = list(link).index(part)
                link.remove(part)
                for k, piece in enumerate(_pieces(part, capsule, what)):
                    link.insert(place + k, piece)


def _version(root: Element) -> tuple[int, ...]:
    """Return the version of a URDF, (1, 0) where it gives none, () where that is none."""
    words = root.get('version', '1.0').split('.')
    return tuple(int(word) for word in words) if all(word.isdecimal() for word in words) else ()


def _demand(version: tuple[int, ...], what: str, given: str) -> None:
    if version < SINCE:
        raise ModelError(
            f'{what}: write <robot version="1.1"> to use {given}, which an older version does '
            'not have and ROS ignores there'
        )


def _name_of(owner: Element) -> str:
    name = owner.get('name')
    return owner.tag if name is None else f'{owner.tag} {shown(name)}'


def _numbers(given: str, n: int, label: str, unit: str) -> Array:
    """Return so many finite numbers, (n,): yourdfpy would accept and change others."""
    try:
        numbers = [float(word) for word in given.split()]
    except ValueError as problem:
        raise ModelError(f'{label}={shown(given)}, expected {n} numbers [{unit}]') from problem
    return frozen_array(numbers, (n,), label, unit, ModelError, FARTHEST)


def _turn_by_rpy(origin: Element, what: str) -> None:
    """Replace the quaternion of an origin, which need not have the length 1, by three angles."""
    if origin.get('rpy') is not None:
        raise ModelError(f'{what}: give rpy or quat_xyzw, not both')
    q = _numbers(origin.attrib.pop('quat_xyzw'), 4, f'{what}: quat_xyzw', '-')
    if np.linalg.norm(q) < 1e-6:
        raise ModelError(f'{what}: quat_xyzw all zero, expected a unit quaternion [-]')
    origin.set('rpy', ' '.join(map(repr, roll_pitch_yaw(rotation_matrix(q)).tolist())))


def _pieces(part: Element, capsule: Element, what: str) -> list[Element]:
    """Return a collision or visual for the cylinder of a capsule and for each of its ends."""
    sizes = [
        _numbers(capsule.get(name, ''), 1, f'{what}: {name}', 'm')[0]
        for name in ('radius', 'length')
    ]
    radius, length = (float(size) for size in sizes)
    if not (radius > 0.0 and length >= 0.0):
        raise ModelError(
            f'{what}: radius {radius:g} and length {length:g}, expected a radius > 0 and a length '
            '>= 0 of its cylinder [m]'
        )
    sphere, cylinder = Element('sphere'), Element('cylinder')
    for shape in (sphere, cylinder):
        shape.set('radius', repr(radius))
    cylinder.set('length', repr(length))
    ends = [0.5 * length, -0.5 * length] if length > 0.0 else [0.0]
    pieces = [(0.0, cylinder)] if length > 0.0 else []
    return [_moved(part, shape, along) for along, shape in [*pieces, *((z, sphere) for z in ends)]]


def _moved(part: Element, shape: Element, along: float) -> Element:
    """Return a collision or visual with another shape, moved along its z axis [m]."""
    result = deepcopy(part)
    (geometry,) = result.findall('geometry')[:1]
    geometry.clear()
    geometry.append(deepcopy(shape))
    origin = result.find('origin')
    if origin is None:
        origin = SubElement(result, 'origin')
    xyz, (roll, pitch, yaw) = (
        [float(word) for word in origin.get(name, '0 0 0').split()] for name in ('xyz', 'rpy')
    )
    # The z axis, turned about the fixed x, y and z in turn.
    x, y, z = math.sin(pitch) * math.cos(roll), -math.sin(roll), math.cos(pitch) * math.cos(roll)
    c, s = math.cos(yaw), math.sin(yaw)
    axis = np.array([c * x - s * y, s * x + c * y, z])
    origin.set('xyz', ' '.join(repr(float(value)) for value in np.array(xyz) + along * axis))
    return result
