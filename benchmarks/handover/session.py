# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The planner's own monitor and requests, a controller and a lagging arm, in virtual time.

A body comes 30 times, joint states 100 times a second; the monitor's timer runs as in the node. A
message needs its transport to the controller, which takes it in the next cycle. A plan takes some
time that is drawn; meanwhile everything else goes on. The clocks count from 1970, as those of
machines do, and the controller's time is exact to the nanosecond, as in a message.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
import heapq
import itertools
import math
import time
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from rclpy.node import Node
from rrth_planner.execution.command import ahead
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import Separation, SeparationRules
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.host import BlockingHost, completed
from rrth_planner.pipeline.in_process_planner import InProcessPlanner
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.requests.outcome import Outcome
from rrth_planner.requests.plan_request import plan_request
from rrth_planner.requests.revalidation import Revalidation
from rrth_planner.ros.interface.inputs import Inputs
from rrth_planner.ros.interface.parameters import (
    declared,
    parameters_from_values,
    PlannerParameters,
)
from rrth_planner.ros.interface.publishers import PlanPublishers
from rrth_planner.ros.interface.reporter import Reporter
from rrth_planner.ros.messages.body import WearerBody
from rrth_planner.ros.messages.controller_points import controller_points_from_msg
from rrth_planner.ros.messages.marker_edits import BodyPart
from rrth_planner.ros.messages.trajectory import joint_trajectory_to_msg
from rrth_planner.ros.monitor.execution_monitor import ExecutionMonitor
from rrth_planner.simulation.lagging_arm import LaggingArm
from rrth_planner.simulation.trajectory_controller import (
    Command,
    commanded_state,
    ControllerRules,
    ControllerVersion,
    TimedPoints,
)

from benchmarks.common.random_draws import random_target
from benchmarks.handover.judge import BEGIN, EXTENSION, HANDOVER, Join, Judge, STOP
from benchmarks.separation.setting import FOLDED, the_arm

# When virtual time begins, since 1970 [s].
EPOCH = 1_800_000_000
# Periods of bodies, joint states and the monitor's timer; how old a body is that comes [s].
BODIES, JOINTS, TIMER, BODY_AGE = 1 / 30, 0.01, 0.02, 0.02
# A body is late by so much, of so many; a part of them does not come at all [s].
LATE_BODY, LOST_BODIES = 0.02, 0.03
# How long a plan takes, mostly, and where that is too long for the first try; where it is the
# second one. Shorter ones would have to be waited for in real time [s].
PLANNING, LONG, SECOND = (0.024, 0.045), (0.055, 0.07), (0.12, 0.15)
OFTEN_LONG = 0.1
# After how long a motion is replaced [s].
LATER = (0.05, 0.7)
# A session that sees nothing new for so long is over [s].
PATIENCE = 30.0
# The share of what replaces a motion that is a stop; the least share of handovers and stops.
STOPS, OTHERS = 0.35, 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """
    A controller and an arm, as the planner knows them.

    Parameters
    ----------
    version : ControllerVersion
    rate : float
        Of the controller [Hz].
    lag, transport : float
        Of the arm behind its command, and the longest way of a message [s]; `controller_delay` is
        their sum.
    is_separated : bool
        Whether motions are proven separate from the wearer.
    is_from_desired : bool
        `interpolate_from_desired_state`.

    """

    version: ControllerVersion
    rate: float
    lag: float
    transport: float
    is_separated: bool
    is_from_desired: bool = True


def joins_of(case: Case, n: int, seed: int) -> list[Join]:
    """Return what was seen of at least n handovers, extensions and stops."""
    return _Session(case, seed).run(n)


def joins_of_item(n: int, item: tuple[Case, int]) -> list[Join]:
    """Return `joins_of` a case and a seed, for a process of its own."""
    return joins_of(item[0], n, item[1])


@cache
def _parameters() -> PlannerParameters:
    arm = the_arm()
    return parameters_from_values({s.name: s.default for s in declared(arm.dof)}, arm)


def _parameters_of(case: Case) -> PlannerParameters:
    given, delay = _parameters(), case.lag + case.transport
    if not case.is_separated:
        return replace(
            given,
            execution=ExecutionRules(None, delay, False),
            body_timeout=0.0,
            joint_timeout=0.0,
            replan=False,
        )
    separation = Separation(
        arm=given.arm,
        rules=SeparationRules(controller_delay=delay),
        margin=given.margin,
        limits=given.limits,
        stop_limits=given.stop_limits,
    )
    return replace(
        given,
        execution=ExecutionRules(separation, delay, False),
        body_timeout=0.2,
        joint_timeout=0.2,
        replan=False,
    )


class _Planner(InProcessPlanner):
    """Plans, and lets virtual time pass meanwhile."""

    def __init__(self, passed: Callable[[float], None], rng: np.random.Generator) -> None:
        self._passed, self._rng = passed, rng
        self.n_tries = 0

    def plan(
        self, question: PlanQuestion, should_stop: Callable[[], bool] = lambda: False
    ) -> MotionPlan:
        """Return the plan, after a time that is drawn."""
        plan = super().plan(question)
        span = PLANNING if self._rng.random() > OFTEN_LONG else LONG
        self._passed(float(self._rng.uniform(*(SECOND if self.n_tries else span))))
        self.n_tries += 1
        return plan


class _Reporter:
    """Reports to nobody."""

    def __init__(self, parameters: PlannerParameters) -> None:
        self.parameters, self.monitor_state = parameters, ('', '')

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *_: None


class _Session:
    """One arm from its first motion on."""

    def __init__(self, case: Case, seed: int) -> None:
        self._case, self._rng = case, np.random.default_rng(seed)
        self._parameters = _parameters_of(case)
        self._arm = LaggingArm(
            FOLDED,
            1.0 / case.rate,
            case.lag,
            ControllerRules(version=case.version, is_from_desired=case.is_from_desired),
            float(self._rng.uniform(0.0, 0.02)),
        )
        self._judge = Judge(1.0 / case.rate, self._parameters.limits)
        self._scene = load_body() if case.is_separated else _nobody()
        self._differences = self._rng.random() < 0.5
        self.now = 0.0
        # What happens next: when [s], in which order, and what.
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        # What is on its way to the controller: kind, points, stamp, and when it comes [s].
        self._sent: list[tuple[float, str, TimedPoints, float]] = []
        # What a message on its way is, and what the controller executes.
        self._kind, self._published, self._waiting = BEGIN, 0, BEGIN
        self._inputs = Inputs('body', 'target', 'joints')
        reporter = cast(Reporter, _Reporter(self._parameters))
        publishers = cast(
            PlanPublishers,
            SimpleNamespace(
                publish_motion=self._send,
                assert_liveliness=lambda: None,
                publish_ray_clear=lambda _: None,
                flush=lambda: None,
                motion_topic='joint_trajectory',
                has_listener=lambda: True,
            ),
        )
        self._timer: Callable[[], None] = lambda: None
        self._monitor = ExecutionMonitor(self._node(), self._inputs, reporter, publishers)
        self._planner = _Planner(self._pass, self._rng)
        for period, act in (
            (BODIES, self._see),
            (JOINTS, self._read),
            (TIMER, lambda: self._timer()),
        ):
            self._repeat(period, act)
        self._see()
        self._read()

    def run(self, n: int) -> list[Join]:
        """Let motions be replaced until so many joins were seen, OTHERS of which no extensions."""
        seen, since = 0.0, self.now
        while seen < n and self.now - since < PATIENCE:
            self._replace()
            kinds = [join.kind for join in self._judge.joins]
            n_extended = kinds.count(EXTENSION)
            n_others = len(kinds) - n_extended - kinds.count(BEGIN)
            count = min(n_others + n_extended, n_others / OTHERS)
            if count > seen:
                seen, since = count, self.now
        return self._judge.joins

    def _node(self) -> Node:
        """Return what the monitor needs of a node."""

        def create_timer(period: float, act: Callable[[], None], clock: Any = None) -> None:
            self._timer = act

        def say(*_: Any, **__: Any) -> None:
            pass

        logger = SimpleNamespace(error=say, warning=say, info=say, debug=say)
        clock = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=self._nanoseconds()))
        return cast(
            Node,
            SimpleNamespace(
                create_timer=create_timer,
                get_clock=lambda: clock,
                get_logger=lambda: logger,
                # Virtual time has nothing to do with the steady clock.
                get_parameter=lambda _: SimpleNamespace(value=True),
                context=SimpleNamespace(ok=lambda: True),
            ),
        )

    def _nanoseconds(self) -> int:
        return EPOCH * NANOSECONDS + round(self.now * NANOSECONDS)

    def _clock(self) -> float:
        return self._nanoseconds() * 1e-9

    def _repeat(self, period: float, act: Callable[[], None]) -> None:
        """Have something done once in every period."""

        def again() -> None:
            self._schedule(self.now + period, again)
            act()

        self._schedule(self.now + float(self._rng.uniform(0.0, period)), again)

    def _schedule(self, when: float, act: Callable[[], None]) -> None:
        heapq.heappush(self._events, (when, next(self._order), act))

    def _pass(self, seconds: float) -> None:
        """Let time pass, with everything that happens meanwhile."""
        end = self.now + seconds
        while True:
            due = min(self._events[0][0], self._arm.time)
            if due > end:
                break
            self.now = max(self.now, due)
            if self._arm.time <= due:
                self._cycle()
            else:
                heapq.heappop(self._events)[2]()
        self.now = end

    def _cycle(self) -> None:
        """Run the controller once, with what has come for it."""
        arm, controller = self._arm, self._arm.controller
        while self._sent and self._sent[0][0] <= arm.time:
            _, self._waiting, points, stamp = self._sent.pop(0)
            arm.receive(points, stamp)
        before: Command = controller.command
        setpoint = arm.step()
        if controller.command is not before:
            former = commanded_state(before, arm.time)
            self._judge.replaced(self._waiting, setpoint.positions, former.positions)
        self._judge.commanded(setpoint.positions)

    def _send(self, trajectory: Trajectory, parameters: PlannerParameters, begin: float) -> None:
        """Send a message to the controller."""
        names = parameters.arm.joint_names
        msg = joint_trajectory_to_msg(trajectory, names, parameters.base_frame, begin)
        points = controller_points_from_msg(msg, names, self._clock())
        stamp = msg.header.stamp
        start = stamp.sec - EPOCH + stamp.nanosec / NANOSECONDS if stamp.sec else 0.0
        comes = self.now + float(self._rng.uniform(0.0, self._case.transport))
        if self._sent:
            comes = max(comes, self._sent[-1][0])
        self._sent.append((comes, self._kind, points, start))

    def _see(self) -> None:
        """Let a body come, or not."""
        if self._case.is_separated:
            draw = self._rng.random()
            if draw < LOST_BODIES:
                return
            if draw < 0.3:
                self._schedule(self.now + float(self._rng.uniform(0.0, LATE_BODY)), self._on_body)
                return
        self._on_body()

    def _on_body(self) -> None:
        now = self._clock()
        parts = tuple(
            ((box.name, 0), BodyPart((box,), measured=now - BODY_AGE)) for box in self._scene.boxes
        )
        body = WearerBody(parts)
        self._inputs.body.accept(lambda: body, now - BODY_AGE)
        n_stops, first = self._monitor.watch.n_stops, len(self._sent)
        self._kind = EXTENSION
        self._monitor.on_body(body, time.time_ns())
        if self._monitor.watch.n_stops > n_stops:
            self._sent[first:] = [(c, STOP, p, s) for c, _, p, s in self._sent[first:]]

    def _read(self) -> None:
        """Let a joint state come."""
        now, measured = self._clock(), self._arm.measured_at(self.now)
        reading = JointReading(measured.positions, measured.velocities, now, now, float('inf'))
        before = self._inputs.joints.value
        if self._differences and before is not None and now > before.taken:
            rates = (measured.positions - before.positions) / (now - before.taken)
            reading = replace(reading, velocities=rates)
        self._inputs.joints.accept(lambda: reading, now)

    def _replace(self) -> None:
        """Have the running motion replaced, or a first one begin."""
        monitor = self._monitor
        if monitor.watch.running is not None:
            self._pass(float(self._rng.uniform(*LATER)))
            if monitor.watch.is_monitoring and self._rng.random() < STOPS:
                self._kind = STOP
                monitor.brake('no longer wanted')
                # Sometimes another motion follows at once.
                self._pass(float(self._rng.choice([0.03, 0.2, 1.0])))
                return
        self._request()
        self._pass(float(self._rng.uniform(0.05, 0.3)))

    def _request(self) -> None:
        """Have a motion to a random target planned and published."""
        self._planner.n_tries = 0
        seed = int(self._rng.integers(2**31))
        completed(
            plan_request(
                BlockingHost(self._planner, self._clock, self._pass, self._clock),
                self._inputs,
                replace(self._parameters, seed=seed),
                lambda: False,
                self._publish,
                PointingGoal(random_target(self._rng)),
                self._monitor.hold,
            )
        )

    async def _publish(self, outcome: Outcome, revalidation: Revalidation) -> Outcome | None:
        """Publish a motion as `PlanQueue` does."""
        revalidation.require_fit()
        if revalidation.is_late():
            return None
        trajectory, plan, snapshot = outcome.trajectory, outcome.plan, outcome.snapshot
        assert trajectory is not None and plan is not None and snapshot is not None
        handover, parameters = outcome.handover, revalidation.parameters
        self._kind = BEGIN if handover is None else HANDOVER
        start = self._clock() + ahead(parameters.execution.controller_delay)
        self._monitor.begin(
            ExecutingMotion(
                trajectory=trajectory,
                start_time=start if handover is None else handover.time,
                target_distance=plan.target_distance,
                escape_time=plan.escape_time,
            ),
            snapshot.goal,
            parameters,
            *(self._monitor.watch.n_stops, self._monitor.watch.n_faults),
            joins=math.inf if handover is None else handover.joins,
            planned_from=None if handover is None else handover.before,
        )
        return outcome


def _nobody() -> Scene:
    """Return a box out of reach: without separation the wearer plays no part."""
    return Scene((Box('far', np.full(3, 30.0), np.full(3, 0.1), np.eye(3)),))
