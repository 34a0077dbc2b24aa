# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of the journeys: every text is within its box, and no box is over another."""

import itertools

import pytest

pytest.importorskip('matplotlib')

from matplotlib.patches import FancyBboxPatch  # noqa: E402
from rrth_planner.visualization.journeys_figure import JOURNEYS, journeys_figure, main  # noqa: E402


def test_texts_are_within_their_boxes_and_boxes_apart():
    figure = journeys_figure()
    figure.canvas.draw()
    (axes,) = figure.axes
    boxes = [p.get_window_extent() for p in axes.patches if isinstance(p, FancyBboxPatch)]
    steps = list(itertools.chain(*JOURNEYS))
    assert len(boxes) == len(steps)
    texts = {text.get_text(): text.get_window_extent() for text in axes.texts}
    for step, box in zip(steps, boxes, strict=True):
        text = texts[step.text]
        assert box.x0 < text.x0 < text.x1 < box.x1
        assert box.y0 < text.y0 < text.y1 < box.y1
    for one, other in itertools.combinations(boxes, 2):
        assert not one.overlaps(other)


def test_the_command_draws_it_or_says_why_not(tmp_path, capsys):
    assert main(['--output', str(tmp_path / 'journeys.png')]) == 0
    assert (tmp_path / 'journeys.png').stat().st_size > 10_000
    assert main(['--output', str(tmp_path / 'no_folder' / 'journeys.png')]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith('journeys_figure: file ')
