# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm of a page: it executes exactly what the node's monitor commands it, and nothing else."""

from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.decision import Command
from rrth_planner.execution.event import Begin, BodyCame, Look, Moment, Tick
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.expected_wearer import is_expected_free
from rrth_planner.execution.fail_safe_stop import holds
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.monitor import Monitor
from rrth_planner.execution.playback import Playback, standing
from rrth_planner.execution.recent_wearer import RecentWearer
from rrth_planner.execution.remaining_motion import is_remaining_free
from rrth_planner.execution.watch import PlainRules
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits


class ShownArm:
    """
    A kinematic arm beside a wearer, its monitor, and the motion for its present target.

    Motions are given as a whole, as by a node without separation; the controller is never late.
    """

    def __init__(self, required: RequiredClearance, q: Array, limits: MotionLimits) -> None:
        """Stand still at q, (dof,) [rad], without a target; limits: of stops."""
        self._rules = PlainRules(
            required=required, stop_limits=limits, execution=ExecutionRules(None, 0.0, False)
        )
        self._playback = standing(q)
        self._now, self._scene = 0.0, Scene(())
        self._recent: RecentWearer[Scene] = RecentWearer(lambda scene: scene)
        self._monitor = Monitor(self._rules, self._moment, self._look, self._send)
        # The motion for the present target, and the number of stops when it began.
        self._motion: ExecutingMotion | None = None
        self._n_stops = 0

    def positions_at(self, time: float) -> Array:
        """Return where the arm is at a time [s], (dof,) [rad]."""
        return self._playback.state_at(time)[0]

    @property
    def end_time(self) -> float:
        """When it has ended its motion, or its stop [s]."""
        return self._playback.end_time

    @property
    def needs_motion(self) -> bool:
        """Whether it rests, but not aimed at its target and free of the wearer."""
        if self._now < self.end_time:
            return False
        motion, is_stopped = self._motion, self._monitor.watch.n_stops != self._n_stops
        return motion is None or is_stopped or not self._is_free(motion)

    def see(self, scene: Scene, time: float) -> None:
        """Go on to a time [s], at which the wearer is there: stop before him, if need be."""
        self._now, self._scene = time, scene
        self._recent.saw(scene, time)
        self._monitor.take(Tick(self._moment()))
        self._monitor.take(BodyCame(self._moment(), None, self._look()))

    def retarget(self) -> None:
        """Have another target: stop, without a motion for that yet."""
        self._monitor.fail('another target', is_replanned=False, is_fault=False)
        self._motion = None

    def begin(self, motion: ExecutingMotion, goal: PointingGoal) -> bool:
        """
        Begin a motion from the present place; return whether it is free of the wearer now.

        Raises
        ------
        RequestError
            The monitor does not let it begin.

        """
        if not self._is_free(motion):
            return False
        at, watch = self._moment(), self._monitor.watch
        counts = watch.n_stops, watch.n_faults
        self._monitor.begin(Begin(at, motion, goal, self._rules, float('inf'), None, *counts))
        self._motion, self._n_stops = motion, watch.n_stops
        return True

    def _is_free(self, motion: ExecutingMotion) -> bool:
        """Return whether the rest of a motion, and its end, are proven free of the wearer."""
        watch = self._monitor.watch
        phase = min(max(self._now - motion.start_time, 0.0), motion.trajectory.duration)
        expected = self._recent.expected(self._now)
        return holds(watch, is_remaining_free, motion, phase, self._scene) and holds(
            watch, is_expected_free, motion, phase, expected
        )

    def _moment(self, later: float = 0.0) -> Moment:
        now = self._now + later
        q, v, _ = self._playback.state_at(now)
        reading = JointReading(q, v, now, now, float('inf'))
        return Moment(now=now, steady=now, reading=reading, rules=self._rules)

    def _look(self) -> Look:
        return Look(self._scene, self._recent.expected(self._now), 0.0)

    def _send(self, command: Command) -> None:
        motion = command.motion
        self._playback = Playback(
            trajectory=motion.trajectory, start_time=motion.start_time, time_scale=1.0
        )
