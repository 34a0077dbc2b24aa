# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
One arm beside a hand that wanders, with everything going wrong that the wire allows; judged.

The judge knows nothing of the proof: contacts are found in plain numpy, instant by instant, with
the hand where it really is.
"""

from dataclasses import dataclass, field
import math

import numpy as np
from rrth_planner.collision.world import arm_world
from rrth_planner.execution.command import ahead
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.decision import Command
from rrth_planner.execution.event import Begin, ClockStepped, Hold, Reset, StopsTaken
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.watch import MonitorState, PlainRules
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RequestError, RrthError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.rehearsal.contacts import distances_to
from rrth_planner.rehearsal.world import BEGIN, Wire, World
from rrth_planner.simulation.trajectory_controller import (
    ControllerRules,
    ControllerState,
    ControllerVersion,
)
from rrth_planner.timing.parameterization import parameterize

from benchmarks.separation.setting import Case, FOLDED, MARGIN, RAY, separation_of, the_arm

# How long everything may go wrong, and how long nothing does after that [s].
CHAOS, CALM = 15.0, 6.0
# Between two things that somebody wants [s].
PAUSE = (0.03, 0.5)
# A handover is planned from what is commanded then, so much later [s].
HANDOVER = 0.045
# A message continues the one before where its first setpoint is as near to that as this [rad].
APART = 1e-4
# A rejected message leaves the controller on another curve than what comes later continues: for
# so long its steps are not judged [s].
REJECTED = 2.0
GOAL = PointingGoal(np.array([1.5, 0.1, 0.3]))
# Where the hand wanders: from, to [m]; how fast, of what is stated [m/s].
PLACES = np.array([[-0.2, -0.7, -0.2], [0.9, 0.7, 1.0]])
SPEEDS = (0.2, 1.95)
HAND = np.array([0.1, 0.1, 0.2])
TORSO = np.array([0.3, 0.4, 0.6]), np.array([0.35, 0.0, -0.3])


@dataclass(slots=True)
class Found:
    """
    What an episode has shown.

    Parameters
    ----------
    faults : list of str
        What was wrong; none where the monitor did right.
    n_contacts : int
        Instants at which the arm was in the hand, slower than the contact speed.

    """

    seed: int
    faults: list[str] = field(default_factory=list)
    n_events: int = 0
    n_commands: int = 0
    n_stops: int = 0
    n_begun: int = 0
    n_contacts: int = 0
    digest: str = ''


class Wanderer:
    """A torso that stands, and a hand that goes from place to place."""

    names = ('torso', 'hand')

    def __init__(self, rng: np.random.Generator, seconds: float, end: float) -> None:
        """Draw where it goes; after a time [s] it stays far away."""
        times, places = [BEGIN], [rng.uniform(*PLACES)]
        while times[-1] < BEGIN + seconds:
            place = rng.uniform(*PLACES)
            way = float(np.linalg.norm(place - places[-1]))
            times.append(times[-1] + way / float(rng.uniform(*SPEEDS)))
            places.append(place)
            if rng.random() < 0.3:
                times.append(times[-1] + float(rng.uniform(0.0, 1.0)))
                places.append(place)
        away = np.array([4.0, 4.0, 0.0])
        way = float(np.linalg.norm(away - places[-1]))
        times.append(times[-1] + way / SPEEDS[1])
        places.append(away)
        self._times, self._places = np.array(times), np.array(places)
        self._turn = np.eye(3).ravel()

    def rows_at(self, time: float) -> Array:
        """Return torso and hand at a time [s], (2, 15)."""
        hand = [np.interp(time, self._times, self._places[:, k]) for k in range(3)]
        size, place = TORSO
        return np.array(
            [
                np.concatenate([place, size, self._turn]),
                np.concatenate([hand, HAND, self._turn]),
            ]
        )


class Episode:
    """One run, from a seed."""

    def __init__(self, seed: int) -> None:
        """Draw wire, controller and what happens."""
        rng = self._rng = np.random.default_rng(seed)
        self.found = Found(seed)
        delay = float(rng.choice([0.01, 0.02]))
        lag = float(rng.choice([0.0, 0.004]))
        case = Case(stop=str(rng.choice(['4/40', '10/400'])), controller_delay=delay)
        self._separation = separation_of(case)
        execution = ExecutionRules(self._separation, delay, 0.01, bool(rng.random() < 0.2))
        rules = PlainRules(
            arm=the_arm(),
            margin=MARGIN,
            ray_guard_length=RAY,
            stop_limits=self._separation.stop_limits,
            execution=execution,
        )
        wire = Wire(
            frame_period=1.0 / float(rng.choice([30, 60, 120])),
            age=(0.005, float(rng.uniform(0.01, 0.06))),
            loss=float(rng.choice([0.0, 0.05, 0.2])),
            transport=(0.0005, delay - lag - 0.0005),
            deciding=(0.0002, float(rng.choice([0.0015, 0.006]))),
        )
        self._wearer = Wanderer(rng, CHAOS, BEGIN + CHAOS)
        version = ControllerVersion(str(rng.choice(['4.20', '4.42', '6.9'])))
        controller = ControllerRules(version=version)
        self.world = World(
            rules,
            self._wearer,
            FOLDED,
            int(rng.integers(2**31)),
            wire,
            controller=controller,
            lag=lag,
        )
        self.world.on_setpoint, self.world.on_command = self._see, self._judge_command
        self.world.on_join = self._judge_join
        # Times [s], and commanded states, of each cycle.
        self._times: list[float] = []
        self._states: list[ControllerState] = []
        self._is_calm, self._rejected = False, -math.inf

    def run(self) -> Found:
        """Run it to its end, and judge."""
        world, monitor = self.world, self.world.monitor
        world.timeline.after(0.2, self._want)
        world.timeline.run(BEGIN + CHAOS)
        self._is_calm = True
        world.stands_until = world.fails_until = world.blind_until = -math.inf
        world.rejects_until = -math.inf
        # The hand goes away, and what was moving comes to rest.
        world.timeline.run(BEGIN + CHAOS + CALM)
        self._judge_end()
        self._judge_curve()
        found = self.found
        found.n_events, found.n_commands = monitor.n_events, monitor.n_commands
        found.n_stops, found.digest = monitor.n_stops, monitor.digest
        return found

    def _want(self) -> None:
        """Have somebody want something, or something fail; and again later."""
        world, rng = self.world, self._rng
        if self._is_calm:
            return
        now, what = world.timeline.now, float(rng.random())
        if what < 0.70:
            self._move()
        elif what < 0.74:
            world.monitor.fail('cancelled', is_replanned=False, is_fault=False)
        elif what < 0.77:
            world.monitor.fail('an error', is_replanned=False)
        elif what < 0.82:
            world.stands_until = now + float(rng.uniform(0.01, 0.4))
        elif what < 0.86:
            world.fails_until = now + float(rng.uniform(0.01, 0.2))
        elif what < 0.91:
            world.blind_until = now + float(rng.uniform(0.05, 0.6))
        elif what < 0.93:
            world.rejects_until = now + float(rng.uniform(0.005, 0.1))
            self._rejected = world.rejects_until
        elif what < 0.95:
            world.take(ClockStepped(world.moment(), 0.0, 'the clock stands still'))
        else:
            world.take(StopsTaken(world.moment()))
        world.timeline.after(float(rng.uniform(*PAUSE)), self._want)

    def _move(self) -> None:
        world, monitor = self.world, self.world.monitor
        now = world.timeline.now
        if world.is_still or not world.scene.boxes or world.reading is None:
            return
        if monitor.watch.commitments.fault or self._rng.random() < 0.1:
            world.take(Reset(world.moment()))
        if not monitor.watch.is_active(now):
            self._begin_at_rest()
            return
        then = now + HANDOVER
        world.take(Hold(world.moment(), then + 0.02))
        command = monitor.watch.tracked.command
        if command is None:
            return
        later = float(self._rng.uniform(0.005, HANDOVER - 0.02))
        world.timeline.after(later, lambda: self._hand_over(command, then))

    def _hand_over(self, command: ExecutingMotion, then: float) -> None:
        world = self.world
        if not world.is_still:
            since = then - command.start_time
            q, v, a = (row[0] for row in sample(command.trajectory, [since]))
            end = np.clip(q + 0.5 * v, *the_arm().bounds)
            still = np.zeros_like(q)
            motion = Trajectory([0.0, 1.2], [q, end], [v, still], [a, still])
            self._begin(motion, then, since, command)
        world.take(Hold(world.moment(), -math.inf))

    def _begin_at_rest(self) -> None:
        world, rng, arm = self.world, self._rng, the_arm()
        command, reading = world.monitor.watch.tracked.command, world.reading
        assert reading is not None
        q = reading.mean_positions() if command is None else command.trajectory.positions[-1]
        free = arm_world(arm, world.scene, MARGIN, RAY)
        for _ in range(8):
            end = np.clip(q + rng.uniform(-0.9, 0.9, arm.dof), *arm.bounds)
            if free.is_edge_valid(q, end):
                break
        else:
            # He may move on.
            end = np.clip(q + rng.uniform(-0.3, 0.3, arm.dof), *arm.bounds)
        motion = parameterize(Path(np.array([q, end])), (), self._separation.limits)
        begin = world.timeline.now + ahead(world.rules.controller_delay)
        self._begin(motion, begin, math.inf, None)

    def _begin(
        self,
        motion: Trajectory,
        begin: float,
        joins: float,
        planned_from: ExecutingMotion | None,
    ) -> bool:
        world = self.world
        planned = ExecutingMotion(trajectory=motion, start_time=begin)
        event = Begin(world.moment(), planned, GOAL, world.rules, joins, planned_from)
        try:
            world.monitor.begin(event)
        except (RequestError, RrthError, ConnectionError):
            return False
        self.found.n_begun += 1
        return True

    def _see(self, time: float, state: ControllerState) -> None:
        self._times.append(time)
        self._states.append(state)

    def _judge_command(self, command: Command) -> None:
        motion = command.motion.trajectory
        if motion.velocities[-1].any() or motion.accelerations[-1].any():
            self._blame('a command does not end at rest')

    def _judge_join(self, time: float, former: ControllerState, setpoint: ControllerState) -> None:
        arrived = self.world.arrived
        if arrived is not None and arrived.begin == 0.0:
            # It begins on reception, whatever time it is by the controller's clock.
            return
        apart = float(np.abs(setpoint.positions - former.positions).max())
        if apart > APART and time > self._rejected + REJECTED:
            self._blame(f'a setpoint is {apart:.4f} rad from what was commanded, {time:.3f} s')

    def _judge_end(self) -> None:
        """Judge whether the arm rests, and moves again if it is asked to."""
        world, watch = self.world, self.world.monitor.watch
        if watch.state is MonitorState.STOPPING and not watch.is_held and not watch.stops:
            self._blame('it stops for ever')
        if watch.pending is not None:
            self._blame('a stop is pending for ever')
        world.take(Reset(world.moment()))
        for _ in range(3):
            if not watch.is_active(world.timeline.now):
                break
            world.monitor.fail('of the judge', is_replanned=False, is_fault=False)
            world.timeline.run(world.timeline.now + 3.0)
            watch = world.monitor.watch
        q = self._states[-1].positions
        if np.abs(self._states[-1].velocities).max() > 1e-9:
            self._blame('the arm never rests')
            return
        before, end = self.found.n_begun, np.clip(q + 0.05, *the_arm().bounds)
        motion = parameterize(Path(np.array([q, end])), (), self._separation.limits)
        for _ in range(40):
            begin = world.timeline.now + ahead(world.rules.controller_delay)
            if self._begin(motion, begin, math.inf, None):
                break
            world.timeline.run(world.timeline.now + 0.1)
        world.timeline.run(world.timeline.now + 3.0)
        arrived = self._states[-1].positions
        if self.found.n_begun == before:
            self._blame('no motion begins any more')
        elif np.abs(arrived - end).max() > 1e-3 and not self._is_arm_in_torso(q):
            self._blame('a motion in the free does not arrive')

    def _is_arm_in_torso(self, q: Array) -> bool:
        free = arm_world(the_arm(), self.world.scene, MARGIN, RAY)
        return not free.is_free(q)

    def _judge_curve(self) -> None:
        """Judge how the arm moved: it met nobody fast."""
        times = np.array(self._times)
        q = np.array([state.positions for state in self._states])
        v = np.array([state.velocities for state in self._states])
        rows = np.array([self._wearer.rows_at(time - self.world.arm.lag_time) for time in times])
        rules = self._separation.rules
        speed = rules.contact_speed
        near = distances_to(the_arm(), q, v, self._wearer.names, rows, speed, 0.01)
        is_fast = near.fast < 0.0
        self.found.n_contacts = int((near.whole.min(axis=(1, 2)) < 0.0).sum())
        if is_fast.any():
            k = int(np.argwhere(is_fast.any(axis=(1, 2)))[0, 0])
            pace = float(near.speeds[k].max())
            self._blame(f'contact at {pace:.3f} m/s, {times[k]:.3f} s')

    def _blame(self, what: str) -> None:
        self.found.faults.append(what)
