# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What ROS reads of the package: dependencies that the code has, and a changelog by versions."""

import ast
from pathlib import Path
import re
import sys

from catkin_pkg.changelog import get_changelog_from_path
from catkin_pkg.package import parse_package
import pytest

ROOT = Path(__file__).parents[2]
# Modules that come with a package of another name: keys of rosdep.
KEYS = {
    'matplotlib': 'python3-matplotlib',
    'mpl_toolkits': 'python3-matplotlib',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'tf2_ros': 'tf2_ros_py',
    'tqdm': 'python3-tqdm',
    'yaml': 'python3-yaml',
}
# rosdep has no key for these, or only one that pip serves; requirements/ lists them.
BY_PIP = {
    *('c3d', 'distributed', 'imageio', 'mcap', 'mcap_ros2', 'mujoco', 'playwright', 'pyarrow'),
    *('pybvh', 'rosbags', 'trimesh', 'viser', 'yourdfpy', 'zstandard'),
}


def imported(file):
    """Return what a file imports: top-level names, late imports included."""
    for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module.partition('.')[0]


def declared(with_rviz):
    """Return what a user of rosdep gets, with RRTH_RVIZ=1 or without."""
    package = parse_package(str(ROOT / 'package.xml'))
    package.evaluate_conditions({'RRTH_RVIZ': '1'} if with_rviz else {})
    return {one.name for one in package.exec_depends if one.evaluated_condition}


@pytest.mark.parametrize('with_rviz', [False, True])
def test_the_manifest_declares_what_is_imported_and_started_and_nothing_else(with_rviz):
    files = [*(ROOT / 'rrth_planner').rglob('*.py'), *(ROOT / 'launch').glob('*.py')]
    names = {name for file in files for name in imported(file)}
    names -= {*sys.stdlib_module_names, 'rrth_planner'}
    assert names >= BY_PIP
    needed = {KEYS.get(name, name) for name in names - BY_PIP}
    launch_file = (ROOT / 'launch/demo_launch.py').read_text(encoding='utf-8')
    needed |= set(re.findall(r"package='(\w+)'", launch_file))
    assert "'ros2',\n                    'topic'," in launch_file
    needed.add('ros2topic')
    rviz = (ROOT / 'rviz/rrth_planner.rviz').read_text(encoding='utf-8')
    needed |= set(re.findall(r'Class: (\w+)/', rviz))
    shown = {name for name in needed if name.startswith('rviz')}
    assert 'rviz2' in shown
    assert declared(with_rviz) == (needed if with_rviz else needed - shown)


def test_the_changelog_has_the_version_of_the_manifest_on_top_and_groups_its_changes():
    text = (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8')
    # Between two releases, what is to come is above, as Forthcoming.
    released = re.findall(r'^(\d+\.\d+\.\d+) \(\d{4}-\d\d-\d\d\)$', text, re.MULTILINE)
    assert released == sorted(released, key=lambda version: [*map(int, version.split('.'))])[::-1]
    assert released[0] == parse_package(str(ROOT / 'package.xml')).version
    changelog = get_changelog_from_path(str(ROOT), package_name='rrth_planner')
    for version in released:
        assert changelog.get_date_of_version(version) is not None
        groups = re.findall(
            r'^\* (.*)', str(changelog.get_content_of_version(version)[-1]), re.MULTILINE
        )
        assert groups
        for group in groups:
            assert re.match(r'(Added|Changed|Removed|Fixed)\b', group), group
