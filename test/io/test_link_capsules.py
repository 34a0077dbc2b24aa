# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm's capsules hold the collision geometry of its links, wherever its joints stand."""

import io
from pathlib import Path
import struct
import sys

from hypothesis import given, strategies as st
import numpy as np
import pytest

yourdfpy = pytest.importorskip('yourdfpy')
trimesh = pytest.importorskip('trimesh')

from rrth_planner.collision.reference_checker import bar_ends_at
from rrth_planner.io.arm_file import arm_from_mapping, arm_to_mapping
from rrth_planner.io.urdf import link_capsules
from rrth_planner.io.urdf.allowed_pairs import (
    colliding_pairs,
    collision_shares,
    disabled_pairs,
)
from rrth_planner.io.urdf.capsules import enclosed_in, Enclosure
from rrth_planner.io.urdf.chain import read_chain
from rrth_planner.io.urdf.export import arm_to_urdf
from rrth_planner.io.urdf.geometry import (
    box_triangles,
    cylinder_triangles,
    link_triangles,
    mesh_file,
    sphere_triangles,
)
from rrth_planner.io.urdf.import_chain import import_chain, with_capsules
from rrth_planner.io.urdf.link_capsules import enclose_links
from rrth_planner.model.arm import ArmModel, bars_of, Capsule, mount_bars, NO_BARS
from rrth_planner.model.errors import ModelError
from rrth_planner.model.rotation import pose_matrix
from worlds import examples

TETRAHEDRON = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.1]])[
    [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
]
SHARE = 'cmeel.prefix/share/example-robot-data/robots'
# Where descriptions of robots are, if they are installed: pip install example-robot-data.
ROBOTS = next(
    (path for path in (Path(folder) / SHARE for folder in sys.path) if path.is_dir()), None
)


def stl(triangles):
    """Return the bytes of a binary STL."""
    facets = [struct.pack('<12fH', 0, 0, 0, *t.ravel(), 0) for t in triangles]
    return b' ' * 80 + struct.pack('<I', len(facets)) + b''.join(facets)


def collision(shape, origin=''):
    """Return a collision element."""
    return f'<collision>{origin}<geometry>{shape}</geometry></collision>'


def joint(name, kind, parent, child, inside=''):
    """Return a joint that may turn by 2, or slide by 0.1."""
    high = '0.1' if kind == 'prismatic' else '1'
    limit = f'<limit lower="-1" upper="{high}" effort="1" velocity="1"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'{inside}{limit}</joint>'
    )


# Two joints, a hand that is fixed, a finger that turns and its tip that slides.
LINKS = {
    'base': collision('<box size="0.1 0.1 0.05"/>', '<origin xyz="0 0 -0.05"/>'),
    'upper': collision(
        '<cylinder radius="0.03" length="0.3"/>', '<origin xyz="0 0.05 0.15" rpy="0.1 0 0"/>'
    ),
    'lower': collision('<mesh filename="part.stl" scale="1 1 -2"/>', '<origin rpy="0 0 1"/>'),
    'hand': collision('<sphere radius="0.06"/>') + collision('<box size="0.02 0.3 0.02"/>'),
    'tool': '',
    'finger': collision('<box size="0.02 0.02 0.1"/>', '<origin xyz="0.02 0 0.05"/>'),
    'tip': collision('<sphere radius="0.02"/>'),
}
JOINTS = [
    joint('a', 'revolute', 'base', 'upper', '<axis xyz="0 0 1"/><origin xyz="0 0 0.05"/>'),
    joint('b', 'revolute', 'upper', 'lower', '<axis xyz="0 1 0"/><origin xyz="0 0 0.3"/>'),
    joint('c', 'fixed', 'lower', 'hand', '<origin xyz="0.3 0 0" rpy="0 1.2 0"/>'),
    joint('d', 'fixed', 'hand', 'tool', '<origin xyz="0 0 0.1"/>'),
    joint('e', 'revolute', 'hand', 'finger', '<axis xyz="1 0 0"/><origin xyz="0 0.1 0.05"/>'),
    joint('f', 'prismatic', 'finger', 'tip', '<axis xyz="0 0 1"/><origin xyz="0 0 0.1"/>'),
]


def urdf_file(folder, links=LINKS, joints=JOINTS):
    """Return a URDF file, and the mesh beside it."""
    text = ''.join(f'<link name="{name}">{shape}</link>' for name, shape in links.items())
    file = folder / 'arm.urdf'
    file.write_text(f'<robot name="random">{text}{"".join(joints)}</robot>')
    (folder / 'part.stl').write_bytes(stl(TETRAHEDRON))
    return file


def imported(file, *, include_branches=False, tool='tool'):
    """Return an arm with capsules, worn somewhere, and what they enclose."""
    mount = pose_matrix([0.1, -0.2, 0.3], [0.1, 0.2, 0.3, 0.9])
    found = import_chain(read_chain(file, None, tool), mount, 0.0)
    flesh = enclose_links(found, include_branches)
    return with_capsules(found, flesh.capsules, 0.0), flesh


def capsules_at(arm, q):
    """Return the capsules of an arm in the base frame, by the names of their links."""
    ends = bar_ends_at(arm, q[None], 0.1)[0]
    placed = {}
    for bar, line in zip((*bars_of(arm), *mount_bars(arm)), ends, strict=True):
        placed.setdefault(bar.name, []).append(Enclosure(line, bar.radius, 0.0))
    return placed


def points_on(triangles, rng, n=400):
    """Return random points on random triangles."""
    shares = rng.dirichlet([0.5, 0.5, 0.5], n)
    return (shares[:, :, None] * triangles[rng.integers(len(triangles), size=n)]).sum(axis=1)


def assert_enclosed(found, file, include_branches, n=20):
    """Check each link at random configurations, as yourdfpy places it."""
    rng = np.random.default_rng(0)
    model = yourdfpy.URDF.load(str(file), load_meshes=False, build_scene_graph=True)
    arm, chain = found.arm, found.chain
    shapes = {
        link.name: np.concatenate(link_triangles(link, file))
        for link in model.robot.links
        if link.collisions
    }
    known = {capsule.name for capsule in arm.capsules}
    for _ in range(n):
        q = rng.uniform(*arm.bounds)
        others = {
            j.name: float(rng.uniform(j.limit.lower, j.limit.upper))
            for j in model.robot.joints
            if j.name not in arm.joint_names and j.type != 'fixed' and j.mimic is None
        }
        model.update_cfg(others | dict(zip(arm.joint_names, q.tolist(), strict=True)))
        placed = capsules_at(arm, q)
        everything = [one for ones in placed.values() for one in ones]
        for name, triangles in shapes.items():
            if name not in known and not include_branches:
                continue
            T = found.T_base_link @ model.get_transform(name, chain.base)
            points = points_on(triangles, rng) @ T[:3, :3].T + T[:3, 3]
            ones = [
                Enclosure(one.ends, one.radius + 1e-9, 0.0) for one in placed.get(name, everything)
            ]
            assert np.any([enclosed_in(points, one) for one in ones], axis=0).all(), name


@pytest.mark.parametrize('include_branches', [False, True])
def test_capsules_move_with_the_links_that_they_enclose(tmp_path, include_branches):
    file = urdf_file(tmp_path)
    found, flesh = imported(file, include_branches=include_branches)
    assert flesh.left_out == (() if include_branches else ('finger', 'tip'))
    names = ['base', 'upper', 'lower', 'hand', 'finger', 'tip'][: 6 if include_branches else 4]
    assert [link.name for link in flesh.links] == names
    assert {c.link for c in flesh.capsules if c.name in ('hand', 'lower')} == {2}
    assert_enclosed(found, file, include_branches)
    assert found.arm.radii.tolist() == [NO_BARS, NO_BARS, 0.0]
    assert max(link.slack for link in flesh.links[:4]) < 0.1
    again = arm_from_mapping(arm_to_mapping(found.arm, 'again'))
    assert [c.radius for c in again.capsules] == [c.radius for c in found.arm.capsules]
    assert all(
        np.array_equal(one.ends, other.ends)
        for one, other in zip(again.capsules, found.arm.capsules, strict=True)
    )


def test_a_link_inside_another_needs_no_capsule(tmp_path):
    small = {**LINKS, 'tool': collision('<box size="0.01 0.01 0.01"/>')}
    file = urdf_file(
        tmp_path, small, [j.replace('xyz="0 0 0.1"/><limit', '/><limit') for j in JOINTS]
    )
    _, flesh = imported(file)
    assert [link.name for link in flesh.links if not link.capsules] == ['tool']


@examples(20)
@given(st.integers(0, 2**32 - 1))
def test_polyhedra_hold_what_they_stand_for(seed):
    rng = np.random.default_rng(seed)
    radius, length = rng.uniform(0.01, 0.2, 2)
    for triangles, thickest in (
        (sphere_triangles(radius), 1.013 * radius),
        (cylinder_triangles(radius, length), np.hypot(1.002 * radius, 0.5 * length)),
    ):
        a, b, c = np.moveaxis(triangles, 1, 0)
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        heights = np.abs((normals * a).sum(axis=1))
        is_end = (np.abs(normals[:, 2]) > 0.999) & (len(triangles) < 1000)
        assert (heights[~is_end] >= radius - 1e-12).all()
        assert heights[is_end] == pytest.approx(0.5 * length)
        assert np.linalg.norm(triangles, axis=2).max() <= thickest
    size = rng.uniform(0.01, 0.2, 3)
    box = box_triangles(size)
    assert np.allclose(box.max(axis=(0, 1)) - box.min(axis=(0, 1)), size)
    area = np.linalg.norm(np.cross(box[:, 1] - box[:, 0], box[:, 2] - box[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(2 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]))


def test_meshes_are_found_where_the_urdf_says(tmp_path, monkeypatch):
    file = tmp_path / 'share' / 'my_arm' / 'urdf' / 'arm.urdf'
    mesh = tmp_path / 'share' / 'my_arm' / 'meshes' / 'part.stl'
    far = tmp_path / 'opt' / 'share' / 'other' / 'part.stl'
    near = tmp_path / 'mine' / 'third' / 'part.stl'
    for path in (file, mesh, far, near):
        path.parent.mkdir(parents=True)
        path.write_bytes(stl(TETRAHEDRON))
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path / "opt"}')
    monkeypatch.setenv('ROS_PACKAGE_PATH', f'{tmp_path / "mine"}:/nowhere')
    for name, expected in (
        ('package://my_arm/meshes/part.stl', mesh),
        ('package://renamed/meshes/part.stl', mesh),
        ('package://other/part.stl', far),
        ('package://third/part.stl', near),
        ('../meshes/part.stl', mesh),
        (str(mesh), mesh),
        (f'file://{mesh}', mesh),
    ):
        assert mesh_file(name, file, 'x').resolve() == expected.resolve()


@pytest.mark.parametrize(
    ('shape', 'words'),
    [
        (
            '<mesh filename="package://none/other.stl"/>',
            'set ROS_PACKAGE_PATH to the folder .*"none": .*no mesh .package://none/other.stl. in',
        ),
        ('<mesh filename="http://a/part.stl"/>', 'expected a file, or package'),
        ('<mesh/>', 'no file name'),
        ('<mesh filename="arm.urdf"/>', 'expected one of .dae, .obj, .stl'),
        ('<mesh filename="broken.stl"/>', 'expected a readable mesh|0 triangles'),
        ('<mesh filename="empty.stl"/>', 'expected a readable mesh|0 triangles'),
        ('<mesh filename="nan.stl"/>', 'expected corners of at most'),
        ('<mesh filename="part.stl" scale="1 2"/>', 'scale'),
        ('<mesh filename="part.stl" scale="1 2 inf"/>', 'scale'),
        ('<box size="0.1 0 0.1"/>', 'size of the box: .*expected lengths > 0'),
        ('<box size="0.1 0.1"/>', 'size of the box: shape'),
        ('<cylinder radius="-1" length="1"/>', 'radius and length of the cylinder'),
        ('<sphere radius="nan"/>', 'radius of the sphere'),
    ],
)
def test_what_cannot_be_read_is_said_in_a_sentence(tmp_path, shape, words):
    file = urdf_file(tmp_path, {**LINKS, 'base': '', 'upper': collision(shape)})
    (tmp_path / 'broken.stl').write_bytes(stl(TETRAHEDRON)[:100])
    (tmp_path / 'empty.stl').write_bytes(stl(TETRAHEDRON[:0]))
    (tmp_path / 'nan.stl').write_bytes(stl(np.full((1, 3, 3), np.nan)))
    with pytest.raises(ModelError, match=f'({words})') as problem:
        imported(file)
    assert 'link "upper": collision geometry 0' in str(problem.value)


def test_branches_that_cannot_be_followed_are_said(tmp_path):
    plain = dict.fromkeys(LINKS, collision('<box size="0.01 0.01 0.01"/>'))
    for kind, words in (('floating', 'floating'), ('planar', 'planar')):
        joints = [*JOINTS[:4], joint('e', kind, 'hand', 'finger'), JOINTS[5]]
        file = urdf_file(tmp_path, plain, joints)
        assert imported(file)[1].left_out == ('finger', 'tip')
        with pytest.raises(ModelError, match=words):
            imported(file, include_branches=True)


def test_the_unit_of_a_collada_file_counts(tmp_path):
    pytest.importorskip('collada')
    text = trimesh.Trimesh(TETRAHEDRON.reshape(-1, 3), np.arange(12).reshape(4, 3)).export(
        file_type='dae'
    )
    if b'meter=' not in text:
        text = text.replace(b'<asset>', b'<asset><unit name="meter" meter="1"/>', 1)
    sizes = []
    for unit in (b'"1"', b'"0.001"'):
        before, _, after = text.partition(b'meter="')
        (tmp_path / 'part.dae').write_bytes(before + b'meter=' + unit + after.partition(b'"')[2])
        shape = collision('<mesh filename="part.dae"/>')
        file = urdf_file(tmp_path, {**LINKS, 'upper': shape})
        (link,) = [x for x in read_chain(file, None, 'tool').robot.links if x.name == 'upper']
        sizes.append(link_triangles(link, file)[0].max())
    assert sizes == pytest.approx([0.3, 0.0003])


def test_what_is_written_is_read_as_capsules_around_the_same(tmp_path):
    found, _ = imported(
        urdf_file(tmp_path, LINKS | {'base': LINKS['finger'], 'hand': LINKS['tip']})
    )
    arm = found.arm
    file = tmp_path / 'written.urdf'
    file.write_text(arm_to_urdf(arm, np.ones(2), 0.01))
    again = import_chain(read_chain(file, None, 'tool'), np.eye(4), 0.0)
    flesh = enclose_links(again)
    again = with_capsules(again, flesh.capsules, 0.0)
    rng = np.random.default_rng(0)
    for q in rng.uniform(*arm.bounds, (5, 2)):
        new = [one for ones in capsules_at(again.arm, q).values() for one in ones]
        new = [Enclosure(one.ends, one.radius + 1e-6, 0.0) for one in new]
        for name, ones in capsules_at(arm, q).items():
            if name == 'pointing ray':
                continue
            for one in ones:
                # What is in a capsule is within its radius of its line.
                away = rng.standard_normal((300, 3))
                away *= one.radius / np.linalg.norm(away, axis=1)[:, None]
                share = rng.random((300, 1)).round(1)
                points = one.ends[0] + share * (one.ends[1] - one.ends[0]) + away
                assert np.any([enclosed_in(points, other) for other in new], axis=0).all()
    robot = yourdfpy.URDF.load(io.BytesIO(file.read_bytes()), load_meshes=False)
    assert len(robot.link_map['mount'].collisions) == 3
    assert not robot.link_map['tool'].collisions


def three_joints(**changes):
    """Return an arm of three joints about z, 0.1 m apart, with a ball on each link."""
    balls = [
        Capsule(name=f'ball {k}', link=k, ends=np.zeros((2, 3)), radius=0.02) for k in range(1, 4)
    ]
    values = {
        'joint_names': ('a', 'b', 'c'),
        'is_prismatic': (False,) * 3,
        'dh': np.array([[0, 0, 0, 0], [0, 0.1, 0, 0], [0, 0.1, 0, 0], [1.5, 0.1, 0, 0]], float),
        'bounds': [[-1.0] * 3, [1.0] * 3],
        'radii': [NO_BARS] * 3 + [0.0],
        'T_base_mount': np.eye(4),
        'capsules': balls,
    }
    return ArmModel(**(values | changes))


def test_parts_that_always_touch_are_found():
    assert colliding_pairs(three_joints(), 200) == ()
    arm = three_joints()
    large = Capsule(name='shield', link=1, ends=np.zeros((2, 3)), radius=0.25)
    arm = three_joints(capsules=[*arm.capsules, large])
    pairs = colliding_pairs(arm, 200)
    assert ('shield', 'ball 3') in pairs
    # Neighbours need not be named.
    assert ('shield', 'ball 2') not in pairs
    # Touching in half of all configurations is a collision.
    middling = Capsule(name='shield', link=1, ends=np.zeros((2, 3)), radius=0.175)
    assert colliding_pairs(three_joints(capsules=[*three_joints().capsules, middling]), 500) == ()


def passing_links():
    """Return a plate, and a flat cylinder that turns over it, two joints on, 12 mm above it."""
    links = {
        'plate': collision('<box size="0.2 0.2 0.03"/>', '<origin xyz="0 0 -0.015"/>'),
        'column': '',
        'wheel': collision(
            '<cylinder radius="0.06" length="0.1"/>', '<origin xyz="0 0.06 0" rpy="1.5708 0 0"/>'
        ),
        'lamp': '',
    }
    joints = [
        joint('a', 'revolute', 'plate', 'column', '<axis xyz="0 0 1"/><origin xyz="0 0 0.072"/>'),
        joint('b', 'revolute', 'column', 'wheel', '<axis xyz="0 1 0"/>'),
        joint('c', 'fixed', 'wheel', 'lamp', '<origin xyz="0.2 0.06 0" rpy="0 1.5708 0"/>'),
    ]
    return links, joints


def test_links_that_pass_each_other_closely_get_capsules_that_do(tmp_path, monkeypatch):
    file = urdf_file(tmp_path, *passing_links())
    found, flesh = imported(file, tool='lamp')
    assert_enclosed(found, file, False)
    assert collision_shares(found.arm, 500)['plate', 'wheel'] < 0.05
    assert colliding_pairs(found.arm, 500) == ()
    # As every link is enclosed, these two always collide, and would be let.
    monkeypatch.setattr(link_capsules, 'OFTEN_SHARE', 2.0)
    usual, of_usual = imported(file, tool='lamp')
    assert colliding_pairs(usual.arm, 500) == (('plate', 'wheel'),)
    assert len(flesh.capsules) > len(of_usual.capsules)


def test_links_that_truly_always_collide_keep_their_capsules(tmp_path, monkeypatch):
    links, joints = passing_links()
    links['plate'] = collision('<box size="0.2 0.2 0.1"/>')
    file = urdf_file(tmp_path, links, joints)
    found, flesh = imported(file, tool='lamp')
    assert colliding_pairs(found.arm, 500) == (('plate', 'wheel'),)
    monkeypatch.setattr(link_capsules, 'OFTEN_SHARE', 2.0)
    _, usual = imported(file, tool='lamp')
    for one, other in zip(flesh.capsules, usual.capsules, strict=True):
        assert one.radius == other.radius and np.array_equal(one.ends, other.ends)


def test_an_srdf_names_pairs_that_may_touch(tmp_path):
    pairs = [('ball 1', 'ball 3'), ('ball 1', 'ball 2'), ('ball 1', 'wheel'), ('ball 1', 'ball 3')]
    file = tmp_path / 'arm.srdf'
    lines = ''.join(f'<disable_collisions link1="{a}" link2="{b}"/>' for a, b in pairs)
    file.write_text(f'<robot name="r">{lines}</robot>')
    assert disabled_pairs(file, three_joints(), 'r') == ((('ball 1', 'ball 3'),), ['wheel'])
    for text, words in (
        ('<sdf/>', 'an SRDF'),
        ('<robot name="r"><disable_collisions/></robot>', 'link1'),
    ):
        file.write_text(text)
        with pytest.raises(ModelError, match=words):
            disabled_pairs(file, three_joints(), 'r')


@pytest.mark.skipif(ROBOTS is None, reason='example-robot-data is not there')
@pytest.mark.parametrize(
    ('name', 'tool', 'most'),
    [
        ('panda_description/urdf/panda.urdf', 'panda_hand_tcp', 12),
        ('ur_description/urdf/ur5_robot.urdf', 'tool0', 16),
    ],
)
def test_real_arms_are_enclosed_in_few_capsules(name, tool, most):
    found, flesh = imported(ROBOTS / name, tool=tool)
    assert len(flesh.capsules) <= most
    assert max(c.radius for c in flesh.capsules if c.link > 0) < 0.085
    assert_enclosed(found, ROBOTS / name, False, n=5)
