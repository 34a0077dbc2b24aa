# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A wearer from a body file or from an example message: the same boxes as the nodes take."""

import numpy as np
import pytest
from rrth_planner.cli.plan import main as plan
from rrth_planner.io.resources import resource_path
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.errors import SceneError

MARKERS = """
markers:
  - {ns: old, id: 7, type: 1, pose: POSE, scale: SIZE}
  - {action: 3}
  - {header: {frame_id: torso}, ns: torso, id: 0, type: 1, pose: POSE, scale: SIZE}
  - {ns: hat, id: 0, type: 1, pose: POSE, scale: SIZE}
  - ns: arms
    id: 0
    type: 6
    pose: {position: {x: 0.1, y: 0.2, z: 0.3}, orientation: TURN}
    scale: SIZE
    points: [{x: 0.1, y: 0.0, z: -0.2}, {x: 0.4, y: -0.5, z: 0.6}]
  - {ns: hat, id: 0, action: 2}
  - LAST
"""
VALUES = {
    'POSE': '{position: {x: 0, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 0, w: 1}}',
    'SIZE': '{x: 0.3, y: 0.2, z: 0.1}',
    'TURN': '{x: 0.5, y: -0.5, z: 0.1, w: 0.7}',
}


def message(folder, last):
    """Return a file with a body: a torso, a list of arms, and one more marker."""
    text = MARKERS
    for name, value in {**VALUES, 'LAST': last}.items():
        text = text.replace(name, value)
    file = folder / 'body.yaml'
    file.write_text(text)
    return file


def test_the_boxes_of_a_message_are_those_that_the_nodes_take(tmp_path):
    file = message(tmp_path, '{ns: arms, id: 9, action: 2}')
    scene = load_body(file)
    assert [box.name for box in scene.boxes] == ['torso/0', 'arms/0[0]', 'arms/0[1]']
    pytest.importorskip('rclpy')
    from rrth_planner.ros.messages.body import scene_of, WearerBody
    from rrth_planner.ros.messages.message_file import message_from_file
    from visualization_msgs.msg import MarkerArray

    body = WearerBody().apply(message_from_file(file, MarkerArray), 0.0, 'torso')
    assert [box.name for box in scene.boxes] == [box.name for box in scene_of(body).boxes]
    np.testing.assert_allclose(scene.numbers, scene_of(body).numbers, atol=1e-12)


@pytest.mark.parametrize(
    ('head', 'words'),
    [
        ('{header: {frame_id: head}, ns: head, type: 1}', 'frame "head", expected "torso" or an'),
        ('{ns: head, type: 2}', r'type 2, expected 1 \(CUBE\) or 6 \(CUBE_LIST\)'),
        ('{ns: head, action: 1}', r'action 1, expected 0 \(ADD\), 2'),
        (
            '{ns: head, type: 6, scale: {x: 1, y: 1, z: 1}, points: [], pose: {position: '
            '{x: 0, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 0, w: 1}}}',
            '0 points, orientation',
        ),
    ],
)
def test_what_is_no_box_of_the_wearer_is_rejected_and_not_left_out(tmp_path, head, words):
    with pytest.raises(SceneError, match=f'body.yaml: marker 6.*{words}'):
        load_body(message(tmp_path, head))


def test_a_file_that_is_neither_is_named(tmp_path):
    with pytest.raises(SceneError, match='body_bad.yaml'):
        load_body(resource_path('msg_examples/body_bad.yaml'))
    file = tmp_path / 'body.yaml'
    file.write_text('markers: 5\n')
    with pytest.raises(SceneError, match='markers: 5, expected a list'):
        load_body(file)
    file.write_text('head: ' + 'long ' * 500)
    with pytest.raises(SceneError, match='expected a mapping with a list of boxes') as refusal:
        load_body(file)
    assert len(str(refusal.value)) < 200 + len(str(file))


def test_a_plan_round_the_wearer_of_a_message_differs_from_that_of_the_body(tmp_path, capsys):
    said = []
    for name in ('body', 'body_arm_raised'):
        body = str(resource_path(f'msg_examples/{name}.yaml'))
        arguments = ['--body', body, '--target', '1.2', '-0.3', '-0.2', '--seed', '1']
        assert plan([*arguments, '--output', str(tmp_path / f'{name}.csv')]) == 0
        said.append((tmp_path / f'{name}.csv').read_text())
    assert said[0] != said[1]
