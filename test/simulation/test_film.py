# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A film shows the run, or one sentence says why there is none."""

import os
import subprocess
import sys

import numpy as np
import pytest
from rrth_planner.model.errors import OptionsError
from rrth_planner.simulation.film import check_film

pytest.importorskip('mujoco')
imageio = pytest.importorskip('imageio.v2')
pytest.importorskip('imageio_ffmpeg')
# MuJoCo chooses its OpenGL when it is imported.
FILM = """
import sys
import numpy as np
from pathlib import Path
from rrth_planner.simulation.film import Frame, NoPicturesError, write_film
from worlds import FOLDED, table_1_arm, wearer
try:
    for file in map(Path, sys.argv[1:]):
        frames = [
            Frame(FOLDED - [0.2 * k, 0.3 * k, 0, 0], wearer(), np.array([0.0, -0.7, 0.4]))
            for k in range(3)
        ]
        write_film(file, table_1_arm(), frames, 10.0)
except NoPicturesError as problem:
    print(problem)
    sys.exit(3)
"""


def filmed(backend, *files):
    return subprocess.run(
        [sys.executable, '-c', FILM, *map(str, files)],
        env={**os.environ, 'MUJOCO_GL': backend, 'PYTHONPATH': os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=200,
    )


def test_a_film_has_a_picture_of_each_frame_in_which_the_arm_moves(tmp_path):
    files = [tmp_path / name for name in ('run.gif', 'run.mp4')]
    ended = filmed('egl', *files)
    if ended.returncode == 3:
        pytest.skip(ended.stdout)
    assert ended.returncode == 0, ended.stderr
    for file in files:
        shown = [np.asarray(picture)[..., :3] for picture in imageio.mimread(file)]
        assert len(shown) == 3
        assert shown[0].shape == (480, 640, 3)
        for one, other in zip(shown[:-1], shown[1:], strict=True):
            changed = (np.abs(one.astype(int) - other) > 60).any(axis=2)
            # The arm is small, the wearer stands still.
            assert 50 < changed.sum() < 0.1 * changed.size
        # The target is red.
        red = shown[0].astype(int)
        assert ((red[..., 0] - red[..., 1] > 100) & (red[..., 0] - red[..., 2] > 100)).sum() > 20


def test_without_opengl_one_sentence_says_so(tmp_path):
    ended = filmed('off', tmp_path / 'run.gif')
    assert ended.returncode == 3, ended.stderr
    assert ended.stdout.startswith('no OpenGL without a window (')
    assert len(ended.stdout.splitlines()) == 1


def test_a_file_that_is_no_film_is_named(tmp_path):
    with pytest.raises(OptionsError, match=r'ends in \.gif or \.mp4'):
        check_film(tmp_path / 'run.avi')
    with pytest.raises(OptionsError, match='folder'):
        check_film(tmp_path / 'nowhere' / 'run.gif')
