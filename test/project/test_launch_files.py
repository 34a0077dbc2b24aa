# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the launch files start, by a stand-in for launch; and that launch itself reads them."""

import os
from pathlib import Path
import runpy
import sys
from types import ModuleType
from xml.etree import ElementTree

import pytest
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml
import yaml

ROOT = Path(__file__).parents[2]
# What the launch files of single nodes share.
SHARED = 'rrth_planner.ros.middleware.node_launch'
FILES = sorted((ROOT / 'launch').glob('*.py'))
NAMES = {
    'launch': ['LaunchDescription'],
    'launch.actions': [
        'DeclareLaunchArgument',
        'ExecuteProcess',
        'IncludeLaunchDescription',
        'LogInfo',
    ],
    'launch.conditions': ['IfCondition'],
    'launch.launch_description_sources': ['PythonLaunchDescriptionSource'],
    'launch.substitutions': [
        'FileContent',
        'LaunchConfiguration',
        'NotEqualsSubstitution',
        'PathJoinSubstitution',
    ],
    'launch_ros': [],
    'launch_ros.actions': ['Node'],
    'launch_ros.parameter_descriptions': ['ParameterValue'],
    'launch_ros.substitutions': ['FindPackageShare'],
}


class Said:
    """Anything of launch as a launch file writes it: its name and its arguments."""

    def __init__(self, name, args, kwargs):
        self.name, self.args, self.kwargs = name, args, kwargs


@pytest.fixture
def stand_in(monkeypatch):
    """Have launch files import a stand-in, whether launch is here or not."""
    for module, names in NAMES.items():
        made = ModuleType(module)
        for name in names:
            setattr(made, name, lambda *a, _name=name, **k: Said(_name, a, k))
        monkeypatch.setitem(sys.modules, module, made)
    monkeypatch.delitem(sys.modules, SHARED, raising=False)
    yield
    # It has imported the stand-in.
    sys.modules.pop(SHARED, None)


@pytest.fixture(autouse=True, name='packages')
def _packages(monkeypatch):
    """Return the installed packages, as ament lists them: RViz, whether it is here or not."""
    index = ModuleType('ament_index_python.packages')
    found = {'rviz2': '/opt/ros/jazzy'}
    index.get_packages_with_prefixes = lambda: found
    monkeypatch.setitem(sys.modules, 'ament_index_python.packages', index)
    return found


def value(said, configuration):
    """Return what a substitution stands for."""
    if isinstance(said, dict):
        return {value(k, configuration): value(v, configuration) for k, v in said.items()}
    if isinstance(said, (list, tuple)):
        return [value(part, configuration) for part in said]
    if not isinstance(said, Said):
        return said
    args = [value(part, configuration) for part in said.args]
    match said.name:
        case 'LaunchConfiguration':
            return configuration[args[0]]
        case 'FindPackageShare':
            assert args == ['rrth_planner']
            return str(ROOT)
        case 'PathJoinSubstitution':
            return os.path.join(*args[0])
        case 'FileContent':
            return Path(args[0]).read_text(encoding='utf-8')
        case 'ParameterValue':
            kind = said.kwargs['value_type']
            return {'true': True, 'false': False}[args[0]] if kind is bool else kind(args[0])
        case 'NotEqualsSubstitution':
            return str(args[0] != args[1]).lower()
        case 'IfCondition':
            return {'true': True, 'false': False}[args[0]]
    raise AssertionError(f'{said.name} is not known')


def launched(file, configuration):
    """Return the nodes and commands that a launch file starts, their arguments as values."""
    description = runpy.run_path(str(file))['generate_launch_description']()
    entities, found = description.args[0], []
    declared = {entity.args[0] for entity in entities if entity.name == 'DeclareLaunchArgument'}
    for entity in entities:
        if entity.name == 'DeclareLaunchArgument':
            assert entity.kwargs['description'].endswith('.')
            default = value(entity.kwargs['default_value'], configuration)
            configuration.setdefault(entity.args[0], default)
        elif entity.name == 'IncludeLaunchDescription':
            # As in launch, an included file shares the configuration of its parent.
            given = dict(entity.kwargs['launch_arguments'])
            configuration.update(value(given, configuration))
            included = value(entity.args[0].args[0], configuration)
            found += launched(included, configuration)
            assert set(given) <= {*configuration, *declared}
        elif value(entity.kwargs.get('condition', True), configuration):
            kwargs = {k: value(v, configuration) for k, v in entity.kwargs.items()}
            found.append((entity.name, kwargs))
    return found


def started(found, executable):
    """Return the arguments of the one node of an executable."""
    (node,) = [
        kwargs for name, kwargs in found if name == 'Node' and kwargs['executable'] == executable
    ]
    return node


@pytest.mark.parametrize('file', FILES, ids=lambda path: path.stem)
def test_what_a_launch_file_starts_is_there(file, stand_in):
    entry_points = (ROOT / 'setup.py').read_text(encoding='utf-8')
    package = ElementTree.parse(ROOT / 'package.xml').getroot()
    needed = {element.text for element in package.findall('exec_depend')}
    found = launched(file, {})
    assert found
    for name, kwargs in found:
        if name == 'ExecuteProcess':
            assert kwargs['cmd'][:2] == ['ros2', 'topic']
            assert 'ros2topic' in needed
        elif kwargs['package'] == 'rrth_planner':
            assert f"'{kwargs['executable']} = rrth_planner" in entry_points
            params_file, rest = kwargs['parameters']
            (node,) = load_yaml(params_file).values()
            assert set(node) == {'ros__parameters'}
            assert rest == {'use_sim_time': False}
        else:
            assert kwargs['package'] in needed


def test_the_demo_starts_everything_on_the_packages_files(stand_in):
    found = launched(ROOT / 'launch' / 'demo_launch.py', {})
    assert started(found, 'planner_node')['parameters'][0] == str(ROOT / 'config/planner.yaml')
    assert started(found, 'playback_node')['parameters'][0] == str(ROOT / 'config/playback.yaml')
    (description,) = started(found, 'robot_state_publisher')['parameters']
    assert description['robot_description'] == (ROOT / 'urdf/arm.urdf').read_text(encoding='utf-8')
    assert started(found, 'rviz2')['arguments'] == ['-d', str(ROOT / 'rviz/rrth_planner.rviz')]
    (command,) = [kwargs['cmd'] for name, kwargs in found if name == 'ExecuteProcess']
    assert command[:5] == ['ros2', 'topic', 'pub', '--rate', '50']
    assert command[5:7] == ['/body_boxes', 'visualization_msgs/msg/MarkerArray']
    assert yaml.safe_load(command[7]) == load_yaml(resource_path('msg_examples/body.yaml'))


def test_the_demo_does_without_rviz_and_body(stand_in):
    found = launched(ROOT / 'launch' / 'demo_launch.py', {'rviz': 'false', 'body_file': ''})
    assert [kwargs.get('executable') for _, kwargs in found] == [
        'planner_node',
        'playback_node',
        'robot_state_publisher',
    ]


def test_the_demo_says_that_rviz_is_not_installed_and_goes_on(stand_in, packages):
    packages.clear()
    *others, (name, kwargs) = launched(ROOT / 'launch' / 'demo_launch.py', {})
    assert name == 'LogInfo'
    assert kwargs['msg'].startswith('RViz is not installed and not started: ')
    assert [name for name, _ in others] == ['Node'] * 3 + ['ExecuteProcess']
    (*_, (name, _)) = launched(ROOT / 'launch' / 'demo_launch.py', {'rviz': 'false'})
    assert name == 'ExecuteProcess'


def test_arguments_of_the_demo_reach_the_nodes(stand_in):
    arguments = {
        'namespace': 'left',
        'planner_params_file': str(ROOT / 'config/playback.yaml'),
        'playback_params_file': str(ROOT / 'config/planner.yaml'),
        'use_sim_time': 'true',
        'urdf_file': str(ROOT / 'package.xml'),
    }
    found = launched(ROOT / 'launch' / 'demo_launch.py', dict(arguments))
    nodes = [kwargs for name, kwargs in found if name == 'Node']
    assert len(nodes) == 4
    for node in nodes:
        assert node['namespace'] == 'left'
        assert node['parameters'][-1]['use_sim_time'] is True
    for executable in ('planner', 'playback'):
        file = started(found, f'{executable}_node')['parameters'][0]
        assert file == arguments[f'{executable}_params_file']
    (command,) = [kwargs['cmd'] for name, kwargs in found if name == 'ExecuteProcess']
    assert command[5] == '/left/body_boxes'
    described = started(found, 'robot_state_publisher')['parameters'][0]['robot_description']
    assert described == (ROOT / 'package.xml').read_text(encoding='utf-8')


def test_a_namespace_reaches_every_topic_of_rviz(stand_in):
    found = launched(ROOT / 'launch' / 'demo_launch.py', {})
    remappings = started(found, 'rviz2')['remappings']
    manager = load_yaml(resource_path('rviz/rrth_planner.rviz'))['Visualization Manager']
    named = {
        entry[key]['Value']
        for entry in [*manager['Displays'], *manager['Tools']]
        for key in ('Topic', 'Description Topic')
        if key in entry
    }
    assert {absolute for absolute, _ in remappings} == named
    # A name without a slash in front is one of the namespace.
    assert all(relative == absolute.removeprefix('/') for absolute, relative in remappings)


@pytest.mark.parametrize('file', FILES, ids=lambda path: path.stem)
def test_launch_itself_reads_the_files(file):
    pytest.importorskip('launch')
    pytest.importorskip('launch_ros')
    description = runpy.run_path(str(file))['generate_launch_description']()
    arguments = description.get_launch_arguments()
    assert {'namespace', 'use_sim_time'} <= {argument.name for argument in arguments}
    assert all(argument.description.endswith('.') for argument in arguments)
