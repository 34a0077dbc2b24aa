# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The robot of a URDF stands where the arm is that was read from it."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('trimesh')
pytest.importorskip('yourdfpy')

from rrth_planner.io.urdf.chain import read_chain
from rrth_planner.io.urdf.import_chain import import_chain
from rrth_planner.io.urdf.placed_robot import place_robot
from rrth_planner.model.errors import ModelError
from rrth_planner.model.rotation import pose_matrix
import worlds

LINK = '<link name="{0}"><visual><geometry>{1}</geometry></visual></link>'
BOX = '<box size="0.1 0.1 0.2"/>'
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin {4}/>'
    '<axis xyz="{5}"/><limit lower="{6}" upper="1" effort="1" velocity="1"/></joint>'
)
# A lift below the arm, three joints of the arm, and a finger that is never at 0.
JOINTS = (
    ('lift', 'prismatic', 'root', 'column', 'xyz="0 0 0.4"', '0 0 1', '0.2'),
    ('a', 'revolute', 'column', 'upper', 'xyz="0.1 0.2 0" rpy="0.3 0 0.2"', '0 0 1', '-1'),
    ('b', 'revolute', 'upper', 'lower', 'xyz="0 0.05 0.3" rpy="0 0.4 0"', '0 -1 0', '-1'),
    ('c', 'continuous', 'lower', 'hand', 'xyz="0.2 0 0.1"', '1 0 0', '-1'),
    ('finger', 'prismatic', 'hand', 'tip', 'xyz="0.1 0 0"', '0 1 0', '0.01'),
)


def urdf(folder, joints=JOINTS, shape=BOX):
    """Return a file of such a robot."""
    names = ['root', *(joint[3] for joint in joints)]
    links = ''.join(LINK.format(name, shape) for name in names)
    text = ''.join(JOINT.format(*joint) for joint in joints)
    (folder / 'robot.urdf').write_text(f'<robot name="r">{links}{text}</robot>')
    return folder / 'robot.urdf'


def arm_of(file):
    """Return the arm from the column to the hand, and where the column is worn."""
    mount = pose_matrix([-0.4, 0.1, 0.2], [0.1, 0.0, 0.3, 0.9])
    return import_chain(read_chain(file, 'column', 'hand', '+x'), mount, 0.02), mount


def test_every_link_is_where_the_arm_has_it(tmp_path):
    file = urdf(tmp_path)
    found, mount = arm_of(file)
    robot = place_robot(file, found.arm)
    rng = np.random.default_rng(0)
    for q in rng.uniform(*found.arm.bounds, (20, 3)):
        values = robot.values(q)
        np.testing.assert_array_equal(values, [0.2, *q, 0.01])
        robot.model.update_cfg(values)
        hand = robot.T_base_root @ robot.model.get_transform('hand', 'root')
        # The lift is at its lower limit, not at 0, and the column is worn there.
        column = robot.T_base_root @ robot.model.get_transform('column', 'root')
        np.testing.assert_allclose(column, mount, atol=1e-9)
        np.testing.assert_allclose(hand, mount @ found.chain.tool_pose(q), atol=1e-9)


@pytest.mark.parametrize(
    ('change', 'sentence'),
    [
        (lambda file: replace(arm_of(file)[0].arm, joint_names=('a', 'x', 'c')), 'no joint "x"'),
        (
            lambda file: replace(arm_of(file)[0].arm, joint_names=('a', 'c', 'b')),
            'expected those of the arm, a, c, b',
        ),
        (
            lambda file: replace(worlds.table_1_arm(), joint_names=('lift', 'a', 'b', 'c')),
            'other axes than those of the arm',
        ),
    ],
)
def test_another_arm_is_rejected_in_one_sentence(tmp_path, change, sentence):
    file = urdf(tmp_path)
    with pytest.raises(ModelError, match=sentence):
        place_robot(file, change(file))


def test_a_mesh_that_is_missing_is_one_sentence(tmp_path):
    file = urdf(tmp_path, shape='<mesh filename="package://none/part.stl"/>')
    with pytest.raises(ModelError, match='no mesh .package://none/part.stl'):
        place_robot(file, arm_of(file)[0].arm)
