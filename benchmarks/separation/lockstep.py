# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The node's monitor and a controller in lock-step: latencies are true, and time is only a number.

A tracker shows a frame every `period`, each as the wearer was `age` ago. The monitor decides about
it as in the node, and what it commands a little later reaches the controller after a random
latency. The controller follows the newest message that it has; the arm follows the controller
`lag` late.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math

import numpy as np
from numpy.typing import NDArray
from rrth_planner.execution.body_motion import body_at
from rrth_planner.execution.command import ahead
from rrth_planner.execution.commitment import Commitment, path_state
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.decision import Command
from rrth_planner.execution.event import Begin, BodyCame, Look, Moment, Sight, Tick
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.expected_wearer import is_expected_free
from rrth_planner.execution.fail_safe_stop import holds
from rrth_planner.execution.joint_reading import JointReading, with_earlier
from rrth_planner.execution.monitor import Monitor
from rrth_planner.execution.recent_wearer import RecentWearer
from rrth_planner.execution.remaining_motion import is_remaining_free
from rrth_planner.execution.watch import PlainRules
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RequestError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import SeenBody, Separation
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.pipeline.motion_plan import MotionPlan

from benchmarks.separation.setting import required

# A motion that has not arrived after so long, or that cannot begin for so long, is not reachable
# now [s].
PATIENCE, BLOCKED = 30.0, 0.5
# An arm so near to the end of its motion has arrived [rad].
NEAR = 1e-3
# The monitor checks its inputs so often [s].
CHECK_PERIOD = 0.02
# No decision needs what the arm aims at.
GOAL = PointingGoal(np.ones(3))
# Instants that are judged are so far apart [s].
INSTANT = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """
    Who is how late [s].

    Parameters
    ----------
    period : float
        Between two frames.
    age : float
        Of what a frame shows.
    thinking : float
        From a frame to the publication of the new commitment.
    latency : (float, float)
        From then until the controller has it, at random between the two.
    lag : float
        Of the arm behind the controller.

    """

    period: float = 1.0 / 120.0
    age: float = 0.03
    thinking: float = 1e-3
    latency: tuple[float, float] = (1e-3, 1e-2)
    lag: float = 0.01


@dataclass(slots=True, eq=False)
class Controller:
    """The trajectories that a controller got: when each came, and when each begins [s]."""

    place: Array
    came: list[float] = field(default_factory=list)
    begins: list[float] = field(default_factory=list)
    trajectories: list[Trajectory] = field(default_factory=list)

    def give(self, trajectory: Trajectory, begin: float, came: float) -> None:
        """Send it a newer one."""
        # What was sent before, and comes after it, is dropped.
        while self.came and self.came[-1] >= came:
            self.came.pop()
            self.begins.pop()
            self.trajectories.pop()
        self.came.append(came)
        self.begins.append(begin)
        self.trajectories.append(trajectory)

    def states(self, times: Array) -> tuple[Array, Array]:
        """Return what it commands at increasing times, (n, dof) each [rad, rad/s]."""
        q, v = np.repeat(self.place[None], len(times), axis=0), np.zeros((len(times), 4))
        borders = [*np.searchsorted(times, self.came), len(times)]
        for k, (first, last) in enumerate(zip(borders[:-1], borders[1:], strict=True)):
            if first < last:
                since = times[first:last] - self.begins[k]
                q[first:last], v[first:last], _ = sample(self.trajectories[k], since)
        return q, v

    def measured(self, time: float, lag: float, before: JointReading | None) -> JointReading:
        """Return the reading of an arm that follows it so late, at a time [s]."""
        q, v = (row[0] for row in self._state_at(time - lag))
        return JointReading(q, v, time, time, math.inf, with_earlier(q, time, before))

    def _state_at(self, time: float) -> tuple[Array, Array]:
        index = self.index_at(time)
        if index < 0:
            return self.place[None], np.zeros_like(self.place)[None]
        return sample(self.trajectories[index], [time - self.begins[index]])[:2]

    def index_at(self, time: float) -> int:
        """Return which trajectory it follows at a time [s]; -1: none."""
        return int(np.searchsorted(self.came, time, side='right')) - 1


@dataclass(slots=True, eq=False)
class Eyes:
    """
    The wearer as the planner knows him: where each part was seen last, and when.

    Parameters
    ----------
    names : tuple of str
    rows : ndarray, shape (m, 15)
    taken : ndarray, shape (m,)
        When, as far as the planner knows [s].

    """

    names: tuple[str, ...]
    rows: Array
    taken: Array

    def see(self, rows: Array, taken: float, seen: NDArray[np.bool_] | None = None) -> None:
        """Have a frame; parts that are not seen stay where they were."""
        if seen is None:
            self.rows, self.taken = rows, np.full(len(rows), taken)
        else:
            self.rows = np.where(seen[:, None], rows, self.rows)
            self.taken = np.where(seen, taken, self.taken)

    def scene(self) -> Scene:
        """Return the parts as they were seen."""
        return scene_of_rows(self.names, self.rows)

    def sight(self, time: float) -> Sight:
        """Return what is known of him at a time [s]."""
        return Sight(self.scene(), self.taken)


def scene_of_rows(names: Sequence[str], rows: Array) -> Scene:
    """Return a scene of boxes by their names and numbers, (m, 15)."""
    return Scene(tuple(Box.of_row(name, row) for name, row in zip(names, rows, strict=True)))


class Planner:
    """
    The planner's part: the node's monitor, which commands the arm, and its present motion.

    Parameters
    ----------
    commitments, messages : list of Commitment, list of Trajectory
        All that were issued, and what the controller got of each: its lead-in, too.
    bodies : list of SeenBody
        As the wearer was known for each of them.
    is_under_way, is_outdated : bool
        Whether the motion has begun, and whether the wearer has got into its way before that.
    blocked_since : float or None
        Since when it cannot begin [s].

    """

    def __init__(
        self,
        settings: Separation,
        timing: Timing,
        rng: np.random.Generator,
        controller: Controller,
        *,
        is_separate: bool = True,
    ) -> None:
        """Rest, without a motion; is_separate: whether motions are given as commitments."""
        self.settings, self.timing, self.controller = settings, timing, controller
        self._rng = rng
        delay = settings.rules.controller_delay
        self._rules = PlainRules(
            required=required(),
            stop_limits=settings.stop_limits,
            execution=ExecutionRules(settings if is_separate else None, delay, is_manual=False),
        )
        self.monitor = Monitor(
            self._rules, self._moment, self._look, self._send, lambda: timing.thinking
        )
        self.plan: MotionPlan | None = None
        self.commitments: list[Commitment] = []
        self.messages: list[Trajectory] = []
        self.bodies: list[SeenBody] = []
        self.is_under_way = self.is_outdated = False
        self.blocked_since: float | None = None
        self._begun, self._n_stops = 0.0, 0
        self._now, self._checked, self._newest = 0.0, -math.inf, -math.inf
        self._reading: JointReading | None = None
        self._scene = Scene(())
        self._recent: RecentWearer[Scene] = RecentWearer(lambda scene: scene)
        self._sent: Command | None = None

    @property
    def motion(self) -> Trajectory:
        """The motion that is to be executed."""
        assert self.plan is not None and self.plan.trajectory is not None
        return self.plan.trajectory

    def begin(self, plan: MotionPlan | None) -> None:
        """Have a motion that begins where the arm is at rest, as soon as it may; None: no more."""
        self.plan, self.blocked_since = plan, None
        self.is_under_way = self.is_outdated = False

    def frame(self, time: float, eyes: Eyes) -> None:
        """Have the monitor take a frame that comes at a time [s]."""
        self._now = time
        self._reading = self.controller.measured(time, self.timing.lag, self._reading)
        if time >= self._checked + CHECK_PERIOD:
            self._checked = time
            self.monitor.take(Tick(self._moment()))
        sight = eyes.sight(time)
        self._scene, self._newest = sight.scene, float(sight.measured.max(initial=-math.inf))
        self._recent.saw(sight.scene, time)
        self.monitor.take(BodyCame(self._moment(), sight, self._look()))
        self._note()
        if self.plan is not None and not self.is_under_way:
            self._try_begin()
        # An error of the monitor stops the arm for good, which would look like prudence.
        assert self.monitor.watch.n_faults == 0, self.monitor.watch.stop_reason

    @property
    def n_further(self) -> int:
        """How often a part was seen further away than assumed."""
        known = self.monitor.watch.commitments.body
        return 0 if known is None else known.n_further

    def brake(self) -> None:
        """Stop the arm, since its motion is given up."""
        self.monitor.fail('the motion is given up', is_replanned=False, is_fault=False)

    def body(self, time: float) -> SeenBody:
        """Return the wearer as the monitor knows him, at a time [s]."""
        known = self.monitor.watch.commitments.body
        assert known is not None
        return body_at(known, time, self.settings.rules)

    def _is_free(self) -> bool:
        """Return whether the motion, before it begins, is clear of the wearer, and soon, too."""
        watch, motion = self.monitor.watch, self._whole(0.0)
        expected = self._recent.expected(self._now)
        return holds(watch, is_remaining_free, motion, 0.0, self._scene) and holds(
            watch, is_expected_free, motion, 0.0, expected
        )

    @property
    def is_stopped(self) -> bool:
        """Whether the monitor has stopped the motion, or given it up."""
        return self.is_under_way and self.monitor.watch.n_stops != self._n_stops

    def is_at_rest(self, time: float) -> bool:
        """Return whether the arm is at rest from a time on if nothing more comes [s]."""
        given = self.controller
        if not given.trajectories:
            return True
        end = given.begins[-1] + given.trajectories[-1].duration
        return time > max(end, given.came[-1]) + self.timing.lag

    def has_arrived(self, time: float) -> bool:
        """Return whether the arm is at rest at the end of its motion."""
        if not self.is_under_way or not self.is_at_rest(time):
            return False
        return bool(np.abs(self.place() - self.motion.positions[-1]).max() < NEAR)

    def cannot_begin(self, time: float) -> bool:
        """Return whether the motion could not begin for BLOCKED."""
        since = self.blocked_since
        return not self.is_under_way and since is not None and time - since >= BLOCKED

    def progress(self, time: float) -> float:
        """Return where within the motion what was commanded is at a time [s]."""
        if not self.is_under_way:
            return 0.0
        if self._rules.execution.separation is not None:
            return float(path_state(self.commitments[-1], time)[0])
        return time - self._begun

    def place(self) -> Array:
        """Return where the arm comes to rest if nothing more comes (dof,) [rad]."""
        last: Array = (
            self.controller.trajectories[-1].positions[-1]
            if self.controller.trajectories
            else self.controller.place
        )
        return last

    def _whole(self, begin: float) -> ExecutingMotion:
        assert self.plan is not None
        return ExecutingMotion(
            trajectory=self.motion,
            start_time=begin,
            target_distance=self.plan.target_distance,
            escape_time=self.plan.escape_time,
        )

    def _try_begin(self) -> None:
        """Have the motion begin, if it may."""
        at = self._moment()
        begin = at.now + ahead(self._rules.execution.controller_delay)
        watch = self.monitor.watch
        counts = watch.n_stops, watch.n_faults
        event = Begin(at, self._whole(begin), GOAL, self._rules, math.inf, None, *counts)
        self.is_outdated = not self._is_free()
        try:
            if not self.is_outdated:
                self.monitor.begin(event)
                self.is_under_way = True
        except RequestError:
            pass
        if not self.is_under_way:
            self.blocked_since = at.now if self.blocked_since is None else self.blocked_since
            return
        self._begun, self._n_stops = begin, watch.n_stops
        self._note()

    def _note(self) -> None:
        """Take note of a commitment that was sent."""
        sent, newest = self.monitor.watch.commitments.sent, self._sent
        if newest is None or sent is None or sent.motion is not newest.motion:
            return
        self._sent = None
        self.commitments.append(sent.commitment)
        self.messages.append(sent.motion.trajectory)
        self.bodies.append(self.body(sent.commitment.start_time))

    def _moment(self, later: float = 0.0) -> Moment:
        # How old what is seen may be is the node's: here it is what is varied.
        now = self._now + later
        return Moment(now=now, steady=now, reading=self._reading, rules=self._rules)

    def _look(self) -> Look | None:
        if self.monitor.watch.running is None:
            return None
        expected = self._recent.expected(self._now)
        return Look(self._scene, expected, max(self._now - self._newest, 0.0))

    def _send(self, command: Command) -> None:
        self._sent = command
        came = self._now + self.timing.thinking + self._rng.uniform(*self.timing.latency)
        motion = command.motion
        self.controller.give(motion.trajectory, motion.start_time, came)


def instants(begin: float, end: float) -> Array:
    """Return instants from one time to another [s]."""
    grid: Array = np.arange(begin, end, INSTANT)
    return grid
