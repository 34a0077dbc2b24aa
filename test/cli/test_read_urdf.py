# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arms from URDF files move as their URDF says; what is no arm is rejected in a sentence."""

import subprocess
import sys

import numpy as np
import pytest

yourdfpy = pytest.importorskip('yourdfpy')

from rrth_planner.cli import read_urdf
from rrth_planner.collision.reference_checker import bars, frames
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.resources import resource_path
from rrth_planner.io.urdf.chain import RAYS, read_chain
from rrth_planner.io.urdf.dh_parameters import rows_of_axes
from rrth_planner.io.urdf.import_chain import import_chain
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.errors import ModelError
from rrth_planner.model.rotation import pose_matrix
from urdf_texts import joint, random_urdf, urdf

TURN = {'axis': {'xyz': '0 0 1'}, 'limit': {'lower': '-1', 'upper': '1'}}


def file_of(tmp_path, text):
    """Return a file with a text."""
    file = tmp_path / 'arm.urdf'
    file.write_text(text)
    return file


def imported(tmp_path, rng):
    """Return a random chain as an arm, worn anywhere."""
    text, tool = random_urdf(rng)
    chain = read_chain(file_of(tmp_path, text), 'base', tool, str(rng.choice(list(RAYS))))
    mount = pose_matrix(rng.uniform(-0.5, 0.5, 3), rng.standard_normal(4))
    return import_chain(chain, mount, 0.02), yourdfpy.URDF.load(
        str(tmp_path / 'arm.urdf'), load_meshes=False
    )


def test_any_chain_moves_as_its_urdf_says(tmp_path):
    rng = np.random.default_rng(3)
    n_exact = n_sliding = n_parallel = n_meeting = 0
    for n in range(100):
        found, model = imported(tmp_path, rng)
        arm = found.arm
        for q in rng.uniform(*arm.bounds, (5, arm.dof)):
            model.update_cfg(dict(zip(arm.joint_names, q.tolist(), strict=True)))
            T_urdf = found.T_base_link @ model.get_transform(found.chain.tool, 'base')
            T = tool_pose(arm, q)
            assert np.abs(T[:3, 2] - T_urdf[:3, :3] @ found.chain.ray).max() < 1e-9
            begin = T[:3, 3] + found.ray_lead * T[:3, 2]
            assert np.abs(begin - T_urdf[:3, 3]).max() < 1e-9
        # What the command prints is this very comparison.
        assert n % 10 or max(found.deviation()) < 1e-9
        n_exact += found.ray_lead == 0.0
        n_sliding += any(arm.is_prismatic)
        n_parallel += (np.abs(np.sin(arm.dh[1:, 0])) < 1e-12).any()
        n_meeting += (arm.dh[1:, 1] == 0.0).any()
    assert min(n_exact, n_sliding, n_parallel, n_meeting) >= 10


def test_a_ray_along_the_last_axis_begins_where_the_tool_is(tmp_path):
    joints = [
        joint('a', 'revolute', 'base', 'l1', **TURN),
        joint('b', 'revolute', 'l1', 'l2', **{**TURN, 'axis': {'xyz': '1 0 0'}}),
        joint('c', 'fixed', 'l2', 'tool', origin={'xyz': '0.1 0.2 0.3'}),
    ]
    file = file_of(tmp_path, urdf(joints))
    assert import_chain(read_chain(file, ray='-x'), np.eye(4), 0.0).ray_lead == 0.0
    # The line of the ray is nearest to the axis of b at the height of its foot.
    assert import_chain(read_chain(file, ray='z'), np.eye(4), 0.0).ray_lead == pytest.approx(0.3)


def test_the_bars_enclose_the_links(tmp_path):
    rng = np.random.default_rng(4)
    share = np.linspace(0.0, 1.0, 41)[:, None]
    for _ in range(60):
        found, _ = imported(tmp_path, rng)
        arm, chain = found.arm, found.chain
        points = chain.points @ found.T_base_link[:3, :3].T + found.T_base_link[:3, 3]
        rest, bent = np.zeros(arm.dof), rng.uniform(*arm.bounds)
        T_rest, T = frames(arm, np.stack([rest, bent]))
        # What belongs to the mount is not checked, so it encloses what lies on it.
        mount = np.stack([arm.T_base_mount[:3, 3], T[0, :3, 3]])
        ends = np.concatenate([bars(arm, bent[None], 1.0)[0], mount[None]])
        radii = [arm.radii[i] for i in range(arm.dof + 1) for _ in 'ad']
        radii = [*radii[(1 if arm.is_prismatic[0] else 2) :], arm.radii[:2].max()]
        is_bar = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > 0.0
        assert len(radii) == len(ends)
        for i in range(arm.dof):
            begin, end = (points[i : i + 2] - T_rest[i, :3, 3]) @ T_rest[i, :3, :3]
            link = (begin + share * (end - begin)) @ T[i, :3, :3].T + T[i, :3, 3]
            gaps = [
                _distances(link, *bar) - radius
                for bar, radius, counts in zip(ends, radii, is_bar, strict=True)
                if counts
            ]
            assert np.min(gaps, axis=0).max() <= -0.02 + 1e-6


def _distances(points, begin, end):
    along = end - begin
    share = np.clip((points - begin) @ along / (along @ along), 0.0, 1.0)
    return np.linalg.norm(points - begin - share[:, None] * along, axis=1)


def test_angles_written_with_few_digits_are_right_angles(tmp_path):
    half = {'origin': {'xyz': '0 0.1 0.2', 'rpy': '0 0 0'}}
    joints = [
        joint('a', 'revolute', 'base', 'l1', **TURN),
        joint('b', 'revolute', 'l1', 'l2', **TURN, origin={'xyz': '.3 0 .1', 'rpy': '1.5708 0 0'}),
        joint('c', 'revolute', 'l2', 'l3', **TURN, origin={'xyz': '.3 0 0', 'rpy': '3.1416 0 0'}),
        # Two angles that only together are next to nothing.
        joint('d', 'fixed', 'l3', 'l4', origin={'xyz': '0.2 0 0', 'rpy': '0.5236 0 0'}),
        joint('e', 'fixed', 'l4', 'l5', origin={'xyz': '0.2 0 0', 'rpy': '-0.523599 0 0'}),
        joint('f', 'revolute', 'l5', 'l6', **TURN, **half),
        joint('g', 'fixed', 'l6', 'tool', origin={'xyz': '0 0 0.1', 'rpy': '0 1.5708 0'}),
    ]  # fmt: skip
    found = import_chain(read_chain(file_of(tmp_path, urdf(joints))), np.eye(4), 0.01)
    quarters = found.arm.dh[:, 0] / (0.5 * np.pi)
    assert np.array_equal(quarters, np.round(quarters))
    assert np.abs(found.arm.dh[:, [1, 3]]).max() < 1.0
    far, tilt = found.deviation()
    assert 0.0 < far < 2e-5
    assert 0.0 < tilt < 5e-5


def test_axes_next_to_parallel_are_told(tmp_path, capsys):
    joints = [
        joint('a', 'revolute', 'base', 'l1', **TURN),
        joint('b', 'revolute', 'l1', 'l2', **TURN, origin={'xyz': '.3 0 0', 'rpy': '0 .002 0'}),
        joint('c', 'revolute', 'l2', 'l3', **{**TURN, 'axis': {'xyz': '1 0 0'}}),
        joint('d', 'fixed', 'l3', 'tool', origin={'xyz': '0.2 0 0'}),
    ]
    file, arm = file_of(tmp_path, urdf(joints)), tmp_path / 'arm.yaml'
    assert read_urdf.main([str(file), '--output', str(arm)]) == 0
    assert 'bars: up to 150.00 m long in an arm of 0.50 m' in capsys.readouterr().out
    # Made from a xacro file, of which the name of its language is left.
    chest = resource_path('config/examples/chest_arm.urdf').read_text()
    named = chest.replace('<robot ', '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    file.write_text(named)
    assert read_urdf.main([str(file), '--ray', '+x', '--output', str(arm)]) == 0
    assert 'bars' not in capsys.readouterr().out.replace('straight bars', '')


def test_a_joint_without_velocity_is_named(tmp_path, capsys):
    chest = resource_path('config/examples/chest_arm.urdf').read_text()
    output, said = ['--ray', '+x', '--output', str(tmp_path / 'arm.yaml')], []
    for text in (chest.replace(' velocity="1.6"', '', 1), chest.replace(' velocity="', ' v="')):
        assert read_urdf.main([str(file_of(tmp_path, text)), *output]) == 0
        said.append([line for line in capsys.readouterr().out.split('\n') if 'max_vel' in line])
    ((line,), none) = said
    assert '[?, 1.6, 1.6, 2.4, 2.4, 2.4]; none given for turn: replace' in line
    assert none == []


@pytest.mark.parametrize(
    ('which', 'left'),
    [('child', 'l1'), ('parent', 'base'), ('child', 'tool')],
)
def test_a_link_that_is_not_declared_is_named(tmp_path, capsys, which, left):
    joints = [joint('a', 'revolute', 'base', 'l1', **TURN), LAST]
    text = urdf(joints).replace(f'<link name="{left}" />', '')
    assert text != urdf(joints)
    arguments = [str(file_of(tmp_path, text)), '--output', str(tmp_path / 'arm.yaml')]
    assert read_urdf.main(arguments) == 2
    said = capsys.readouterr().err
    name = 'last' if left == 'tool' else 'a'
    assert f'joint "{name}": its {which} link "{left}" is not declared, expected one of' in said
    assert said.count('\n') == 1


def test_lines_that_are_no_numbers_are_rejected():
    with pytest.raises(ModelError, match='finite'):
        rows_of_axes(np.full((2, 3), np.nan), np.eye(3)[:2], np.eye(3)[2])


LAST = joint('last', 'revolute', 'l1', 'tool', **{**TURN, 'axis': {'xyz': '1 0 0'}})
CHAINS = {
    'floating': [joint('a', 'floating', 'base', 'l1'), LAST],
    'planar': [joint('a', 'planar', 'base', 'l1'), LAST],
    'moves with "last"': [
        joint('a', 'revolute', 'base', 'l1', **TURN, mimic={'joint': 'last'}),
        LAST,
    ],
    'no limits': [joint('a', 'revolute', 'base', 'l1', axis={'xyz': '0 0 1'}), LAST],
    'expected lower < upper': [
        joint('a', 'prismatic', 'base', 'l1', limit={'lower': '0.2', 'upper': '0.1'}),
        LAST,
    ],
    'not all 0': [
        joint('a', 'revolute', 'base', 'l1', limit=TURN['limit'], axis={'xyz': '0 0 0'}),
        LAST,
    ],
    'finite numbers': [
        joint('a', 'revolute', 'base', 'l1', **TURN, origin={'xyz': '0 nan 0'}),
        LAST,
    ],
    'no joint moves': [joint('a', 'fixed', 'base', 'tool')],
    'give --tool LINK': [LAST, joint('b', 'revolute', 'l1', 'other', **TURN)],
    'give --base LINK': [LAST, joint('b', 'fixed', 'base', 'other')],
    'expected a tree': [LAST, joint('b', 'fixed', 'base', 'tool')],
}  # fmt: skip
TEXTS = {
    'a xacro file': '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro/></robot>',
    'no URDF': '<sdf version="1.9"/>',
    'readable XML (.*': 'joints: [1, 2]\n',
    'no URDF [(].*': '<robot name="a"><link name="b"/><joint name="c" type="revolute"/></robot>',
    'readable XML [(].*[)]': '',
    'expected one, the root': '<robot name="a"/>',
    **{words: urdf(joints) for words, joints in CHAINS.items()},
}


@pytest.mark.parametrize('words', TEXTS)
def test_what_is_no_arm_is_rejected_in_a_sentence(tmp_path, capsys, words):
    file, arm = file_of(tmp_path, TEXTS[words]), tmp_path / 'arm.yaml'
    assert read_urdf.main([str(file), '--output', str(arm)]) == 2
    said = capsys.readouterr().err
    assert said.startswith('read_urdf: ')
    assert said.count('\n') == 1
    assert words.split(' (')[0].split(' [')[0] in said
    assert not arm.exists()


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--tool', 'nothing'], "no link of the URDF, expected one of ['torso'"),
        (['--base', 'lamp', '--tool', 'plate'], 'no chain of joints'),
        (['--base', 'lamp'], 'no joint moves'),
        (['--ray', 'up'], 'expected one of +x'),
        (['--radius', '-1'], 'radius: -1.0, expected a length >= 0'),
        (['--mount', '0', '0', '0', '0', '0', '0', '0'], 'not all 0'),
        (['--check', '1', '2'], '--check: 2 values, expected 6, one for each'),
        # The first joint alone sweeps a cone.
        (['--tool', 'turret'], 'expected 2: the ray sweeps a surface'),
    ],
)
def test_a_wrong_request_is_rejected_in_a_sentence(tmp_path, capsys, arguments, words):
    file, arm = resource_path('config/examples/chest_arm.urdf'), tmp_path / 'arm.yaml'
    assert read_urdf.main([str(file), '--output', str(arm), *arguments]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count('\n') == 1
    assert not arm.exists()


def test_files_that_cannot_be_used_are_named(tmp_path, capsys):
    file, output = resource_path('config/examples/chest_arm.urdf'), tmp_path / 'no' / 'arm.yaml'
    assert read_urdf.main([str(tmp_path / 'none.urdf'), '--output', str(output)]) == 2
    assert 'none.urdf: No such file' in capsys.readouterr().err
    assert read_urdf.main([str(file), '--output', str(output)]) == 2
    assert 'no/arm.yaml' in capsys.readouterr().err


WITHOUT = """
import sys
for name in {names}:
    sys.modules[name] = None
from rrth_planner.cli.read_urdf import main
sys.exit(main(['arm.urdf', '--output', 'arm.yaml']))
"""


@pytest.mark.parametrize('names', [('yourdfpy',), ('yourdfpy', 'trimesh')])
def test_what_is_not_installed_is_named(names):
    ended = subprocess.run(
        [sys.executable, '-c', WITHOUT.format(names=names)], capture_output=True, text=True
    )
    assert ended.returncode == 2
    (line,) = ended.stderr.splitlines()
    assert line.startswith(f'read_urdf: needs {", ".join(names)}; install ')
    assert line.endswith("pip install 'rrth_planner[tools]'")


def test_the_mount_is_where_the_first_link_is_worn(tmp_path, capsys):
    file, arm = resource_path('config/examples/chest_arm.urdf'), tmp_path / 'arm.yaml'
    worn = ['--base', 'plate', '--mount', '-0.2', '0', '0.3', '0', '0', '1', '0', '--ray', '-z']
    assert read_urdf.main([str(file), '--output', str(arm), *worn, '--check', *'000000']) == 0
    # Half a turn about z, and then 0.05 m up to the first joint.
    assert np.allclose(load_arm(arm).T_base_mount[:3, 3], (-0.2, 0.0, 0.35), atol=1e-12)
    T = tool_pose(load_arm(arm), np.zeros(6))
    # The lamp's -z is the plate's x: backwards on the wearer.
    assert np.allclose(T[:3, 2], (-1.0, 0.0, 0.0), atol=1e-4)
    assert 'tool at' in capsys.readouterr().out


def with_geometry(text):
    """Return the example with boxes on three links, and a finger on the lamp."""
    box = (
        '<collision><origin xyz="0 0 0.05"/><geometry><box size="0.04 0.04 {}"/></geometry>'
        '</collision>'
    )
    for link, length in (('upper_arm', 0.2), ('forearm', 0.1), ('lamp', 0.02)):
        text = text.replace(
            f'<link name="{link}"/>', f'<link name="{link}">{box.format(length)}</link>'
        )
    finger = (
        f'<link name="finger">{box.format(0.03)}</link><joint name="grip" type="revolute">'
        '<parent link="lamp"/><child link="finger"/><axis xyz="1 0 0"/>'
        '<limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    return text.replace('</robot>', finger)


def test_links_with_collision_geometry_become_capsules(tmp_path, capsys):
    chest = resource_path('config/examples/chest_arm.urdf').read_text()
    file, arm = file_of(tmp_path, with_geometry(chest)), tmp_path / 'arm.yaml'
    srdf = tmp_path / 'arm.srdf'
    pair = '<disable_collisions link1="upper_arm" link2="lamp"/>'
    srdf.write_text(f'<robot name="chest_arm">{pair}</robot>')
    request = [str(file), '--tool', 'lamp', '--ray', '+x', '--output', str(arm)]
    assert read_urdf.main([*request, '--srdf', str(srdf), '--ray-radius', '0.01']) == 0
    said, found = capsys.readouterr().out, load_arm(arm)
    assert 'shape: 3 capsules' in said
    assert '  upper_arm: 1 capsule, radius up to 0.0' in said
    assert 'left out: finger, moved by joints beside the chain' in said
    assert 'may meet, by arm.srdf: upper_arm and lamp' in said
    assert [(c.name, c.link) for c in found.capsules] == [
        ('upper_arm', 2),
        ('forearm', 3),
        ('lamp', 6),
    ]
    assert found.allowed == (('upper_arm', 'lamp'),)
    assert found.radii.tolist() == [-1.0] * 6 + [0.01]
    assert read_urdf.main([*request, '--include-branches']) == 0
    assert 'left out' not in capsys.readouterr().out
    assert [c.name for c in load_arm(arm).capsules][-1] == 'finger'
    assert read_urdf.main([*request, '--geometry', 'bars', '--ray-radius', '0.02']) == 0
    assert 'shape' not in capsys.readouterr().out
    bars_only = load_arm(arm)
    assert (bars_only.capsules, bars_only.radii[-1]) == ((), 0.02)
    assert read_urdf.main([*request, '--geometry', 'bars', '--srdf', str(srdf)]) == 2
    assert 'the links are bars, expected collision geometry' in capsys.readouterr().err
    assert read_urdf.main([*request, '--ray-radius', '-1']) == 2
    assert 'ray radius: -1.0, expected a length >= 0' in capsys.readouterr().err


def test_without_collision_geometry_links_are_bars(tmp_path, capsys):
    file, arm = resource_path('config/examples/chest_arm.urdf'), tmp_path / 'arm.yaml'
    assert read_urdf.main([str(file), '--ray', '+x', '--output', str(arm)]) == 0
    assert 'shape: no collision geometry: each link is a bar' in capsys.readouterr().out
    assert load_arm(arm).capsules == ()


def test_an_interrupt_is_a_sentence(tmp_path, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(read_urdf, 'import_chain', interrupted)
    file = resource_path('config/examples/chest_arm.urdf')
    assert read_urdf.main([str(file), '--output', str(tmp_path / 'arm.yaml')]) == 130
    assert capsys.readouterr().err == 'read_urdf: interrupted\n'
    assert not list(tmp_path.iterdir())
