# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Who may import whom: kernels know arrays, the core knows no ROS, nobody imports ros."""

import ast
from graphlib import TopologicalSorter
import os
from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).parent.parent / 'rrth_planner'
MODULES = {
    '.'.join(file.relative_to(ROOT.parent).with_suffix('').parts).removesuffix('.__init__'): file
    for file in sorted(ROOT.rglob('*.py'))
}
ROS = {'rclpy', 'tf2_ros', 'builtin_interfaces', 'rcl_interfaces', 'std_srvs', 'rosidl_parser'}
# What a module of the core may import beyond numpy and the standard library.
OWN = {
    'fcl_shapes': {'fcl'},
    'resources': {'ament_index_python'},
    'text_files': {'yaml'},
    'cluster': {'tqdm', 'distributed'},
    'store': {'pyarrow'},
    'runs': {'numba'},
    'urdf_chain': {'yourdfpy', 'trimesh'},
    'quick_decoding': {'rosbags'},
    # Tools to look at motions, in the layers of ROS and of the viewers.
    'recorder': {'mcap'},
    'recordings': {'mcap', 'mcap_ros2'},
    'viewer_picture': {'playwright'},
}
# The node says that it compiles before it imports what has to be compiled; what only one option of
# a command needs takes seconds to load.
# The report says which requirements it misses before it imports what has them.
REPORTER = 'rrth_planner.cli.reproduce'
LATE = {
    ('rrth_planner.ros.planner_node', 'rrth_planner.pipeline.plan_motion'),
    ('rrth_planner.ros.planner_node', 'rrth_planner.ros.requests.plan_request'),
    ('rrth_planner.cli.point_at', 'rrth_planner.ros.client.follow_motion'),
    ('rrth_planner.cli.point_at', 'rrth_planner.ros.messages.body'),
    ('rrth_planner.cli.point_at', 'rrth_planner.ros.client.dry_run'),
    *(
        ('rrth_planner.ros.planner_node', f'rrth_planner.ros.{name}')
        for name in ('inputs', 'listener', 'plan_queue', 'reporter')
    ),
    # Once it is known that what they need is installed.
    ('rrth_planner.cli.record', 'rrth_planner.ros.client.recorder'),
    ('rrth_planner.cli.plot', 'rrth_planner.ros.client.recording_reader'),
    ('rrth_planner.cli.viewer', 'rrth_planner.ros.client.viewer_feed'),
    ('rrth_planner.cli.viewer', 'rrth_planner.visualization.viewer.live_page'),
    ('rrth_planner.cli.viewer', 'rrth_planner.visualization.viewer.page'),
}


def imports_of(file):
    """Return what a file imports: (name, level, is at the top) of each import."""
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


def allowed(module, name):
    """Return whether a module may import a name by the rules of the house."""
    package, root = module.split('.')[1:2], name.split('.')[0]
    layer = package[0] if package and package[0] in ('kernels', 'ros', 'viewers') else 'core'
    if root == 'rrth_planner':
        target = (name.split('.')[1:2] or [''])[0]
        if layer == 'kernels':
            return target == 'kernels'
        if target == 'viewers':
            is_demo = layer == 'ros' and 'demo' in module
            return layer == 'viewers' or is_demo or module == REPORTER
        return target != 'ros' or layer == 'ros' or (module, name) in LATE
    if root in sys.stdlib_module_names or root == 'numpy':
        return True
    return root in {
        'kernels': {'numba'},
        'ros': {*ROS, 'tqdm', root if root.endswith('_msgs') else 'rclpy'},
        'viewers': {'matplotlib', 'mpl_toolkits', 'viser'},
        'core': set(),
    }[layer] | OWN.get(module.split('.')[-1], set())


@pytest.mark.parametrize('module', MODULES)
def test_a_module_imports_only_what_its_layer_may(module):
    for name, level, is_top in imports_of(MODULES[module]):
        assert level == 0, f'{module} imports {name} relatively'
        assert allowed(module, name), f'{module} may not import {name}'
        is_late_by_right = (module, name) in LATE or module == REPORTER
        if name.startswith('rrth_planner') and not is_late_by_right:
            assert is_top, f'{module} imports {name} below the top'
        if name.startswith('rrth_planner.fcl_'):
            may = (
                '.escape',
                '.fcl_check',
                '.fcl_shapes',
                '.judges',
                '.opinions',
                '.ros.second_opinion',
            )
            assert module.endswith(may), f'{module} imports {name}'


def test_imports_are_acyclic():
    graph = {
        module: {name for name, _, _ in imports_of(file) if name in MODULES and name != module}
        - {'rrth_planner'}
        for module, file in MODULES.items()
    }
    tuple(TopologicalSorter(graph).static_order())


BLOCKED = """
import sys
for name in ('rclpy', 'fcl', 'matplotlib', 'tkinter', 'yaml', 'ament_index_python', 'tf2_ros'):
    sys.modules[name] = None
import rrth_planner
assert rrth_planner.__doc__
from rrth_planner import certificate, kernels, oracle, planner, timing, world
from rrth_planner.kernels import arm_validity
assert not [name for name in sys.modules if name.startswith(('rrth_planner.ros', 'rclpy.'))]
"""


def test_the_core_works_without_ros_fcl_or_a_display():
    paths = os.pathsep.join([str(ROOT.parent), os.environ.get('PYTHONPATH', '')])
    environment = {**os.environ, 'PYTHONPATH': paths}
    environment.pop('DISPLAY', None)
    subprocess.run([sys.executable, '-c', BLOCKED], env=environment, check=True)
