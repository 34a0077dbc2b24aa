# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
What the monitor of a moving arm must do, whatever happens: judged from outside, cycle by cycle.

The judge knows nothing of the proof, and decides nothing as the monitor does: contacts are found
in plain numpy, with the hands where they really are; what is commanded is what a controller makes
of the messages.
"""

from dataclasses import dataclass, field
import math

import numpy as np
from rrth_planner.execution.commitments import is_separate, LATEST
from rrth_planner.execution.decision import Command
from rrth_planner.execution.tracked_motion import OFF_COMMAND
from rrth_planner.execution.watch import MonitorState
from rrth_planner.model.trajectory import positions_at
from rrth_planner.rehearsal.contacts import distances_to
from rrth_planner.rehearsal.world import World
from rrth_planner.simulation.trajectory_controller import ControllerState

from benchmarks.monitor_search.wearer import Person
from benchmarks.separation.setting import the_arm

# A message continues the one before it: its first setpoint may be due so long after both part [s],
# by no more than the greatest jerk makes of that; and rounding [rad, rad/s].
PARTED, APART, APART_SPEED = 8e-3, 3e-6, 3e-4
# After a rejected message an arm at rest may be so far from what it was commanded, unnoticed, and
# its next motion begins there [rad].
UNNOTICED = OFF_COMMAND + 1e-3
# A rejected message leaves the controller on another curve than what comes later continues: for
# so long its steps are not judged [s].
REJECTED = 2.0
# A stop that is due comes within so long, not counting standstills and failures [s].
PROMPT = 0.06
# So many bodies may leave the whole rest of a motion unproven before it is stopped.
UNPROVEN = 3
# An arm that misses a stop is given it again within so long [s], where it is further off the stop
# than this [rad], and faster than this [rad/s].
AGAIN, OFF_STOP, MOVES = 0.25, 0.03, 0.1


@dataclass(slots=True)
class Found:
    """
    What an episode has shown.

    Parameters
    ----------
    faults : list of str
        What was wrong; none where the monitor did right.
    n_contacts : int
        Instants at which the arm was in a hand, slower than the contact speed.

    """

    seed: int
    faults: list[str] = field(default_factory=list)
    n_events: int = 0
    n_commands: int = 0
    n_stops: int = 0
    n_begun: int = 0
    n_contacts: int = 0
    digest: str = ''


@dataclass(slots=True)
class Due:
    """A stop that is due: why, of which motion, and since how many cycles of a working host."""

    why: str
    n_motions: int
    n_cycles: int = 0


class Judge:
    """Looks on, and blames."""

    def __init__(self, world: World, found: Found) -> None:
        """Look at a world, and write down what is wrong."""
        self._world, self.found = world, found
        world.on_setpoint, world.on_command, world.on_join = self._see, self._sent, self._joined
        world.on_unsent, world.on_frame = self._unsent, self._frame
        # Times [s], and commanded states, of each cycle.
        self.times: list[float] = []
        self.states: list[ControllerState] = []
        self.has_ended = False
        # Until when the controller rejected [s], and whether no motion has begun at rest since.
        self.rejected, self.is_apart = -math.inf, False
        # Whether no motion may begin until a reset.
        self.is_faulty = False
        self.is_beginning = False
        self._due: Due | None = None
        self._n_pending = self._n_missed = self._n_unproven = 0
        self._judged = -math.inf
        self._last: tuple[Command, float] | None = None
        # When parts were measured at the latest, by the frames, and by what the monitor knows [s].
        self._frames: dict[str, float] = {}
        self._known: dict[str, float] = {}

    def blame(self, what: str) -> None:
        """Write down what is wrong, once."""
        kind = what.split(',')[0]
        if not any(fault.split(',')[0] == kind for fault in self.found.faults):
            self.found.faults.append(f'{what}, {self._world.timeline.now:.3f} s')

    def expect_stop(self, why: str) -> None:
        """Take note that the arm is to be stopped, if it executes a motion."""
        watch = self._world.monitor.watch
        if watch.is_monitoring and self._due is None:
            self._due = Due(why, watch.n_motions)

    def begun(self) -> None:
        """Take note of a motion that has begun."""
        self.found.n_begun += 1
        if self.is_faulty:
            self.blame('a motion begins after a fault')

    def reject(self, until: float) -> None:
        """Take note that the controller rejects what comes until then [s]."""
        self.rejected, self.is_apart = until, True

    def _sent(self, command: Command) -> None:
        self._last, self._n_missed = (command, self._world.timeline.now), 0
        if command.within < math.inf and self._world.took > LATEST:
            self.blame('a commitment is published too late')
        motion = command.motion.trajectory
        if motion.velocities[-1].any() or motion.accelerations[-1].any():
            self.blame('a command does not end at rest')

    def _unsent(self, command: Command) -> None:
        if not self.is_beginning and self._world.monitor.watch.is_monitoring:
            self.expect_stop('a commitment could not be published')
            self.is_faulty |= command.within < math.inf

    def _frame(self, measured: float, names: tuple[str, ...]) -> None:
        for name in names:
            self._frames[name] = max(measured, self._frames.get(name, -math.inf))

    def _joined(self, time: float, former: ControllerState, setpoint: ControllerState) -> None:
        arrived = self._world.arrived
        if arrived is None or arrived.begin == 0.0 or time <= self.rejected + REJECTED:
            # It begins on reception, whatever time it is by the controller's clock.
            return
        apart = float(np.abs(setpoint.positions - former.positions).max())
        faster = float(np.abs(setpoint.velocities - former.velocities).max())
        jerk = float(self._world.rules.stop_limits.jerk.max())
        is_apart = self.is_apart and not former.velocities.any()
        if is_apart:
            self.is_apart = False
        if apart > (UNNOTICED if is_apart else APART + jerk * PARTED**3 / 6):
            self.blame(f'a setpoint jumps, {apart:.2e} rad')
        elif faster > APART_SPEED + jerk * PARTED**2 / 2:
            self.blame(f'a setpoint jumps in speed, {faster:.4f} rad/s')

    def _see(self, time: float, state: ControllerState) -> None:
        self.times.append(time)
        self.states.append(state)
        if self.has_ended:
            return
        world = self._world
        is_working = not world.is_still and world.timeline.now >= world.fails_until
        self._judge_stops(is_working)
        self._judge_memory()
        self._judge_proof(is_working)
        if is_working:
            self._judge_missed(state)

    def _judge_stops(self, is_working: bool) -> None:
        """Judge whether what is to stop the arm does so, and soon."""
        world, due = self._world, self._due
        now, watch, wire = world.timeline.now, world.monitor.watch, world.wire
        newest = max(self._frames.values(), default=math.inf)
        oldest = min(self._frames.values(), default=math.inf)
        if now - newest > wire.body_timeout or now - oldest > wire.keep_lost:
            self.expect_stop('the wearer is not seen')
        elif due is not None and due.why == 'the wearer is not seen':
            due = self._due = None
        running = watch.running
        is_over = (
            running is None or now >= running.start_time + running.trajectory.duration - PROMPT
        )
        if due is not None and (
            is_over or not watch.is_monitoring or watch.n_motions != due.n_motions
        ):
            due = self._due = None
        period = self._world.arm.controller.period
        if due is not None:
            due.n_cycles += is_working
            if due.n_cycles * period > PROMPT:
                self.blame(f'no stop: {due.why}')
                self._due = None
        self._n_pending += is_working
        if watch.pending is None or is_over:
            self._n_pending = 0
        if self._n_pending * period > PROMPT:
            self.blame('a stop is pending, and is not published')

    def _judge_memory(self) -> None:
        """Judge whether what is known of the wearer is never replaced by older news."""
        body = self._world.monitor.watch.commitments.body
        if body is None:
            return
        for box, measured in zip(body.scene.boxes, body.measured, strict=True):
            known = self._known.get(box.name, -math.inf)
            if measured < known - 1e-9:
                self.blame(f'older news of {box.name} replace newer ones')
            elif measured > self._frames[box.name] + 1e-9:
                self.blame(f'{box.name} is taken to be newer than it was measured')
            self._known[box.name] = max(known, float(measured))

    def _judge_proof(self, is_working: bool) -> None:
        """Judge whether the whole rest of a motion is given up where it is not proven any more."""
        world = self._world
        now, watch = world.timeline.now, world.monitor.watch
        known, fresh = watch.commitments, max(self._frames.values(), default=-math.inf)
        if not watch.is_monitoring or known.sent is None or not known.is_whole:
            self._n_unproven = 0
            return
        if fresh == self._judged or not is_working:
            return
        # The rest is shorter, and the wearer no older, than when it was proven.
        self._judged = fresh
        is_proven = is_separate(known, known.sent.motion, now)
        self._n_unproven = 0 if is_proven else self._n_unproven + 1
        if self._n_unproven > UNPROVEN:
            self.blame('the whole rest of a motion is not proven any more')

    def _judge_missed(self, state: ControllerState) -> None:
        """Judge whether a stop that the controller has rejected is repeated."""
        world, last = self._world, self._last
        is_stopping = world.monitor.watch.state is MonitorState.STOPPING
        if last is None or not is_stopping or world.arrived is last[0]:
            return
        if np.abs(state.velocities).max() < MOVES:
            return
        stop, now = last[0].motion, world.timeline.now
        times = np.linspace(0.0, min(max(now - stop.start_time, 0.0), stop.trajectory.duration))
        off = np.abs(positions_at(stop.trajectory, times) - state.positions).max(axis=1).min()
        self._n_missed += bool(off > OFF_STOP)
        if self._n_missed * world.arm.controller.period > AGAIN:
            self.blame('a stop that the arm has missed is not repeated')

    def judge_curve(self, person: Person) -> None:
        """Judge how the arm moved: it met nobody fast."""
        times = np.array(self.times)
        q = np.array([state.positions for state in self.states])
        v = np.array([state.velocities for state in self.states])
        lag = self._world.arm.lag_time
        # The arm does later what is due by then.
        rows = np.array([person.rows_at(time + lag) for time in times])
        rules = self._world.rules.execution.separation
        assert rules is not None
        speed = rules.rules.contact_speed
        near = distances_to(the_arm(), q, v, person.names, rows, speed, 0.01)
        # An arm of bars without flesh is in a box at a distance of 0.
        is_fast, is_slow = near.fast <= 0.0, near.whole <= 0.0
        self.found.n_contacts = int((is_slow & ~is_fast).any(axis=(1, 2)).sum())
        if is_fast.any():
            k = int(np.argwhere(is_fast.any(axis=(1, 2)))[0, 0])
            pace = float(near.speeds[k][is_fast[k]].max())
            self.blame(f'contact, {pace:.3f} m/s at {times[k]:.3f} s')
