# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A posture that no person can have is not believed; people in any posture are."""

from dataclasses import replace

from fleshed_person import make_person, plates, posture_of, SEEN, seen_by
import numpy as np
import pytest
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.model.errors import SceneError
from rrth_planner.wearer.body_boxes import body_boxes
from rrth_planner.wearer.plausible_posture import plausible_posture
from rrth_planner.wearer.posture import Posture

KINECT = load_skeleton('azure_kinect')
# The skeleton of rigid bodies on chest, upper arms and hands.
PLATES = """\
base: {frame: chest, offset: [0.1, 0.0, 0.0]}
joints:
  nape: {frame: chest, offset: [0.05, 0.0, 0.3]}
  neck: {frame: chest, offset: [0.05, 0.0, 0.27]}
  hips: {frame: chest, offset: [0.1, 0.0, -0.35]}
  left shoulder: {frame: left_arm, offset: [0.0, -0.05, 0.15]}
  left elbow: {frame: left_arm, offset: [0.0, -0.05, -0.15]}
  left wrist: {frame: left_hand, offset: [0.0, 0.0, 0.05]}
  left hand: {frame: left_hand, offset: [0.0, 0.0, -0.03]}
  right shoulder: {frame: right_arm, offset: [0.0, 0.05, 0.15]}
  right elbow: {frame: right_arm, offset: [0.0, 0.05, -0.15]}
  right wrist: {frame: right_hand, offset: [0.0, 0.0, 0.05]}
  right hand: {frame: right_hand, offset: [0.0, 0.0, -0.03]}
parts:
  pelvis: {around: [base, hips], forward: 0.42, backward: 0.25, left: 0.32, right: 0.32, up: 0.1, down: 0.25}
  head: {bone: [neck, nape], radius: 0.12, ends: [0.05, 0.3]}
without: [neck, left thigh, right thigh, left shin, right shin, left foot, right foot]
"""  # noqa: E501


def person_of(tracker, seed=7):
    """Return what a tracker sees of somebody who stands upright, some metres away."""
    posture = seen_by(tracker, make_person(np.random.default_rng(seed), is_upright=True))
    return replace(posture, positions=posture.positions + [1.0, 2.0, 5.0])


def placed(posture, **places):
    """Return a posture with points in other places."""
    positions = posture.positions.copy()
    for name, place in places.items():
        positions[posture.names.index(name)] = place
    return replace(posture, positions=positions)


def of(posture, name):
    """Return where a point is."""
    return posture.positions[posture.names.index(name)]


@pytest.mark.parametrize('tracker', SEEN)
def test_people_in_any_posture_are_believed_with_the_noise_of_a_tracker(tracker):
    skeleton = load_skeleton(tracker)
    for seed in range(150):
        rng = np.random.default_rng(seed)
        posture = seen_by(tracker, make_person(rng))
        found = plausible_posture(skeleton, posture)
        assert found.posture is posture
        noise = rng.normal(scale=0.015, size=posture.positions.shape)
        noisy = replace(posture, positions=posture.positions + noise)
        assert plausible_posture(skeleton, noisy).doubts == ()


def test_a_recorded_person_is_believed_from_the_first_frame_to_the_last():
    person, skeleton = load_person(), load_skeleton('cmu_bvh')
    for positions, rotations in zip(person.positions, person.rotations, strict=True):
        posture = Posture(names=person.names, positions=positions, rotations=rotations)
        assert plausible_posture(skeleton, posture).doubts == ()


@pytest.mark.parametrize(
    ('points', 'lost'),
    [
        (('HAND_LEFT',), ('left hand',)),
        (('WRIST_LEFT', 'HAND_LEFT'), ('left forearm', 'left hand')),
        (('ELBOW_LEFT',), ('left upper arm', 'left forearm')),
        (('FOOT_RIGHT',), ('right foot',)),
        (('NOSE',), ('head',)),
    ],
)
def test_a_point_at_exactly_0_0_0_is_lost_while_the_person_is_elsewhere(points, lost):
    posture = placed(person_of('azure_kinect'), **dict.fromkeys(points, 0.0))
    assert body_boxes(KINECT, posture)[1] == lost
    (doubt,) = plausible_posture(KINECT, posture).doubts
    assert doubt == f'{", ".join(f"{chr(34)}{p}{chr(34)}" for p in points)} at exactly 0 0 0'


def test_a_person_may_stand_where_the_frame_has_its_origin():
    posture = person_of('azure_kinect')
    for name in ('HAND_LEFT', 'PELVIS', 'NECK'):
        at = replace(posture, positions=posture.positions - of(posture, name))
        assert plausible_posture(KINECT, at).posture is at


def test_points_in_exactly_the_same_place_are_lost():
    posture = person_of('azure_kinect')
    same = placed(posture, ELBOW_LEFT=of(posture, 'WRIST_LEFT'))
    assert body_boxes(KINECT, same)[1] == ('left upper arm', 'left forearm', 'left hand')


@pytest.mark.parametrize(
    ('point', 'lost'),
    [
        ('WRIST_LEFT', ('left forearm', 'left hand')),
        ('HAND_LEFT', ('left forearm', 'left hand')),
        ('ELBOW_RIGHT', ('right upper arm', 'right forearm')),
        ('KNEE_LEFT', ('left thigh', 'left shin', 'left foot')),
    ],
)
def test_a_bone_of_a_length_that_nobody_has_loses_its_parts(point, lost):
    posture = person_of('azure_kinect')
    far = placed(posture, **{point: of(posture, point) + [0.0, 1.5, 0.0]})
    assert body_boxes(KINECT, far)[1] == lost
    assert any(' m long, expected 0.' in doubt for doubt in plausible_posture(KINECT, far).doubts)


@pytest.mark.parametrize('place', [[0.0, 0.0, 0.0], [0.3, 0.1, 0.2]])
def test_a_rigid_body_that_is_elsewhere_loses_forearm_and_hand(place, tmp_path):
    file = tmp_path / 'plates.yaml'
    file.write_text(PLATES)
    skeleton = load_skeleton(str(file))
    person = posture_of(plates(make_person(np.random.default_rng(7), is_upright=True)))
    person = replace(person, positions=person.positions + [3.0, 2.0, 5.0])
    assert body_boxes(skeleton, person)[1] == ()
    assert body_boxes(skeleton, placed(person, left_hand=place))[1] == (
        'left forearm',
        'left hand',
    )


@pytest.mark.parametrize('tracker', ['azure_kinect', 'mediapipe', 'xsens'])
@pytest.mark.parametrize(
    ('scale', 'words'),
    [
        (1000.0, 'm away, expected metres: are the positions in mm'),
        (100.0, 'm away, expected metres: are the positions in cm'),
        (1.0 / 0.0254, 'm away, expected metres: are the positions in inch'),
        (0.4, 'm long, expected .* m, and .* coordinates of an image'),
        (1.6, 'm long, expected .* m, and .* taller than stature says'),
    ],
)
def test_a_person_in_another_unit_is_rejected_with_the_likely_cause(tracker, scale, words):
    posture = person_of(tracker)
    other = replace(posture, positions=scale * posture.positions)
    with pytest.raises(SceneError, match=words):
        body_boxes(load_skeleton(tracker), other)


@pytest.mark.parametrize('tracker', ['azure_kinect', 'mediapipe', 'xsens'])
def test_left_and_right_mirrored_is_rejected(tracker):
    posture = person_of(tracker)
    mirrored = replace(posture, positions=posture.positions * [-1.0, 1.0, 1.0])
    with pytest.raises(SceneError, match='behind the back .*: are left and right mirrored'):
        body_boxes(load_skeleton(tracker), mirrored)


def test_a_face_at_the_back_of_the_head_is_lost():
    posture = person_of('azure_kinect')
    ears = 0.5 * (of(posture, 'EAR_LEFT') + of(posture, 'EAR_RIGHT'))
    behind = placed(posture, NOSE=2.0 * ears - of(posture, 'NOSE'))
    assert body_boxes(KINECT, behind)[1] == ('head',)


def test_a_child_is_believed_where_the_stature_says_so():
    posture = person_of('azure_kinect')
    child = replace(posture, positions=0.6 * posture.positions)
    with pytest.raises(SceneError, match='smaller than the parameter stature says'):
        body_boxes(KINECT, child)
    assert body_boxes(load_skeleton('azure_kinect', (1.0, 1.1)), child)[1] == ()
    with pytest.raises(SceneError, match='stature: .*expected that of the smallest'):
        load_skeleton('azure_kinect', (2.0, 1.0))


def test_points_that_the_tracker_has_under_another_name_are_named():
    posture = person_of('azure_kinect')
    names = tuple('CHEST' if name == 'SPINE_CHEST' else name for name in posture.names)
    with pytest.raises(SceneError, match='base: no point "SPINE_CHEST" among'):
        body_boxes(KINECT, replace(posture, names=names))
