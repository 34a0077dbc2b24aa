# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The page that plans itself: controls change the request, one thread draws the response."""

from collections.abc import Callable
from dataclasses import replace
from threading import Event, Lock
import time
from typing import Any, NoReturn

import numpy as np
from rrth_planner.io.urdf.placed_robot import PlacedRobot
from rrth_planner.model.trajectory import positions_at, Trajectory
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.visualization.viewer.curves import path_curve, tool_positions, trajectory_curve
from rrth_planner.visualization.viewer.examples import example_body, example_target
from rrth_planner.visualization.viewer.panel import OWN, Panel, response_html
from rrth_planner.visualization.viewer.planning_worker import Response, ViewerModel
from rrth_planner.visualization.viewer.player import Player
from rrth_planner.visualization.viewer.scene_view import SceneView
import viser

# Frame period of a playing motion, and longest sleep of an idle page [s].
FRAME_PERIOD, LONGEST_SLEEP = 1.0 / 30.0, 0.5


class ViewerPage:
    """Show a first request, let it be changed, and show and play the resulting motion."""

    def __init__(
        self,
        server: viser.ViserServer,
        question: PlanQuestion,
        robot: PlacedRobot | None = None,
    ) -> None:
        """Draw what is known, and request a plan; robot as for `SceneView`."""
        self._own = question
        self._arm = question.arm
        self._lock, self._wake = Lock(), Event()
        # Both are written by the callbacks of the page, and drawn by `run`.
        self._player = Player()
        self._trajectory: Trajectory | None = None
        self._drawn: Response | None = None
        self._body: Any = None
        self.view = SceneView(server, question.arm, question.ray_guard_length, robot)
        self.panel = Panel(server, self.view.layers, is_live=False)
        panel = self.panel
        panel.target.value = tuple(question.goal.target.tolist())
        for slider, value in (
            (panel.margin, question.margin),
            (panel.seed, question.seed),
            (panel.step_size, question.options.step_size),
        ):
            slider.max = max(slider.max, value)
            slider.value = value
        self.view.target.position = question.goal.target
        self.model = ViewerModel(question, lambda response: self._wake.set())
        self._connect()
        self.model.ask()

    def run(self) -> NoReturn:
        """Draw all changes until the thread is interrupted."""
        before = time.monotonic()
        while True:
            now = time.monotonic()
            with self._lock:
                self._player = self._player.advanced(now - before)
                is_playing = self._player.is_playing
            before = now
            self.draw()
            self._wake.wait(FRAME_PERIOD if is_playing else LONGEST_SLEEP)
            self._wake.clear()

    def draw(self) -> None:
        """Draw the newest response, and the arm at the present time of the motion."""
        question, response = self.model.question, self.model.response
        body = (question.scene, question.margin)
        if body != self._body:
            self._body = body
            self.view.show_body(*body)
        if response is not self._drawn:
            self._drawn = response
            self._draw_response(response)
        with self._lock:
            player, trajectory = self._player, self._trajectory
        q = question.q_start
        if trajectory is not None:
            q = positions_at(trajectory, [player.time])[0]
        self.view.show_configuration(q, question.goal.target)
        self.panel.play.label = 'Pause' if player.is_playing else 'Play'
        self.panel.time.value = round(player.time, 3)

    def show_end(self) -> None:
        """Show the end of the motion."""
        self._play(Player.at_end)

    def _draw_response(self, response: Response) -> None:
        plan, question = response.plan, response.question
        trajectory = None if plan is None else plan.trajectory
        self.panel.said.content = response_html(response)
        if question is not None:
            self.view.start.move(question.q_start)
        nothing = np.empty((0, 3))
        search = None if plan is None else plan.search
        self.view.show_trees(() if search is None else search.trees)
        for layer, path in (
            ('first', None if search is None else search.raw_path),
            ('short', None if plan is None else plan.path),
        ):
            curve = nothing if path is None else path_curve(self._arm, path.waypoints)
            corners = nothing if path is None else tool_positions(self._arm, path.waypoints)
            self.view.show_path(layer, curve, corners)
        curve = nothing if trajectory is None else trajectory_curve(self._arm, trajectory)
        self.view.show_path('timed', curve, nothing)
        duration = 0.0 if trajectory is None else trajectory.duration
        with self._lock:
            self._trajectory = trajectory
            self._player = self._player.loaded(duration)
        self.panel.time.max = max(round(duration, 3), 0.01)
        self.panel.time.disabled = self.panel.play.disabled = trajectory is None

    def _connect(self) -> None:
        """Connect the controls to the request and the player."""
        panel = self.panel
        for control, change in (
            (panel.target, self._on_numbers),
            (panel.target_example, self._on_target_example),
            (panel.body_example, self._on_body_example),
            (panel.margin, lambda: self.model.ask(margin=panel.margin.value)),
            (panel.seed, lambda: self.model.ask(seed=panel.seed.value)),
            (panel.step_size, lambda: self.model.ask(step_size=panel.step_size.value)),
            (panel.time, lambda: self._play(lambda player: player.moved(panel.time.value))),
            (panel.speed, self._on_motion_settings),
            (panel.repeat, self._on_motion_settings),
        ):
            control.on_update(self._by_hand(change))
        panel.start_here.on_click(self._by_hand(self._on_start_here))
        panel.play.on_click(self._by_hand(lambda: self._play(Player.toggled)))
        self.view.target.on_update(self._by_hand(self._on_drag))

    def _by_hand(self, change: Callable[[], Any]) -> Callable[[Any], None]:
        """Return a callback for changes by the user only, not for those by this program."""

        def on_event(event: Any) -> None:
            if event.client is not None:
                change()
                self._wake.set()

        return on_event

    def _on_drag(self) -> None:
        # Read late: callbacks may overtake each other, the position is always the newest.
        target = np.asarray(self.view.target.position, dtype=np.float64)
        self.panel.target.value = tuple(target.round(4).tolist())
        self.panel.target_example.value = OWN
        self._play(Player.aimed)
        self.model.ask(target=target)

    def _on_numbers(self) -> None:
        self.panel.target_example.value = OWN
        self._aim(np.array(self.panel.target.value))

    def _on_target_example(self) -> None:
        name = self.panel.target_example.value
        target = self._own.goal.target if name == OWN else example_target(name)
        self.panel.target.value = tuple(target.tolist())
        self._aim(target)

    def _aim(self, target: Any) -> None:
        self.view.target.position = target
        self._play(Player.aimed)
        self.model.ask(target=target)

    def _on_body_example(self) -> None:
        name = self.panel.body_example.value
        self.model.ask(scene=self._own.scene if name == OWN else example_body(name))

    def _on_start_here(self) -> None:
        with self._lock:
            player, trajectory = self._player, self._trajectory
        if trajectory is None:
            self.model.ask(q_start=self._own.q_start)
        else:
            self.model.ask(q_start=positions_at(trajectory, [player.time])[0])

    def _on_motion_settings(self) -> None:
        speed, is_repeating = float(self.panel.speed.value), self.panel.repeat.value
        self._play(lambda player: replace(player, speed=speed, is_repeating=is_repeating))

    def _play(self, change: Callable[[Player], Player]) -> None:
        with self._lock:
            self._player = change(self._player)
