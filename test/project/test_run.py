# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The script `run`: what it answers without an environment, and of what it makes one."""

from functools import cache
from importlib import metadata
from importlib.util import find_spec
from itertools import product
import json
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

from packaging.requirements import Requirement
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


# What `./run` installs at once, and what it adds for the tests and for single commands.
FIRST, FURTHER = ('run', 'ros-wheels'), ('campaign', 'tools', 'simulation', 'test', 'docs')
PLACES = [
    {'python_version': f'3.{k}', 'python_full_version': f'3.{k}.9', 'platform_machine': machine}
    for k, machine in product(range(10, 14), ('x86_64', 'aarch64'))
]
# A python3 that makes an environment without installing anything: its pip only writes down what it
# is given.
PYTHON = """\
#!/bin/sh
if [ "$1 $2" != '-m venv' ]; then exec "{python}" -S "$@"; fi
mkdir -p "$3/bin" "$3/site"
cat >"$3/bin/python" <<END
#!/bin/sh
case "\\$*" in
    '-m pip '*) echo "\\$*" >>"{log}" ;;
    *sysconfig*) echo "$3/site" ;;
    *) exec "{python}" -S "\\$@" ;;
esac
END
chmod +x "$3/bin/python"
"""


def ranges(name):
    """Return the requirements of a file of ranges."""
    lines = (ROOT / 'requirements' / f'{name}.txt').read_text(encoding='utf-8').splitlines()
    return [Requirement(line) for line in lines if line and not line.startswith('#')]


@cache
def locked(name):
    """Return the requirements of a file of exact versions."""
    text = (ROOT / 'requirements' / 'locked' / f'{name}.txt').read_text(encoding='utf-8')
    found = []
    for entry in text.replace('\\\n', ' ').splitlines():
        if entry.startswith('#'):
            continue
        line, *hashes = entry.split(' --hash=')
        assert hashes, f'{line} has no hashes'
        assert all(re.fullmatch(r'sha256:[0-9a-f]{64}\s*', digest) for digest in hashes)
        found.append(Requirement(line))
    return found


def plain(name):
    """Return the name of a package as indices spell it."""
    return re.sub(r'[-_.]+', '-', name).lower()


def versions(place, names):
    """Return which version of each package is installed at a place."""
    found = {}
    for one in (one for name in names for one in locked(name)):
        if one.marker is None or one.marker.evaluate({'sys_platform': 'linux', **place}):
            (version,) = one.specifier
            assert version.operator == '=='
            assert found.setdefault(plain(one.name), version.version) == version.version, one.name
    return found


@pytest.mark.parametrize('place', PLACES, ids=lambda place: '-'.join(place.values()))
def test_every_range_has_one_exact_version_for_each_python(place):
    found = versions(place, (*FIRST, *FURTHER))
    for name in (*FIRST, *FURTHER):
        own = versions(place, (*FIRST, name))
        for wanted in ranges(name):
            exact = own.get(plain(wanted.name))
            assert exact, f'{wanted} of {name}.txt is not locked: requirements/lock'
            assert wanted.specifier.contains(exact), f'{wanted}, locked {exact}: requirements/lock'
    assert found['numpy'] == versions(place, ('run',))['numpy']


def needed(name):
    """Return what an installed package needs here; the extras of requirements are those given."""
    for text in metadata.requires(name) or ():
        one = Requirement(text)
        if one.marker is None or one.marker.evaluate({'extra': ''}):
            yield plain(one.name)


@pytest.mark.parametrize('name', [*FIRST[1:], *FURTHER])
def test_what_an_exact_version_needs_is_locked_beside_it(name):
    here = versions({}, (FIRST[0], name))
    installed = {plain(one.metadata['Name']): one for one in metadata.distributions()}
    missing = {
        (package, other)
        for package in here
        if package in installed
        for other in needed(installed[package].metadata['Name'])
        if other not in here
    }
    assert not missing, 'requirements/lock leaves them out'


def test_an_environment_is_made_of_exact_versions_and_new_ones_make_a_new_one(tmp_path):
    clone, bin_folder, log = tmp_path / 'clone', tmp_path / 'bin', tmp_path / 'log'
    shutil.copytree(ROOT / 'requirements', clone / 'requirements')
    shutil.copy(ROOT / 'run', clone)
    bin_folder.mkdir()
    python = bin_folder / 'python3'
    python.write_text(PYTHON.format(python=sys._base_executable, log=log))
    python.chmod(0o700)

    def run(*arguments):
        """Run a command in the environment; return what pip was given since the last time."""
        log.write_text('')
        subprocess.run(
            [BASH, clone / 'run', 'exec', *arguments],
            env=environment(PATH=f'{bin_folder}:{os.defpath}'),
            capture_output=True,
            timeout=120,
        )
        return [
            [str(Path(file).relative_to(clone)) for file in re.findall(r'-r (\S+)', line)]
            for line in log.read_text().splitlines()
        ]

    def files(*names):
        return [f'requirements/locked/{name}.txt' for name in names]

    assert run('true') == [files(*FIRST)]
    assert run('true') == []
    # The command itself fails here, where nothing is installed.
    assert run('plot') == [files('run', 'tools')]
    assert run('plot') == []
    (before,) = clone.glob('.venv/py3*')
    for name in FIRST:
        with open(clone / f'requirements/locked/{name}.txt', 'a') as file:
            file.write('# edited\n')
        assert run('true') == [files(*FIRST)]
        (after,) = clone.glob('.venv/py3*')
        assert after != before
        before = after
