# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A URDF is the arm of its DH rows, as another library reads it."""

import io
from pathlib import Path
from xml.etree import ElementTree

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.cli.write_urdf import main, urdf_of_file
from rrth_planner.collision.reference_checker import bars
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings
from rrth_planner.io.urdf.export import arm_to_urdf, RAY_LENGTH
from rrth_planner.model.arm import ArmModel, forward_kinematics
from rrth_planner.model.errors import ModelError
from rrth_planner.model.rotation import roll_pitch_yaw
from worlds import examples, QUARTER, random_chain, random_rotation

yourdfpy = pytest.importorskip('yourdfpy')

ROOT = Path(__file__).parents[2]
RADIUS = 0.015
SEEDS = st.integers(0, 2**32 - 1)


def read(text):
    """Return a URDF as yourdfpy reads it."""
    return yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False)


def frames_of(robot, arm, q):
    """Return where yourdfpy sees the links of the joints and the tool, (dof + 1, 4, 4) [m]."""
    robot.update_cfg(dict(zip(arm.joint_names, q, strict=True)))
    links = [*(f'{name}_link' for name in arm.joint_names), 'tool']
    return np.array([robot.get_transform(link, robot.base_link) for link in links])


def configurations(arm, rng, n):
    return rng.uniform(*arm.bounds, (n, arm.dof))


def rotation_of(roll, pitch, yaw):
    """Return Rz(yaw) Ry(pitch) Rx(roll), each written out."""
    c, s = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    rx = np.array([[1.0, 0.0, 0.0], [0.0, c[0], -s[0]], [0.0, s[0], c[0]]])
    ry = np.array([[c[1], 0.0, s[1]], [0.0, 1.0, 0.0], [-s[1], 0.0, c[1]]])
    rz = np.array([[c[2], -s[2], 0.0], [s[2], c[2], 0.0], [0.0, 0.0, 1.0]])
    return rz @ ry @ rx


@examples(200)
@given(SEEDS, st.sampled_from([None, QUARTER, -QUARTER, QUARTER - 1e-9, 1e-11 - QUARTER]))
def test_roll_pitch_and_yaw_give_the_rotation_back(seed, pitch):
    rng = np.random.default_rng(seed)
    rotation = random_rotation(rng)
    if pitch is not None:
        # Where roll and yaw turn about one axis, or nearly so.
        rotation = rotation_of(rng.uniform(-3.0, 3.0), pitch, rng.uniform(-3.0, 3.0))
    angles = roll_pitch_yaw(rotation)
    np.testing.assert_allclose(rotation_of(*angles), rotation, rtol=0.0, atol=1e-11)


def test_the_packaged_urdf_is_the_one_that_is_written():
    written = resource_path('urdf/arm.urdf').read_text(encoding='utf-8')
    assert written == urdf_of_file(), './run exec write_urdf --output urdf/arm.urdf'


def test_the_packaged_urdf_moves_as_the_arm_does():
    arm = load_arm()
    robot = read(resource_path('urdf/arm.urdf').read_text(encoding='utf-8'))
    assert robot.base_link == 'torso'
    assert tuple(robot.actuated_joint_names) == arm.joint_names
    for q in configurations(arm, np.random.default_rng(0), 100):
        expected = forward_kinematics(arm, q)
        np.testing.assert_allclose(frames_of(robot, arm, q), expected, rtol=0.0, atol=1e-12)
    mount = robot.get_transform('mount', 'torso')
    np.testing.assert_allclose(mount, arm.T_base_mount, rtol=0.0, atol=1e-12)


@examples(40)
@given(SEEDS, st.booleans())
def test_any_chain_moves_as_its_urdf_does(seed, has_tail):
    rng = np.random.default_rng(seed)
    arm = random_chain(rng, has_tail)
    robot = read(arm_to_urdf(arm, np.full(arm.dof, 1.5), RADIUS))
    for q in configurations(arm, rng, 3):
        expected = forward_kinematics(arm, q)
        np.testing.assert_allclose(frames_of(robot, arm, q), expected, rtol=0.0, atol=1e-11)


def test_a_continuous_joint_stays_one():
    arm = load_arm(resource_path('config/examples/chest_arm.yaml'))
    joint = read(arm_to_urdf(arm, np.ones(arm.dof), RADIUS)).joint_map['wrist_roll']
    assert joint.type == 'continuous'
    assert (joint.limit.lower, joint.limit.upper, joint.limit.velocity) == (None, None, 1.0)


@examples(40)
@given(SEEDS, st.booleans())
def test_joints_have_the_kinds_and_limits_of_the_arm(seed, has_tail):
    rng = np.random.default_rng(seed)
    arm = random_chain(rng, has_tail)
    speeds = rng.uniform(0.1, 3.0, arm.dof)
    robot = read(arm_to_urdf(arm, speeds, RADIUS))
    for i, name in enumerate(arm.joint_names):
        joint = robot.joint_map[name]
        assert joint.type == ('prismatic' if arm.is_prismatic[i] else 'revolute')
        assert (joint.limit.lower, joint.limit.upper) == tuple(arm.bounds[:, i])
        assert (joint.limit.velocity, joint.limit.effort) == (speeds[i], 0.0)
        assert list(joint.axis) == [0.0, 0.0, 1.0]


@examples(40)
@given(SEEDS, st.booleans())
def test_what_is_drawn_covers_the_bars_that_the_planner_keeps_clear(seed, has_tail):
    rng = np.random.default_rng(seed)
    arm = random_chain(rng, has_tail)
    robot = read(arm_to_urdf(arm, np.ones(arm.dof), RADIUS))
    for q in configurations(arm, rng, 3):
        poses = frames_of(robot, arm, q)
        links = dict(zip([*(f'{n}_link' for n in arm.joint_names), 'tool'], poses, strict=True))
        drawn = []
        for name, T in [*links.items(), ('mount', arm.T_base_mount)]:
            for visual in robot.link_map[name].visuals:
                half = 0.5 * visual.geometry.cylinder.length
                ends = np.array([[0.0, 0.0, -half, 1.0], [0.0, 0.0, half, 1.0]])
                drawn.append((ends @ (T @ visual.origin).T)[:, :3])
        for bar in bars(arm, q[None], RAY_LENGTH)[0]:
            assert any(off_segment(point, *ends) < 1e-9 for point in bar for ends in drawn)
            middle = bar.mean(axis=0)
            assert min(off_segment(middle, *ends) for ends in drawn) < 1e-9


def off_segment(point, a, b):
    """Return the distance of a point from a segment [m]."""
    along = b - a
    t = np.clip((point - a) @ along / max(along @ along, 1e-30), 0.0, 1.0)
    return np.linalg.norm(point - a - t * along)


def test_a_bar_is_as_thick_as_the_arm_says():
    arm = load_arm()
    thick = ArmModel(
        joint_names=arm.joint_names,
        is_prismatic=arm.is_prismatic,
        dh=arm.dh,
        bounds=arm.bounds,
        radii=[0.03, 0.0, 0.0, 0.02, 0.0],
        T_base_mount=arm.T_base_mount,
    )
    links = read(arm_to_urdf(thick, np.ones(4), RADIUS)).link_map
    found = [links[f'joint_{i}_link'].visuals[0].geometry.cylinder.radius for i in (1, 3, 4)]
    assert found == [0.03, RADIUS, 0.02]


def test_the_velocities_are_those_of_the_settings(tmp_path):
    file = tmp_path / 'mine.yaml'
    file.write_text('/**: {ros__parameters: {max_velocity: [0.5, 1.0, 2.0, 3.0]}}\n')
    found = [read(text).joint_map for text in (urdf_of_file(), urdf_of_file(None, file))]
    names = load_arm().joint_names
    packaged = load_settings(4).limits.velocity.tolist()
    assert [found[0][name].limit.velocity for name in names] == packaged
    assert [found[1][name].limit.velocity for name in names] == [0.5, 1.0, 2.0, 3.0]


def test_the_command_writes_where_it_is_told(tmp_path, capsys):
    output = tmp_path / 'new' / 'arm.urdf'
    assert main(['--output', str(output), '--radius', '0.02', '--base-frame', 'chest']) == 0
    robot = read(output.read_text(encoding='utf-8'))
    assert robot.base_link == 'chest'
    assert robot.link_map['joint_1_link'].visuals[0].geometry.cylinder.radius == 0.02
    assert capsys.readouterr().out == ''
    assert main([]) == 0
    root = ElementTree.fromstring(capsys.readouterr().out)
    assert root.get('name') == 'table_1_arm'


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--radius', '0'], 'radius: 0.0, expected a length > 0 [m]'),
        (['--arm', 'nowhere.yaml'], 'nowhere.yaml'),
        (['--settings', 'nowhere.yaml'], 'nowhere.yaml'),
        (['--base-frame', 'tool'], 'expected names, printable and all different'),
        (['--base-frame', ''], 'expected names, printable and all different'),
        (['--base-frame', 'a\x01b'], 'expected names, printable and all different'),
        (['--output', '/dev/null/arm.urdf'], 'expected a file that can be written'),
    ],
)
def test_what_cannot_be_written_is_said_in_one_line(arguments, words, capsys):
    assert main(arguments) == 2
    said = capsys.readouterr()
    assert said.out == ''
    assert said.err.startswith('write_urdf: ')
    assert words in said.err
    assert said.err.count('\n') == 1


def test_an_arm_without_a_name_is_called_arm(tmp_path):
    text = resource_path('config/arm.yaml').read_text(encoding='utf-8')
    file = tmp_path / 'mine.yaml'
    for name, expected in (('', 'arm'), ('name: "<7> & more"', '<7> & more')):
        file.write_text(text.replace('name: table_1_arm', name), encoding='utf-8')
        assert ElementTree.fromstring(urdf_of_file(file)).get('name') == expected


def test_speeds_that_are_none_are_rejected():
    with pytest.raises(ModelError, match='max_velocity: shape'):
        arm_to_urdf(load_arm(), np.ones(3), RADIUS)
