# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
A wearer, his tracker, the monitor, a controller and a lagging arm in virtual time.

What goes wrong on a real wire is drawn with a seed: frames that are late or lost, messages that
take their time, a host that stands still, a middleware that fails, a controller that rejects.
"""

from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import Protocol

import numpy as np
from rrth_planner.execution.decision import Command
from rrth_planner.execution.event import BodyCame, Event, Look, Moment, Sight, Tick
from rrth_planner.execution.flight_recorder import FlightRecorder
from rrth_planner.execution.joint_reading import JointReading, with_earlier
from rrth_planner.execution.monitor import Monitor
from rrth_planner.execution.recent_wearer import RecentWearer
from rrth_planner.execution.watch import MonitorRules
from rrth_planner.model.arrays import Array
from rrth_planner.model.curves import state_at
from rrth_planner.model.scene import Box, Scene
from rrth_planner.rehearsal.timeline import Timeline
from rrth_planner.simulation.lagging_arm import LaggingArm
from rrth_planner.simulation.trajectory_controller import (
    commanded_state,
    ControllerRules,
    ControllerState,
    DEFAULT_RULES,
    points_of,
    TimedPoints,
)

# Periods of joint states and of the monitor's checks [s].
JOINT_PERIOD, CHECK_PERIOD = 0.01, 0.02
# A host that has other things to do decides so much later [s].
HESITATION = 0.04
# Virtual time begins then [s]: stamps are positive.
BEGIN = 1000.0


class Wearer(Protocol):
    """Somebody who moves."""

    @property
    def names(self) -> tuple[str, ...]:
        """The parts of him."""

    def rows_at(self, time: float) -> Array:
        """Return his boxes at a time [s], (m, 15); NaN: a part that is lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wire:
    """
    What becomes of frames and messages.

    Parameters
    ----------
    frame_period : float
        Of the tracker [s].
    age : (float, float)
        How old a frame is that comes: from, to [s].
    loss, doubled : float
        The shares of frames that never come, and of those that come twice [-].
    transport : (float, float)
        How long a message takes to the controller: from, to [s].
    deciding : (float, float)
        How long a decision takes: from, to [s].
    hesitating : float
        The share of decisions that take up to `HESITATION` [-].
    body_timeout, joint_timeout : float
        [s].
    keep_lost : float
        How long a lost part stays where it was before the arm stops [s].

    """

    frame_period: float = 1 / 60
    age: tuple[float, float] = (0.01, 0.03)
    loss: float = 0.0
    doubled: float = 0.0
    transport: tuple[float, float] = (0.001, 0.005)
    deciding: tuple[float, float] = (0.0002, 0.0015)
    hesitating: float = 0.0
    body_timeout: float = 0.2
    joint_timeout: float = 0.2
    keep_lost: float = 2.0


class World:
    """
    All of it, from a time at which the arm rests.

    Parameters
    ----------
    arm : LaggingArm
        What executes the commands.
    monitor : Monitor
        What is tried.

    """

    def __init__(
        self,
        rules: MonitorRules,
        wearer: Wearer,
        q: Array,
        seed: int,
        wire: Wire,
        *,
        controller: ControllerRules = DEFAULT_RULES,
        controller_period: float = 0.005,
        lag: float = 0.0,
        begin: float = BEGIN,
        is_drawn: bool = True,
        deciding: Callable[[], float] | None = None,
        flight: FlightRecorder | None = None,
    ) -> None:
        """
        Place the arm at rest at q, (dof,) [rad], at a time [s].

        is_drawn: whether what happens is drawn; else `frame_came`, `joints_came` and `check` are
        called by whoever knows what happened. deciding: returns how long a decision takes [s];
        None: that is drawn, too.
        """
        self.rules, self.wearer, self.wire = rules, wearer, wire
        self._is_drawn = is_drawn
        self.rng = np.random.default_rng(seed)
        self.timeline = Timeline(begin)
        self.arm = LaggingArm(q, controller_period, lag, controller, begin, state_at)
        self.monitor = Monitor(
            rules, self.moment, self.look, self.send, deciding or self._deciding, flight
        )
        # Until when the host stands still, the middleware fails, frames are lost and the
        # controller rejects what it is given [s].
        self.stands_until = self.fails_until = self.blind_until = self.rejects_until = -math.inf
        # Parts that the tracker does not see now.
        self.hidden: frozenset[str] = frozenset()
        # For those who judge: each cycle's command, and when it is due [s]; where another message
        # counts from there on, what the one before commands then, too; each message, and each one
        # that could not be sent; when each frame that comes was measured [s], and its parts.
        self.on_setpoint: Callable[[float, ControllerState], None] = lambda time, state: None
        self.on_join: Callable[[float, ControllerState, ControllerState], None] = lambda *_: None
        self.on_command: Callable[[Command], None] = lambda command: None
        self.on_unsent: Callable[[Command], None] = lambda command: None
        self.on_frame: Callable[[float, tuple[str, ...]], None] = lambda *_: None
        self._reading: JointReading | None = None
        # The newest sight and the last ones, by when they came [s].
        self._scene, self._measured = Scene(()), -math.inf
        # Of each part that has been seen: its box, and when it was measured last [s].
        self._parts: dict[str, tuple[Box, float]] = {}
        # How long the last decision took [s].
        self.took = 0.0
        self._recent: RecentWearer[Scene] = RecentWearer(lambda scene: scene)
        self._last_arrival = -math.inf
        # What the controller was given last.
        self.arrived: Command | None = None
        # Bodies that came while the host stood still.
        self._waiting: list[tuple[float, tuple[Box, ...], float, bool]] = []
        if not is_drawn:
            return
        timeline, rng = self.timeline, self.rng
        timeline.every(controller_period, self._cycle)
        timeline.every(JOINT_PERIOD, self._read, float(rng.uniform(0.0, JOINT_PERIOD)))
        timeline.every(CHECK_PERIOD, self.check, float(rng.uniform(0.0, CHECK_PERIOD)))
        timeline.every(wire.frame_period, self._frame)

    def moment(self, later: float = 0.0) -> Moment:
        """Return the moment that comes so much later than now [s], with what is known now."""
        # Where it is drawn what happens, a decision takes time on its way to the controller only.
        now, overdue = self.timeline.now + (0.0 if self._is_drawn else later), ''
        if self.monitor.watch.running is not None:
            age = now - self._measured
            joints = math.inf if self._reading is None else now - self._reading.taken
            if joints > self.wire.joint_timeout:
                overdue = f'joint states are {joints:.3f} s old'
            elif age > self.wire.body_timeout:
                overdue = f'the body is {age:.3f} s old'
            elif lost := self.lost_since(now - self.wire.keep_lost):
                overdue = f'the body has lost parts: {", ".join(lost)}'
        return Moment(
            now=now, steady=now, reading=self._reading, rules=self.rules, overdue=overdue
        )

    def look(self) -> Look | None:
        """Return the wearer, as he was seen last, beside the running motion."""
        if self.monitor.watch.running is None:
            return None
        now = self.timeline.now
        return Look(self._scene, self.expected(), now - self._measured)

    def stand_still(self, until: float) -> None:
        """Have the host stand still until a time [s]."""
        self.stands_until = max(until, self.stands_until)

    def reject(self, until: float) -> None:
        """Have the controller reject what it is given until a time [s]."""
        self.rejects_until = max(until, self.rejects_until)

    def lost_since(self, time: float) -> tuple[str, ...]:
        """Return the parts that are lost, and were measured before a time last [s]."""
        latest = min(self._measured, time)
        return tuple(name for name, (_, taken) in self._parts.items() if taken < latest)

    @property
    def is_still(self) -> bool:
        """Whether the host stands still."""
        return self.timeline.now < self.stands_until

    @property
    def scene(self) -> Scene:
        """The wearer as he was seen last."""
        return self._scene

    @property
    def taken(self) -> Array:
        """When each part of him was seen last, (m,) [s]."""
        return np.array([time for _, time in self._parts.values()])

    @property
    def measured(self) -> float:
        """When he was seen last [s]."""
        return self._measured

    @property
    def is_wearer_moving(self) -> bool:
        """Whether a part of him has moved lately by more than a tracker's noise."""
        return self._recent.is_moving(self.timeline.now)

    @property
    def reading(self) -> JointReading | None:
        """Where the arm was last."""
        return self._reading

    def take(self, event: Event) -> None:
        """Have the monitor take an event now."""
        self.monitor.take(event)

    def expected(self) -> Scene:
        """Return where moving parts of the wearer will be soon."""
        return self._recent.expected(self.timeline.now)

    def _cycle(self) -> None:
        arm, controller = self.arm, self.arm.controller
        before, due = controller.command, self.arm.time + controller.period
        setpoint = arm.step()
        if controller.command is not before:
            self.on_join(arm.time, commanded_state(before, due, state_at), setpoint)
        self.on_setpoint(arm.time, setpoint)

    def joints_came(self, reading: JointReading) -> None:
        """Have joint positions come now."""
        self._reading = reading

    def _read(self) -> None:
        if self.is_still:
            return
        now = self.timeline.now
        state = self.arm.measured_at(now)
        recent = with_earlier(state.positions, now, self._reading)
        self.joints_came(
            JointReading(state.positions, state.velocities, now, now, math.inf, recent)
        )

    def check(self) -> None:
        """Have the monitor check what it knows."""
        if not self.is_still:
            self.read()
            self.monitor.take(Tick(self.moment()))

    def _frame(self) -> None:
        """Have a frame seen now, which comes later, or never."""
        now, wire = self.timeline.now, self.wire
        age, is_lost = float(self.rng.uniform(*wire.age)), self.rng.random() < wire.loss
        if is_lost or now < self.blind_until:
            return
        rows = self.wearer.rows_at(now)
        rows.setflags(write=False)
        known = np.isfinite(rows.sum(axis=1)).tolist()
        boxes = zip(self.wearer.names, rows, known, strict=True)
        seen = tuple(
            Box.of_row(name, row)
            for name, row, is_seen in boxes
            if is_seen and name not in self.hidden
        )
        if not seen:
            return
        self.timeline.after(age, lambda: self.frame_came(seen, now))
        if wire.doubled and self.rng.random() < wire.doubled:
            again = float(self.rng.uniform(*wire.age))
            self.timeline.after(again, lambda: self.frame_came(seen, now))

    def frame_came(self, seen: tuple[Box, ...], measured: float, is_newest: bool = True) -> None:
        """
        Have the parts that were seen at a time [s] come now.

        is_newest: whether they are the newest ones of those that came together.
        """
        self._waiting.append((self.timeline.now, seen, measured, is_newest))
        if not self.is_still:
            self.read()

    def is_new(self, measured: float) -> bool:
        """Return whether a body was measured [s] after all that came before it."""
        return measured > self._measured

    def read(self) -> None:
        """Have all bodies seen that came, and the newest one checked."""
        waiting, self._waiting = self._waiting, []
        for k, (came, seen, measured, is_newest) in enumerate(waiting):
            self.on_frame(measured, tuple(box.name for box in seen))
            if not self.is_new(measured):
                continue
            # A part that is not shown is lost: it is taken to be where it was.
            self._parts.update((box.name, (box, measured)) for box in seen)
            self._scene = Scene(tuple(box for box, _ in self._parts.values()))
            self._measured = measured
            self._recent.saw(self._scene, self.timeline.now)
            sight = Sight(self._scene, np.array([then for _, then in self._parts.values()]))
            look = self.look() if is_newest and k == len(waiting) - 1 else None
            self.monitor.take(BodyCame(self.moment(), sight, look), self.timeline.now - came)

    def _deciding(self) -> float:
        self.took = float(self.rng.uniform(*self.wire.deciding))
        if self.wire.hesitating and self.rng.random() < self.wire.hesitating:
            self.took = float(self.rng.uniform(self.took, HESITATION))
        return self.took

    def send(self, command: Command) -> None:
        """Publish a command; raise ConnectionError where the middleware fails."""
        now = self.timeline.now
        if now < self.fails_until:
            self.on_unsent(command)
            raise ConnectionError('no middleware')
        self.on_command(command)
        points = points_of(command.motion.trajectory)
        # A commitment is published so long after the body for which it was found.
        sent = now + (self.took if command.within < math.inf else 0.0)
        arrives = max(sent + float(self.rng.uniform(*self.wire.transport)), self._last_arrival)
        self._last_arrival = arrives
        self.timeline.at(arrives, lambda: self._arrive(points, command))

    def _arrive(self, points: TimedPoints, command: Command) -> None:
        if self.timeline.now >= self.rejects_until:
            self.arrived = command
            self.arm.receive(points, command.begin)
