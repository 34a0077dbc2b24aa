# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Views of separation say which part slows an arm, and draw how far parts may get."""

import numpy as np
import pytest

pytest.importorskip('matplotlib')

from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from rrth_planner.execution.separation_status import SeparationState  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.model.arm import tool_pose  # noqa: E402
from rrth_planner.model.scene import Box, Scene  # noqa: E402
from rrth_planner.model.separation import reach_of, SeenBody, SeparationRules  # noqa: E402
from rrth_planner.model.trajectory import Trajectory  # noqa: E402
from rrth_planner.visualization.motion_figure import motion_figure  # noqa: E402
from rrth_planner.visualization.separation_view import (  # noqa: E402
    draw_instant,
    draw_spans,
    grown_parts,
    Instant,
    reserves,
    Span,
)

ARM, RULES = load_arm(), SeparationRules()
BEGIN = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])


def instant(boxes, way=0.4):
    """Return an arm that moves by a way [rad] in a second beside boxes: names, and centres."""
    scene = Scene(tuple(Box(name, place, [0.1, 0.1, 0.1], np.eye(3)) for name, place in boxes))
    left = Trajectory(
        times=[0.0, 1.0],
        positions=[BEGIN, BEGIN - way],
        velocities=np.zeros((2, 4)),
        accelerations=np.zeros((2, 4)),
    )
    seen = SeenBody(scene, np.zeros(len(scene.boxes)), reach_of(scene.names, RULES))
    target = np.array([1.5, 0.0, 0.3])
    return Instant(time=2.0, seen=seen, rules=RULES, left=left, target=target)


def beside_tool(offset):
    """Return a place so far from the tool half way [m]."""
    return tool_pose(ARM, BEGIN - 0.2)[:3, 3] + np.array(offset)


def test_what_slows_an_arm_is_the_part_that_may_be_at_it_first():
    near, far = beside_tool([0.4, 0.0, 0.0]), beside_tool([0.6, 0.0, 0.0])
    # A hand gets further than a head: it counts first, although the head is nearer.
    left = reserves(ARM, instant([('head', near), ('hand', far)]))
    assert left[1] < left[0]
    # The torso gets nowhere, and nothing meets an arm that is not faster than it may be then.
    assert np.isinf(reserves(ARM, instant([('torso', near)])))
    assert np.isinf(reserves(ARM, instant([('hand', near)], way=1e-3)))


def test_a_part_is_drawn_grown_by_how_far_it_may_get():
    at = instant([('head', beside_tool([0.4, 0.0, 0.0])), ('torso', [0.0, 0.0, -0.2])])
    # 1 s after it was seen, by its lines and the error of its box; a torso gets nowhere.
    by = 0.1 + 0.25 * (1.0 + RULES.controller_delay) + RULES.body_error
    (box,) = grown_parts(ARM, at)
    assert box.name == 'head'
    np.testing.assert_allclose(box.size, 0.1 + 2.0 * by)
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(projection='3d')
    draw_instant(axes, ARM, at, 1.0, 1.0)
    figure.canvas.draw()
    words = [text.get_text() for text in axes.texts]
    assert 'now' in words
    assert 'at rest\n1.00 s later' in words


def test_the_rate_is_drawn_with_the_parts_that_slow_the_arm():
    axes = Figure().add_subplot()
    slowed, stopped = SeparationState.SLOWED, SeparationState.PROTECTIVE_STOP
    spans = [
        Span(begin=0.0, end=1.0, rate=1.0, state=SeparationState.NORMAL, part=''),
        Span(begin=1.0, end=2.0, rate=0.5, state=slowed, part='head'),
        Span(begin=2.0, end=3.0, rate=0.3, state=slowed, part='head'),
        Span(begin=3.0, end=3.01, rate=0.0, state=stopped, part='left hand'),
        Span(begin=3.01, end=4.0, rate=1.0, state=SeparationState.NORMAL, part=''),
    ]
    draw_spans(axes, spans)
    times, rates = axes.lines[0].get_data()
    assert list(times) == [0.0, 1.0, 2.0, 3.0, 3.01, 4.0]
    assert list(rates) == [1.0, 0.5, 0.3, 0.0, 1.0, 1.0]
    # Said once for both spans; what is too short has no room.
    (text,) = axes.texts
    assert (text.get_text(), text.get_position()[0]) == ('head', 2.0)
    legend = [entry.get_text() for entry in axes.get_legend().get_texts()]
    assert legend == ['normal', 'slowed', 'protective stop']


def test_what_was_seen_beside_a_person_is_a_row_of_its_own():
    at = instant([('head', beside_tool([0.4, 0.0, 0.0]))])
    state = SeparationState.SLOWED
    spans = [Span(begin=0.0, end=1.0, rate=0.5, state=state, part='head')]
    figure = motion_figure(ARM, at.seen.scene, [], None, 1.0, (at, spans))
    view, rate = figure.axes
    assert 'before the arm is at rest' in view.get_title()
    assert rate.get_title(loc='left').endswith('which part slows it; left at 2.0 s')
    assert (rate.get_xlabel(), rate.get_ylabel()) == (
        'time [s]',
        'rate of the planned motion [-]',
    )
