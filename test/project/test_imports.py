# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Who may import whom: the table of CONTRIBUTING.md, late imports included."""

import ast
from functools import cache
from graphlib import TopologicalSorter
import os
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[2] / 'rrth_planner'
MODULES = {
    '.'.join(file.relative_to(ROOT.parent).with_suffix('').parts).removesuffix('.__init__'): file
    for file in sorted(ROOT.rglob('*.py'))
}
# What each package may import of the project, and beyond numpy and the standard library.
MAY = {
    'kernels': '',
    'model': 'kernels',
    'collision': 'kernels model',
    'planning': 'kernels model collision',
    'timing': 'kernels model collision',
    'execution': 'kernels model collision timing',
    'pipeline': 'kernels model collision timing planning',
    'wearer': 'model',
    'io': 'model collision planning pipeline wearer',
    'simulation': 'model wearer io',
    'requests': 'model collision planning execution pipeline io',
    'rehearsal': 'kernels model collision timing execution pipeline wearer io requests simulation',
    'visualization': 'model collision planning execution pipeline wearer io',
    'ros': 'kernels model collision planning timing execution pipeline wearer io requests '
    'simulation',
    'reproduction': 'kernels model collision planning io visualization',
    'cli': 'kernels model collision planning timing execution pipeline wearer io requests '
    'visualization simulation rehearsal ros reproduction',
}
# Within `ros`, each package imports only itself and those before it.
ROS_ROOMS = ('messages', 'middleware', 'interface', 'monitor', 'requests', 'client')
ROS = {'rclpy', 'tf2_ros', 'builtin_interfaces', 'rcl_interfaces', 'std_srvs', 'rosidl_parser'}
LIBRARIES = {
    'kernels': {'numba'},
    'ros': {*ROS, 'tqdm', 'launch', 'launch_ros'},
    'visualization': {'matplotlib', 'mpl_toolkits', 'viser'},
    'simulation': {'mujoco'},
    'reproduction': {'matplotlib'},
    'cli': {'rclpy', 'matplotlib', 'viser', 'tqdm'},
}
# What single modules import beyond that.
OWN = {
    'rrth_planner.cli.campaign_file': {'pyarrow'},
    'rrth_planner.cli.query_batch': {'pyarrow'},
    'rrth_planner.io.cluster': {'tqdm', 'distributed'},
    'rrth_planner.io.parquet_file': {'pyarrow'},
    'rrth_planner.io.query_file': {'pyarrow'},
    'rrth_planner.io.motion_capture_file': {'pybvh', 'c3d'},
    'rrth_planner.io.resources': {'ament_index_python'},
    'rrth_planner.io.text_file': {'yaml'},
    'rrth_planner.io.urdf.chain': {'yourdfpy', 'trimesh'},
    'rrth_planner.io.urdf.geometry': {'trimesh'},
    'rrth_planner.io.urdf.placed_robot': {'yourdfpy'},
    'rrth_planner.reproduction.row_store': {'pyarrow'},
    'rrth_planner.ros.client.recorder': {'mcap'},
    'rrth_planner.ros.client.recording_files': {'mcap', 'mcap_ros2', 'rosbags', 'zstandard'},
    'rrth_planner.ros.messages.definitions': {'rosbags'},
    'rrth_planner.simulation.film': {'imageio'},
    'rrth_planner.visualization.viewer.screenshot': {'playwright'},
}
# The live viewer shows what a node of its own hears.
FEED = ('rrth_planner.visualization.viewer.live_page', 'rrth_planner.ros.client.viewer_feed')
# Who may use the second checker.
SECOND_USERS = {
    'rrth_planner.collision.second_checker',
    'rrth_planner.collision.trajectory_validation',
    'rrth_planner.collision.checker_comparison',
    'rrth_planner.collision.separation_checker',
}
# Modules that import parts of the project below their top. The executable of the node starts the
# planning process before it loads the node; that process loads no kernels that are not compiled
# yet. The node says that it compiles before it imports what has to be compiled, and so does a
# command, which also says which libraries it misses before it imports what needs them. What only
# one option of a command needs takes seconds to load. A playback needs kernels for stops only. The
# package of clients gives its public one where that is used.
LATE = {
    'rrth_planner.pipeline.planning_worker',
    'rrth_planner.ros.client',
    'rrth_planner.ros.planner',
    'rrth_planner.ros.planner_node',
    'rrth_planner.execution.playback',
    'rrth_planner.ros.interface.posture_inputs',
    *(
        f'rrth_planner.cli.{name}'
        for name in (
            *('plan', 'plot', 'point_at', 'read_urdf', 'record', 'replay', 'reproduce', 'viewer'),
            *('simulate', 'rehearse'),
            *('campaign', 'file_question', 'query_batch'),
        )
    ),
}


def room_of(module):
    """Return the package of a module."""
    return (module.split('.') + [''])[1]


@cache
def imports_of(file):
    """Return what a file imports: (name, level, is at the top) of each import."""
    return tuple(_imports_of(file))


def _imports_of(file):
    tree = ast.parse(file.read_text(encoding='utf-8'))
    top = set(map(id, tree.body))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, 0, id(node) in top) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ''
            yield base, node.level, id(node) in top
            for alias in node.names:
                if f'{base}.{alias.name}' in MODULES:
                    yield f'{base}.{alias.name}', node.level, id(node) in top


def may_import(module, name):
    """Return whether a module may import a name by the table."""
    room, root = room_of(module), name.split('.')[0]
    if root == 'rrth_planner':
        other = room_of(name)
        if room == 'ros' and other == 'ros':
            return is_below(name, module)
        return other in {room, '', *MAY[room].split()} or (module, name) == FEED
    if root in sys.stdlib_module_names or root == 'numpy':
        return True
    if root.endswith('_msgs') and room in ('ros', 'cli'):
        return True
    return root in LIBRARIES.get(room, set()) | OWN.get(module, set())


def is_below(name, module):
    """Return whether a name of `ros` is of the same package as a module of it, or of one below."""
    places = [parts[2] if len(parts := m.split('.')) > 3 else '' for m in (name, module)]
    # The nodes are above all.
    rank = [len(ROS_ROOMS) if not place else ROS_ROOMS.index(place) for place in places]
    return rank[0] <= rank[1] or name.removeprefix('rrth_planner.ros.') in ROS_ROOMS


@pytest.mark.parametrize('module', [m for m in MODULES if m != 'rrth_planner'])
def test_a_module_imports_only_what_its_package_may(module):
    for name, level, is_top in imports_of(MODULES[module]):
        assert level == 0, f'{module} imports {name} relatively'
        assert may_import(module, name), f'{module} may not import {name}'
        if name.startswith('rrth_planner') and module not in LATE:
            assert is_top, f'{module} imports {name} below the top'
        if name == 'rrth_planner.collision.second_checker':
            assert module in SECOND_USERS, f'{module} imports {name}'


def graph_of_modules():
    """Return which modules each module imports, late imports included."""
    return {
        module: {name for name, _, _ in imports_of(file) if name in MODULES and name != module}
        - {'rrth_planner'}
        for module, file in MODULES.items()
    }


def test_contributing_has_the_same_table():
    page = (ROOT.parent / 'CONTRIBUTING.md').read_text(encoding='utf-8')
    rows = re.findall(r'^\| `rrth_planner/(\w+)/` \|.*\| ([^|]+) \|$', page, re.MULTILINE)
    assert [room for room, _ in rows] == [*MAY]
    for room, cell in rows:
        others, _, libraries = cell.partition(';')
        listed = set(MAY) - {room} if others == 'everything' else set(others.split(', '))
        assert listed - {'nothing of the project'} == set(MAY[room].split()), room
        if room in {'kernels', 'simulation', 'visualization', 'reproduction'}:
            assert set(libraries.strip().split(', ')) == LIBRARIES[room] - {'mpl_toolkits'}
    assert f'those before it: {", ".join(ROS_ROOMS)};' in ' '.join(page.split())


def test_imports_are_acyclic():
    tuple(TopologicalSorter(graph_of_modules()).static_order())


def test_packages_are_acyclic():
    graph = {room: set() for room in MAY}
    for module, names in graph_of_modules().items():
        if module != 'rrth_planner':
            others = {room_of(name) for name in names if (module, name) != FEED}
            graph[room_of(module)] |= others - {room_of(module)}
    tuple(TopologicalSorter(graph).static_order())


def test_the_rooms_are_those_of_the_table():
    assert {path.name for path in ROOT.iterdir() if path.name != '__pycache__'} == {
        *MAY,
        '__init__.py',
        'py.typed',
    }


@pytest.mark.parametrize('checker', ['second_checker', 'separation_checker'])
def test_a_second_checker_shares_nothing_with_the_certificate(checker):
    graph, found = graph_of_modules(), {f'rrth_planner.collision.{checker}'}
    while new := {name for module in found for name in graph[module]} - found:
        found |= new
    assert not [name for name in found if 'certificate' in name]
    for module in found:
        assert 'numba' not in {name.split('.')[0] for name, _, _ in imports_of(MODULES[module])}


BLOCKED = """
import sys
for name in ('rclpy', 'fcl', 'matplotlib', 'tkinter', 'yaml', 'ament_index_python', 'tf2_ros'):
    sys.modules[name] = None
import rrth_planner
assert rrth_planner.__doc__
from rrth_planner.collision import certificate, reference_checker, world
from rrth_planner.kernels.collision import arm_validity
from rrth_planner.planning import planner
from rrth_planner.timing import parameterization
assert not [name for name in sys.modules if name.startswith(('rrth_planner.ros', 'rclpy.'))]
"""


def test_the_core_works_without_ros_fcl_or_a_display():
    paths = os.pathsep.join([str(ROOT.parent), os.environ.get('PYTHONPATH', '')])
    environment = {**os.environ, 'PYTHONPATH': paths}
    environment.pop('DISPLAY', None)
    subprocess.run([sys.executable, '-c', BLOCKED], env=environment, check=True)
