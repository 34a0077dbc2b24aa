# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A body from a file is that of the example message; what is no body is rejected in a sentence."""

import numpy as np
import pytest
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings
from rrth_planner.io.text_file import load_yaml
from rrth_planner.io.wearer_file import load_body, scene_from_mapping
from rrth_planner.model.errors import OptionsError, RrthError, SceneError
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.planning.options import RRTOptions

GOOD = {'name': 'torso', 'center': [0.0, 0.0, 0.1], 'size': [0.3, 0.4, 0.6]}


def test_the_packaged_body_is_that_of_the_example_message():
    markers = load_yaml(resource_path('msg_examples/body.yaml'))['markers']
    added = [marker for marker in markers if marker['action'] == 0]
    scene = load_body()
    assert len(scene.boxes) == len(added)
    for box, marker in zip(scene.boxes, added, strict=True):
        assert box.name == marker['text']
        assert box.center.tolist() == list(marker['pose']['position'].values())
        assert box.size.tolist() == list(marker['scale'].values())
        q = [marker['pose']['orientation'][axis] for axis in 'xyzw']
        assert np.allclose(box.rotation, rotation_matrix(q), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ('data', 'words'),
    [
        (None, 'expected a mapping with a list of boxes'),
        ({'boxes': []}, 'expected a mapping with a list of boxes'),
        ({'boxes': [5]}, 'box 0: 5, expected a mapping'),
        ({'boxes': [GOOD, {'name': 'head'}]}, 'box 1: no center, size, expected'),
        ({'boxes': [{**GOOD, 'colour': 'red'}]}, 'box 0: colour, expected only'),
        ({'boxes': [{**GOOD, 'size': [0.1, 0.0, 0.1]}]}, 'lengths > 0'),
        ({'boxes': [{**GOOD, 'quaternion_xyzw': 'up'}]}, r'expected numbers of shape \(4\)'),
        ({'boxes': [{**GOOD, 'quaternion_xyzw': [0, 0, 0]}]}, r'shape \(3,\), expected \(4\)'),
        ({'boxes': [{**GOOD, 'quaternion_xyzw': [0, 0, 0, 0]}]}, 'expected four numbers'),
    ],
)
def test_what_is_no_body_is_rejected(data, words):
    with pytest.raises(SceneError, match=words):
        scene_from_mapping(data)


def test_a_file_is_named(tmp_path):
    file = tmp_path / 'body.yaml'
    with pytest.raises(RrthError, match='body.yaml'):
        load_body(file)
    file.write_text('boxes: []\n')
    with pytest.raises(SceneError, match='file .*body.yaml: body'):
        load_body(file)
    file.write_text('boxes:\n  - {name: a, center: [1, 0, 0], size: [0.1, 0.1, 0.1]}\n')
    assert load_body(file).boxes[0].center.tolist() == [1.0, 0.0, 0.0]


def test_settings_come_from_the_file_of_the_node(tmp_path):
    packaged = load_settings(6)
    assert packaged.margin == 0.02
    assert packaged.limits.velocity.tolist() == [1.5] * 6
    file = tmp_path / 'mine.yaml'
    file.write_text('/**: {ros__parameters: {margin: 0.05, max_jerk: [20.0], algorithm: rrt}}\n')
    mine = load_settings(4, file, margin=0.03)
    assert mine.margin == 0.03
    assert mine.limits.jerk.tolist() == [20.0] * 4
    assert isinstance(mine.options, RRTOptions)
    with pytest.raises(OptionsError, match='speed: unknown parameter'):
        load_settings(4, speed=1.0)
    with pytest.raises(OptionsError, match='max_velocity: .* expected 4 values'):
        load_settings(4, max_velocity=[1.0, 2.0])
    file.write_text('margin: 0.05\n')
    with pytest.raises(OptionsError, match='expected a parameter file'):
        load_settings(4, file)
