# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Boxes contain the flesh of people, as each tracker reports them, and are not absurdly large."""

from functools import cache

from fleshed_person import make_person, SEEN, seen_by, turn
from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.arm import forward_kinematics
from rrth_planner.model.errors import SceneError
from rrth_planner.model.scene import Box
from rrth_planner.wearer.body_boxes import base_pose, body_boxes, rows_of_postures
from rrth_planner.wearer.posture import Posture
from rrth_planner.wearer.recorded_person import postures_at
from rrth_planner.wearer.skeleton import Direction, FrameBase, Joint, JointBase, Part, Skeleton
from worlds import examples

N_PEOPLE = 120
# Volume of all boxes over that of the flesh, at most. An ellipsoid fills half of its box, a limb
# as thick as in the table 0.8, and with 1 cm of clothes a third of the volume is theirs: that
# makes 3. Where the tracker reports no frame in the chest the trunk has room to lean, and where it
# reports nothing beyond the wrists the hands have room to bend, which doubles it.
LARGEST = {
    'xsens': 3.6,
    'xsens_bvh': 3.6,
    'azure_kinect': 3.7,
    'cmu_bvh': 3.9,
    'mediapipe': 4.5,
    'ros4hri': 5.5,
    'tum_bvh': 6.5,
    'zed_body_18': 12.0,
    'zed_body_34': 3.7,
    'zed_body_38': 3.7,
    'zed_body_70': 3.7,
    'coco_17': 12.0,
    'halpe_26': 5.5,
}
# So much more than the flesh is inside where a frame of the tracker is in the chest [m].
CLOTHES = {'xsens': 0.01, 'xsens_bvh': 0.01, 'cmu_bvh': 0.01}
# How far the base frame is from the chest that it is worn on, degrees and metres, for a wearer
# who stands with hanging arms, and for 95 of 100 in any posture.
OFF_UPRIGHT, OFF = (6.0, 0.06), {'azure_kinect': (13.0, 0.04), 'mediapipe': (32.0, 0.15)}


@cache
def person_of(seed, is_upright=False):
    """Return a person; all trackers see the same ones."""
    return make_person(np.random.default_rng(seed), is_upright)


def outside(points, box, T):
    """Return how far points of the tracker's frame are outside a box, the furthest [m]."""
    in_box = ((points - T[:3, 3]) @ T[:3, :3] - box.center) @ box.rotation
    return (np.abs(in_box) - box.size / 2).max()


def flesh_of(tracker, person):
    """Return the points and the volume of each part that a tracker has."""
    skin, volume = dict(person.skin), dict(person.volume)
    if tracker == 'tum_bvh':
        # Its head has the neck in it.
        skin['head'] = np.concatenate([skin['head'], skin.pop('neck')])
        volume['head'] += volume.pop('neck')
    return skin, volume


@pytest.mark.parametrize('tracker', SEEN)
def test_all_flesh_and_clothes_are_inside_the_box_of_its_part(tracker):
    skeleton, ratios = load_skeleton(tracker), []
    for seed in range(N_PEOPLE):
        person = person_of(seed)
        posture = seen_by(tracker, person)
        scene, missing = body_boxes(skeleton, posture)
        assert missing == ()
        T = base_pose(skeleton, posture)
        skin, volume = flesh_of(tracker, person)
        for box in scene.boxes:
            far = outside(skin[box.name], box, T)
            assert far <= 1e-9 - CLOTHES.get(tracker, 0.0), (
                f'{box.name} of person {seed}: {far:.3f} m outside'
            )
        boxes = sum(np.prod(box.size) for box in scene.boxes)
        ratios.append(boxes / sum(volume[box.name] for box in scene.boxes))
    assert np.mean(ratios) < LARGEST[tracker]


@pytest.mark.parametrize('tracker', SEEN)
def test_the_base_frame_is_in_the_chest(tracker):
    skeleton = load_skeleton(tracker)

    def off(seed, is_upright):
        person = person_of(seed, is_upright)
        T = base_pose(skeleton, seen_by(tracker, person))
        rotation, origin = person.frames['base']
        cosine = (np.trace(T[:3, :3].T @ rotation) - 1) / 2
        return np.degrees(np.arccos(min(cosine, 1.0))), np.linalg.norm(T[:3, 3] - origin)

    for seed in range(50):
        assert (np.array(off(seed, True)) <= OFF_UPRIGHT).all()
    if tracker in CLOTHES:
        for seed in range(50):
            np.testing.assert_allclose(off(seed, False), 0.0, atol=1e-5)
    elif tracker in OFF:
        most = np.percentile([off(seed, False) for seed in range(200)], 95, axis=0)
        assert (most <= OFF[tracker]).all()


def test_an_upright_wearer_has_his_parts_where_the_body_of_the_examples_has_them():
    posture = seen_by('xsens', person_of(3, is_upright=True))
    boxes = {box.name: box for box in body_boxes(load_skeleton('xsens'), posture)[0].boxes}
    # x forward, y left, z up, origin at the centre of the chest.
    assert boxes['head'].center[2] > 0.3
    assert boxes['left upper arm'].center[1] > 0.15 > -0.15 > boxes['right upper arm'].center[1]
    assert boxes['left foot'].center[2] < -0.8
    assert boxes['left foot'].center[0] > boxes['left shin'].center[0]
    assert np.abs(boxes['torso'].center[:2]).max() < 0.05
    # Wherever he stands and whichever way he faces.
    other = Posture(
        names=posture.names,
        positions=posture.positions @ turn([1, 2, 3], 70).T + [3.0, -2.0, 1.0],
        rotations=turn([1, 2, 3], 70) @ posture.rotations,
    )
    for box in body_boxes(load_skeleton('xsens'), other)[0].boxes:
        np.testing.assert_allclose(box.numbers, boxes[box.name].numbers, atol=1e-12)


@pytest.mark.parametrize('tracker', SEEN)
def test_the_folded_arm_keeps_its_margin_from_a_wearer_who_stands(tracker):
    arm, skeleton, settings = load_arm(), load_skeleton(tracker), load_settings(4)
    folded = load_yaml(resource_path('config/playback.yaml'))['/**']['ros__parameters']
    poses = forward_kinematics(arm, np.array(folded['initial_positions']))
    corners = np.array([arm.T_base_mount[:3, 3], *poses[:, :3, 3]])
    ray = poses[-1, :3, 3] + settings.ray_guard_length * poses[-1, :3, 2]
    share = np.linspace(0.0, 1.0, 50)[:, None]
    ends = zip(corners, [*corners[1:], ray], strict=True)
    line = np.concatenate([start + share * (end - start) for start, end in ends])
    for seed in range(50):
        person = person_of(seed, is_upright=True)
        for box in body_boxes(skeleton, seen_by(tracker, person))[0].boxes:
            gaps = np.maximum(np.abs((line - box.center) @ box.rotation) - box.size / 2, 0.0)
            assert np.linalg.norm(gaps, axis=1).min() > settings.margin, box.name


@pytest.mark.parametrize('tracker', SEEN)
def test_boxes_are_boxes(tracker):
    posture = seen_by(tracker, person_of(5))
    for box in body_boxes(load_skeleton(tracker), posture)[0].boxes:
        # Made anew, it is validated.
        again = Box(box.name, box.center, box.size, box.rotation)
        np.testing.assert_array_equal(again.numbers, box.numbers)
        assert not box.numbers.flags.writeable


def replaced(posture, name, position):
    """Return a posture with another position of a point."""
    positions = posture.positions.copy()
    positions[posture.names.index(name)] = position
    return Posture(names=posture.names, positions=positions, rotations=posture.rotations)


@pytest.mark.parametrize('position', [np.nan, np.inf, 1e300, -2e3])
def test_parts_of_a_lost_point_are_missing_and_all_others_are_there(position):
    skeleton = load_skeleton('azure_kinect')
    posture = seen_by('azure_kinect', person_of(7))
    scene, missing = body_boxes(skeleton, replaced(posture, 'ELBOW_LEFT', position))
    assert missing == ('left upper arm', 'left forearm')
    whole = {box.name: box for box in body_boxes(skeleton, posture)[0].boxes}
    assert len(scene.boxes) == len(whole) - 2
    for box in scene.boxes:
        np.testing.assert_array_equal(box.numbers, whole[box.name].numbers)


def test_a_point_that_the_tracker_does_not_report_is_lost():
    skeleton = load_skeleton('xsens')
    posture = seen_by('xsens', person_of(7))
    keep = [k for k, name in enumerate(posture.names) if name != 'RightToe']
    posture = Posture(
        names=tuple(posture.names[k] for k in keep),
        positions=posture.positions[keep],
        rotations=posture.rotations[keep],
    )
    assert body_boxes(skeleton, posture)[1] == ('right foot',)


def test_a_lost_rotation_loses_what_is_placed_by_it():
    skeleton = load_skeleton('xsens')
    posture = seen_by('xsens', person_of(7))
    rotations = posture.rotations.copy()
    rotations[posture.names.index('Head')] = np.nan
    posture = Posture(names=posture.names, positions=posture.positions, rotations=rotations)
    # The neck ends at the head, wherever that faces.
    assert body_boxes(skeleton, posture)[1] == ('head',)


@pytest.mark.parametrize(
    ('tracker', 'name'),
    [('azure_kinect', 'NECK'), ('azure_kinect', 'SHOULDER_LEFT'), ('xsens', 'T8')],
)
def test_without_the_base_frame_there_are_no_boxes(tracker, name):
    posture = seen_by(tracker, person_of(7))
    for call in (body_boxes, base_pose):
        with pytest.raises(SceneError, match='^base: .* lost, expected all of them$'):
            call(load_skeleton(tracker), replaced(posture, name, np.nan))


def test_a_base_frame_without_a_rotation_is_named():
    posture = seen_by('xsens', person_of(7))
    points = Posture(names=posture.names, positions=posture.positions)
    with pytest.raises(SceneError, match='base: no frame "T8" with a rotation'):
        body_boxes(load_skeleton('xsens'), points)
    empty = Posture(names=(), positions=np.zeros((0, 3)))
    with pytest.raises(SceneError, match='base: no frame "T8" with a rotation'):
        body_boxes(load_skeleton('xsens'), empty)


ARM = Part(
    'arm', ('a', 'b'), [[0.05, 0.05], [0.05, 0.05], [0.1, 0.2]], (Direction('up', 'a', 'b'),)
)
HEAD = Part(
    'head',
    ('a', 'c'),
    [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]],
    (Direction('left', 'a', 'b'), Direction('forward', 'a', 'c')),
)
JOINTS = tuple(Joint(name, (name,)) for name in 'abc')


def simple(*parts):
    """Return a skeleton whose points are in the base frame."""
    used = {joint for part in parts for joint in part.joints}
    used |= {end for part in parts for axis in part.axes for end in (axis.start, axis.end)}
    joints = tuple(joint for joint in JOINTS if joint.name in used)
    return Skeleton(joints=joints, parts=parts, base=None, axes=np.eye(3))


def triangle(*positions):
    """Return a posture of the points a, b and c."""
    return Posture(names=('a', 'b', 'c'), positions=np.array(positions, dtype=float))


coordinates = st.floats(-2.0, 2.0)
points = st.tuples(coordinates, coordinates, coordinates)


@examples(300)
@given(points, points)
def test_a_limb_reaches_its_radius_round_the_bone_and_its_ends_beyond(a, b):
    scene, _ = body_boxes(simple(ARM), triangle(a, b, a))
    (box,) = scene.boxes
    again = Box(box.name, box.center, box.size, box.rotation)
    bone = np.subtract(b, a)
    length = np.linalg.norm(bone)
    if length >= 0.01:
        np.testing.assert_allclose(again.size, [0.1, 0.1, length + 0.3], atol=1e-12)
        along = bone / length
        np.testing.assert_allclose(again.rotation[:, 2], along, atol=1e-9)
        np.testing.assert_allclose(again.center, a + (length + 0.1) / 2 * along, atol=1e-9)
    else:
        # However the arm is turned, and however long it is in truth.
        far = 0.5 + np.linalg.norm([0.05, 0.05, 0.2])
        assert (np.abs(np.subtract(a, again.center)) <= again.size / 2 - far + 1e-9).all()


@examples(300)
@given(points, points)
def test_a_limb_that_turns_a_little_has_a_box_that_turns_little(a, b):
    bone = np.subtract(b, a)
    length = np.linalg.norm(bone)
    turned = turn(np.cross(bone, [0.3, 0.5, 0.7]), 1.0) @ bone if length > 0.01 else bone
    if length < 0.01 or bone[2] - bone[0] > 0.9 * np.sqrt(2.0) * length:
        # Close to opposite to how it hangs.
        return
    before, after = (
        body_boxes(simple(ARM), triangle(a, a + end, a))[0].boxes[0].rotation
        for end in (bone, turned)
    )
    assert np.degrees(np.arccos(min((np.trace(before.T @ after) - 1) / 2, 1.0))) < 6.0


@examples(300)
@given(points, points, points)
def test_a_box_round_joints_has_its_first_axis_and_its_margins(a, b, c):
    (box,) = body_boxes(simple(HEAD), triangle(a, b, c))[0].boxes
    again = Box(box.name, box.center, box.size, box.rotation)
    left, forward = np.subtract(b, a), np.subtract(c, a)
    across = np.linalg.norm(np.cross(left, forward))
    if np.linalg.norm(left) < 0.02 or across < 0.02 * np.linalg.norm(left):
        assert (again.size > 1.0).all() or np.linalg.norm(left) >= 0.01
        return
    y = left / np.linalg.norm(left)
    x = forward - forward @ y * y
    x /= np.linalg.norm(x)
    R = np.column_stack([x, y, np.cross(x, y)])
    np.testing.assert_allclose(again.rotation, R, atol=1e-9)
    inside = np.array([a, c]) @ R
    lower, upper = inside.min(axis=0) - [0.1, 0.3, 0.5], inside.max(axis=0) + [0.2, 0.4, 0.6]
    np.testing.assert_allclose(again.size, upper - lower, atol=1e-9)
    np.testing.assert_allclose(again.center, R @ (lower + upper) / 2, atol=1e-9)


@pytest.mark.parametrize('axes', [('up', 'left'), ('left', 'up'), ('forward', 'up')])
def test_any_two_directions_make_the_same_axes(axes):
    # Of a base frame that is turned and moved.
    R, o = turn([1, -2, 0.5], 100), np.array([0.3, 0.2, -0.4])
    ends = {'forward': 'a', 'left': 'b', 'up': 'c'}
    positions = [o + R @ axis for axis in np.eye(3)]
    base = JointBase(
        'o', [0.0, 0.0, 0.1], tuple(Direction(axis, 'o', ends[axis]) for axis in axes)
    )
    used = {'o', *(ends[axis] for axis in axes)}
    names = ('a', 'b', 'c', 'o')
    skeleton = Skeleton(
        joints=tuple(Joint(name, (name,)) for name in names if name in used),
        parts=(Part('torso', ('base',), np.full((3, 2), 0.2)),),
        base=base,
        axes=np.eye(3),
    )
    posture = Posture(names=names, positions=np.array([*positions, o]))
    T = base_pose(skeleton, posture)
    np.testing.assert_allclose(T[:3, :3], R, atol=1e-12)
    np.testing.assert_allclose(T[:3, 3], o + R @ [0.0, 0.0, 0.1], atol=1e-12)


def test_an_offset_is_in_the_axes_of_the_wearer_and_a_mean_between_its_points():
    # In the frames of this tracker x is left, y up and z forward.
    axes = np.column_stack([np.eye(3)[2], np.eye(3)[0], np.eye(3)[1]])
    R = turn([0.2, 1, 0], 40)
    skeleton = Skeleton(
        joints=(Joint('tip', ('hand',), [0.1, 0.02, -0.03]), Joint('hips', ('a', 'b'))),
        parts=(
            Part('hand', ('tip',), np.full((3, 2), 0.1)),
            Part('pelvis', ('hips',), np.full((3, 2), 0.1)),
        ),
        base=FrameBase('hand', [0.0, 0.0, 0.0]),
        axes=axes,
    )
    posture = Posture(
        names=('b', 'hand', 'a'),
        positions=np.array([[1.0, 0.0, 0.0], [0.5, 0.6, 0.7], [0.0, 2.0, 4.0]]),
        rotations=np.array([np.full((3, 3), np.nan), R, np.eye(3)]),
    )
    hand, pelvis = body_boxes(skeleton, posture)[0].boxes
    np.testing.assert_allclose(hand.center, [0.1, 0.02, -0.03], atol=1e-12)
    np.testing.assert_allclose(pelvis.center, (R @ axes).T @ [0.0, 0.4, 1.3], atol=1e-12)


def test_many_postures_have_the_boxes_of_each():
    person, skeleton = load_person(), load_skeleton('cmu_bvh')
    names, rng = person.names, np.random.default_rng(8)
    positions, rotations = postures_at(person, np.linspace(0.0, 9.0, 60))
    for k in range(12):
        point = rng.integers(len(names))
        # A point is lost, or further away than anybody is tall, or mixed up with another one.
        positions[k, point] = (np.nan, 7.0, positions[k, point - 1])[k % 3]
    # Nobody is seen, and somebody ten times as tall.
    positions[12], rotations[13] = np.nan, np.nan
    positions[14] *= 10.0
    rows = rows_of_postures(skeleton, names, positions, rotations)
    n_lost = 0
    for k in range(len(positions)):
        posture = Posture(names=names, positions=positions[k], rotations=rotations[k])
        try:
            boxes = {box.name: box.numbers for box in body_boxes(skeleton, posture)[0].boxes}
        except SceneError:
            boxes = {}
        for part, row in zip(skeleton.parts, rows[k], strict=True):
            n_lost += part.name not in boxes
            assert np.array_equal(row, boxes.get(part.name, np.full(15, np.nan)), equal_nan=True)
    assert 0 < n_lost < rows.shape[0] * rows.shape[1]
