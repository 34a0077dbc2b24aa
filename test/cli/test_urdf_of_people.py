# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""URDFs as people have them: of version 1.1, in other units, with a gripper, worn too near."""

import json
import os
from pathlib import Path
import pty
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('yourdfpy')
pytest.importorskip('fcl')

from rrth_planner.cli import plan, read_urdf
from rrth_planner.collision.world import arm_world
from rrth_planner.io.arm_file import arm_to_yaml, load_arm
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings
from rrth_planner.io.urdf.chain import read_chain
from rrth_planner.io.urdf.placed_robot import place_robot
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import ArmModel, Capsule, forward_kinematics, tool_pose
from rrth_planner.model.rotation import pose_matrix, rotation_matrix

BEHIND = ['--mount', '-0.3', '0', '0.3', '0', '0', '0', '1']
BOX = '<geometry><box size="{0} {0} {1}"/></geometry>'
LINK = '<{{}}><origin xyz="0 0 {1}"/>{0}</{{}}>'


def shape(kind='collision', width=0.06, length=0.3):
    """Return the shape of a link that stands on its joint [m]."""
    return f'<{kind}><origin xyz="0 0 {length / 2}"/>{BOX.format(width, length)}</{kind}>'


def arm_urdf(  # noqa: PLR0913
    body=None,
    *,
    name='r',
    version='',
    limits='lower="-2" upper="2" velocity="1" effort="1"',
    inside='',
    elbow='',
    hand='',
):
    """Return an arm of three joints: what a link and a joint hold, and what hangs at its end."""
    body = shape() if body is None else body
    joints = ''.join(
        f'<link name="l{k}">{body}</link><joint name="j{k}" type="revolute">'
        f'<parent link="{parent}"/><child link="l{k}"/><origin xyz="0 0 {z}" {elbow * (k == 1)}/>'
        f'<axis xyz="{axis}"/><limit {limits}/>{inside}</joint>'
        for k, (parent, z, axis) in enumerate(
            [('base', 0.1, '0 0 1'), ('l0', 0.3, '0 1 0'), ('l1', 0.3, '0 1 0')]
        )
    )
    return f'<robot name="{name}" {version}><link name="base"/>{joints}{hand}</robot>'


def read(tmp_path, text, *options):
    """Return the exit code of read_urdf and the arm's file."""
    file, arm = tmp_path / 'arm.urdf', tmp_path / 'arm.yaml'
    file.write_text(text)
    return read_urdf.main([str(file), '--output', str(arm), *options]), arm


def warnings(capsys):
    """Return what was printed, and the lines of warnings."""
    said = capsys.readouterr()
    return said.out, [line for line in said.err.splitlines() if 'warning: ' in line]


SRDF = '<robot{0}><disable_collisions link1="l0" link2="l2"/>{1}</robot>'
OTHERS = ''.join(
    f'<disable_collisions link1="{one}" link2="{other}"/>'
    for one, other in (('l0', 'lens'), ('lens', 'case'))
)


def said(capsys):
    """Return the lines of the command, but for the one that says that kernels are compiled."""
    lines = capsys.readouterr().err.splitlines()
    return [line for line in lines if 'compil' not in line]


@pytest.mark.parametrize('given', [' name="quite_another_arm"', ' name="R"', ''])
def test_an_srdf_of_another_robot_is_rejected_with_both_names(tmp_path, capsys, given):
    srdf = tmp_path / 'wrong.srdf'
    srdf.write_text(SRDF.format(given, ''))
    code, arm = read(tmp_path, arm_urdf(), '--srdf', str(srdf))
    assert (code, arm.exists()) == (2, False)
    (line,) = said(capsys)
    other = given.split('"')[1] if given else 'None'
    assert "give the SRDF of robot 'r'" in line
    assert other in line


def test_links_of_an_srdf_that_are_not_the_arms_are_counted(tmp_path, capsys):
    srdf = tmp_path / 'own.srdf'
    srdf.write_text(SRDF.format(' name="r"', OTHERS))
    code, arm = read(tmp_path, arm_urdf(), '--srdf', str(srdf))
    assert (code, load_arm(arm).allowed) == (0, (('l0', 'l2'),))
    assert 'no part of the arm, but in own.srdf: 2 links: lens, case' in capsys.readouterr().out


TURN = (0.1, -0.7, 0.3, 0.6)


@pytest.mark.parametrize(
    'q', [(0.0, 0.5**0.5, 0.0, 0.5**0.5), TURN, tuple(3.0 * value for value in TURN)]
)
def test_quaternions_of_urdf_1_1_turn_joints_geometry_and_picture(tmp_path, q):
    quat = f'quat_xyzw="{" ".join(map(repr, q))}"'
    body = f'<collision><origin xyz="0.05 0 0" {quat}/>{BOX.format(0.02, 0.3)}</collision>'
    text = arm_urdf(body, version='version="1.1"', elbow=quat)
    code, file = read(tmp_path, text, *BEHIND)
    assert code == 0
    arm, R = load_arm(file), rotation_matrix(q)
    T = pose_matrix([-0.3, 0.0, 0.4], [0, 0, 0, 1]) @ pose_matrix([0, 0, 0.3], q)
    T = T @ pose_matrix([0, 0, 0.3], [0, 0, 0, 1])
    assert np.abs(tool_pose(arm, np.zeros(3))[:3, 2] - R[:, 2]).max() < 1e-12
    chain = read_chain(tmp_path / 'arm.urdf')
    place = pose_matrix([-0.3, 0, 0.3], [0, 0, 0, 1])
    assert np.abs(place @ chain.tool_pose(np.zeros(3)) - T).max() < 1e-12
    # A long box: its capsule lies along it.
    (capsule,) = (c for c in arm.capsules if c.name == 'l0')
    T_0 = forward_kinematics(arm, np.zeros(3))[0]
    along = capsule.ends[1] - capsule.ends[0]
    along = T_0[:3, :3] @ along
    assert abs(along @ R[:, 2]) > 0.99 * np.linalg.norm(along)
    robot = place_robot(tmp_path / 'arm.urdf', arm)
    robot.model.update_cfg(robot.values(np.zeros(3)))
    seen = robot.T_base_root @ robot.model.get_transform('l2', 'base')
    assert np.abs(seen - T).max() < 1e-9


@pytest.mark.parametrize('kind', ['collision', 'visual'])
@pytest.mark.parametrize(('radius', 'length'), [(0.04, 0.3), (0.05, 0.0)])
def test_a_capsule_of_urdf_1_1_is_one_of_the_arm(tmp_path, kind, radius, length):
    turned = 'rpy="0.3 0.5 -1.2"'
    body = (
        f'<{kind}><origin xyz="0 0.1 0.15" {turned}/><geometry>'
        f'<capsule radius="{radius}" length="{length}"/></geometry></{kind}>'
    )
    text = arm_urdf(body, version='version="1.2"')
    code, file = read(tmp_path, text, '--geometry', kind, *BEHIND)
    assert code == 0
    (capsule,) = (c for c in load_arm(file).capsules if c.name == 'l0')
    # The polyhedra round a cylinder and a sphere are a little wider.
    assert radius <= capsule.radius < 1.02 * radius
    size = np.linalg.norm(capsule.ends[1] - capsule.ends[0]) + 2.0 * capsule.radius
    assert length + 2.0 * radius <= size < 1.02 * (length + 2.0 * radius)
    T = forward_kinematics(load_arm(file), np.zeros(3))[0]
    middle = T[:3, :3] @ capsule.ends.mean(axis=0) + T[:3, 3]
    assert np.allclose(middle, (-0.3, 0.1, 0.55), atol=2e-3)


CAPSULE = '<collision><geometry><capsule {}/></geometry></collision>'
QUAT = '<collision><origin {}/><geometry><sphere radius="0.1"/></geometry></collision>'


@pytest.mark.parametrize(
    ('body', 'version', 'words'),
    [
        (CAPSULE.format('radius="0.1" length="1"'), '', 'write <robot version="1.1"> to use <cap'),
        (CAPSULE.format('radius="0.1" length="1"'), '1.0', 'write <robot version="1.1"> to use'),
        (CAPSULE.format('radius="0" length="1"'), '1.1', 'expected a radius > 0'),
        (CAPSULE.format('radius="1" length="-1"'), '1.1', 'expected a radius > 0'),
        (CAPSULE.format('radius="1"'), '1.1', "capsule of link 'l0': length"),
        (QUAT.format('quat_xyzw="0 0 0 1"'), '', 'write <robot version="1.1"> to use quat_xyzw'),
        (QUAT.format('quat_xyzw="0 0 0 1"'), 'new', 'write <robot version="1.1"> to use quat'),
        (QUAT.format('quat_xyzw="0 0 0 1" rpy="0 0 0"'), '1.1', 'rpy or quat_xyzw, not both'),
        (QUAT.format('quat_xyzw="0 0 0 0"'), '1.1', 'all zero, expected a unit quaternion'),
        (QUAT.format('quat_xyzw="0 0 1"'), '1.1', 'quat_xyzw'),
        (QUAT.format('quat_xyzw="0 0 nan 1"'), '1.1', 'quat_xyzw'),
    ],
)
def test_what_urdf_1_1_does_not_allow_is_rejected(tmp_path, capsys, body, version, words):
    version = f'version="{version}"' if version else ''
    code, arm = read(tmp_path, arm_urdf(body, version=version))
    assert (code, arm.exists()) == (2, False)
    (line,) = said(capsys)
    assert words in line


SOFT = '<safety_controller k_velocity="1" {}/>'


@pytest.mark.parametrize(
    ('given', 'expected'),
    [
        ('soft_lower_limit="-1" soft_upper_limit="1.5"', (-1.0, 1.5)),
        ('soft_lower_limit="-9" soft_upper_limit="0.5"', (-2.0, 0.5)),
        ('soft_upper_limit="0.5"', (-2.0, 0.5)),
        ('soft_lower_limit="0.5"', (0.5, 2.0)),
        ('soft_lower_limit="0" soft_upper_limit="0"', (-2.0, 2.0)),
        ('', (-2.0, 2.0)),
    ],
)
def test_of_soft_limits_the_narrower_are_taken(tmp_path, capsys, given, expected):
    code, arm = read(tmp_path, arm_urdf(inside=SOFT.format(given)))
    assert (code, load_arm(arm).bounds.T.tolist()) == (0, [list(expected)] * 3)
    said = capsys.readouterr().out
    assert said.count('within soft limits of safety_controller (limits -2 to 2)') == (
        3 if 'soft' in given and expected != (-2.0, 2.0) else 0
    )


@pytest.mark.parametrize('given', [(3, 4), (1, -1), ('nan', 1)])
def test_soft_limits_that_leave_nothing_are_rejected(tmp_path, capsys, given):
    inside = SOFT.format('soft_lower_limit="{}" soft_upper_limit="{}"'.format(*given))
    assert read(tmp_path, arm_urdf(inside=inside))[0] == 2
    assert 'joint "j0": soft limits' in capsys.readouterr().err


def test_what_is_only_seen_can_be_enclosed(tmp_path, capsys):
    text = arm_urdf(shape('visual', 0.1))
    code, file = read(tmp_path, text)
    (line, _) = warnings(capsys)[1]
    assert 'give --geometry visual to enclose what is only seen: l0, l1, l2' in line
    assert (code, load_arm(file).capsules) == (0, ())
    code, file = read(tmp_path, text, '--geometry', 'visual')
    assert [c.name for c in load_arm(file).capsules] == ['l0', 'l1', 'l2']
    assert min(c.radius for c in load_arm(file).capsules) >= 0.05
    # What is not seen keeps its collisions.
    both = text.replace(shape('visual', 0.1), shape('collision', 0.2), 1)
    code, file = read(tmp_path, both, '--geometry', 'visual')
    assert [c.name for c in load_arm(file).capsules] == ['l0', 'l1', 'l2']
    # One of them is only seen: it is said.
    code, file = read(tmp_path, both)
    assert 'not checked: give --geometry visual to enclose' in capsys.readouterr().out


LIMITS = 'lower="{}" upper="{}" velocity="{}" effort="{}"'


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        (arm_urdf(shape(width=60.0, length=300.0)), 'scale="0.001 0.001 0.001"'),
        (arm_urdf(shape(width=0.1, length=2.5)), 'a capsule of "l0" is 2.'),
        (arm_urdf(shape(width=6e-5, length=3e-4)), 'look at the scale of the meshes'),
        (arm_urdf().replace('0 0 0.3"', '0 0 300"'), 'write origins of joints in metres'),
        (arm_urdf(limits=LIMITS.format(-180, 180, 1, 1)), 'write limits in radians, not degrees'),
        (arm_urdf(limits=LIMITS.format(-2, 2, 0, 1)), 'correct the velocity in the limit of "j0"'),
        (arm_urdf(limits=LIMITS.format(-2, 2, 180, 1)), 'correct the velocity'),
        (arm_urdf(limits=LIMITS.format(-2, 2, -1, 1)), 'correct the velocity'),
        (arm_urdf(limits=LIMITS.format(-2, 2, 1, 0)), 'correct the effort'),
        (arm_urdf(limits=LIMITS.format(-2, 2, 1, 1e6)), 'correct the effort'),
    ],
)
def test_what_is_hardly_meant_is_a_line_of_warning(tmp_path, capsys, text, words):
    assert read(tmp_path, text, '--mount', '-3', '0', '0.3', '0', '0', '0', '1')[0] == 0
    lines = warnings(capsys)[1]
    assert sum(words in line for line in lines) == 1
    assert all(line.count('warning') == 1 for line in lines)


def test_a_plausible_arm_has_no_warnings(tmp_path, capsys):
    assert read(tmp_path, arm_urdf(), *BEHIND)[0] == 0
    assert capsys.readouterr().err.count('warning') == 0


def test_a_mount_without_room_is_said_and_mended_at_plan_time(tmp_path, capsys):
    code, file = read(tmp_path, arm_urdf())
    said, lines = warnings(capsys)
    assert code == 0
    assert 'free: 0.0 % of 1000 random configurations' in said
    assert any('give --mount X Y Z' in line and '"torso" collide' in line for line in lines)
    asked = ['--arm', str(file), '--start', 'auto', '--target', '1.5', '0.1', '0.3', '--json']
    assert plan.main(asked) == 2
    assert 'plan: give --mount X Y Z' in capsys.readouterr().err
    assert plan.main([*asked, *BEHIND, '--seed', '1']) == 0
    moved = json.loads(capsys.readouterr().out)
    # The same numbers mean the same to read_urdf.
    code, again = read(tmp_path, arm_urdf(), *BEHIND)
    assert code == 0
    capsys.readouterr()
    assert plan.main([*asked[:1], str(again), *asked[2:], '--seed', '1']) == 0
    told = json.loads(capsys.readouterr().out)
    assert told['end'] == moved['end']
    remade = load_arm(file, pose_matrix([-0.3, 0.0, 0.3], [0, 0, 0, 1]))
    assert np.abs(remade.T_base_mount - load_arm(again).T_base_mount).max() < 1e-12


@pytest.mark.parametrize('limits', [LIMITS.format(-2, 2, 1, 1), LIMITS.format(0.4, 2, 1, 1)])
def test_the_free_start_is_free_and_the_share_is_true(tmp_path, capsys, limits):
    code, file = read(tmp_path, arm_urdf(limits=limits), *BEHIND)
    said = capsys.readouterr().out
    arm = load_arm(file)
    (line,) = (line for line in said.splitlines() if line.startswith('start: --from '))
    start = np.array([float(word) for word in line.split(' is free')[0].split()[2:]])
    assert f'"initial_positions:={[float(value) for value in start]}"' in line
    settings = load_settings(arm.dof)
    world = arm_world(arm, load_body(), settings.margin, settings.ray_guard_length)
    assert world.is_valid(start)
    rng = np.random.default_rng(77)
    n = sum(world.is_valid(q) for q in rng.uniform(*arm.bounds, (2000, arm.dof)))
    share = float(said.split('free: ')[1].split(' %')[0]) / 100.0
    assert abs(share - n / 2000) < 0.08
    # What is proposed leads to a motion.
    (following,) = (line for line in said.splitlines() if line.startswith('next: plan '))
    assert plan.main([*following.split()[2:], '--json']) == 0
    assert json.loads(capsys.readouterr().out)['start']['q'] == pytest.approx(start.tolist())


def test_a_large_arm_is_told_a_place_where_it_has_room(tmp_path, capsys):
    text = arm_urdf(shape(width=0.5, length=0.6)).replace('0 0 0.3"', '0 0 0.6"')
    code, _ = read(tmp_path, text)
    (line,) = (line for line in warnings(capsys)[1] if 'give --mount' in line)
    place = line.split('such as ')[1].split(':')[0].split()
    assert read(tmp_path, text, *place)[0] == code == 0
    (following,) = (x for x in capsys.readouterr().out.splitlines() if x.startswith('next: '))
    assert plan.main(following.split()[2:]) == 0


def test_prefixes_without_a_declaration_are_read_as_ros_does(tmp_path):
    text = arm_urdf().replace('<limit ', '<limit drake:acceleration="2.5" ')
    assert read(tmp_path, text.replace('</robot>', '<drake:joint/></robot>'))[0] == 0


def test_start_and_from_exclude_each_other(capsys):
    with pytest.raises(SystemExit):
        plan.main(['--target', '1', '0', '0', '--start', 'auto', '--from', '0', '0', '0', '0'])
    assert 'not allowed with' in capsys.readouterr().err


def finger(name, kind, joint='', parent='l2', inside=''):
    """Return a link that a joint of its own moves at the end of the arm."""
    return (
        f'<link name="{name}"/><joint name="{joint or name + "_joint"}" type="{kind}">'
        f'<parent link="{parent}"/><child link="{name}"/><axis xyz="0 1 0"/>'
        f'<limit lower="0" upper="0.04" velocity="1" effort="1"/>{inside}</joint>'
    )


MIMIC = '<mimic joint="a_joint"/>'
JAWS = {
    'one jaw by name': finger('moving_jaw', 'revolute', 'gripper'),
    'one jaw by its joint': finger('mover', 'revolute', 'jointGripper'),
    'two fingers': finger('left_finger', 'prismatic') + finger('right_finger', 'prismatic'),
    'two that slide': finger('a', 'prismatic') + finger('b', 'prismatic'),
    'two that turn': finger('a', 'revolute') + finger('b', 'revolute'),
    'one follows': finger('a', 'prismatic') + finger('b', 'prismatic', inside=MIMIC),
    'on a palm': '<link name="palm"/><joint name="p" type="fixed"><parent link="l2"/>'
    '<child link="palm"/></joint>' + finger('a', 'prismatic', parent='palm')
    + finger('b', 'prismatic', parent='palm'),
}  # fmt: skip


@pytest.mark.parametrize('what', JAWS)
def test_a_jaw_is_asked_about_and_not_taken(tmp_path, capsys, what):
    text = arm_urdf(hand=JAWS[what])
    hand = 'palm' if 'palm' in JAWS[what] else 'l2'
    code, arm = read(tmp_path, text)
    assert (code, arm.exists()) == (2, False)
    (line,) = said(capsys)
    assert line.startswith(f'read_urdf: give --tool LINK, one of {hand} (3 joints)')
    jaw = JAWS[what].split('<link name="')[-1].split('"')[0]
    code, arm = read(tmp_path, text, '--tool', jaw)
    assert (code, arm.exists()) == (2, False)
    assert f'give --tool {hand}' in capsys.readouterr().err
    code, arm = read(tmp_path, text, '--tool', hand)
    assert (code, load_arm(arm).dof) == (0, 3)
    if 'mimic' not in JAWS[what]:
        code, arm = read(tmp_path, text, '--tool', jaw, '--jaw')
        assert (code, load_arm(arm).dof) == (0, 4)


@pytest.mark.parametrize(
    'hand',
    [
        finger('telescope', 'prismatic'),
        finger('gripper_link', 'revolute', 'wrist_rotate'),
        finger('lamp', 'revolute', 'gripper_roll_joint'),
        '<link name="finger"/><joint name="f" type="fixed"><parent link="l2"/>'
        '<child link="finger"/></joint>',
    ],
)
def test_what_is_no_jaw_is_taken(tmp_path, hand):
    code, arm = read(tmp_path, arm_urdf(hand=hand))
    assert (code, load_arm(arm).dof) == (0, 3 + ('fixed' not in hand))


def test_a_robot_called_gripper_is_no_jaw(tmp_path):
    code, arm = read(tmp_path, arm_urdf().replace('name="j', 'name="gripper_j'))
    assert (code, load_arm(arm).dof) == (0, 3)


def test_the_remedy_comes_first_however_long_the_rest_is(tmp_path, capsys):
    ends = ''.join(
        f'<link name="{k:03}{"x" * 200}"/><joint name="e{k}" type="fixed"><parent link="l2"/>'
        f'<child link="{k:03}{"x" * 200}"/></joint>'
        for k in range(100)
    )
    assert read(tmp_path, arm_urdf(hand=ends))[0] == 2
    said = capsys.readouterr().err
    assert said.startswith('read_urdf: give --tool LINK, one of 000x')
    roots = ''.join(f'<link name="{k:03}{"x" * 200}"/>' for k in range(100))
    assert read(tmp_path, arm_urdf(hand=roots))[0] == 2
    assert capsys.readouterr().err.startswith('read_urdf: give --base LINK: ')
    mesh = f'package://arms/{"x" * 3000}.stl'
    body = f'<collision><geometry><mesh filename="{mesh}"/></geometry></collision>'
    assert read(tmp_path, arm_urdf(body))[0] == 2
    said = capsys.readouterr().err
    assert said.startswith('read_urdf: set ROS_PACKAGE_PATH to the folder that has the folder "ar')
    assert read(tmp_path, arm_urdf(), '--tool', 'y' * 900)[0] == 2
    assert 'expected one of' in capsys.readouterr().err


ROBOTS = ('lynxmotion_al5d_description/urdf/al5d_robot.urdf',
          'unimation_puma560_description/urdf/puma560_robot.urdf',
          'kuka_description/kuka_lbr_iiwa/urdf/lbr_iiwa_14_r820.urdf')  # fmt: skip


@pytest.mark.parametrize('robot', ROBOTS)
def test_what_is_printed_leads_from_a_makers_file_to_a_motion(tmp_path, capsys, robot):
    rtbdata = pytest.importorskip('rtbdata', reason='rtb-data, with URDFs of makers, is not there')
    file, arm = Path(rtbdata.__file__).parent / 'xacro' / robot, tmp_path / 'arm.yaml'
    command = [str(file), '--output', str(arm)]
    for _ in range(3):
        read_urdf.main(command)
        said = capsys.readouterr()
        if 'next: ' in said.out:
            break
        # The remedy that it names.
        (line,) = (line for line in said.err.splitlines() if 'such as ' in line)
        command += line.split('such as ')[1].split(':')[0].split()
    (following,) = (x for x in said.out.splitlines() if x.startswith('next: '))
    assert plan.main(following.split()[2:]) == 0
    assert 'duration' in capsys.readouterr().out


PROGRESS = """
import sys
from rrth_planner.cli import progress
clock = iter([0.0, 0.5, 1.5, 2.0, 13.0])
progress.time = type('Clock', (), {'monotonic': staticmethod(lambda: next(clock))})
with progress.Progress('read_urdf') as said:
    for name in 'abcd':
        said(f'enclosing {name}')
"""


def test_progress_is_lines_without_a_terminal():
    ended = subprocess.run([sys.executable, '-c', PROGRESS], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (0, '')
    said = [line.split(': ')[1] for line in ended.stderr.splitlines()]
    assert said == ['enclosing b ...', 'enclosing d ...']


def test_progress_is_one_line_that_goes_on_a_terminal():
    ours, theirs = pty.openpty()
    subprocess.run([sys.executable, '-c', PROGRESS], stderr=theirs, check=True)
    said = os.read(ours, 10000).decode()
    for end in (ours, theirs):
        os.close(end)
    assert '\n' not in said
    assert [part for part in said.split('\r\x1b[K') if part] == [
        f'enclosing {name} ...' for name in 'bcd'
    ]
    assert said.endswith('\r\x1b[K')


def test_the_example_is_read_as_before(tmp_path):
    file = resource_path('config/examples/chest_arm.urdf')
    arm = tmp_path / 'arm.yaml'
    assert (
        read_urdf.main([str(file), '--ray', '+x', '--radius', '0.025', '--output', str(arm)]) == 0
    )
    ours, packaged = load_arm(arm), load_arm(resource_path('config/examples/chest_arm.yaml'))
    assert np.array_equal(ours.dh, packaged.dh)
    assert np.abs(ours.T_base_mount - packaged.T_base_mount).max() < 1e-12


def sliding_arm(tmp_path, longest):
    """Return the file of an arm whose hand slides out of its shoulder, clear beyond 0.4 m."""
    ball, quarter = np.array([[0.0, 0.0, -0.01], [0.0, 0.0, 0.01]]), 0.5 * np.pi
    arm = ArmModel(
        joint_names=('turn', 'tilt', 'slide'),
        is_prismatic=(False, False, True),
        dh=np.array([[0.0] * 4, [-quarter, 0, 0, 0], [quarter, 0, 0, 0], [0.0] * 4]),
        bounds=np.array([[-2.0, -2.0, 0.0], [2.0, 2.0, longest]]),
        radii=np.zeros(4),
        T_base_mount=np.eye(4),
        capsules=tuple(
            Capsule(name=name, link=link, ends=ball, radius=radius)
            for name, link, radius in (('shoulder', 1, 0.19), ('fork', 2, 0.01), ('hand', 3, 0.19))
        ),
    )
    file = tmp_path / 'arm.yaml'
    file.write_text(arm_to_yaml(arm, 'arm'))
    return file


def test_an_arm_that_is_mostly_in_its_own_way_is_told_where_some_is_free(tmp_path, capsys):
    asked = ['--arm', str(sliding_arm(tmp_path, 0.43)), '--start', 'auto']
    asked += ['--target', '-1.2', '0.1', '2.5']
    assert plan.main(asked) == 2
    said = capsys.readouterr().err
    assert 'plan: give --mount X Y Z QX QY QZ QW, where ' in said
    assert '% are free, such as ' in said
    place = said.split('such as ')[1].split(':')[0].split()
    assert plan.main([*asked, *place]) == 0
