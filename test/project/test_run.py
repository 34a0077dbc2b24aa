# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The script `run`: what it answers before it has made an environment."""

from functools import cache
from importlib.util import find_spec
import json
import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest
from rrth_planner.cli.rrth import COMMANDS
from rrth_planner.io.extras import ROS

ROOT = Path(__file__).parents[2]
BASH = shutil.which('bash')
pytestmark = pytest.mark.skipif(
    BASH is None or not (ROOT / 'run').is_file(), reason='run is not installed, or has no bash'
)
# As the commands in an environment print it.
HELP = """
import contextlib, importlib, io, json, sys
from rrth_planner.cli.rrth import COMMANDS, main
texts = {}
for name in sys.argv[1:]:
    command, out = COMMANDS[name], io.StringIO()
    sys.argv[0] = name
    with contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
        if command.settings:
            main([name, '--help'])
        else:
            importlib.import_module(f'rrth_planner.{command.module}').main(['--help'])
    texts[name] = out.getvalue()
print(json.dumps(texts))
"""


def environment(**more):
    """Return the variables of a process without an environment of its own."""
    return {'HOME': os.environ.get('HOME', '/'), 'COLUMNS': '100', 'LC_ALL': 'C.UTF-8', **more}


@pytest.fixture(scope='module', name='clone')
def _clone(tmp_path_factory):
    """Return a fresh clone, and beside it a `python3` of this version without any package."""
    folder = tmp_path_factory.mktemp('fresh') / 'clone'
    folder.mkdir()
    shutil.copy(ROOT / 'run', folder)
    for name in ('rrth_planner', 'config', 'requirements'):
        (folder / name).symlink_to(ROOT / name)
    python = folder.parent / 'bin' / 'python3'
    python.parent.mkdir()
    python.write_text(f'#!/bin/sh\nexec "{sys._base_executable}" -S "$@"\n')
    python.chmod(0o700)
    return folder


def answer(clone, *arguments):
    """Return what `./run` prints in a fresh clone, from elsewhere; it shall end well."""
    path = f'{clone.parent}/bin:{os.defpath}'
    ended = subprocess.run(
        [BASH, clone / 'run', *arguments],
        cwd='/',
        env=environment(PATH=path),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (ended.returncode, ended.stderr) == (0, '')
    assert not (clone / '.venv').exists(), 'an environment has been made'
    return ended.stdout.replace(str(clone), str(ROOT))


@cache
def helps():
    """Return what each command prints in the environment of this process."""
    names = [name for name, c in COMMANDS.items() if find_spec('rclpy') or ROS not in c.needs]
    command = [sys.executable, '-c', HELP, *names]
    paths = os.pathsep.join([str(ROOT), os.environ.get('PYTHONPATH', '')])
    printed = subprocess.check_output(
        command, env={**os.environ, **environment(PYTHONPATH=paths)}, text=True, timeout=300
    )
    return json.loads(printed)


@pytest.mark.parametrize('name', COMMANDS)
def test_a_fresh_clone_prints_the_help_of_a_command_as_its_environment_does(name, clone):
    if name not in helps():
        pytest.skip('needs ROS')
    found = answer(clone, 'exec', name, '--help')
    assert found.startswith(f'usage: {name} ')
    assert found == helps()[name]


def test_help_is_asked_for_by_a_short_option_too_and_of_the_demo_and_of_a_part(clone):
    assert answer(clone, 'demo', '-h') == answer(clone, 'exec', 'demo', '--help')
    assert answer(clone, 'exec', 'plot', 'plan', '-h').startswith('usage: plot plan ')
