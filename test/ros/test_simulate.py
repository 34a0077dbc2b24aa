# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The command `simulate` from outside: planner, physics and person at once, and a clean end."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('mujoco')
pytest.importorskip('fcl')

from rrth_planner.cli.simulate import CENTER, main, SWING, target_at  # noqa: E402

# Cold, the planner is compiled first [s].
LONGEST_RUN = 400.0
MODULE = [sys.executable, '-m', 'rrth_planner.cli.simulate', '--no-viewer']


@pytest.mark.slow
def test_a_run_reports_targets_and_what_the_physics_saw():
    ended = subprocess.run(
        [*MODULE, '--seconds', '4'],
        capture_output=True,
        text=True,
        timeout=LONGEST_RUN,
        env=os.environ,
    )
    assert ended.returncode == 0, ended.stderr + ended.stdout
    last = ended.stdout.splitlines()[-1]
    found = re.match(r'Targets reached: (\d+), missed: (\d+); real-time factor: ([\d.]+); ', last)
    assert found, ended.stdout
    # A busy machine's commitments come late, to which the arm catches up; one that its servos do
    # not hold would be off by its length.
    lag = float(
        re.search(r'greatest distance of the tool from its motion \[m\]: ([\d.]+)', last)[1]
    )
    assert 0.0 < lag < 0.1
    assert re.search(r'contacts: \d+; greatest force of a contact \[N\]: [\d.]+\.$', last)


def test_the_target_moves_slowly_and_stays_before_the_wearer():
    places = np.array([target_at(t) for t in np.linspace(0.0, 100.0, 10001)])
    assert (np.abs(places - CENTER) <= SWING + 1e-12).all()
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() / 0.01 < 0.3


@pytest.mark.parametrize(
    ('arguments', 'code', 'words'),
    [
        (['--video', 'run.gif'], 2, '--video: given without --seconds'),
        (['--video', 'run.avi', '--seconds', '1'], 1, 'ends in .gif or .mp4'),
        (['--lag', '0'], 2, '--lag: 0, expected a number > 0 [m]'),
    ],
)
def test_what_is_wrong_is_said(call, arguments, code, words):
    ended = call(main, '--no-viewer', *arguments)
    assert ended.returncode == code
    assert words in ended.stderr
