# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The commands of the tutorial that need no ROS do what it says they do."""

from importlib import import_module
import os
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r'^```(\w*)\n(.*?)^```$', re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r'-?\d+(\.\d+)?(e[+-]?\d+)?')
COMPILING = re.compile(r'^(\w+: )?compiling kernels, .*: takes .*\n', re.MULTILINE)
# Like ./run, but with the Python of the tests.
RUN = """\
#!/bin/sh
shift
case $1 in
{cases}
esac
"""


def steps():
    """Return the commands of each block in bash, and the output that the next block shows."""
    blocks = BLOCK.findall((ROOT / 'docs/tutorial.md').read_text(encoding='utf-8'))
    found = []
    for (kind, text), (next_kind, shown) in zip(blocks, [*blocks[1:], ('end', '')], strict=True):
        if kind == 'bash':
            found.append((text, shown if next_kind == '' else ''))
    return found


def commands():
    """Return the module of each command, as setup.py names them."""
    text = (ROOT / 'setup.py').read_text(encoding='utf-8')
    return dict(re.findall(r"'(\w+) = ([\w.]+):main'", text))


def shape(text):
    """Return a text with every number as #: seeds fix the rest, but not how long a plan takes."""
    return NUMBER.sub('#', text).split()


@pytest.mark.slow
def test_every_offline_command_prints_what_the_tutorial_shows(tmp_path):
    pytest.importorskip('yourdfpy')
    pytest.importorskip('fcl')
    cases = '\n'.join(
        f'    {name}) shift; exec "{sys.executable}" -m {module} "$@" ;;'
        for name, module in commands().items()
    )
    run = tmp_path / 'run'
    run.write_text(RUN.format(cases=cases))
    run.chmod(0o755)
    (tmp_path / 'config').symlink_to(ROOT / 'config')
    paths = os.pathsep.join(filter(None, (str(ROOT), os.environ.get('PYTHONPATH', ''))))
    n_shown = 0
    for text, shown in steps():
        done = subprocess.run(
            ['bash', '-e', '-c', text],
            cwd=tmp_path,
            env={**os.environ, 'PYTHONPATH': paths},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=280,
        )
        assert done.returncode == 0, (text, done.stdout)
        # What a command says once for each machine is not in the tutorial.
        said = COMPILING.sub('', done.stdout)
        assert shape(said) == shape(shown), (text, done.stdout)
        n_shown += bool(shown)
    assert n_shown >= 6


def test_every_command_of_the_tutorial_is_one():
    blocks = BLOCK.findall((ROOT / 'docs/tutorial.md').read_text(encoding='utf-8'))
    names = [name for _, text in blocks for name in re.findall(r'\./run exec (\w+)', text)]
    assert {'read_urdf', 'plan', 'viewer', 'planner_node', 'playback_node'} <= set(names)
    assert set(names) <= {*commands(), 'python'}


def test_keys_and_options_of_the_tutorial_exist(capsys):
    text = (ROOT / 'docs/tutorial.md').read_text(encoding='utf-8')
    declared = set()
    for name in ('read_urdf', 'plan'):
        with pytest.raises(SystemExit) as end:
            import_module(commands()[name]).main(['--help'])
        assert end.value.code == 0
        declared.update(re.findall(r'--[a-z]+', capsys.readouterr().out))
    lines = [line for line in text.splitlines() if re.search('exec (read_urdf|plan) ', line)]
    used = {word for line in lines for word in re.findall(r'(?<= )--[a-z]+', line)}
    assert used
    assert used <= declared
