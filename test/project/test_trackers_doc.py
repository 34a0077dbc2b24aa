# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What docs/trackers.md says: its skeleton is one, its parameters are those of the nodes."""

from importlib import import_module
from pathlib import Path
import re

from fleshed_person import make_person, plates, posture_of
import numpy as np
import pytest
from rrth_planner.io.resources import resource_path
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.io.text_file import load_yaml
from rrth_planner.wearer.body_boxes import base_pose, body_boxes

PAGE = Path(__file__).parents[2] / 'docs' / 'trackers.md'
pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason='the documents are not installed')


@pytest.fixture(name='skeleton')
def _skeleton(tmp_path):
    """Give the skeleton of rigid bodies."""
    (text,) = re.findall(r'^```yaml\n(.*?)^```', PAGE.read_text(encoding='utf-8'), re.M | re.S)
    file = tmp_path / 'wearer.yaml'
    file.write_text(text, encoding='utf-8')
    return load_skeleton(file)


def test_boxes_of_rigid_bodies_contain_whoever_wears_them(skeleton):
    names = {part.name for part in skeleton.parts}
    assert {'torso', 'head', 'left hand', 'right hand'} <= names
    for seed in range(150):
        person = make_person(np.random.default_rng(seed))
        posture = posture_of(plates(person))
        scene, lost = body_boxes(skeleton, posture)
        assert not lost
        T = base_pose(skeleton, posture)
        # Legs have no plates.
        legs = ('thigh', 'shin', 'foot')
        for part in (part for part in person.skin if not part.endswith(legs)):
            points = (person.skin[part] - T[:3, 3]) @ T[:3, :3]
            far = [
                (np.abs((points - box.center) @ box.rotation) - box.size / 2).max(axis=1)
                for box in scene.boxes
            ]
            # In any of the boxes; the arm's frame is up to 5 mm off where its length differs.
            assert np.min(far, axis=0).max() <= 5e-3, (part, seed)


def test_the_parameters_of_its_commands_are_those_of_the_node():
    settings = load_yaml(resource_path('config/body_boxes.yaml'))['/**']['ros__parameters']
    text = PAGE.read_text(encoding='utf-8')
    given = re.findall(r"-p (\w+):=([\w./{}'-]+)", text)
    assert len(given) > 10
    assert {name for name, _ in given} <= set(settings)
    for name in {value for name, value in given if name == 'skeleton'} - {'wearer.yaml'}:
        load_skeleton(name)


def test_drivers_are_started_as_the_boxes_need_them():
    text = PAGE.read_text(encoding='utf-8')
    # A Kinect at its default of 5 Hz loses all parts between two frames.
    (kinect,) = re.findall(r'^ros2 launch azure_kinect_ros_driver .*$', text, re.M)
    assert {'fps:=30', 'depth_mode:=NFOV_UNBINNED'} <= set(kinect.split())
    # The URDF of a person has this topic (REP 155); the other launch file is for one robot only.
    assert re.search(r'robot_description:=/humans/bodies/\w+/urdf$', text, re.M)
    assert 'hri_body_detect_with_args.launch.py' in text


def test_functions_of_the_page_on_skeletons_exist():
    text = (PAGE.parent / 'skeletons.md').read_text(encoding='utf-8')
    modules = re.findall(r'^from (rrth_planner[\w.]*) import|`(rrth_planner\.[\w.]+)`', text, re.M)
    known = set().union(*(dir(import_module(one or other)) for one, other in modules))
    called = set(re.findall(r'`(\w+)\(', text))
    assert called
    assert called <= known


def test_the_file_of_parameters_has_the_defaults_of_the_node():
    pytest.importorskip('rclpy')
    from rrth_planner.ros.interface.tracker_parameters import SETTINGS

    settings = load_yaml(resource_path('config/body_boxes.yaml'))['/**']['ros__parameters']
    assert settings == {setting.name: setting.default for setting in SETTINGS}
