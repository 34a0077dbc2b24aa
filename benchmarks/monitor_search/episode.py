# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""One arm beside hands that reach for it, with everything going wrong that the wire allows."""

from dataclasses import replace
import math

import numpy as np
from rrth_planner.collision.world import arm_world
from rrth_planner.execution.command import ahead
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.event import Begin, ClockStepped, Hold, Reset, StopsTaken
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.watch import MonitorState, PlainRules
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RequestError, RrthError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import positions_at, sample, Trajectory
from rrth_planner.rehearsal.contacts import moving_bars
from rrth_planner.rehearsal.world import BEGIN, Wire, World
from rrth_planner.simulation.trajectory_controller import ControllerRules, ControllerVersion
from rrth_planner.timing.parameterization import parameterize

from benchmarks.monitor_search.judge import Found, Judge
from benchmarks.monitor_search.wearer import Person
from benchmarks.separation.setting import (
    Case,
    FOLDED,
    MARGIN,
    RAY,
    required,
    separation_of,
    the_arm,
)

# How long everything may go wrong, and how long nothing does after that [s].
CHAOS, CALM = 15.0, 6.0
# Between two things that somebody wants [s].
PAUSE = (0.03, 0.5)
# A handover is planned from what is commanded then, so much later [s].
HANDOVER = 0.045
# The share of motions that are stopped soon, which the controller misses [-].
MISSES = 0.1
# A hand of another stays where it came in for so long [s].
STAYS = 1.0
GOAL = PointingGoal(np.array([1.5, 0.1, 0.3]))


class Episode:
    """One run, from a seed."""

    def __init__(self, seed: int) -> None:
        """Draw wire, controller and what happens."""
        rng = self._rng = np.random.default_rng(seed)
        self.found = Found(seed)
        delay = float(rng.choice([0.01, 0.02]))
        lag = float(rng.choice([0.0, 0.004]))
        case = Case(stop=str(rng.choice(['4/40', '10/400'])), controller_delay=delay)
        separation = separation_of(case)
        # Hands go on for as long as they like: what bounds them is their greatest speed.
        bounded = replace(separation.rules, body_reach=())
        self._separation = replace(separation, rules=bounded)
        execution = ExecutionRules(self._separation, delay, bool(rng.random() < 0.2))
        rules = PlainRules(
            required=required(),
            stop_limits=self._separation.stop_limits,
            execution=execution,
        )
        wire = Wire(
            frame_period=1.0 / float(rng.choice([30, 60, 120])),
            age=(0.005, float(rng.uniform(0.01, 0.06))),
            loss=float(rng.choice([0.0, 0.05, 0.2])),
            doubled=float(rng.choice([0.0, 0.1])),
            transport=(0.0005, delay - lag - 0.0005),
            deciding=(0.0002, float(rng.choice([0.0015, 0.006]))),
            hesitating=float(rng.choice([0.0, 0.02])),
        )
        self._person = Person(rng, self._aim)
        # When hands of others are seen for the first time [s].
        self._seen_from = BEGIN + rng.uniform(1.0, CHAOS - 2.0, len(self._person.others))
        version = ControllerVersion(str(rng.choice(['4.20', '4.42', '6.9'])))
        controller = ControllerRules(version=version)
        self.world = World(
            rules,
            self._person,
            FOLDED,
            int(rng.integers(2**31)),
            wire,
            controller=controller,
            lag=lag,
        )
        self.judge = Judge(self.world, self.found)
        self._is_calm = False

    def run(self) -> Found:
        """Run it to its end, and judge."""
        world, monitor = self.world, self.world.monitor
        world.hidden = frozenset(self._person.names[2:])
        world.timeline.after(0.2, self._want)
        world.timeline.every(world.arm.controller.period, self._move_hands)
        world.timeline.run(BEGIN + CHAOS)
        self._is_calm = True
        self._person.hand.leave(world.timeline.now)
        world.hidden = frozenset()
        world.stands_until = world.fails_until = world.blind_until = -math.inf
        world.rejects_until = -math.inf
        world.wire = replace(world.wire, loss=0.0, hesitating=0.0)
        # The hand goes away, and what was moving comes to rest.
        world.timeline.run(BEGIN + CHAOS + CALM)
        self._judge_end()
        self.judge.judge_curve(self._person)
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
        elif what < 0.73:
            self._fail('cancelled', is_fault=False)
        elif what < 0.75:
            self._fail('an error', is_fault=True)
        elif what < 0.78:
            self._miss_stop()
        elif what < 0.82:
            world.stands_until = now + float(rng.uniform(0.01, 0.4))
        elif what < 0.85:
            world.fails_until = now + float(rng.uniform(0.01, 0.2))
            if rng.random() < 0.5:
                self._fail('cancelled', is_fault=False)
        elif what < 0.88:
            world.blind_until = now + float(rng.uniform(0.05, 0.6))
        elif what < 0.91:
            world.hidden |= {'hand'}
            world.timeline.after(float(rng.uniform(0.05, 2.5)), self._show)
        elif what < 0.93:
            self._reject(now + float(rng.uniform(0.005, 0.1)))
        elif what < 0.96:
            self.judge.expect_stop('the clock stands still')
            world.take(ClockStepped(world.moment(), 0.0, 'the clock stands still'))
        else:
            world.take(StopsTaken(world.moment()))
        world.timeline.after(float(rng.uniform(*PAUSE)), self._want)

    def _fail(self, why: str, is_fault: bool) -> None:
        if self.world.is_still:
            return
        self.judge.expect_stop(why)
        self.judge.is_faulty |= is_fault and self.world.monitor.watch.running is not None
        self.world.monitor.fail(why, is_replanned=False, is_fault=is_fault)

    def _miss_stop(self) -> None:
        """Have the arm be stopped, and the controller miss that."""
        if not self._is_calm and not self.world.is_still:
            self._reject(self.world.timeline.now + float(self._rng.uniform(0.02, 0.1)))
            self._fail('cancelled', is_fault=False)

    def _reset(self) -> None:
        self.judge.is_faulty = False
        self.world.take(Reset(self.world.moment()))

    def _reject(self, until: float) -> None:
        self.world.rejects_until = until
        self.judge.reject(until)

    def _show(self) -> None:
        self.world.hidden -= {'hand'}

    def _move_hands(self) -> None:
        world, person = self.world, self._person
        now, is_whole = world.timeline.now, world.monitor.watch.commitments.is_whole
        if not self._is_calm:
            person.hand.go_on(now)
        others = zip(person.names[2:], person.others, self._seen_from, strict=True)
        for name, hand, since in others:
            # Where the arm was given the whole rest of its motion, that matters most.
            if now >= since and is_whole and name in world.hidden:
                world.hidden -= {name}
                hand.leave(now + STAYS)

    def _aim(self, flight: float) -> Array:
        """Return some place of the arm after a time [s], as it is planned now, (3,) [m]."""
        world, arm = self.world, the_arm()
        planned = world.monitor.watch.commitments.planned
        if planned is None:
            q = self.judge.states[-1].positions if self.judge.states else FOLDED
        else:
            then = world.timeline.now + flight - planned.start_time
            phase = min(max(then, 0.0), planned.trajectory.duration)
            q = positions_at(planned.trajectory, [phase])[0]
        ends = moving_bars(arm, q[None], np.zeros((1, arm.dof)))[0][0]
        # The last bars are the fastest.
        return np.asarray(ends[-1].mean(axis=0))

    def _move(self) -> None:
        world, monitor = self.world, self.world.monitor
        now = world.timeline.now
        if world.is_still or not world.scene.boxes or world.reading is None:
            return
        is_reset = self._rng.random()
        if is_reset < (0.5 if monitor.watch.commitments.fault else 0.1):
            self._reset()
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
            motion = Trajectory(
                *(np.array(x) for x in ([0.0, 1.2], [q, end], [v, still], [a, still]))
            )
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
        begin = world.timeline.now + ahead(world.rules.execution.controller_delay)
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
        watch = world.monitor.watch
        counts = watch.n_stops, watch.n_faults
        event = Begin(world.moment(), planned, GOAL, world.rules, joins, planned_from, *counts)
        self.judge.is_beginning = True
        try:
            world.monitor.begin(event)
        except (RequestError, RrthError, ConnectionError):
            return False
        finally:
            self.judge.is_beginning = False
        self.judge.begun()
        if not self._is_calm and self._rng.random() < MISSES:
            world.timeline.after(float(self._rng.uniform(0.1, 0.4)), self._miss_stop)
        return True

    def _judge_end(self) -> None:
        """Judge whether the arm rests, and moves again if it is asked to."""
        world, watch = self.world, self.world.monitor.watch
        if watch.state is MonitorState.STOPPING and not watch.is_held and not watch.stops:
            self.judge.blame('it stops for ever')
        if watch.pending is not None:
            self.judge.blame('a stop is pending for ever')
        self.judge.has_ended = True
        self._reset()
        for _ in range(3):
            if not watch.is_active(world.timeline.now):
                break
            world.monitor.fail('of the judge', is_replanned=False, is_fault=False)
            world.timeline.run(world.timeline.now + 3.0)
            watch = world.monitor.watch
        q = self.judge.states[-1].positions
        if np.abs(self.judge.states[-1].velocities).max() > 1e-9:
            self.judge.blame('the arm never rests')
            return
        command = watch.tracked.command
        if command is not None:
            # As a request: a rest that is a little aside, after a message that was missed, is not
            # noticed, and the controller holds what it is taken to hold.
            q = command.trajectory.positions[-1]
        ends = [np.clip(q + way, *the_arm().bounds) for way in (0.05, -0.05)]
        # Where the torso is in both ways nothing is asked but that the motion begins.
        free = [end for end in ends if self._is_way_free(q, end)]
        before, end = self.found.n_begun, (free or ends)[0]
        motion = parameterize(Path(np.array([q, end])), (), self._separation.limits)
        for _ in range(40):
            begin = world.timeline.now + ahead(world.rules.execution.controller_delay)
            if self._begin(motion, begin, math.inf, None):
                break
            world.timeline.run(world.timeline.now + 0.1)
        world.timeline.run(world.timeline.now + 3.0)
        arrived = self.judge.states[-1].positions
        if self.found.n_begun == before:
            self.judge.blame('no motion begins any more')
        elif free and np.abs(arrived - end).max() > 1e-3:
            self.judge.blame('a motion in the free does not arrive')

    def _is_way_free(self, begin: Array, end: Array) -> bool:
        """Return whether the arm and its ray are free of the wearer from begin to end, (dof,)."""
        return arm_world(the_arm(), self.world.scene, MARGIN, RAY).is_edge_valid(begin, end)
