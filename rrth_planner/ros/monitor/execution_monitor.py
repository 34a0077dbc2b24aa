# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The monitor in the node: messages and clocks become events, decisions become messages.

It fails closed: any error ends in a fail-safe stop by what was known before it.
"""

from collections.abc import Callable
from contextlib import suppress
import math
from threading import RLock
import time
import traceback

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rrth_planner.execution.clock_watch import ClockWatch, watch_clock
from rrth_planner.execution.decision import Command, Decision, Line
from rrth_planner.execution.event import (
    Begin,
    BodyCame,
    ClockStepped,
    Event,
    Fail,
    Hold,
    Look,
    Moment,
    NobodyListens,
    Reset,
    Rest,
    Sight,
    StopsTaken,
    Tick,
)
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.fail_safe_stop import pending
from rrth_planner.execution.flight_recorder import FlightRecorder
from rrth_planner.execution.remaining_motion import is_ray_clear
from rrth_planner.execution.step import Fate, following, Step, step_of
from rrth_planner.execution.watch import Level, MonitorRules, MonitorState, Stop, Watch
from rrth_planner.model.errors import one_line, RequestError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.model.status import ErrorCode
from rrth_planner.ros.interface.inputs import Inputs
from rrth_planner.ros.interface.parameters import NEVER
from rrth_planner.ros.interface.publishers import PlanPublishers
from rrth_planner.ros.interface.reporter import Reporter
from rrth_planner.ros.messages.body import scene_of, WearerBody

# Period of the checks of the inputs and of the commanded motion [s].
CHECK_PERIOD = 0.02
# Clocks are read at once where that takes no longer [s].
AT_ONCE = 1e-3


class ExecutionMonitor:
    """
    Stops the arm when its remaining motion is no longer proven free of the wearer.

    What is decided is `execution.decide`'s. A decision is published first, then kept, then
    reported. A stop that could not be published is tried again; meanwhile liveliness is not
    asserted, so that an arm that supervises it stops by itself.
    """

    def __init__(
        self, node: Node, inputs: Inputs, reporter: Reporter, publishers: PlanPublishers
    ) -> None:
        """Begin with no motion."""
        self._node, self._inputs, self._reporter = node, inputs, reporter
        self._publishers = publishers
        # All calls come from the node's own thread, but `close` may come from another one.
        self._lock, self._is_closed = RLock(), False
        self._watch = Watch(rules=reporter.parameters, motion_topic=publishers.motion_topic)
        self.flight = FlightRecorder()
        # The last body that the watch has seen.
        self._seen: WearerBody | None = None
        # The node's clock beside the steady one.
        self._clocks: ClockWatch | None = None
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(CHECK_PERIOD, self.check, clock=steady)

    @property
    def watch(self) -> Watch:
        """What is known of what the arm was given, and of what became of that."""
        return self._watch

    def begin(
        self,
        planned: ExecutingMotion,
        goal: PointingGoal,
        parameters: MonitorRules,
        n_stops: int,
        n_faults: int,
        publish: Callable[[], None] = lambda: None,
        joins: float | None = math.inf,
        planned_from: ExecutingMotion | None = None,
    ) -> None:
        """
        Publish a motion, and monitor it with the parameters of its plan.

        It is checked with the next body: called in the node's own thread right after revalidation.
        With separation the controller is given the first commitment of it; raise RequestError
        where it cannot begin. Parameters are those of `execution.event.Begin`.

        Parameters
        ----------
        publish : callable
            Publishes the planned motion for those who want to see it.

        """
        with self._lock:
            if self._is_closed:
                raise RequestError(ErrorCode.PREEMPTED, 'the planner is shutting down')
            self._check_clock()
            at, counts = self._moment(), (n_stops, n_faults)
            event = Begin(at, planned, goal, parameters, joins, planned_from, *counts)

            def send(command: Command) -> None:
                publish()
                self._publish(command)

            before = self._watch
            step = self._stepped(event, lambda: 0.0, send)
            # From here on the arm moves: an error must stop it.
            self._run_fail_safe(lambda: self._report(before, step.decision, 0.0))
            with suppress(Exception):
                if not self._watch.is_doubted and not self._publishers.has_listener():
                    self._take(lambda: NobodyListens(self._moment()))

    def on_body(self, body: WearerBody, arrived: int, is_newest: bool = True) -> None:
        """
        Check the remaining motion against a body that arrived at a time [ns].

        Of bodies that came together the newest is checked; all of them say how fast parts are.
        """
        sights: list[Sight] = []

        def came() -> BodyCame:
            at = self._moment()
            if body is not self._seen and at.rules.execution.separation is not None:
                parts = (*body.parts, *body.lost)
                measured = np.array([part.measured for _, part in parts for _ in part.boxes])
                sights.append(Sight(scene_of(body), measured))
            look = self._look(body, at) if is_newest else None
            return BodyCame(at, sights[0] if sights else None, look)

        def check() -> None:
            self._check_clock()
            self._take(came, arrived)
            self._seen = None if self._reporter.parameters.execution.separation is None else body
            if sights and self._watch.commitments.body is not None:
                with suppress(Exception):
                    self._reporter.body_observed(self._watch.commitments.body)

        self._run_fail_safe(check)

    def check_clock(self) -> None:
        """Stop the arm where the node's clock has stepped; called before a message is read."""
        self._run_fail_safe(self._check_clock)

    def fail(self, why: str, is_replanned: bool = True) -> None:
        """
        Stop the arm, if it moves, because of a failure.

        Parameters
        ----------
        is_replanned : bool
            Whether to plan again once the arm is at rest: not after an error, which would recur.

        """
        with self._lock:
            self._fail(why, is_replanned, is_fault=not is_replanned)

    def brake(self, why: str) -> None:
        """Stop the arm, if it moves, because it is no longer wanted to arrive."""
        with self._lock:
            self._fail(why, is_replanned=False, is_fault=False)

    def hold(self, until: float) -> ExecutingMotion | None:
        """
        Return what the arm is commanded, which does not change until a time [s].

        A handover is planned from it; also the last motion after its end, since the controller
        holds that. Without separation it is the whole motion anyway. None: it is not known.
        """
        self._run_fail_safe(lambda: self._take(lambda: Hold(self._moment(), until)))
        return self._watch.tracked.command

    def take_stops(self) -> list[Stop]:
        """Return the stops published since the last call."""
        stops = list(self._watch.stops)
        if stops:
            self._run_fail_safe(lambda: self._take(lambda: StopsTaken(self._moment())))
        return stops

    def reset(self) -> str:
        """
        Allow motions again after a fault, with separation; return what it was.

        A motion that waits for that goes on: also one that was stopped and is planned anew.
        """
        fault = self._watch.commitments.fault
        self._run_fail_safe(lambda: self._take(lambda: Reset(self._moment())))
        return fault

    def report_hold(self, why: str) -> None:
        """Report that the arm stays where it came to rest."""
        self._run_fail_safe(lambda: self._take(lambda: Rest(self._moment(), why)))

    def close(self) -> None:
        """Stop the arm, which is no longer monitored, and end monitoring."""
        with self._lock:
            self._is_closed = True
            if self._node.context.ok():
                self.fail('the planner is shutting down', is_replanned=False)
                if self._watch.state is MonitorState.STOPPING:
                    self._publishers.flush()
            watch = self._watch
            self._watch = Watch(rules=watch.rules, motion_topic=watch.motion_topic)

    def _run_fail_safe(self, check: Callable[[], None]) -> None:
        """Run a check; an error in it ends in a stop."""
        try:
            with self._lock:
                check()
        except Exception as problem:
            try:
                self.fail(f'the monitor failed, {_named(problem)}', is_replanned=False)
            finally:
                with suppress(Exception):
                    self._node.get_logger().error(''.join(traceback.format_exception(problem)))

    def _take(
        self,
        happens: Callable[[], Event],
        arrived: int | None = None,
        published: float | None = None,
    ) -> None:
        """
        Take what happens, report it, and take what follows.

        arrived: when the body came that it is about [ns]; published: how long after its cause the
        stop was that it is about [s].
        """
        # What it takes to see what is known counts, too: a commitment begins by that time.
        begun, before = time.perf_counter(), self._watch
        step = self._stepped(happens(), lambda: time.perf_counter() - begun, self._publish)
        decision = step.decision
        if decision.is_stop:
            # An error in the report must not undo the stop.
            with suppress(Exception):
                published = self._waited(before, decision, step.took, arrived)
                self._report(before, decision, published)
        else:
            self._report(before, decision, step.took if published is None else published)
        for then in following(
            step,
            self._moment,
            lambda at: self._look(self._inputs.body.value, at),
            lambda: 0.0 if arrived is None else self._elapsed(arrived),
        ):
            self._take(then, arrived, published)

    def _stepped(
        self, event: Event, took: Callable[[], float], publish: Callable[[Command], None]
    ) -> Step:
        """Publish what is decided about an event, keep it, and remember it."""
        before, fate, published = self._watch, Fate.NONE, None
        try:
            step = step_of(before, event, took, publish)
            self._watch = step.decision.watch
            fate, published = step.fate, step.published
        finally:
            self._remember(before, event, fate, published)
        return step

    def _remember(self, watch: Watch, event: Event, fate: Fate, command: Command | None) -> None:
        # What cannot be recorded is decided all the same.
        with suppress(Exception):
            self.flight.record(watch, event, fate, command)

    def _waited(
        self, before: Watch, decision: Decision, took: float, arrived: int | None
    ) -> float:
        """Return how long after its cause a stop was published [s]."""
        if arrived is not None:
            return self._elapsed(arrived)
        since = before.pending or decision.watch.pending
        return took if since is None else time.monotonic() - since.since

    def _fail(self, why: str, is_replanned: bool, is_fault: bool) -> None:
        """Stop the arm, if it moves; a stop that cannot be decided or published is tried again."""
        event = Fail(self._moment_of_failure(), why, is_replanned, is_fault)
        before = self._watch
        try:
            self._take(lambda: event)
        except Exception:
            if self._watch is before:
                self._watch = pending(before, event)
                self._remember(before, event, Fate.PENDING, None)
            with suppress(Exception):
                self._node.get_logger().error(traceback.format_exc())

    def _publish(self, command: Command) -> None:
        motion = command.motion.trajectory
        self._publishers.publish_motion(motion, command.rules, command.begin)

    def _report(self, before: Watch, decision: Decision, took: float) -> None:
        """Report what was decided in so long a time [s]: diagnostics, `~/state` and log."""
        watch, reporter = decision.watch, self._reporter
        if decision.is_stop:
            reporter.stop_published(took)
        if decision.age is not None:
            reporter.body_used(decision.age)
        if decision.is_free:
            reporter.remaining_motion_checked(took)
        if decision.command is not None and decision.command.within < math.inf:
            reporter.commitment_published(took)
        if (watch.state, watch.sentence, watch.level) != (
            before.state,
            before.sentence,
            before.level,
        ):
            reporter.monitor_state = (watch.state.value, watch.sentence)
            reporter.monitor_level = bytes([watch.level])
            reporter.publish_soon()
        if watch.unfollowed is not before.unfollowed:
            level, sentence = watch.unfollowed
            reporter.unfollowed(bytes([level]), sentence)
        if watch.separation is not before.separation:
            reporter.separation_status(watch.separation)
        for line in decision.lines:
            self._log(line, took)

    def _log(self, line: Line, took: float) -> None:
        text = f'{line.text}; published after {1e3 * took:.2f} ms' if line.is_timed else line.text
        # Two calls: rclpy raises where one line of code logs at changing severities.
        if line.level is Level.ERROR:
            self._node.get_logger().error(text)
        else:
            self._node.get_logger().warning(text)

    def check(self) -> None:
        """Run the periodic checks, and assert liveliness."""
        self._run_fail_safe(self._check_periodically)

    def _check_periodically(self) -> None:
        self._check_clock()
        self._take(lambda: Tick(self._moment()))
        if self._watch.pending is None:
            self._publishers.assert_liveliness()
        if self._reporter.parameters.separates != NEVER:
            self._publishers.publish_ray_clear(self._is_ray_clear())

    def _check_clock(self) -> None:
        before = time.monotonic()
        now = self._node.get_clock().now().nanoseconds / NANOSECONDS
        after = time.monotonic()
        if after - before > AT_ONCE:
            return
        is_simulated = self._node.get_parameter('use_sim_time').value
        steady = 0.5 * (before + after)
        self._clocks, found = watch_clock(self._clocks, now, steady, is_simulated)
        if found is not None:
            # How old things are does not change by a step.
            self._inputs.shift(found.step)
            step, sentence = found.step, found.sentence
            self._take(lambda: ClockStepped(self._moment(), step, sentence))

    def _moment(self) -> Moment:
        """Return the present, with what is known now."""
        now, steady = self._now(), time.monotonic()
        rules, overdue = self._reporter.parameters, ''
        if self._watch.running is not None:
            try:
                self._inputs.require_fresh(now, rules)
            except RequestError as problem:
                overdue = str(problem)
        return Moment(
            now=now,
            steady=steady,
            reading=self._inputs.joints.value,
            rules=rules,
            overdue=overdue,
        )

    def _moment_of_failure(self) -> Moment:
        """Return the present with as little as possible: whatever failed may fail again."""
        rules = self._watch.rules
        with suppress(Exception):
            rules = self._reporter.parameters
        reading = self._inputs.joints.value
        return Moment(now=self._now(), steady=time.monotonic(), reading=reading, rules=rules)

    def _look(self, body: WearerBody, at: Moment) -> Look | None:
        """Return the wearer beside the running motion; None: there is none."""
        if self._watch.running is None:
            return None
        age, expected = self._inputs.body.age(at.now), self._inputs.expected_scene()
        return Look(scene_of(body.at(at.now)), expected, age)

    def _is_ray_clear(self) -> bool:
        """Return whether the pointing ray is known to be clear of the wearer."""
        parameters, now = self._reporter.parameters, self._now()
        if parameters.execution.separation is None:
            # Where a wearer is who was described once is not known either.
            return False
        try:
            # Where a part is that was lost is not known.
            body = self._inputs.body_at(now, parameters)
            q = self._inputs.joints_at(now, parameters.joint_timeout).positions
        except RequestError:
            return False
        return is_ray_clear(q, parameters.required, scene_of(body))

    def _elapsed(self, arrived: int) -> float:
        """Return the time since the arrival of a body [ns -> s]."""
        return (time.time_ns() - arrived) / NANOSECONDS

    def _now(self) -> float:
        return self._node.get_clock().now().nanoseconds / NANOSECONDS


def _named(problem: Exception) -> str:
    return one_line(f'{type(problem).__name__}: {problem}')
