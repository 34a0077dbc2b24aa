# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""People of BVH and C3D are where an independent calculation has them, in metres."""

import sys

import numpy as np
import pytest
from recordings import bvh_text, JOINTS, RATE, set_frames, write_c3d
from rrth_planner.io import motion_capture_file
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.resources import resource_path
from rrth_planner.model.errors import NotInstalledError, RecordError, RrthError
from rrth_planner.wearer.recorded_person import posture_at

NAMES = ('a', 'b', 'c')


@pytest.fixture
def bvh(tmp_path):
    """Return the path of a BVH in centimetres."""
    pytest.importorskip('pybvh')
    file = tmp_path / 'person.bvh'
    file.write_text(bvh_text()[0])
    return file


def turned(axis, degrees):
    """Return the rotation about a coordinate axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = {'X': (1, 2), 'Y': (2, 0), 'Z': (0, 1)}[axis]
    rotation = np.eye(3)
    rotation[i, i] = rotation[j, j] = c
    rotation[i, j], rotation[j, i] = -s, s
    return rotation


def joint_poses(values):
    """Return the pose of each joint in one frame of JOINTS, by name, (4, 4) [cm]."""
    # The order of the channels is that of the text: depth first.
    order = ['hip', 'chest', 'head', 'lHand', 'lFoot']
    by_name = {name: (before, offset, turns) for name, before, offset, turns in JOINTS}
    poses = {}
    for k, name in enumerate(order):
        before, offset, turns = by_name[name]
        T = np.eye(4)
        T[:3, 3] = values[:3] if before is None else offset
        for axis, degrees in zip(turns, values[3 + 3 * k : 6 + 3 * k], strict=True):
            T[:3, :3] = T[:3, :3] @ turned(axis, degrees)
        poses[name] = T if before is None else poses[before] @ T
    return poses


def test_the_joints_of_a_bvh_are_where_its_angles_put_them(bvh):
    person = load_person(bvh)
    assert person.names == tuple(name for name, *_ in JOINTS)
    assert person.rate == RATE
    values = bvh_text()[1]
    assert person.positions.shape == (len(values), 5, 3)
    for frame, row in enumerate(values):
        for name, T in joint_poses(row).items():
            k = person.names.index(name)
            np.testing.assert_allclose(person.positions[frame, k], 0.01 * T[:3, 3], atol=1e-9)
            np.testing.assert_allclose(person.rotations[frame, k], T[:3, :3], atol=1e-9)


@pytest.mark.parametrize(('unit', 'scale'), [('m', 0.01), ('cm', 1.0), ('mm', 10.0)])
def test_the_unit_of_a_bvh_is_guessed_and_said_or_given(tmp_path, bvh, unit, scale):
    expected = load_person(bvh, unit='cm').positions
    file = tmp_path / 'scaled.bvh'
    file.write_text(bvh_text(scale=scale)[0])
    said = []
    guessed = load_person(file, say=said.append)
    assert said == [f'file {file}: lengths taken as {unit}: the skeleton is 1.46 m tall']
    np.testing.assert_allclose(guessed.positions, expected, atol=1e-6)
    for given in (unit, repr(0.01 / scale)):
        person = load_person(file, unit=given, say=said.append)
        np.testing.assert_allclose(person.positions, guessed.positions, rtol=1e-12)
        assert said[-1].endswith('1.46 m tall')


@pytest.mark.parametrize(('unit', 'scale'), [('inch', 1 / 2.54), ('foot', 1 / 30.48)])
def test_a_skeleton_of_no_adults_size_needs_a_unit(tmp_path, bvh, unit, scale):
    expected = load_person(bvh, unit='cm').positions
    file = tmp_path / 'scaled.bvh'
    file.write_text(bvh_text(scale=scale)[0])
    with pytest.raises(RecordError, match=f'--unit is needed, .*1.46 m in {unit}'):
        load_person(file)
    np.testing.assert_allclose(load_person(file, unit=unit).positions, expected, atol=1e-4)


def test_an_upper_body_is_told_by_the_span_of_its_arms(tmp_path):
    pytest.importorskip('pybvh')
    arms = ''.join(
        f'JOINT {name}\n{{\nOFFSET {x} 40 0\nCHANNELS 0\n}}\n'
        for name, x in (('left', 65), ('right', -65))
    )
    changes = [('OFFSET 0 60 0', 'OFFSET 0 20 0'), ('JOINT chest', f'{arms}JOINT chest')]
    chain(tmp_path, *changes)
    said = []
    load_person(tmp_path / 'chain.bvh', say=said.append)
    assert said[0].endswith('the skeleton is 0.60 m tall, and 1.30 m from end to end')


def test_a_spine_alone_is_as_tall_as_it_is_long(tmp_path):
    pytest.importorskip('pybvh')
    said = []
    chain(tmp_path, ('OFFSET 0 60 0', 'OFFSET 0 80 0'))
    load_person(tmp_path / 'chain.bvh', say=said.append)
    assert said[0].endswith('m tall')
    assert ' 0.00 m' not in said[0]


CHAIN = """HIERARCHY
ROOT Hips
{
OFFSET 0 0 0
CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
JOINT THE NAME
{
OFFSET 0 60 0
CHANNELS 3 Zrotation Xrotation Yrotation
JOINT Head
{
OFFSET 0 60 0
CHANNELS 3 Zrotation Xrotation Yrotation
End Site
{
OFFSET 0 20 0
}
}
}
}
MOTION
Frames: 2
Frame Time: 0.04
1 2 3 10 20 30 40 50 60 70 80 90
0 0 0 0 0 0 0 0 0 0 0 0
"""


def chain(tmp_path, *changes, name='chest'):
    """Return the person of a chain of three joints, written with some changes."""
    text = CHAIN.replace('THE NAME', name)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / 'chain.bvh'
    file.write_bytes(text.encode())
    return load_person(file)


@pytest.mark.parametrize(
    'changes',
    [
        [('End Site', 'END SITE')],
        [('End Site', 'end site')],
        [('End Site', 'EndSite')],
        [('Frame Time: 0.04', 'Frame Time:0.04')],
        [('Frame Time: 0.04', 'FRAME TIME :\t0.04'), ('Frames: 2', 'frames:2')],
        [('\n', '\r\n')],
        [('\n{', ' {')],
        [('HIERARCHY', '\ufeffHierarchy'), ('ROOT', 'root'), ('JOINT', 'Joint')],
        [('OFFSET', '\tOffset'), ('CHANNELS', 'Channels'), ('Xposition', 'XPOSITION')],
        [('30 40 50', '30\n40 50')],
        [('Xposition Yposition Zposition', 'Zposition Xposition Yposition'),
         ('1 2 3 10', '3 1 2 10')],
        [('Xposition Yposition Zposition Zrotation Xrotation Yrotation',
          'Zrotation Xrotation Yrotation Xposition Yposition Zposition'),
         ('1 2 3 10 20 30', '10 20 30 1 2 3')],
    ],
)  # fmt: skip
def test_a_bvh_may_be_spelt_in_many_ways(tmp_path, changes):
    pytest.importorskip('pybvh')
    plain, other = chain(tmp_path), chain(tmp_path, *changes)
    assert other.names == plain.names == ('Hips', 'chest', 'Head')
    assert other.rate == plain.rate == 25.0
    np.testing.assert_array_equal(other.positions, plain.positions)
    np.testing.assert_array_equal(other.rotations, plain.rotations)


def test_names_with_blanks_are_read_whole(tmp_path):
    pytest.importorskip('pybvh')
    person = chain(tmp_path, ('Hips', 'Bip01 Pelvis'), ('Head', 'Bip01 Head'), name='Bip01 Spine')
    assert person.names == ('Bip01 Pelvis', 'Bip01 Spine', 'Bip01 Head')


def test_joints_may_have_positions_that_are_their_offsets(tmp_path):
    pytest.importorskip('pybvh')
    channels = 'CHANNELS 3 Zrotation Xrotation Yrotation\nJOINT Head'
    moving = 'CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\nJOINT Head'
    values = ('1 2 3 10 20 30 40', '1 2 3 10 20 30 0 60 0 40')
    still = ('0 0 0 0 0 0 0 0 0 0 0 0', '0 0 0 0 0 0 0 60 0.0001 0 0 0 0 0 0')
    person = chain(tmp_path, (channels, moving), values, still)
    np.testing.assert_array_equal(person.positions, chain(tmp_path).positions)
    away = ('0 0 0 0 0 0 0 0 0 0 0 0', '0 0 0 0 0 0 0 62 0 0 0 0 0 0 0')
    with pytest.raises(RecordError, match='JOINT "chest": its Yposition differs .* by up to 2,'):
        chain(tmp_path, (channels, moving), values, away)


def test_joints_may_have_fewer_rotations(tmp_path):
    pytest.importorskip('pybvh')
    channels = 'CHANNELS 3 Zrotation Xrotation Yrotation\nEnd'
    person = chain(tmp_path, (channels, 'CHANNELS 1 Xrotation\nEnd'), (' 70 80 90', ' 80'),
                   ('0 0 0 0 0 0 0 0 0 0 0 0', '0 0 0 0 0 0 0 0 0 0'))  # fmt: skip
    expected = chain(tmp_path, (' 70 80 90', ' 0 80 0'))
    np.testing.assert_allclose(person.rotations, expected.rotations, atol=1e-15)


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda text: text[: text.rindex(' ')], '215 values for 12 frames of 18 channels'),
        (lambda text: text[: text.rindex('\n', 0, -1) + 1], '198 values for 12 frames of 18'),
        (
            lambda text: text.replace('}', '', 1),
            'is not closed by a "}": the hierarchy is cut off',
        ),
        (lambda text: text[: text.index('MOTION')], 'no MOTION after the hierarchy'),
        (lambda text: '', 'no ROOT'),
        (
            lambda text: text.replace('JOINT', 'BONE'),
            'line [0-9]+: "BONE .*expected ROOT, JOINT',
        ),
        (lambda text: text.replace('}', '}}', 1), 'expected one ROOT|without a "{" before it'),
        (lambda text: text.replace('chest', 'hip'), 'given twice'),
        (lambda text: text.replace('Frames: 12', 'Frames: 1000000000'), 'for 1000000000 frames'),
        (lambda text: text.replace('Frames: 12', 'Frames: many'), '"many", expected a number'),
        (lambda text: text.replace('Frames: 12', 'Frames 12'), 'Frames: missing'),
        (lambda text: text.replace('32.000000', 'nan'), 'not finite'),
        (lambda text: text.replace('32.000000', '1e300'), 'expected'),
        (lambda text: text.replace('32.000000', '32,0', 1), 'line [0-9]+: "32,0", expected a num'),
        (lambda text: text.replace('Frame Time: 0.02', 'Frame Time: -1'), 'Frame Time: -1'),
        (lambda text: text.replace('Frame Time: 0.02', 'Frame Time: 0'), 'a time > 0'),
        (lambda text: text.replace('JOINT', 'JOINT x\n' * 3000), 'joints and ends'),
        (lambda text: text.replace('OFFSET', 'OFFSET 1', 1), 'expected three numbers'),
        (lambda text: text.replace('CHANNELS 3 Z', 'CHANNELS 4 Z', 1), 'number of channels'),
        (lambda text: text.replace('Yrotation', 'Wrotation', 1), 'channel "Wrotation"'),
        (
            lambda text: text.replace('CHANNELS 3', 'CHANNELS 6 Xposition Yposition Zposition', 1),
            'values for 12 frames of 21 channels',
        ),
    ],
)
def test_a_bvh_that_is_damaged_is_rejected_in_a_sentence(bvh, change, words):
    bvh.write_text(change(bvh.read_text()))
    with pytest.raises(RecordError, match=words) as rejected:
        load_person(bvh)
    assert str(rejected.value).startswith(f'file {bvh}: ')


def test_the_points_of_a_c3d_are_read_in_its_unit_and_may_be_lost(tmp_path):
    pytest.importorskip('c3d')
    positions = np.random.default_rng(2).uniform(-900.0, 900.0, (20, 3, 3))
    lost = [(3, 1), (4, 1), (7, 0)]
    for unit, scale in (('mm', 1e-3), ('cm', 1e-2), ('m', 1.0)):
        file = tmp_path / f'{unit}.c3d'
        write_c3d(file, NAMES, positions, unit, lost)
        person = load_person(file)
        assert person.names == NAMES
        assert person.rate == RATE
        assert person.rotations is None
        expected = scale * positions
        expected[tuple(np.transpose(lost))] = np.nan
        np.testing.assert_allclose(person.positions, expected, atol=1e-3 * scale)
        np.testing.assert_allclose(load_person(file, unit='mm').positions * scale * 1e3, expected)


def test_a_c3d_of_more_points_than_a_parameter_has_names_is_read_whole(tmp_path):
    pytest.importorskip('c3d')
    names, file = tuple(f'p{k}' for k in range(600)), tmp_path / 'many.c3d'
    positions = np.random.default_rng(3).uniform(100.0, 900.0, (2, 600, 3))
    write_c3d(file, names, positions)
    person = load_person(file)
    assert person.names == names
    np.testing.assert_allclose(person.positions, 1e-3 * positions, rtol=1e-6)


def test_gaps_that_are_zeros_are_lost_and_a_common_subject_is_left_out(tmp_path):
    pytest.importorskip('c3d')
    file, positions = tmp_path / 'person.c3d', np.full((4, 3, 3), 500.0)
    positions[2, 1] = 0.0
    positions[3, 0, :2] = 0.0
    write_c3d(file, ('Jo:a', 'Jo:b', 'Jo:c'), positions)
    person = load_person(file)
    assert person.names == NAMES
    assert np.argwhere(np.isnan(person.positions).any(axis=2)).tolist() == [[2, 1]]
    # Of two people each one's points keep his name.
    write_c3d(file, ('Jo:a', 'Al:a', 'Jo:c'), positions)
    assert load_person(file).names == ('Jo:a', 'Al:a', 'Jo:c')


@pytest.mark.parametrize('start', [1, 2, 65528, 65535, 65536, 70000, 140000])
def test_a_c3d_may_begin_at_any_frame(tmp_path, start):
    pytest.importorskip('c3d')
    file, n = tmp_path / 'late.c3d', 8
    positions = 100.0 + np.arange(n * 9.0).reshape(n, 3, 3)
    write_c3d(file, NAMES, positions)
    set_frames(file, start, start + n - 1)
    person = load_person(file)
    np.testing.assert_allclose(person.positions, 1e-3 * positions, rtol=1e-6)


def test_a_c3d_of_more_frames_than_its_header_can_say_is_counted_by_its_data(tmp_path):
    pytest.importorskip('c3d')
    file, n = tmp_path / 'long.c3d', 70_000
    positions = np.full((n, 1, 3), 500.0)
    positions[:, 0, 0] += np.arange(n)
    write_c3d(file, ('a',), positions)
    set_frames(file, 1, n)
    assert load_person(file).positions.shape == (n, 1, 3)
    # As of a writer that does not know the two words.
    data = file.read_bytes()
    for name in (b'ACTUAL_START_FIELD', b'ACTUAL_END_FIELD', b'LONG_FRAMES'):
        data = data.replace(name, b'X' * len(name))
    file.write_bytes(data)
    person = load_person(file)
    assert n <= len(person.positions) <= n + 512 // 16
    np.testing.assert_allclose(person.positions[n - 1, 0, 0], 1e-3 * (500.0 + n - 1))
    assert np.isnan(person.positions[n:]).all()


def test_a_c3d_that_is_damaged_is_rejected_in_a_sentence(tmp_path):
    pytest.importorskip('c3d')
    file = tmp_path / 'person.c3d'
    write_c3d(file, NAMES, np.ones((200, 3, 3)), unit='inch')
    assert load_person(file).positions.max() == pytest.approx(0.0254)
    write_c3d(file, NAMES, np.ones((200, 3, 3)), unit='ell')
    with pytest.raises(RecordError, match='lengths in "ell", expected m, cm, mm, inch, foot'):
        load_person(file)
    assert load_person(file, unit='cm').positions.max() == pytest.approx(0.01)
    data = file.read_bytes()
    file.write_bytes(data[:-4096])
    with pytest.raises(RecordError, match='frames, expected 200: the file is cut off'):
        load_person(file)
    for n in (0, 3, 600):
        file.write_bytes(data[:n])
        with pytest.raises(RecordError, match='expected a readable .c3d file'):
            load_person(file)


@pytest.mark.parametrize(
    ('name', 'unit', 'words'),
    [
        ('none.bvh', None, 'No such file'),
        ('person.fbx', None, 'expected a name that ends in .bvh, .c3d, .csv'),
        ('person.bvh', 'ell', 'unit: ell, expected m, cm, mm, inch, foot or how long it is'),
        ('person.bvh', '-1', 'unit: -1, expected m, cm'),
        ('person.bvh', 'nan', 'unit: nan, expected m, cm'),
        ('person.csv', 'mm', 'unit: mm, expected m for a table'),
    ],
)
def test_what_cannot_be_read_is_said_before_any_library_is_asked(tmp_path, name, unit, words):
    with pytest.raises(RrthError, match=words):
        load_person(tmp_path / name, unit=unit)


def test_a_file_that_is_too_long_or_has_too_many_points_is_rejected(bvh, monkeypatch):
    monkeypatch.setattr(motion_capture_file, 'MOST_POINTS', 59)
    with pytest.raises(RecordError, match='12 frames of 5 points, expected at most 59 in all'):
        load_person(bvh)
    with bvh.open('ab') as file:
        file.truncate(16 * 2**20 + 1)
    with pytest.raises(RrthError, match='expected at most 16777216 bytes'):
        load_person(bvh)


@pytest.mark.parametrize(('suffix', 'library'), [('.bvh', 'pybvh'), ('.c3d', 'c3d')])
def test_a_library_that_is_missing_is_named(tmp_path, monkeypatch, suffix, library):
    monkeypatch.setitem(sys.modules, library, None)
    file = tmp_path / f'person{suffix}'
    file.write_text('')
    with pytest.raises(NotInstalledError, match=rf'needs {library}; .*rrth_planner\[tools\]'):
        load_person(file)


def test_the_person_that_comes_along_is_one_at_work():
    file = resource_path('config/people/construction_work.csv')
    assert file.stat().st_size < 300_000
    assert 'subject 62, take 13' in file.read_text().splitlines()[0]
    person = load_person()
    assert person.rate == 30.0
    assert 8.0 < person.duration < 10.0
    assert not np.isnan(person.positions).any()
    posture = posture_at(person, 5.0)
    place = dict(zip(person.names, posture.positions, strict=True))
    # Of that skeleton y is up.
    assert place['head'][1] > place['chest'][1] > place['hip'][1] > place['rFoot'][1]
    hand = person.positions[:, person.names.index('lHand')]
    assert np.linalg.norm(np.diff(hand, axis=0), axis=1).max() * person.rate > 1.0
