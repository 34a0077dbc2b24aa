# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""People of BVH and C3D are where an independent calculation has them, in metres."""

import sys

import numpy as np
import pytest
from recordings import bvh_text, JOINTS, RATE, write_c3d
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
    assert said == [f'file {file}: lengths taken as {unit} by the size of the skeleton']
    np.testing.assert_allclose(guessed.positions, expected, atol=1e-6)
    given = load_person(file, unit=unit, say=said.append)
    np.testing.assert_array_equal(given.positions, guessed.positions)
    assert len(said) == 1


def test_a_skeleton_of_no_persons_size_needs_a_unit(tmp_path, bvh):
    file = tmp_path / 'tiny.bvh'
    file.write_text(bvh_text(scale=0.1)[0])
    with pytest.raises(RecordError, match='from end to end, expected the size of a person'):
        load_person(file)
    assert load_person(file, unit='cm').positions.max() < 0.2


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda text: text[: len(text) // 2], 'number of columns changed'),
        (lambda text: text[: text.rindex('\n', 0, -1) + 1], '12 frames but file contains 11'),
        (lambda text: text[:200], 'expected a readable .bvh file'),
        (lambda text: '', 'No ROOT'),
        (lambda text: text.replace('chest', 'hip'), 'given twice'),
        (lambda text: text.replace('Frames: 12', 'Frames: 1000000000'), '1000000000 frames'),
        (lambda text: text.replace('32.000000', 'nan'), 'not finite'),
        (lambda text: text.replace('32.000000', '1e300'), 'expected'),
        (lambda text: text.replace('Frame Time: 0.02', 'Frame Time: -1'), 'frame_time'),
        (lambda text: text.replace('JOINT', 'JOINT x\n' * 3000), 'joints and ends'),
        (
            lambda text: text.replace('CHANNELS 3', 'CHANNELS 6 Xposition Yposition Zposition', 1),
            'position channels on non-root joints',
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


def test_a_c3d_that_is_damaged_is_rejected_in_a_sentence(tmp_path):
    pytest.importorskip('c3d')
    file = tmp_path / 'person.c3d'
    write_c3d(file, NAMES, np.ones((200, 3, 3)), unit='inch')
    with pytest.raises(RecordError, match='lengths in "inch", expected m, cm, mm'):
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
        ('person.bvh', 'inch', 'unit: inch, expected m, cm, mm'),
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
    monkeypatch.setattr(sys, 'path', [])
    monkeypatch.delitem(sys.modules, library, raising=False)
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
