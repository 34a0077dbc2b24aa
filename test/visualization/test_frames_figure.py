# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of the frames names each of them, readably, and points at where it is."""

from itertools import combinations

from matplotlib.text import Annotation
from mpl_toolkits.mplot3d import proj3d
import numpy as np
import pytest
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.wearer_file import load_body
from rrth_planner.visualization.frames_figure import frames_figure, main
from worlds import random_chain

NAMES = ['mount: frame 0', *(f'frame {i}: joint_{i}' for i in range(1, 5)), 'tool', 'pointing ray']


def labels_of(axes):
    return [text for text in axes.texts if isinstance(text, Annotation)]


@pytest.mark.parametrize('seed', [None, 0, 1, 2])
def test_labels_are_all_there_and_none_hides_another(seed):
    arm = load_arm() if seed is None else random_chain(np.random.default_rng(seed), True)
    figure = frames_figure(arm, load_body())
    figure.canvas.draw()
    body, close = figure.axes
    if seed is None:
        assert sorted(text.get_text() for text in labels_of(close)) == sorted(NAMES)
    assert 'base frame' in [text.get_text() for text in labels_of(body)]
    # The text alone, without its leader line.
    boxes = [
        text.get_bbox_patch().get_window_extent()
        for axes in figure.axes
        for text in labels_of(axes)
    ]
    boxes += [text.get_window_extent() for text in figure.texts]
    assert not [pair for pair in combinations(boxes, 2) if pair[0].overlaps(pair[1])]
    for box in boxes:
        assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0 < box.y1 <= figure.bbox.y1


def test_leader_lines_end_where_the_frames_are():
    arm = load_arm()
    figure = frames_figure(arm, load_body())
    figure.canvas.draw()
    for axes in figure.axes:
        (label,) = [text for text in labels_of(axes) if text.get_text() == 'mount: frame 0']
        expected = proj3d.proj_transform(*arm.T_base_mount[:3, 3], axes.get_proj())[:2]
        np.testing.assert_allclose(label.xy, expected, atol=1e-12)


def test_the_command_writes_a_picture(tmp_path, capsys):
    output = tmp_path / 'frames.png'
    assert main(['--output', str(output)]) == 0
    assert output.read_bytes().startswith(b'\x89PNG')
    assert main(['--output', str(tmp_path / 'nowhere' / 'frames.png')]) == 2
    assert main(['--output', str(tmp_path / 'frames.sound')]) == 2
    assert main(['--arm', str(tmp_path / 'nothing.yaml')]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    assert all(line.startswith('frames_figure: ') for line in lines)
