# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What pip and colcon install: commands, files beside the code, what is said of the package."""

from fnmatch import fnmatch
from importlib.util import find_spec
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import pytest
import rrth_planner
from rrth_planner.cli.rrth import COMMANDS
import setuptools

# After setuptools, which brings it where Python does not.
from distutils.core import run_setup  # isort: skip

ROOT = Path(__file__).parents[2]
FOLDERS = ('config', 'msg_examples', 'rviz', 'urdf')
# pip needs one of these to build a wheel without an index.
CAN_BUILD = bool(find_spec('wheel')) or int(setuptools.__version__.split('.')[0]) >= 71
# From any folder, without the sources.
USE = """
from pathlib import Path
import numpy as np
import rrth_planner as rrth
from rrth_planner.io.resources import resource_path
here = Path(rrth.__file__).parent
assert here.parent == Path({folder!r}), here
names = ('config/arm.yaml', 'config/maps/spiral.yaml', 'config/examples/chest_arm.urdf')
names = (*names, 'config/human.yaml', 'config/skeletons/xsens.yaml')
for name in (*names, 'msg_examples/body.yaml', 'urdf/arm.urdf', 'rviz/rrth_planner.rviz'):
    assert resource_path(name) == here / name
assert rrth.load_settings(rrth.load_arm().dof) and rrth.load_body()
from rrth_planner.io.motion_capture_file import load_person
assert load_person().rate == 30.0
"""


@pytest.fixture(autouse=True)
def _in_the_project(monkeypatch):
    """Have setup.py find what it lists."""
    monkeypatch.chdir(ROOT)


def described(command):
    """Return the package as setup.py describes it for a command of setuptools."""
    return run_setup('setup.py', [command], stop_after='init')


def scripts(distribution):
    """Return the commands of a package, by name."""
    return dict(line.split(' = ') for line in distribution.entry_points['console_scripts'])


def files_of_the_project():
    """Return the files beside the code that are installed."""
    found = {
        str(path.relative_to(ROOT))
        for folder in FOLDERS
        for path in (ROOT / folder).rglob('*')
        if path.is_file() and path.name != 'README.md'
    }
    assert len(found) > 20
    return found


@pytest.mark.parametrize('command', ['bdist_wheel', 'dist_info', 'editable_wheel'])
def test_pip_gets_one_package_and_one_command(command):
    distribution = described(command)
    assert scripts(distribution) == {'rrth': 'rrth_planner.cli.rrth:main'}
    assert {name.split('.')[0] for name in distribution.packages} == {'rrth_planner'}
    assert not distribution.data_files
    assert distribution.package_data['rrth_planner'] == ['py.typed']
    for file in files_of_the_project():
        folder, _, name = file.partition('/')
        assert f'rrth_planner.{folder}' in distribution.packages
        assert distribution.package_dir[f'rrth_planner.{folder}'] == folder
        patterns = distribution.package_data[f'rrth_planner.{folder}']
        assert any(fnmatch(name, p) and name.count('/') == p.count('/') for p in patterns), file


@pytest.mark.parametrize('command', ['install', 'develop', 'egg_info'])
def test_colcon_gets_every_executable_and_the_files_in_share(command):
    distribution = described(command)
    found = scripts(distribution)
    assert set(found) == set(COMMANDS)
    for name, entry in found.items():
        assert entry == f'rrth_planner.{COMMANDS[name].module}:main'
        assert find_spec(entry.partition(':')[0])
    shared = {file for _, files in distribution.data_files for file in files}
    assert shared >= files_of_the_project()
    assert {'package.xml', 'launch/demo_launch.py', 'resource/rrth_planner'} <= shared
    for folder, files in distribution.data_files:
        for file in files:
            place = os.path.dirname(file)
            if place != 'resource':
                assert folder == os.path.join('share/rrth_planner', place).rstrip('/')


def test_run_offers_what_colcon_installs():
    text = (ROOT / 'run').read_text(encoding='utf-8')
    (nodes,) = re.findall(r'ros\.\{([\w,]+)\}_node', text)
    (commands,) = re.findall(r'cli\.\{([\w,]+)\}', text)
    offered = {f'{name}_node' for name in nodes.split(',')} | set(commands.split(','))
    assert offered == set(COMMANDS)


def in_order(requirement):
    """Return a requirement as its name and its bounds."""
    return frozenset(re.findall(r'[<>=]+[\d.]+|^[\w-]+', requirement))


def test_every_requirement_is_said_once():
    distribution = described('dist_info')
    names = {re.split(r'[\[<>=]', line)[0] for line in distribution.install_requires}
    assert names == {'numpy', 'numba', 'pyyaml', 'python-fcl'}
    extras = distribution.extras_require
    assert set(extras) == {'node', 'ros', 'campaign', 'simulation', 'tools', 'test'}
    assert {extra for c in COMMANDS.values() for extra in filter(None, c.extras.split(','))} <= {
        *extras
    }
    run = (ROOT / 'requirements/run.txt').read_text(encoding='utf-8')
    assert set(map(in_order, [*distribution.install_requires, *extras['node']])) == {
        in_order(line) for line in run.splitlines() if not line.startswith('#')
    }


def test_there_is_one_version_and_what_is_said_is_that_of_the_manifest():
    distribution = described('dist_info')
    manifest = ElementTree.parse(ROOT / 'package.xml').getroot()
    version = manifest.findtext('version')
    assert distribution.get_version() == rrth_planner.__version__ == version
    assert re.search(rf'^{re.escape(version)} \(', (ROOT / 'CHANGELOG.rst').read_text(), re.M)
    assert distribution.get_name() == manifest.findtext('name')
    assert distribution.get_description() == manifest.findtext('description')
    metadata = distribution.metadata
    assert metadata.project_urls == {
        url.get('type', 'website'): url.text for url in manifest.findall('url')
    }
    assert metadata.long_description.startswith('# rrth_planner')
    assert metadata.long_description_content_type == 'text/markdown'
    pythons = {f'Programming Language :: Python :: 3.{k}' for k in (10, 11, 12, 13)}
    assert pythons | {'Typing :: Typed'} <= set(distribution.get_classifiers())


def ended_well(*command, **options):
    """Run a command; it shall end well."""
    ended = subprocess.run(
        list(map(str, command)),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=200,
        **options,
    )
    assert ended.returncode == 0, ended.stdout
    return ended.stdout


def test_colcons_commands_of_setuptools_install_as_ros_does(tmp_path):
    base = tmp_path / 'install'
    ended_well(
        *(sys.executable, '-W', 'ignore', 'setup.py', 'egg_info', '--egg-base', tmp_path),
        *('build', '--build-base', tmp_path / 'build'),
        *('install', '--prefix', base, '--record', tmp_path / 'log'),
        '--single-version-externally-managed',
    )
    executables = base / 'lib' / 'rrth_planner'
    assert {path.name for path in executables.iterdir()} == set(COMMANDS)
    assert all(os.access(path, os.X_OK) for path in executables.iterdir())
    assert not (base / 'bin').exists()
    share = base / 'share' / 'rrth_planner'
    assert files_of_the_project() <= {
        str(path.relative_to(share)) for path in share.rglob('*') if path.is_file()
    }
    (package,) = base.glob('l*/python3*/*-packages/rrth_planner')
    assert (package / 'py.typed').is_file()
    assert not (package / 'config').exists()


@pytest.mark.skipif(not CAN_BUILD, reason='no wheel can be built offline')
def test_pip_installs_into_any_folder(tmp_path):
    sources, folder = tmp_path / 'sources', tmp_path / 'folder'
    # Not in the project, where a build leaves its folder.
    shutil.copytree(
        ROOT,
        sources,
        ignore=shutil.ignore_patterns('.*', 'build', 'docs', 'test', 'benchmarks', '__pycache__'),
    )
    pip = (sys.executable, '-m', 'pip', 'install', '-q', '--no-deps', '--no-build-isolation')
    ended_well(*pip, '--no-compile', '--target', folder, sources)
    places = {re.sub('-.*', '', path.name) for path in folder.iterdir()}
    assert places == {'rrth_planner', 'bin'}
    assert [path.name for path in (folder / 'bin').iterdir()] == ['rrth']
    environment = {**os.environ, 'PYTHONPATH': str(folder)}
    code = USE.format(folder=str(folder))
    ended_well(sys.executable, '-c', code, cwd=tmp_path, env=environment)
    told = ended_well(folder / 'bin' / 'rrth', '--version', cwd=tmp_path, env=environment)
    assert told == f'rrth {rrth_planner.__version__}\n'
    told = ended_well(folder / 'bin' / 'rrth', 'plan', '--help', cwd=tmp_path, env=environment)
    assert told.startswith('usage: rrth plan ')
