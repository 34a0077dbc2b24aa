# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Hands of another size, hands that bend any way, and hands round points of fingers."""

from fleshed_person import make_person, SEEN, seen_by
import numpy as np
import pytest
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.model.errors import SceneError
from rrth_planner.wearer.body_boxes import base_pose, body_boxes
from rrth_planner.wearer.hands import (
    hand_distances,
    HANDS,
    hands_of,
    has_fingers,
    LENGTH,
    round_wrists,
)

WITHOUT_FINGERS = [name for name in SEEN if name != 'zed_body_70']


def boxes_of(skeleton, posture):
    """Return the boxes of a wearer by name, and his base frame."""
    scene, missing = body_boxes(skeleton, posture)
    assert missing == ()
    return {box.name: box for box in scene.boxes}, base_pose(skeleton, posture)


@pytest.mark.parametrize('tracker', WITHOUT_FINGERS)
def test_all_flesh_of_hands_is_within_what_a_hand_with_any_wrist_may_fill(tracker):
    skeleton = load_skeleton(tracker)
    for seed in range(60):
        person = make_person(np.random.default_rng(seed))
        boxes, T = boxes_of(round_wrists(skeleton), seen_by(tracker, person))
        for name in HANDS:
            skin = (person.skin[name] - T[:3, 3]) @ T[:3, :3]
            row = boxes[name].numbers
            assert hand_distances(skin[None], row[None]).max() <= 1e-9
            wrist = T[:3, :3].T @ (person.at(name) - T[:3, 3])
            np.testing.assert_allclose(row[:3], wrist, atol=1e-9)


def test_the_distance_of_a_hand_is_that_of_the_nearest_of_many_places_in_it():
    rng = np.random.default_rng(2)
    row = np.concatenate([[0.1, 0.2, 0.3], [2 * LENGTH] * 3, np.eye(3).ravel()])
    # Places in it: balls of 3 cm round lines of 18.5 cm from the wrist, up to 110 degrees off.
    turned, round_, along = (rng.uniform(0.0, high, 40_000) for high in (110, 360, 0.185))
    a, b = np.radians(turned), np.radians(round_)
    lines = along * np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
    points = row[:3] + rng.uniform(-0.35, 0.35, (300, 3))
    found = hand_distances(points[None], row[None])[0]
    nearest = np.linalg.norm(points[:, :, None] - row[:3, None] - lines, axis=1).min(axis=1)
    nearest = np.maximum(nearest - 0.03, 0.0)
    # Of places drawn at random the nearest is a little further.
    assert (found <= nearest + 1e-9).all()
    assert (nearest <= found + 0.02).all()
    assert (found == 0.0).any()
    assert found.max() > 0.2


@pytest.mark.parametrize('tracker', WITHOUT_FINGERS)
def test_a_hand_of_a_size_is_a_cube_that_begins_just_before_the_wrist(tracker):
    person = make_person(np.random.default_rng(1))
    posture = seen_by(tracker, person)
    boxes, T = boxes_of(load_skeleton(tracker, hand_size=0.2), posture)
    usual, _ = boxes_of(load_skeleton(tracker), posture)
    for name, box in boxes.items():
        if name not in HANDS:
            np.testing.assert_array_equal(box.numbers, usual[name].numbers)
            continue
        np.testing.assert_allclose(box.size, 0.2)
        wrist = T[:3, :3].T @ (person.at(name) - T[:3, 3])
        np.testing.assert_allclose(np.linalg.norm(box.center - wrist), 0.07, atol=1e-9)
        # It leads on to the hand.
        hand = T[:3, :3].T @ (person.at(f'{name.split()[0]} palm') - T[:3, 3])
        assert (box.center - wrist) @ (hand - wrist) > 0.0
        assert box.size.prod() < usual[name].size.prod()


@pytest.mark.parametrize('size', [-0.1, 0.01, 1.5, float('nan')])
def test_a_hand_of_no_size_is_rejected(size):
    with pytest.raises(SceneError, match=r'hand_size: .*, expected 0 or a size from 0.05 to 1 '):
        load_skeleton('cmu_bvh', hand_size=size)


def test_hands_round_points_of_fingers_have_the_size_that_is_seen():
    fingers, knuckles = load_skeleton('zed_body_70'), load_skeleton('zed_body_38')
    assert all(map(has_fingers, hands_of(fingers)))
    assert not any(map(has_fingers, hands_of(knuckles)))
    with pytest.raises(SceneError, match='a box round finger points'):
        load_skeleton('zed_body_70', hand_size=0.2)
    assert hands_of(round_wrists(fingers)) == hands_of(fingers)
    ratios = []
    for seed in range(30):
        person = make_person(np.random.default_rng(seed))
        one, _ = boxes_of(fingers, seen_by('zed_body_70', person))
        other, _ = boxes_of(knuckles, seen_by('zed_body_38', person))
        ratios += [one[name].size.prod() / other[name].size.prod() for name in HANDS]
    assert np.mean(ratios) < 0.5
