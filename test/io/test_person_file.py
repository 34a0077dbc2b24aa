# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A table of a recorded person comes back as it was written, or is rejected in one sentence."""

import numpy as np
import pytest
from rrth_planner.io.person_file import read_person, write_person
from rrth_planner.model.errors import RecordError
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.wearer.recorded_person import RecordedPerson


def made_up():
    """Return a recording in which a point, and the axes of another one, are lost for a while."""
    rng = np.random.default_rng(1)
    positions, rotations = rng.normal(size=(9, 3, 3)), np.full((9, 3, 3, 3), np.nan)
    positions[4:6, 2] = np.nan
    for frame in range(9):
        rotations[frame, 1] = rotation_matrix(rng.normal(size=4))
    rotations[7, 1] = np.nan
    return RecordedPerson(
        names=('hip', 'chest, upper', 'lHand'),
        rate=29.97,
        positions=positions,
        rotations=rotations,
    )


def test_a_recording_is_read_as_it_was_written(tmp_path):
    person, file = made_up(), tmp_path / 'person.csv'
    write_person(person, file, ['Made up,\nfor a test.'])
    assert file.read_text().startswith('# Made up, for a test.\ntime [s],hip x [m],')
    read = read_person(file)
    assert read.names == person.names
    assert read.rate == pytest.approx(29.97, rel=1e-12)
    np.testing.assert_allclose(read.positions, person.positions, atol=0.51e-4)
    np.testing.assert_allclose(read.rotations, person.rotations, atol=3e-4)


def test_points_alone_have_no_rotations(tmp_path):
    file = tmp_path / 'person.csv'
    write_person(RecordedPerson(names=('a',), rate=30.0, positions=np.ones((4, 1, 3))), file)
    read = read_person(file)
    assert read.rotations is None
    assert read.rate == 30.0


HEADER = 'time [s],a x [m],a y [m],a z [m]'
TURNED = f'{HEADER},a qx,a qy,a qz,a qw'


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', 'columns'),
        ('# nothing', 'columns'),
        ('time [s]\n0\n1', 'columns'),
        ('time [s],a x [m],a y [m],b z [m]\n0,0,0,0', 'columns'),
        (f'{HEADER},b qx,b qy,b qz,b qw\n', 'columns'),
        (f'{HEADER}\n0,0,0,0', '1 frames, expected at least 2'),
        (f'{HEADER}\n0,0,0,0\n1,0,0', 'lines of other lengths, expected 4 fields'),
        (
            f'{HEADER}\n0,0,0,0\n1,0,0,x',
            "could not convert string to float: 'x', expected numbers",
        ),
        (f'{HEADER}\n0,0,0,0\n1,0,0,0\n3,0,0,0', 'uneven steps'),
        (f'{HEADER}\n0,0,0,0\n0,0,0,0', 'uneven steps'),
        (f'{HEADER}\n0,0,0,0\n,0,0,0', 'uneven steps'),
        (f'{HEADER}\n0,0,0,0\n1,0,0,1e9', 'numbers beyond 10000'),
        (f'{TURNED}\n0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,2', 'a: a quaternion of another length'),
        (f'{TURNED}\n0,0,0,0,0,0,0,1\n1,0,0,0,0,0,,1', 'a: a quaternion of another length'),
        (f'{HEADER}\n"', 'expected a readable file'),
    ],
)
def test_what_is_no_recording_is_rejected_in_a_sentence(tmp_path, text, words):
    file = tmp_path / 'person.csv'
    file.write_text(text)
    with pytest.raises(RecordError, match=words.replace('[', r'\[')) as rejected:
        read_person(file)
    assert str(rejected.value).startswith(f'file {file}: ')
