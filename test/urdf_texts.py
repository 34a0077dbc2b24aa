# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""URDF files that the tests write: chains of any shape."""

import xml.etree.ElementTree as ElementTree

import numpy as np

QUARTER = np.pi / 2
AXES = np.array([(0, 0, 1), (1, 0, 0), (0, -1, 0), (0.6, 0, 0.8), (0.3, -0.4, 0.5)], float)


def joint(name, kind, parent, child, **tags):
    """Return a joint, attributes of its tags as mappings."""
    element = ElementTree.Element('joint', name=name, type=kind)
    ElementTree.SubElement(element, 'parent', link=parent)
    ElementTree.SubElement(element, 'child', link=child)
    for tag, attributes in tags.items():
        ElementTree.SubElement(element, tag, attributes)
    return element


def numbers(values):
    """Return numbers as a URDF holds them, to the bit."""
    return ' '.join(repr(float(value)) for value in values)


def urdf(joints):
    """Return the text of a URDF with these joints, and the links that they name."""
    robot = ElementTree.Element('robot', name='random')
    links = {}
    for element in joints:
        for tag in ('parent', 'child'):
            links.setdefault(element.find(tag).get('link'))
    for name in links:
        ElementTree.SubElement(robot, 'link', name=name)
    robot.extend(joints)
    return ElementTree.tostring(robot, encoding='unicode')


def random_urdf(rng):
    """Return a chain of 1 to 7 moving joints: skew, parallel, meeting and coincident axes."""
    dof = int(rng.integers(1, 8))
    joints, parent = [], 'base'
    kinds = []
    for _ in range(dof):
        kinds += ['fixed'] if rng.random() < 0.3 else []
        kinds.append(str(rng.choice(['revolute', 'continuous', 'prismatic'], p=[0.6, 0.2, 0.2])))
    for i, kind in enumerate([*kinds, 'fixed']):
        square = rng.choice([0.0, QUARTER, -QUARTER, 2 * QUARTER], 3)
        rpy = np.where(rng.random(3) < 0.7, square, rng.uniform(-3.0, 3.0, 3))
        xyz = np.where(rng.random(3) < 0.6, 0.0, rng.uniform(-0.3, 0.3, 3))
        axis = AXES[rng.integers(len(AXES))]
        low, high = (-0.4, 0.3) if kind == 'prismatic' else (-3.0, 2.5)
        joints.append(
            joint(
                f'j{i}',
                kind,
                parent,
                f'l{i}',
                origin={'xyz': numbers(xyz), 'rpy': numbers(rpy)},
                axis={'xyz': numbers(axis / np.linalg.norm(axis))},
                limit={'lower': repr(low), 'upper': repr(high), 'effort': '1', 'velocity': '2'},
            )
        )
        parent = f'l{i}'
    # A branch, which is none of the chain's business.
    joints.append(joint('finger', 'floating', 'base', 'hand'))
    return urdf(joints), parent
