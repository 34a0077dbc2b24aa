# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The command of an installation by pip, also where ROS and the extras are missing."""

import os
from pathlib import Path
import subprocess
import sys

import pytest
import rrth_planner
from rrth_planner.cli import rrth

ROOT = Path(__file__).parents[2]
# Run as `rrth` is, without what no bare installation has.
BARE = """
import contextlib, io, sys
MISSING = ('rclpy', 'geometry_msgs', 'matplotlib', 'viser', 'mcap', 'mcap_ros2', 'yourdfpy',
           'trimesh', 'pybvh', 'c3d', 'tqdm', 'distributed', 'pyarrow', 'rosbags', 'playwright')
for name in (*MISSING, *sys.argv[1:]):
    sys.modules[name] = None
sys.argv[0] = '/usr/bin/rrth'
from rrth_planner.cli.rrth import COMMANDS, main

def run(*arguments):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main(arguments)
        except SystemExit as end:
            code = end.code
    return code, out.getvalue(), err.getvalue()
"""
HELP = """
for name in COMMANDS:
    for option in ('-h', '--help'):
        code, out, err = run(name, option)
        assert (code, err) == (0, ''), (name, code, err)
        assert out.startswith(f'usage: rrth {name} '), out
        assert len(out.splitlines()) > 5, out
"""
# Without them a command prints its help, too.
LIBRARIES = ('numpy', 'numba', 'yaml', 'fcl')
# What is started without what it needs, and what is named.
NEEDS = """
ROS = 'ROS 2 Jazzy (rclpy)'
for arguments, needed, extras in (
    (['planner_node'], [ROS], 'ros'),
    (['playback_node', '--ros-args', '-h'], [ROS], 'ros'),
    (['point_at', '1', '0', '0'], [ROS, 'tqdm'], 'ros,tools'),
    (['wearer'], [ROS], 'ros'),
    (['record'], [ROS, 'mcap', 'tqdm'], 'ros,tools'),
    (['demo'], [ROS, 'matplotlib'], 'ros'),
    (['viewer'], ['viser'], 'tools'),
    (['read_urdf', 'a.urdf', '--output', 'a.yaml'], ['yourdfpy', 'trimesh'], 'tools'),
    (['plot', 'plan', '--target', '1', '0', '0', '-o', 'a.png'], ['matplotlib'], 'tools'),
    (['campaign', 'a.csv', '--output', 'a.parquet'], ['distributed', 'pyarrow', 'tqdm'],
     'campaign'),
    (['reproduce'], ['distributed', 'pyarrow', 'tqdm', 'matplotlib'], 'campaign'),
):
    code, out, err = run(*arguments)
    how = f"pip install 'rrth_planner[{extras}]'"
    assert code in (1, 2) and not out, (arguments, code, out, err)
    assert err.count(chr(10)) == 1, err
    assert err.startswith(f'rrth {arguments[0]}: needs {", ".join(needed)}; '), err
    assert err.endswith(f' with: {how}' + chr(10)), err
"""


@pytest.mark.parametrize(
    ('code', 'missing'), [(HELP, LIBRARIES), (NEEDS, ())], ids=['help', 'needs']
)
def test_without_ros_and_extras_all_help_and_say_what_to_install(code, missing, tmp_path):
    code = f'import sys; sys.path.insert(0, {str(ROOT)!r})\n{BARE}{code}'
    ended = subprocess.run(
        [sys.executable, '-c', code, *missing],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 0, ended.stderr


def test_what_it_is_given_reaches_the_command_and_its_exit_code_comes_back(tmp_path, capsys):
    pytest.importorskip('yaml')
    file = tmp_path / 'arm.urdf'
    assert rrth.main(['write_urdf', '--output', str(file)]) == 0
    assert file.read_text().endswith('</robot>\n')
    assert rrth.main(['write_urdf', '--arm', str(tmp_path / 'none.yaml')]) == 2
    assert capsys.readouterr().err.startswith('write_urdf: file ')


@pytest.mark.parametrize(
    ('arguments', 'code', 'told'),
    [
        ([], 0, 'usage: rrth COMMAND ...'),
        (['--help'], 0, 'commands that need ROS 2 Jazzy:'),
        (['--version'], 0, f'rrth {rrth_planner.__version__}'),
        (['plam'], 2, "invalid choice: 'plam'"),
        (['--seed', '1'], 2, 'usage: rrth COMMAND ...'),
    ],
)
def test_what_is_no_command_is_answered_by_rrth_itself(arguments, code, told, capsys):
    with pytest.raises(SystemExit) as end:
        rrth.main(arguments)
    assert end.value.code == code
    said = capsys.readouterr()
    assert told in (said.err if code else said.out)


def test_a_reader_that_has_ended_ends_a_command_silently():
    pytest.importorskip('yaml')
    # Of two processes that share a pipe, the one that reads is gone before the other prints.
    read, write = os.pipe()
    os.close(read)
    ended = subprocess.run(
        [sys.executable, '-m', 'rrth_planner.cli.rrth', 'write_urdf'],
        stdout=write,
        stderr=subprocess.PIPE,
        text=True,
        timeout=120,
        check=False,
    )
    os.close(write)
    assert (ended.returncode, ended.stderr) == (141, '')
