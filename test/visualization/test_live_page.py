# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the running nodes shows how a motion is executed beside a wearer who moves."""

from argparse import Namespace
from dataclasses import replace
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')
pytest.importorskip('viser')

from rrth_planner.cli.viewer import _served  # noqa: E402
from rrth_planner.execution.separation_status import (  # noqa: E402
    SeparationState,
    SeparationStatus,
)
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.model.arm import tool_pose  # noqa: E402
from rrth_planner.model.curves import part  # noqa: E402
from rrth_planner.model.scene import Box, Scene  # noqa: E402
from rrth_planner.model.separation import SeparationRules  # noqa: E402
from rrth_planner.visualization.viewer.live_page import LivePage, STATE_COLOURS  # noqa: E402
from rrth_planner.visualization.viewer.panel import CHART_PERIOD, CHART_SPAN, RateChart  # noqa: E402
from rrth_planner.visualization.viewer.scene_view import TIMED  # noqa: E402
import sample_motions  # noqa: E402

ARM = load_arm()
MOTION = sample_motions.planned_motion(np.random.default_rng(0))


@pytest.fixture(name='server')
def _server():
    with _served(Namespace(host='127.0.0.1', port=0, open=False, screenshot=None)) as (server, _):
        yield server


def drawn_colour(page):
    """Return the colour of the motion."""
    (line,) = (h for h in page.view._drawn['timed'] if h.name == '/timed/line')
    return np.unique(np.asarray(line.colors).reshape(-1, 3), axis=0).tolist()


def feed_of(scene, **values):
    """Return what a page shows: an arm in motion beside a wearer."""
    seen = {
        'arm': ARM,
        'ray_guard_length': 1.0,
        'margin': 0.02,
        'scene': scene,
        'target': None,
        'positions': ARM.bounds.mean(axis=0),
        'trajectory': MOTION,
        'separation': None,
        'rules': SeparationRules(),
        'given': None,
        'said': '',
    }
    return SimpleNamespace(**seen | values)


def test_how_far_parts_near_a_moving_arm_may_get_is_drawn_until_it_is_at_rest(server):
    motion = part(MOTION, 0.2, 0.7)
    place = tool_pose(ARM, motion.positions[0])[:3, 3] + [0.3, 0.0, 0.0]
    scene = Scene((Box('head', place, [0.1, 0.1, 0.1], np.eye(3)),))
    feed = feed_of(scene, given=(time.monotonic(), motion))

    def drawn():
        """Return the boxes that another page draws."""
        page = LivePage(server, feed)
        page.draw()
        return page.view.reach

    # Nobody has said that motions are separate from him.
    assert drawn() == []
    feed.separation = SeparationStatus()
    (box,) = drawn()
    least, most = 0.1 + 2.0 * 0.1, 0.1 + 2.0 * (0.1 + 0.25 * (motion.duration + 0.1) + 0.05)
    assert least < box.dimensions[0] < most
    feed.given = time.monotonic() - motion.duration, motion
    assert drawn() == []


def test_the_motion_has_the_colour_of_its_state_and_the_rate_is_drawn_once_there_is_one(server):
    feed = feed_of(Scene(()))
    page = LivePage(server, feed)
    page.draw()
    assert page.panel.rate.plot is None
    assert drawn_colour(page) == [list(TIMED)]
    for state in SeparationState:
        feed.separation = replace(SeparationStatus(), state=state, rate=0.5)
        page.draw()
        assert drawn_colour(page) == [list(STATE_COLOURS.get(state.name, TIMED))]
    assert page.panel.rate.plot.data[1].tolist() == [0.5]
    assert set(STATE_COLOURS) < set(SeparationState.__members__)


def test_the_chart_shows_the_least_rates_of_the_last_seconds(server):
    with server.gui.add_folder('Response') as folder:
        chart = RateChart(folder, server.gui)
    assert chart.plot is None
    for k in range(3):
        chart.draw((0.9, 0.2, 0.7)[k], 0.4 * k * CHART_PERIOD)
    chart.draw(0.8, 1.2 * CHART_PERIOD)
    times, rates = chart.plot.data
    np.testing.assert_allclose(times, [-1.2 * CHART_PERIOD, 0.0])
    assert rates.tolist() == [0.9, 0.2]
    for now in np.arange(1.0, 2.0 * CHART_SPAN, 1.01 * CHART_PERIOD):
        chart.draw(1.0, now)
        times, rates = chart.plot.data
        assert -CHART_SPAN <= times[0] <= times[-1] == 0.0
    assert (np.diff(times) > 0.0).all()
    assert rates.min() == 1.0
