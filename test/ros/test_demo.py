# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The demo from outside: it succeeds, or reports in one sentence why not, and leaves nothing."""

import re
import signal
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('rclpy')
image = pytest.importorskip('matplotlib.image')

from rrth_planner.cli import demo  # noqa: E402

# Cold, the planner is compiled first [s].
LONGEST_RUN = 400.0
MODULE = [sys.executable, '-m', 'rrth_planner.cli.demo']


def run(*arguments):
    """Return how a demo ended."""
    return subprocess.run(
        [*MODULE, *map(str, arguments)], capture_output=True, text=True, timeout=LONGEST_RUN
    )


@pytest.mark.slow
def test_the_demo_points_at_targets_and_beside_a_person_and_draws_that(tmp_path):
    path = tmp_path / 'motions.png'
    ended = run('--output', path)
    assert ended.returncode == 0, ended.stderr
    table = ended.stdout.splitlines()
    for target in ('front', 'left', 'high'):
        row = next(line.split() for line in table if line.startswith(f'{target} '))
        assert row[2::2] == ['ms', 'rad', 's', 'm', 'mm']
        assert float(row[7]) >= 0.02
        assert float(row[9]) <= 1.0
    beside = next(line for line in table if line.startswith('Beside a person at work'))
    figures = [float(n) for n in re.findall(r'[\d.]*\d', beside)]
    n_reached, n_targets, miss, n_commitments, n_stops, least_rate, share, n_frames = figures
    assert n_reached == n_targets == 2
    assert miss <= 1.0
    # However busy the machine is.
    assert n_commitments > 4
    assert n_frames > 4
    assert n_stops >= 0
    assert 0.0 <= least_rate <= 1.0
    assert 0.0 <= share <= 100.0
    judged = next(line for line in table if line.startswith('Each commitment ends at rest'))
    n_excused, n_unknown, n_instants, speed, n_contacts = map(
        float, re.findall(r'[\d.]*\d', judged)
    )
    assert n_excused + n_unknown < n_commitments
    assert n_instants > n_contacts
    assert speed == 0.1
    pixels = image.imread(path)
    assert pixels.std() > 0.05
    assert np.ptp(pixels[..., :3]) > 0.9


@pytest.mark.slow
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_demo_ends_its_processes(tmp_path, number):
    process = subprocess.Popen(
        [*MODULE, '--output', str(tmp_path / 'motions.png')],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        # The first line of a node, so both processes are there; pipes close when all have ended.
        while not process.stdout.readline().startswith('  '):
            assert process.poll() is None
        process.send_signal(number)
        _, words = process.communicate(timeout=LONGEST_RUN)
    finally:
        process.kill()
    assert process.returncode == 130
    assert words == 'demo interrupted\n'


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--targets', 'nowhere'], 'target_nowhere.yaml'),
        (['--output', '/nowhere/motions.png'], 'folder'),
        (['--seed', '-5'], 'seed'),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path, call, arguments, words):
    ended = call(demo.main, '--output', tmp_path / 'motions.png', *arguments)
    assert ended.returncode == 1
    assert ended.stderr.startswith('demo failed: ')
    assert len(ended.stderr.splitlines()) == 1
    assert words in ended.stderr


def test_no_timeout_at_all_is_rejected(tmp_path, call):
    ended = call(demo.main, '--output', tmp_path / 'motions.png', '--timeout', '0')
    assert ended.returncode == 2
    assert '--timeout: 0, expected a number > 0 [s]' in ended.stderr
