# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the running nodes: it shows their topics, and sends requests to the planner."""

import time
from typing import Any, NoReturn

import numpy as np
from rrth_planner.io.urdf.placed_robot import PlacedRobot
from rrth_planner.model.curves import part
from rrth_planner.model.separation import reach_of, SeenBody
from rrth_planner.ros.client.viewer_feed import ViewerFeed
from rrth_planner.visualization.separation_view import grown_parts, Instant
from rrth_planner.visualization.viewer.curves import tool_positions, trajectory_curve
from rrth_planner.visualization.viewer.panel import Panel
from rrth_planner.visualization.viewer.scene_view import SceneView
import viser

# Of the picture [s].
FRAME_PERIOD = 1.0 / 30.0
# Of what is drawn of the wearer's reach [s].
REACH_PERIOD = 0.1
# Colours of a motion that is slowed down or stopped for a wearer who moves, by the state.
STATE_COLOURS = {'SLOWED': (232, 138, 32), 'PROTECTIVE_STOP': (209, 50, 70), 'FAULT': (30, 30, 30)}


class LivePage:
    """Show the messages of a feed; dragging the target publishes it and requests a plan."""

    def __init__(
        self, server: viser.ViserServer, feed: ViewerFeed, robot: PlacedRobot | None = None
    ) -> None:
        """Draw nothing yet; robot as for `SceneView`."""
        self._feed = feed
        self._drawn: dict[str, Any] = {}
        self._is_dragged = False
        self.view = SceneView(server, feed.arm, feed.ray_guard_length, robot)
        self.view.layers['start'].visible = False
        self.view.layers['reach'] = server.scene.add_frame('/reach', show_axes=False)
        # When to draw next how far parts may get [s].
        self._reach_due = -np.inf
        self.panel = Panel(server, self.view.layers, is_live=True)
        self.view.target.on_update(self._on_drag)
        self.panel.on_target(lambda target: feed.ask(target))
        self.panel.plan.on_click(lambda _: feed.ask())

    def run(self) -> NoReturn:
        """Draw the messages until the thread is interrupted."""
        while True:
            self.draw()
            time.sleep(FRAME_PERIOD)

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
        trajectory, status = feed.trajectory, feed.separation
        if status is not None:
            self.panel.rate.draw(status.rate, time.monotonic())
        colour = None if status is None else STATE_COLOURS.get(status.state.name)
        # Both are taken note of.
        is_new = self._is_new('trajectory', trajectory) | self._is_new('colour', colour)
        if trajectory is not None and is_new:
            curve = trajectory_curve(feed.arm, trajectory)
            corners = tool_positions(feed.arm, trajectory.positions[[0, -1]])
            self.view.show_path('timed', curve, corners, colour)
        self._draw_reach(time.monotonic())
        said = feed.said
        if self._drawn.get('said') != said:
            self._drawn['said'] = said
            self.panel.say(said)

    def _draw_reach(self, now: float) -> None:
        """Draw how far parts of a wearer who moves may get before the arm is at rest [s]."""
        feed, boxes = self._feed, []
        if now < self._reach_due:
            return
        self._reach_due = now + REACH_PERIOD
        if feed.rules is not None and feed.separation is not None and feed.given is not None:
            came, motion = feed.given
            scene = feed.scene
            if now < came + motion.duration:
                # Bodies are a few hundredths of a second old, which is not seen here.
                ages = np.zeros(len(scene.boxes))
                seen = SeenBody(scene, ages, reach_of(scene.names, feed.rules))
                # It may have come after this time was read.
                left = part(motion, max(now - came, 0.0), motion.duration)
                instant = Instant(time=now, seen=seen, rules=feed.rules, left=left)
                boxes = grown_parts(feed.arm, instant)
        self.view.show_reach(boxes)

    def _is_new(self, what: str, value: Any) -> bool:
        is_new = what not in self._drawn or self._drawn[what] is not value
        self._drawn[what] = value
        return is_new

    def _on_drag(self, event: Any) -> None:
        self._is_dragged = event.phase != 'end'
        self._feed.ask(np.asarray(self.view.target.position, dtype=np.float64))
