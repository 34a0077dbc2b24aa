# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The controls of the page, and its description of a response."""

from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from html import escape
from typing import Any

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.visualization.viewer.examples import BODIES, example_target, TARGETS
from rrth_planner.visualization.viewer.planning_worker import Response
from rrth_planner.visualization.viewer.scene_view import FIRST, SHORT, TIMED, TREES
import viser

OWN = 'own'
# Labels of the layers at their checkboxes.
SHOWN = {
    'margin': 'margin around the boxes',
    'start': 'arm at the start',
    'tree': 'tree',
    'first': 'first path',
    'short': 'path after shortcuts',
    'timed': 'trajectory with corner blends',
    'reach': 'how far the nearest parts may get before the arm is at rest',
    'meshes': 'meshes of the URDF',
}
BRAND = (59, 111, 182)
GOOD, BAD = '#14804a', '#b3261e'
SPEEDS = ('0.1', '0.25', '0.5', '1')
MOST_SEEDS, STEP_SIZES, MOST_MARGIN, FARTHEST = 99, (0.05, 1.5), 0.1, 5.0
# What the chart shows [s], and how long after each other it is drawn [s].
CHART_SPAN, CHART_PERIOD = 20.0, 0.1
STROKE = '#3b6fb6'


def response_html(response: Response) -> str:
    """Return a response as HTML: planning time, sentence, and the three steps."""
    sentence = escape(response.sentence)
    plan = response.plan
    if plan is None:
        return _page('no motion', BAD, sentence, [])
    took = f'planning time {1e3 * plan.planning_time:.2f} ms'
    if plan.trajectory is None or plan.path is None or plan.search is None:
        return _page(f'no motion, {took}', BAD, f'{plan.status.value}: {sentence}', [])
    raw, trees = plan.search.raw_path, plan.search.trees
    first = 'one straight edge'
    if raw is not None:
        first = f'{len(raw.waypoints)} waypoints, {raw.length:.3f} rad'
    short = f'{len(plan.path.waypoints)} waypoints, {plan.path.length:.3f} rad'
    timed = f'{len(plan.trajectory.times)} points, {plan.trajectory.duration:.2f} s'
    rows = [
        (FIRST, f'first path: {first}'),
        (SHORT, f'after shortcuts: {short}'),
        (TIMED, f'trajectory with corner blends: {timed}'),
    ]
    rows += [
        (colour, f'tree from the {end}: {len(tree.nodes)} nodes')
        for colour, end, tree in zip(TREES, ('start', 'goals'), trees, strict=False)
    ]
    return _page(took, GOOD, sentence, rows)


def _page(title: str, colour: str, sentence: str, rows: list[tuple[Any, str]]) -> str:
    lines = ''.join(
        f'<div style="margin-top:0.25em"><span style="display:inline-block;width:1.5em;'
        f'height:0.3em;margin-right:0.5em;vertical-align:middle;background:rgb{rgb}"></span>'
        f'{text}</div>'
        for rgb, text in rows
    )
    return (
        f'<div style="padding:0.2em 0.8em 0.6em;font-size:0.85em;line-height:1.35">'
        f'<b style="color:{colour}">{title}</b><div>{sentence}</div>{lines}</div>'
    )


class RateChart:
    """The rate of the last `CHART_SPAN` seconds, 0 to 1; no chart until there is a rate."""

    def __init__(self, folder: viser.GuiFolderHandle, gui: viser.GuiApi) -> None:
        """Create nothing yet; the chart appears in the folder."""
        self._folder, self._gui = folder, gui
        # Times [s] and rates [-]: the least one since the time before.
        self._rates: deque[tuple[float, float]] = deque()
        self._least = np.inf
        self.plot: Any = None

    def draw(self, rate: float, now: float) -> None:
        """Draw the rate that is permitted now [s]."""
        self._least = min(self._least, rate)
        if self._rates and now < self._rates[-1][0] + CHART_PERIOD:
            return
        self._rates.append((now, self._least))
        self._least = np.inf
        while self._rates[0][0] < now - CHART_SPAN:
            self._rates.popleft()
        times, rates = np.array(self._rates).T
        data = (times - now, rates)
        if self.plot is not None:
            self.plot.data = data
            return
        with self._folder:
            self.plot = self._gui.add_uplot(
                data,
                ({'label': 'time [s]'}, {'label': 'rate [-]', 'stroke': STROKE, 'width': 2.0}),
                title='rate of the motion [-], last 20 s',
                scales={
                    'x': {'time': False, 'range': (-CHART_SPAN, 0.0)},
                    'y': {'range': (0.0, 1.05)},
                },
                legend={'show': False},
                aspect=2.5,
            )


class Panel:
    """
    The controls, among them a checkbox for each layer, which it shows and hides.

    Live, where the nodes plan, there are none that need a plan of this process.
    """

    def __init__(
        self, server: viser.ViserServer, layers: Mapping[str, Any], *, is_live: bool
    ) -> None:
        """Create the controls."""
        gui = server.gui
        gui.configure_theme(
            control_layout='fixed',
            control_width='large',
            show_logo=False,
            show_share_button=False,
            brand_color=BRAND,
        )
        gui.set_panel_label('rrth_planner')
        response = gui.add_folder('Response')
        with response:
            self.said = gui.add_html(response_html(Response()))
        self.rate = RateChart(response, gui)
        with gui.add_folder('Target'):
            self.target_example = gui.add_dropdown('example', (OWN, *TARGETS))
            self.target = gui.add_vector3(
                'x, y, z [m]',
                (0.0, 0.0, 0.0),
                min=(-FARTHEST,) * 3,
                max=(FARTHEST,) * 3,
                step=0.01,
            )
            self.plan = gui.add_button('Plan', visible=is_live)
        with gui.add_folder('Request', visible=not is_live):
            self.body_example = gui.add_dropdown('body', (OWN, *BODIES))
            self.margin = gui.add_slider('margin [m]', 0.0, MOST_MARGIN, 0.005, 0.02)
            self.seed = gui.add_slider('seed', 0, MOST_SEEDS, 1, 0)
            self.step_size = gui.add_slider(
                'tree step [rad]', *STEP_SIZES, 0.05, STEP_SIZES[1], hint='step_size'
            )
            self.start_here = gui.add_button('Start from the present configuration')
        with gui.add_folder('Motion', visible=not is_live):
            self.play = gui.add_button('Play')
            self.time = gui.add_slider('time [s]', 0.0, 1.0, 0.01, 0.0)
            self.speed = gui.add_dropdown('speed', SPEEDS, initial_value='1')
            self.repeat = gui.add_checkbox('repeat', False)
        with gui.add_folder('Show'):
            for name, layer in layers.items():
                if not is_live or name in ('margin', 'timed', 'reach'):
                    box = gui.add_checkbox(SHOWN[name], True)
                    box.on_update(partial(_show, layer))

    def say(self, sentence: str) -> None:
        """Show a sentence in place of a response."""
        self.said.content = (
            f'<div style="padding:0.2em 0.8em 0.6em;font-size:0.85em">{escape(sentence)}</div>'
        )

    def on_target(self, take: Callable[[Array], object]) -> None:
        """Have each target taken that is typed, or chosen of the examples, (3,) [m]."""

        def typed(event: Any) -> None:
            if event.client is not None:
                take(np.array(self.target.value))

        def chosen(event: Any) -> None:
            if event.client is not None and self.target_example.value != OWN:
                take(example_target(self.target_example.value))

        self.target.on_update(typed)
        self.target_example.on_update(chosen)


def _show(layer: Any, event: Any) -> None:
    layer.visible = event.target.value
