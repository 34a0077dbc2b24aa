# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The files that docs/ros_control.md shows are those of the packaged arm."""

from pathlib import Path
import re
from xml.etree import ElementTree

import pytest
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml
import yaml

TEXT = (Path(__file__).parents[2] / 'docs' / 'ros_control.md').read_text(encoding='utf-8')


def block(language):
    """Return the one block of a language."""
    (found,) = re.findall(rf'```{language}\n(.*?)```', TEXT, re.DOTALL)
    return found


@pytest.fixture(scope='module')
def controllers():
    """Return controllers.yaml."""
    return yaml.safe_load(block('yaml'))


@pytest.fixture(scope='module')
def robot():
    """Return the URDF with the mock, put together as the text says."""
    lines = resource_path('urdf/arm.urdf').read_text(encoding='utf-8').splitlines()
    assert lines[-1] == '</robot>'
    return ElementTree.fromstring('\n'.join([*lines[:-1], block('xml'), lines[-1]]))


def test_the_controller_moves_the_joints_of_the_arm_as_was_proven(controllers):
    names = list(load_arm().joint_names)
    parameters = controllers['arm_controller']['ros__parameters']
    assert parameters['joints'] == names
    assert set(parameters['constraints']) > set(names)
    assert parameters['command_interfaces'] == ['position']
    assert parameters['state_interfaces'] == ['position', 'velocity']
    assert parameters['interpolation_method'] == 'splines'
    assert parameters['allow_nonzero_velocity_at_trajectory_end'] is False


def test_what_is_spawned_and_remapped_is_what_the_manager_knows(controllers):
    known = controllers['controller_manager']['ros__parameters']
    (spawned,) = re.findall(r'spawner (.*?) --param-file', TEXT)
    assert set(spawned.split()) == {name for name in known if name != 'update_rate'}
    assert '-r joint_trajectory:=arm_controller/joint_trajectory' in TEXT


def test_the_mock_has_the_joints_and_interfaces_and_begins_folded(robot, controllers):
    parameters = controllers['arm_controller']['ros__parameters']
    system = robot.find('ros2_control')
    assert system.findtext('hardware/plugin') == 'mock_components/GenericSystem'
    joints = system.findall('joint')
    moving = [
        joint.get('name') for joint in robot.findall('joint') if joint.find('limit') is not None
    ]
    assert [joint.get('name') for joint in joints] == moving == parameters['joints']
    for joint in joints:
        for kind in ('command', 'state'):
            names = [entry.get('name') for entry in joint.findall(f'{kind}_interface')]
            assert names == parameters[f'{kind}_interfaces']
    begins = [float(joint.findtext('state_interface/param')) for joint in joints]
    playback = load_yaml(resource_path('config/playback.yaml'))['/**']['ros__parameters']
    assert begins == playback['initial_positions']
