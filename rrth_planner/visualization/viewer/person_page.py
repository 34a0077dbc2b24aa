# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a recorded person at work: the arm moves beside him, and plans again and again."""

from contextlib import suppress
from threading import Lock
import time
from typing import NoReturn

import numpy as np
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.io.urdf.placed_robot import PlacedRobot
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RequestError, SceneError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.visualization.viewer.curves import trajectory_curve
from rrth_planner.visualization.viewer.panel import Panel
from rrth_planner.visualization.viewer.planning_worker import Response, ViewerModel
from rrth_planner.visualization.viewer.scene_view import SceneView
from rrth_planner.visualization.viewer.shown_arm import ShownArm
from rrth_planner.wearer.body_boxes import body_boxes
from rrth_planner.wearer.recorded_person import posture_at, RecordedPerson
from rrth_planner.wearer.skeleton import Skeleton
import viser

# Of the picture [s].
FRAME_PERIOD = 1.0 / 30.0
# Where the planner found no motion it is asked again after this time [s].
RETRY_PAUSE = 0.2


class PersonPage:
    """Move the wearer as recorded, and the arm beside him; a dragged target is aimed at next."""

    def __init__(
        self,
        server: viser.ViserServer,
        question: PlanQuestion,
        person: RecordedPerson,
        skeleton: Skeleton,
        robot: PlacedRobot | None = None,
    ) -> None:
        """
        Draw nothing yet; the question's scene is the wearer at the beginning.

        robot: as for `SceneView`.
        """
        self._person, self._skeleton = person, skeleton
        self._scene = question.scene
        self._margin, self._arm = question.margin, question.arm
        self._shown = ShownArm(question.required, question.q_start, question.limits)
        self._lock = Lock()
        # Written by the callbacks of the page.
        self._aimed: Array | None = None
        self._target = question.goal.target
        # The number of the request that is being planned, 0: none; when to ask again [s].
        self.asked, self._next = 0, 0.0
        self._read: Response | None = None
        self.view = SceneView(server, question.arm, question.ray_guard_length, robot)
        for name in ('start', 'tree', 'first', 'short'):
            self.view.layers[name].visible = False
        self.panel = Panel(server, self.view.layers, is_live=True)
        self.panel.plan.visible = False
        self.panel.target.value = tuple(self._target.tolist())
        self.view.target.position = self._target
        self.view.target.on_update(lambda _: self.aim(np.asarray(self.view.target.position)))
        self.panel.on_target(self._move_target)
        self.model = ViewerModel(question)

    def run(self) -> NoReturn:
        """Draw until the thread is interrupted."""
        begin = time.monotonic()
        while True:
            now = time.monotonic()
            self.draw(now - begin)
            time.sleep(max(0.0, now + FRAME_PERIOD - time.monotonic()))

    def run_for(self, span: float) -> None:
        """Draw for a time [s]."""
        begin = time.monotonic()
        while (now := time.monotonic() - begin) < span:
            self.draw(now)
            time.sleep(FRAME_PERIOD)

    def draw(self, now: float) -> None:
        """Move wearer and arm to a time [s], and draw them."""
        # Where the tracker had lost him the last boxes stay.
        with suppress(SceneError):
            self._scene, _ = body_boxes(self._skeleton, posture_at(self._person, now))
        with self._lock:
            aimed, self._aimed = self._aimed, None
        if aimed is not None:
            self._target, self._next = aimed, now
            # What is being planned for another target does not count.
            self.asked = 0
        self._shown.see(self._scene, now)
        if aimed is not None:
            self._shown.retarget()
        self._take_response(now)
        if not self.asked and now >= self._next and self._shown.needs_motion:
            self.asked = self.model.ask(
                scene=self._scene, q_start=self._shown.positions_at(now), target=self._target
            )
        self.view.move_body(self._scene, self._margin)
        self.view.show_configuration(self._shown.positions_at(now), self._target)

    def positions_at(self, time: float) -> Array:
        """Return where the arm is at a time [s], (dof,) [rad]."""
        return self._shown.positions_at(time)

    def aim(self, target: Array) -> None:
        """Aim at another target from the next frame on, (3,) in the base frame [m]."""
        with self._lock:
            self._aimed = np.array(target, dtype=np.float64)

    def _take_response(self, now: float) -> None:
        """Start the motion that was asked for, if it is there."""
        response = self.model.response
        if not self.asked or response.number != self.asked or response is self._read:
            return
        self._read, self.asked = response, 0
        self.panel.say(response.sentence)
        plan = response.plan
        if plan is None or plan.trajectory is None:
            self._next = now + RETRY_PAUSE
            return
        motion = ExecutingMotion(
            trajectory=plan.trajectory,
            start_time=now,
            target_distance=plan.target_distance,
            escape_time=plan.escape_time,
        )
        with suppress(RequestError):
            self._shown.begin(motion, PointingGoal(self._target))
        curve = trajectory_curve(self._arm, plan.trajectory)
        self.view.show_path('timed', curve, np.empty((0, 3)))

    def _move_target(self, target: Array) -> None:
        self.view.target.position = target
        self.panel.target.value = tuple(target.round(4).tolist())
        self.aim(target)
