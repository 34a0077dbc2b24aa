# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Masses and inertias of a URDF: the same arm as MuJoCo makes of the file itself."""

from dataclasses import replace

import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')
pytest.importorskip('trimesh')
pytest.importorskip('yourdfpy')

from rrth_planner.io.urdf.chain import read_chain
from rrth_planner.io.urdf.import_chain import import_chain
from rrth_planner.model.errors import ModelError
from rrth_planner.model.rotation import pose_matrix
from rrth_planner.simulation.arm_dynamics import ArmDynamics
from rrth_planner.simulation.mechanics import usual_mechanics
from rrth_planner.simulation.urdf_inertia import urdf_inertias

INERTIAL = (
    '<inertial><origin xyz="{0} 0.02 0.05" rpy="0.3 {0} 0.1"/><mass value="{1}"/>'
    '<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.002" ixz="0.001" iyz="0.003"/></inertial>'
)
LINK = '<link name="{0}">{1}</link>'
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin {4}/>'
    '<axis xyz="{5}"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
)
# Two joints that turn and one that slides, with a camera and a cable fixed to two links.
JOINTS = (
    ('a', 'revolute', 'base', 'upper', 'xyz="0.1 0.2 0" rpy="0.3 0 0.2"', '0 0 1'),
    ('b', 'revolute', 'upper', 'lower', 'xyz="0 0.05 0.3" rpy="0 0.4 0"', '0 -1 0'),
    ('cable fix', 'fixed', 'lower', 'cable', 'xyz="0 0 0.2" rpy="0.5 0 0"', '0 0 1'),
    ('c', 'prismatic', 'lower', 'hand', 'xyz="0.2 0 0.1"', '1 0 0'),
    ('camera fix', 'fixed', 'hand', 'camera', 'xyz="0 0.1 0.1" rpy="0 0 1"', '0 0 1'),
)


def urdf(folder, masses):
    """Return a file of such an arm whose links have some masses [kg]."""
    links = ''.join(
        LINK.format(name, INERTIAL.format(0.01 * k, mass) if mass else '')
        for k, (name, mass) in enumerate(masses.items())
    )
    text = f'<robot name="r">{links}{"".join(JOINT.format(*j) for j in JOINTS)}</robot>'
    (folder / 'arm.urdf').write_text(text)
    return folder / 'arm.urdf', text


MASSES = {'base': 3.0, 'upper': 1.0, 'lower': 0.8, 'cable': 0.1, 'hand': 0.5, 'camera': 0.3}


def test_weight_and_inertia_are_those_of_the_file(tmp_path):
    file, text = urdf(tmp_path, MASSES)
    mount = pose_matrix([-0.4, 0.1, 0.2], [0.1, 0.0, 0.3, 0.9])
    arm = import_chain(read_chain(file, 'base', 'hand', '+x'), mount, 0.02).arm
    found = urdf_inertias(file, arm)
    assert [one.mass for one in found] == pytest.approx([1.0, 0.9, 0.8])
    bare = replace(usual_mechanics(3), payload=0.0, armature=np.zeros(3), inertias=found)
    dynamics = ArmDynamics(arm, bare)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    gravity = np.array([0.5, 1.0, -9.7])
    # MuJoCo has the file's base at the origin.
    model.opt.gravity[:] = mount[:3, :3].T @ gravity
    for q in np.random.default_rng(0).uniform(*arm.bounds, (10, 3)):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(dynamics.weight(q, gravity), data.qfrc_bias, atol=1e-9)
        rows = np.empty((3, 3))
        for row, unit in zip(rows, np.eye(3), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        np.testing.assert_allclose(dynamics.inertia(q), rows, atol=1e-9)


def test_a_link_without_a_mass_is_named(tmp_path):
    file, _ = urdf(tmp_path, MASSES | {'upper': 0.0})
    arm = import_chain(read_chain(file, 'base', 'hand', '+x'), np.eye(4), 0.02).arm
    with pytest.raises(ModelError, match='no mass in the links that joint "a" moves'):
        urdf_inertias(file, arm)
