# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Boxes as numbers: placed as matrices place them, rejected as one by one, none of them lost."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.kernels.collision.boxes import first_bad, may_meet, place, rows_of
from rrth_planner.kernels.layout import BOX_ROWS, MAX_BARS, NUMBERS
from rrth_planner.model.arrays import FARTHEST
from rrth_planner.model.errors import SceneError
from rrth_planner.model.rotation import pose_matrix, quaternion_xyzw, rotation_matrix
from rrth_planner.model.scene import Box, Scene
from rrth_planner.ros.messages.marker_edits import boxes_of
from worlds import examples, random_boxes, random_rotation

SEEDS = st.integers(0, 2**32 - 1)
WRONG = [
    ('center', 0, np.nan, 'finite'),
    ('center', 2, 1e5, 'numbers of at most 10000'),
    ('size', 1, 0.0, 'lengths > 0'),
    ('size', 2, -1.0, 'lengths > 0'),
    ('size', 0, np.inf, 'finite'),
    ('size', 0, 2e4, 'numbers of at most 10000'),
    ('rotation', (0, 0), 0.5, 'rotation matrix'),
    ('rotation', (1, 1), np.nan, 'finite'),
    ('rotation', slice(None), -np.eye(3), 'rotation matrix'),
    ('rotation', slice(None), np.zeros((3, 3)), 'rotation matrix'),
]


@examples(60)
@given(seed=SEEDS, n=st.integers(0, 12))
def test_markers_are_placed_as_by_matrices(seed, n):
    rng = np.random.default_rng(seed)
    frames = np.array(
        [pose_matrix(rng.normal(size=3), rng.normal(size=4) + 0.01) for _ in range(3)]
    )
    markers, which = rng.normal(size=(n, 13)), rng.integers(3, size=n)
    boxes = np.empty((n, NUMBERS))
    place(markers, which, frames, boxes)
    for marker, frame, box in zip(markers, frames[which], boxes, strict=True):
        rotation = rotation_matrix(marker[3:7])
        at = frame @ np.append(marker[:3] + rotation @ marker[10:], 1.0)
        assert np.allclose(box[:3], at[:3], rtol=0.0, atol=1e-12)
        assert np.array_equal(box[3:6], marker[7:10])
        assert np.allclose(box[6:].reshape(3, 3), frame[:3, :3] @ rotation, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(('field', 'index', 'value', 'words'), WRONG)
def test_of_many_boxes_the_first_that_is_none_is_rejected(field, index, value, words):
    scene = random_boxes(np.random.default_rng(3), 5)
    names, numbers = [box.name for box in scene.boxes], scene.numbers.copy()
    assert first_bad(numbers, FARTHEST) == -1
    row = numbers[3]
    part = {'center': row[:3], 'size': row[3:6], 'rotation': row[6:].reshape(3, 3)}[field]
    part[index] = value
    numbers[4, 3] = -1.0
    assert first_bad(numbers, FARTHEST) == 3
    with pytest.raises(SceneError, match=words) as together:
        boxes_of(names, numbers)
    with pytest.raises(SceneError) as alone:
        Box(names[3], row[:3], row[3:6], row[6:].reshape(3, 3))
    assert str(together.value) == str(alone.value)
    assert f'box "{names[3]}"' in str(alone.value)


def test_boxes_made_together_are_those_made_alone():
    scene = random_boxes(np.random.default_rng(4), 7)
    made = boxes_of([box.name for box in scene.boxes], scene.numbers.copy())
    for box, other in zip(made, scene.boxes, strict=True):
        assert box.name == other.name
        for field in ('center', 'size', 'rotation', 'numbers'):
            one = getattr(box, field)
            assert np.array_equal(one, getattr(other, field))
            with pytest.raises(ValueError, match='read-only'):
                one[0] = 0.0
    assert np.array_equal(Scene(made).numbers, scene.numbers)
    assert Scene(()).numbers.shape == (0, NUMBERS)


@examples(40)
@given(seed=SEEDS, n=st.integers(0, 9), growth=st.floats(0.0, 0.1))
def test_rows_tell_which_points_are_inside(seed, n, growth):
    rng = np.random.default_rng(seed)
    scene = random_boxes(rng, n)
    T = pose_matrix(rng.normal(size=3), quaternion_xyzw(random_rotation(rng)))
    rows = np.empty((BOX_ROWS, n))
    # Any of the 63 bars.
    allowed = rng.integers(0, 1 << MAX_BARS, size=n)
    rows_of(scene.numbers, allowed, T, growth, rows)
    for k, box in enumerate(scene.boxes):
        # Points in the box's own axes, none of them within rounding of its faces.
        half = 0.5 * box.size + growth
        own = half * rng.choice([-1.3, -0.9, 0.2, 0.8, 1.2], size=(20, 3))
        points = (box.center + own @ box.rotation.T) @ T[:3, :3].T + T[:3, 3]
        seen = points @ rows[:9, k].reshape(3, 3).T + rows[9:12, k]
        assert np.allclose(seen, own, rtol=0.0, atol=1e-12)
        assert np.array_equal(rows[12:15, k], half)
        found = sum(1 << bar for bar in range(MAX_BARS) if may_meet(rows, k, bar))
        assert found == allowed[k]
