# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the running nodes: it shows their topics, and sends requests to the planner."""

from collections.abc import Callable
from html import escape
import time
from typing import Any, Protocol

import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.visualization.viewer.curves import tool_positions, trajectory_curve
from rrth_planner.visualization.viewer.examples import example_target
from rrth_planner.visualization.viewer.panel import OWN, Panel
from rrth_planner.visualization.viewer.scene_view import SceneView
import viser

FRAME = 1.0 / 30.0
WIDTH = 0.010


class Feed(Protocol):
    """Latest messages of the nodes; the same value until a new message arrives."""

    arm: ArmModel
    margin: float
    ray_guard_length: float

    @property
    def scene(self) -> Scene:
        """The wearer in the base frame."""

    @property
    def target(self) -> Array | None:
        """In the base frame, (3,) [m]."""

    @property
    def positions(self) -> Array | None:
        """Of the joints, (dof,) [rad]."""

    @property
    def trajectory(self) -> Trajectory | None:
        """The commanded motion."""

    @property
    def said(self) -> str:
        """The last response of the planner, and what is missing."""

    def ask(self, target: Array | None = None) -> None:
        """Publish a target (3,) [m], and request a plan."""


class LivePage:
    """
    Show the messages of a feed; dragging the target publishes it and requests a plan.

    Parameters
    ----------
    server : viser.ViserServer
    feed : Feed

    """

    def __init__(self, server: viser.ViserServer, feed: Feed) -> None:
        """Draw nothing yet."""
        self._feed = feed
        self._drawn: dict[str, Any] = {}
        self._is_dragged = False
        self.view = SceneView(server, feed.arm, feed.ray_guard_length)
        self.view.layers['start'].visible = False
        self.panel = Panel(server, is_live=True, on_layer=self._on_layer)
        self.view.target.on_update(self._on_drag)
        self.panel.target.on_update(self._on_numbers)
        self.panel.target_example.on_update(self._on_example)
        self.panel.plan.on_click(lambda _: feed.ask())

    def run(self, is_over: Callable[[], bool] = lambda: False) -> None:
        """Draw the messages until `is_over`, or the thread is interrupted."""
        while not is_over():
            self.draw()
            time.sleep(FRAME)

    def draw(self) -> None:
        """Draw what has changed."""
        feed = self._feed
        if self._is_new('scene', feed.scene):
            self.view.show_body(feed.scene, feed.margin)
        target = feed.target
        if self._is_new('target', target) and target is not None and not self._is_dragged:
            self.view.target.position = target
            self.panel.target.value = tuple(target.round(4).tolist())
        positions = feed.positions
        if positions is not None and self._is_new('positions', positions):
            self.view.show_configuration(positions, target)
        trajectory = feed.trajectory
        if trajectory is not None and self._is_new('trajectory', trajectory):
            curve = trajectory_curve(feed.arm, trajectory)
            corners = tool_positions(feed.arm, trajectory.positions[[0, -1]])
            self.view.show_path('timed', curve, corners, WIDTH)
        said = feed.said
        if self._drawn.get('said') != said:
            self._drawn['said'] = said
            self.panel.said.content = (
                f'<div style="padding:0.2em 0.8em 0.6em;font-size:0.85em">{escape(said)}</div>'
            )

    def _is_new(self, what: str, value: Any) -> bool:
        is_new = what not in self._drawn or self._drawn[what] is not value
        self._drawn[what] = value
        return is_new

    def _on_drag(self, event: Any) -> None:
        self._is_dragged = event.phase != 'end'
        self._ask(np.asarray(self.view.target.position, dtype=np.float64))

    def _on_numbers(self, event: Any) -> None:
        if event.client is not None:
            self._ask(np.array(self.panel.target.value))

    def _on_example(self, event: Any) -> None:
        if event.client is not None and self.panel.target_example.value != OWN:
            self._ask(example_target(self.panel.target_example.value))

    def _ask(self, target: Array) -> None:
        self._feed.ask(target)

    def _on_layer(self, name: str, is_shown: bool) -> None:
        self.view.layers[name].visible = is_shown
