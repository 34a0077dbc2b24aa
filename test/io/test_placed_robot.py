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


def test_a_joint_moves_as_in_the_arm_however_long_its_axis_is(tmp_path):
    joints = [
        ('a', 'revolute', 'root', 'upper', 'xyz="0.1 0.2 0" rpy="0.3 0 0.2"', '0 0 5', '-1'),
        ('b', 'revolute', 'upper', 'lower', 'xyz="0 0.05 0.3" rpy="0 0.4 0"', '0 -0.1 0', '-1'),
        ('c', 'prismatic', 'lower', 'hand', 'xyz="0.2 0 0.1"', '0 2 2', '-1'),
    ]
    file = urdf(tmp_path, joints)
    chain = read_chain(file, 'root', 'hand', '+x')
    arm = import_chain(chain, pose_matrix([0.0, 0.0, 0.2], [0.0, 0.0, 0.0, 1.0]), 0.02).arm
    robot, q = place_robot(file, arm), np.array([0.3, -0.4, 0.5])
    robot.model.update_cfg(robot.values(q))
    hand = robot.model.get_transform('hand', 'root')
    np.testing.assert_allclose(hand, chain.tool_pose(q), atol=1e-9)


# A tetrahedron of 3 x 4 x 5 of the file's units, which its scene moves.
DAE = (
    '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>'
    '<created>2026-01-01T00:00:00</created><modified>2026-01-01T00:00:00</modified>{unit}'
    '<up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g" name="g"><mesh>'
    '<source id="p"><float_array id="pa" count="12">0 0 0 3 0 0 0 4 0 0 0 5</float_array>'
    '<technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>'
    '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>'
    '</source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
    '<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>'
    '<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>'
    '<library_visual_scenes><visual_scene id="s" name="s"><node id="n" name="n">'
    '<translate>1 2 0</translate><instance_geometry url="#g"/></node></visual_scene>'
    '</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>'
)


@pytest.mark.parametrize(
    ('unit', 'metres'),
    [
        ('<unit name="centimeter" meter="0.01"/>', 0.01),
        ('<unit meter="0.0254"/>', 0.0254),
        ('', 1),
    ],
)
@pytest.mark.parametrize(
    ('scale', 'factor'), [('', 1.0), ('scale="2"', 2.0), ('scale="0.1 0.2 0.3"', [0.1, 0.2, 0.3])]
)
def test_a_mesh_is_seen_as_large_as_the_capsules_enclose_it(tmp_path, unit, metres, scale, factor):
    pytest.importorskip('collada')
    (tmp_path / 'part.dae').write_text(DAE.format(unit=unit))
    file = urdf(tmp_path)
    found, _ = arm_of(file)
    mesh = f'<mesh filename="part.dae" {scale}/>'
    text = file.read_text().replace(LINK.format('hand', BOX), LINK.format('hand', mesh))
    file.write_text(text)
    robot = place_robot(file, found.arm)
    low, high = np.array([[1.0, 2.0, 0.0], [4.0, 6.0, 5.0]]) * metres * factor
    scene, corners = robot.model.scene, []
    for node in scene.graph.nodes_geometry:
        T, name = scene.graph.get(node, 'hand')
        # The other links are boxes.
        if len(scene.geometry[name].faces) == 4:
            corners.append(scene.geometry[name].vertices @ T[:3, :3].T + T[:3, 3])
    np.testing.assert_allclose(np.concatenate(corners).min(axis=0), low, atol=1e-9)
    np.testing.assert_allclose(np.concatenate(corners).max(axis=0), high, atol=1e-9)
