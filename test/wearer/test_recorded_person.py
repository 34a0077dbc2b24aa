# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A recording has a posture at any time, and neither jumps nor finds what was lost."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.model.errors import RecordError
from rrth_planner.model.rotation import quaternion_xyzw, rotation_matrix
from rrth_planner.wearer.recorded_person import (
    excerpt,
    posture_at,
    RecordedPerson,
    resampled,
)

RATE = 20.0


def person_of(seed, n_frames=7, n=3, turn=0.5):
    """Return a made-up recording that turns by less than an angle [rad] from frame to frame."""
    rng = np.random.default_rng(seed)
    rotations = np.empty((n_frames, n, 3, 3))
    rotations[0] = np.eye(3)
    for frame in range(1, n_frames):
        for k in range(n):
            axis = rng.normal(size=3)
            half = 0.5 * rng.uniform(0.0, turn)
            vector = axis / np.linalg.norm(axis) * np.sin(half)
            step = rotation_matrix([*vector, np.cos(half)])
            rotations[frame, k] = rotations[frame - 1, k] @ step
    return RecordedPerson(
        names=tuple(f'point_{k}' for k in range(n)),
        rate=RATE,
        positions=rng.normal(size=(n_frames, n, 3)),
        rotations=rotations,
    )


def slerp(begin, end, part):
    """Return a rotation between two, by quaternions (Shoemake 1985)."""
    p, q = quaternion_xyzw(begin), quaternion_xyzw(end)
    q = -q if p @ q < 0.0 else q
    angle = np.arccos(min(1.0, p @ q))
    if angle < 1e-6:
        return begin
    weights = np.sin((1.0 - part) * angle), np.sin(part * angle)
    return rotation_matrix((weights[0] * p + weights[1] * q) / np.sin(angle))


def test_at_the_time_of_a_frame_the_posture_is_that_frame():
    person = person_of(1)
    for k in range(7):
        posture = posture_at(person, k / RATE)
        np.testing.assert_array_equal(posture.positions, person.positions[k])
        np.testing.assert_allclose(posture.rotations, person.rotations[k], atol=1e-15)
        assert posture.names == person.names


@given(st.integers(0, 2**31), st.integers(0, 5), st.floats(0.0, 1.0), st.sampled_from([0.5, 3.1]))
def test_between_two_frames_it_is_interpolated(seed, k, part, turn):
    person = person_of(seed, turn=turn)
    posture = posture_at(person, (k + part) / RATE)
    begin, end = person.positions[k : k + 2]
    np.testing.assert_allclose(posture.positions, (1 - part) * begin + part * end, atol=1e-4)
    for i, rotation in enumerate(posture.rotations):
        begin, end = person.rotations[k : k + 2, i]
        np.testing.assert_allclose(rotation, slerp(begin, end, part), atol=2e-5)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-8)


def test_half_a_turn_apart_the_nearer_rotation_is_taken():
    turns = np.array([np.eye(3), np.diag([1.0, -1.0, -1.0])])[:, None]
    person = RecordedPerson(
        names=('head',), rate=1.0, positions=np.zeros((2, 1, 3)), rotations=turns
    )
    np.testing.assert_allclose(posture_at(person, 0.4).rotations, turns[0], atol=1e-12)
    np.testing.assert_allclose(posture_at(person, 0.6).rotations, turns[1], atol=1e-12)


@given(st.integers(0, 2**31), st.floats(0.0, 50.0), st.floats(1e-4, 0.05))
def test_played_forwards_and_backwards_nothing_jumps(seed, time, step):
    person = person_of(seed)
    before, after = posture_at(person, time), posture_at(person, time + step)
    fastest = np.linalg.norm(np.diff(person.positions, axis=0), axis=2).max() * RATE
    moved = np.linalg.norm(after.positions - before.positions, axis=1)
    assert moved.max() <= fastest * step + 1e-4
    mirrored = posture_at(person, 2.0 * person.duration * 7 - time)
    np.testing.assert_allclose(mirrored.positions, before.positions, atol=1e-4)


def test_what_is_lost_in_a_frame_is_lost_up_to_its_neighbours():
    person = person_of(3)
    positions, rotations = person.positions.copy(), person.rotations.copy()
    positions[3, 1] = np.nan
    rotations[4, 2] = np.nan
    holed = RecordedPerson(names=person.names, rate=RATE, positions=positions, rotations=rotations)
    for at, point_lost, turn_lost in (
        (2.0, False, False),
        (2.1, True, False),
        (3.0, True, False),
        (3.2, True, True),
        (3.7, True, True),
        (4.0, False, True),
        (4.9, False, True),
        (5.0, False, False),
    ):
        posture = posture_at(holed, at / RATE)
        lost = np.isnan(posture.positions).all(axis=1)
        assert lost.tolist() == [False, point_lost, False], at
        lost = np.isnan(posture.rotations).all(axis=(1, 2))
        assert lost.tolist() == [False, False, turn_lost], at
        assert np.isnan(posture.positions).sum() == 3 * point_lost


def test_points_alone_have_no_rotations():
    person = RecordedPerson(names=('a',), rate=2.0, positions=np.ones((3, 1, 3)))
    assert posture_at(person, 0.7).rotations is None
    assert resampled(person, 7.0).rotations is None
    assert excerpt(person, 0.5).rotations is None


def test_one_frame_is_there_at_all_times():
    person = RecordedPerson(names=('a',), rate=2.0, positions=[[[1.0, 2.0, 3.0]]])
    for time in (0.0, 0.3, 100.0):
        assert posture_at(person, time).positions.tolist() == [[1.0, 2.0, 3.0]]


def test_an_excerpt_has_the_frames_between_its_times():
    person = person_of(4)
    part = excerpt(person, 2 / RATE, 5 / RATE)
    np.testing.assert_array_equal(part.positions, person.positions[2:6])
    np.testing.assert_array_equal(part.rotations, person.rotations[2:6])
    np.testing.assert_array_equal(excerpt(person).positions, person.positions)
    np.testing.assert_array_equal(excerpt(person, 0.06).positions, person.positions[2:])


@pytest.mark.parametrize(
    ('begin', 'end', 'words'),
    [
        (-1.0, None, 'expected times in this order within the recording, 0 to 0.300'),
        (0.0, 9.0, 'within the recording'),
        (0.2, 0.1, 'in this order'),
        (0.06, 0.07, 'no frame, expected at least 0.05'),
        (float('nan'), None, 'within the recording'),
    ],
)
def test_an_excerpt_of_nothing_is_rejected(begin, end, words):
    with pytest.raises(RecordError, match=words):
        excerpt(person_of(4), begin, end)


@pytest.mark.parametrize('rate', [3.0, 20.0, 60.0, 47.3])
def test_a_resampled_recording_is_the_same_motion(rate):
    person = person_of(5)
    other = resampled(person, rate)
    assert other.rate == rate
    assert 0.0 <= person.duration - other.duration < 1.0 / rate
    for k in range(len(other.positions)):
        posture = posture_at(person, k / rate)
        np.testing.assert_allclose(other.positions[k], posture.positions, atol=1e-12)
        np.testing.assert_allclose(other.rotations[k], posture.rotations, atol=1e-12)


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'rate': 0.0}, r'rate: 0.0, expected a number > 0 \[1/s\]'),
        ({'rate': float('nan')}, 'rate: nan'),
        ({'names': ('a', 'a')}, 'point "a": given twice'),
        ({'names': ('a', 'b\n')}, 'point 1: '),
        ({'names': ('a',)}, r'positions: shape \(2, 2, 3\), expected \(2, 1, 3\)'),
        ({'rotations': np.zeros((2, 2, 3))}, 'rotations: shape'),
        ({'positions': np.zeros((0, 2, 3))}, '0 frames of 2 points'),
    ],
)
def test_what_is_no_recording_is_rejected(changes, words):
    good = {'names': ('a', 'b'), 'rate': 2.0, 'positions': np.zeros((2, 2, 3))}
    with pytest.raises(RecordError, match=words):
        RecordedPerson(**{**good, **changes})
    with pytest.raises(RecordError, match='rate: -1'):
        resampled(RecordedPerson(**good), -1)


def test_a_recording_cannot_be_changed():
    person = person_of(6)
    with pytest.raises(ValueError, match='read-only'):
        person.positions[0] = 0.0
