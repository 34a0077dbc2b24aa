# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the running nodes shows how a motion is executed beside a wearer who moves."""

from argparse import Namespace
from dataclasses import replace
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
from rrth_planner.model.scene import Scene  # noqa: E402
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


def test_the_motion_has_the_colour_of_its_state_and_the_rate_is_drawn_once_there_is_one(server):
    feed = SimpleNamespace(
        arm=ARM,
        ray_guard_length=1.0,
        margin=0.02,
        scene=Scene(()),
        target=None,
        positions=ARM.bounds.mean(axis=0),
        trajectory=MOTION,
        separation=None,
        said='',
    )
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
