# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What docs/trackers.md says: its skeleton is one, its parameters are those of the nodes."""

from pathlib import Path
import re

import pytest
from rrth_planner.io.resources import resource_path
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.io.text_file import load_yaml

PAGE = Path(__file__).parents[2] / 'docs' / 'trackers.md'
pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason='the documents are not installed')


def test_the_skeleton_of_rigid_bodies_is_one(tmp_path):
    (text,) = re.findall(r'^```yaml\n(.*?)^```', PAGE.read_text(encoding='utf-8'), re.M | re.S)
    file = tmp_path / 'wearer.yaml'
    file.write_text(text, encoding='utf-8')
    names = {part.name for part in load_skeleton(file).parts}
    assert {'torso', 'head', 'left hand', 'right hand'} <= names


def test_the_parameters_of_its_commands_are_those_of_the_node():
    settings = load_yaml(resource_path('config/body_boxes.yaml'))['/**']['ros__parameters']
    text = PAGE.read_text(encoding='utf-8')
    given = re.findall(r"-p (\w+):=([\w./{}'-]+)", text)
    assert len(given) > 10
    assert {name for name, _ in given} <= set(settings)
    for name in {value for name, value in given if name == 'skeleton'} - {'wearer.yaml'}:
        load_skeleton(name)


def test_the_file_of_parameters_has_the_defaults_of_the_node():
    pytest.importorskip('rclpy')
    from rrth_planner.ros.interface.tracker_parameters import SETTINGS

    settings = load_yaml(resource_path('config/body_boxes.yaml'))['/**']['ros__parameters']
    assert settings == {setting.name: setting.default for setting in SETTINGS}
