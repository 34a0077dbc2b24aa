# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Check the remaining motion against each new body, since the wearer moves too.

It fails closed: any error during a check ends in a fail-safe stop.
"""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
import math
from threading import RLock
import time
import traceback

from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rrth_planner.collision.certificate import least_clearance
from rrth_planner.collision.separation import Blocked
from rrth_planner.collision.world import arm_world
from rrth_planner.execution import commitments as given
from rrth_planner.execution.clock_watch import ClockStep, ClockWatch, watch_clock
from rrth_planner.execution.command import (
    begin_of,
    continues,
    lead_in,
    led,
    rest_at,
    stop_along,
)
from rrth_planner.execution.commitments import Commitments
from rrth_planner.execution.executing_motion import ExecutingMotion, MAX_DEVIATION
from rrth_planner.execution.expected_wearer import is_expected_free
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.remaining_motion import (
    escapes_by_continuing,
    is_place_free,
    is_ray_clear,
    is_remaining_free,
)
from rrth_planner.execution.separation_status import SeparationState, SeparationStatus
from rrth_planner.execution.tracked_motion import (
    check_command,
    commands,
    find,
    forget_command,
    is_lost,
    is_over,
    missed_stop,
    shifted,
    track,
    track_next,
    track_nothing,
    track_previous,
    track_stop,
    track_stop_again,
    tracked_phase,
    TrackedMotion,
)
from rrth_planner.model.errors import one_line
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import part_of, Trajectory
from rrth_planner.ros.interface.inputs import Inputs, RequestError
from rrth_planner.ros.interface.parameters import MANUAL, NEVER, PlannerParameters
from rrth_planner.ros.interface.publishers import PlanPublishers
from rrth_planner.ros.interface.reporter import Reporter
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.error_codes import ErrorCode

# Period of the checks of the inputs and of the commanded motion [s].
PERIOD = 0.02
# A body that is checked later than this after its arrival causes a stop [s].
LONGEST_WAIT = 0.05
OFF_TRAJECTORY = (
    f'arm is > {MAX_DEVIATION:g} rad from the commanded trajectory: monitoring suspended'
)
# Why the arm is stopped for a body.
IN_THE_WAY = 'the remaining motion is not proven free of the wearer'
SOON_IN_THE_WAY = 'the wearer is about to move into the path of the arm'
NOT_SEPARATE = 'the remaining motion is no longer proven separate from the wearer'
# An arm off its motion may come nearer to the wearer than the margin, but not than this share.
MARGIN_LEFT = 0.5
# With separation it goes on for so long while the wearer is in the way further on [s].
PATIENCE = 0.3
# Why a whole motion is stopped that began beside a body that stands still.
STREAM_BEGAN = 'bodies come as a stream now: from here on motions are proven separate from it'
# Clocks are read at once where that takes no longer [s].
AT_ONCE = 1e-3
# So long after the clock was set no motion begins: what was measured before, and came after, is
# too young or too old [s].
SETTLING = 0.5
# Why a motion is given up.
TOO_NEAR = 'the wearer is too near for the motion to continue'
NOT_FOLLOWED = 'the arm is at rest off its motion, and does not follow it'
# So many motions one after the other that an arm ignores from their begin on are the last ones.
MOST_IGNORED = 3
# An arm that was reported to ignore a motion follows one where that has led it further [rad].
FOLLOWED = 0.02
# By whether the arm follows the last commanded motion.
SWITCHED = {
    False: 'arm ignored the last commanded motion: monitoring the previous one, which it follows',
    True: 'arm follows the last commanded motion again: monitoring it',
}


class MonitorState(Enum):
    """What the monitor is doing; the values appear in diagnostics."""

    IDLE = 'no motion'
    MONITORING = 'monitoring'
    STOPPING = 'stopping'
    HOLDING = 'holding'


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """
    A published fail-safe stop, for its second check and for replanning.

    Parameters
    ----------
    goal : PointingGoal or None
        Of the stopped motion.
    parameters : PlannerParameters
        Of the stopped motion.
    scene : Scene or None
        The wearer that the stop is proven free of; None: it is not.
    is_replanned : bool
        Whether to plan for the goal again once the arm is at rest.
    n_motions : int
        Number of motions commanded until then.

    """

    trajectory: Trajectory
    goal: PointingGoal | None
    parameters: PlannerParameters
    scene: Scene | None
    is_replanned: bool
    n_motions: int


class ExecutionMonitor:
    """
    Stops the arm when its remaining motion is no longer proven free of the wearer.

    So does any error during that check, a rejected or stale input, and a body that is checked too
    late. A stop that could not be published is tried again; meanwhile liveliness is not asserted,
    so that an arm that supervises it stops by itself.
    """

    def __init__(
        self, node: Node, inputs: Inputs, reporter: Reporter, publishers: PlanPublishers
    ) -> None:
        """Begin with no motion."""
        self._node, self._inputs, self._reporter = node, inputs, reporter
        self._publishers = publishers
        # All calls come from the node's own thread, but `close` may come from another one.
        self._lock, self._is_closed = RLock(), False
        self._tracked = TrackedMotion()
        self._commitments = Commitments()
        # The last body of which that took note.
        self._seen: WearerBody | None = None
        self._goal: PointingGoal | None = None
        self._state = MonitorState.IDLE
        # A motion planned before a stop must not follow it, nor a replanned motion another one.
        self.n_stops, self.n_motions = 0, 0
        # Nor may one planned before an error follow that.
        self.n_faults = 0
        # The reason of the last published stop, and of one that is still to be published; since
        # when [s], and whether to plan again after it.
        self.stop_reason = self.pending_stop = ''
        self._pending_since, self._is_replanned = 0.0, True
        # How many motions the arm has ignored from their begin on, one after the other; whether
        # it ignores the last one, and whether anything of that kind was reported since it has
        # followed one.
        self._n_ignored, self._is_ignored, self._is_doubted = 0, False, False
        # Whether the last motion was executed to its end.
        self.has_arrived = False
        # The level of the last stop, and whether the arm stays where that ends.
        self._stop_level, self._is_held = DiagnosticStatus.WARN, False
        # Of the plan: a margin that is changed later does not apply to its motion.
        self._parameters = reporter.parameters
        # Since when the wearer has been in the way of the running motion [s].
        self._in_the_way_since: float | None = None
        # A stop that was not published, since the commitment that comes to rest by itself is
        # proven and the stop is not: the motion that it ends.
        self._withheld_stop: ExecutingMotion | None = None
        self._stops: deque[Stop] = deque(maxlen=10)
        # The last stop, where the arm goes on after `reset` only.
        self._waiting: Stop | None = None
        # The node's clock beside the steady one; by that one, until when no motion begins [s], and
        # why.
        self._clocks: ClockWatch | None = None
        self._settled, self._unsettled_by = -math.inf, ''
        # Whether the next stop begins on reception: the controller's clock may not have stepped.
        self._is_unstamped = False
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD, self._on_timer, clock=steady)

    @property
    def running(self) -> ExecutingMotion | None:
        """The motion that the arm executes, as far as known."""
        return self._tracked.motion

    def begin(
        self,
        planned: ExecutingMotion,
        goal: PointingGoal,
        parameters: PlannerParameters,
        publish: Callable[[], None] = lambda: None,
        joins: float | None = math.inf,
        planned_from: ExecutingMotion | None = None,
    ) -> None:
        """
        Publish a motion, and monitor it with the parameters of its plan.

        It is checked with the next body: called in the node's own thread right after revalidation.
        With separation the controller is given the first commitment of it; raise RequestError
        where it cannot begin.

        Parameters
        ----------
        publish : callable
            Publishes the planned motion for those who want to see it.
        joins : float or None
            The time within what is commanded at which the motion begins [s]; inf: at rest. None:
            what is commanded until then is not known.
        planned_from : ExecutingMotion or None
            What was commanded when the motion was planned, where that counts.

        """
        with self._lock:
            if self._is_closed:
                raise RequestError(ErrorCode.PREEMPTED, 'the planner is shutting down')
            self._check_clock()
            if time.monotonic() < self._settled:
                raise RequestError(
                    ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                    f'{self._unsettled_by} less than {SETTLING:g} s ago: the ages of body and '
                    'joints are not known yet',
                )
            before = self._tracked, self._parameters, self._goal, self._state
            commitments = self._commitments
            try:
                if planned_from is not None and planned_from is not self._tracked.command:
                    raise RequestError(
                        ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                        'the arm was commanded something else while its motion was planned',
                    )
                now, delay = self._now(), parameters.controller_delay
                lead = self._lead_in(planned, joins, now, delay)
                commanded = self._begin_commitments(planned, parameters, lead)
                reading, rest_speed = self._inputs.joints.value, parameters.rest_speed
                self._tracked = track(self._tracked, commanded, reading, now, delay, rest_speed)
                self._parameters, self._goal = parameters, goal
                self._state, self._in_the_way_since = MonitorState.MONITORING, None
                publish()
                self._publishers.publish_motion(
                    commanded.trajectory, parameters, commanded.start_time
                )
            except Exception:
                self._tracked, self._parameters, self._goal, self._state = before
                self._commitments = commitments
                raise
            self.n_motions += 1
            self._withheld_stop, self._is_unstamped = None, False
            self._is_ignored = self.has_arrived = self._is_held = False
            self._waiting = None
            # From here on the arm moves: an error must stop it.
            self._run_fail_safe(lambda: self._set_state(MonitorState.MONITORING, ''))
            with suppress(Exception):
                self._require_listener()

    def _begin_commitments(
        self, planned: ExecutingMotion, parameters: PlannerParameters, lead: Trajectory
    ) -> ExecutingMotion:
        """
        Return the first commitment of a motion, to be published; without separation all of it.

        lead: what is commanded before that. Raise RequestError where it cannot begin.
        """
        if parameters.separation is None:
            commanded = led(lead, planned)
            self._commitments = given.end(self._commitments)
            return commanded
        if self._commitments.fault:
            raise RequestError(
                ErrorCode.FAILURE,
                'after an error the planner does not move the arm until ~/reset: '
                f'{self._commitments.fault}',
            )
        if self._commitments.body is None:
            raise RequestError(
                ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA, 'no body yet, expected one for separation'
            )
        found = given.begin(self._commitments, planned, parameters.execution, lead)
        if isinstance(found, Blocked):
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f'the motion cannot begin: if {found.box} moves, {found.bar} is not proven '
                f'separate from it {found.time:.2f} s after the start',
            )
        self._commitments = found
        assert found.sent is not None
        with suppress(Exception):
            rate = given.rate_at(found, found.sent.commitment.start_time)
            self._reporter.separation_status(given.status_of(None, rate, False))
        return found.sent.motion

    def _lead_in(
        self, planned: ExecutingMotion, joins: float | None, now: float, delay: float
    ) -> Trajectory:
        """Return what is commanded from a little before now until a motion begins."""
        command, left = self._tracked.command, planned.start_time - begin_of(now, delay)
        if joins is None or planned.start_time <= now:
            return rest_at(planned.trajectory, 0.0)
        if command is None and math.isinf(joins):
            return rest_at(planned.trajectory, left)
        if command is None:
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                'what the arm is commanded is not known any more, expected the motion that it '
                'was planned from',
            )
        # The last instants before a rest may still be commanded.
        at = planned.start_time - command.start_time if math.isinf(joins) else joins
        lead = lead_in(command.trajectory, at - left, at)
        if math.isinf(joins) and not continues(lead, planned.trajectory):
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                'the arm is not commanded to rest where its motion begins',
            )
        return lead

    def close(self) -> None:
        """Stop the arm, which is no longer monitored, and end monitoring."""
        with self._lock:
            self._is_closed = True
            if self._node.context.ok():
                self.fail('the planner is shutting down', is_replanned=False)
                if self._state is MonitorState.STOPPING:
                    self._publishers.flush()
            self._tracked = track_nothing(self._tracked)
            self._commitments = given.end(self._commitments)
            self._state = MonitorState.IDLE

    def _stop_of(self, running: ExecutingMotion, phase: float, now: float) -> ExecutingMotion:
        """
        Return the fail-safe stop of a motion.

        What is commanded counts, not where an arm that lags behind is; unless it executes the
        motion more slowly than commanded: then it stops from its phase [s].
        """
        if self._commitments.is_active or commands(
            self._tracked, running, self._inputs.joints.value
        ):
            phase = now - running.start_time
        parameters = self._parameters
        return stop_along(
            running,
            phase,
            now,
            parameters.stop_limits,
            parameters.controller_delay,
            self._is_unstamped,
        )

    def on_body(self, body: WearerBody, arrived: int, is_newest: bool = True) -> None:
        """
        Check the remaining motion against a body that arrived at a time [ns].

        Of bodies that came together the newest is checked; all of them say how fast parts are.
        """

        def check() -> None:
            self._check_clock()
            self._observe(body)
            if is_newest:
                self._check_remaining_motion(body, arrived)

        self._run_fail_safe(check)

    def _observe(self, body: WearerBody) -> None:
        """Take note of a body that came now; the lock is held."""
        separation = self._reporter.parameters.separation
        if separation is None:
            self._commitments, self._seen = replace(self._commitments, body=None), None
        elif body is not self._seen:
            parts = (*body.parts, *body.lost)
            measured = np.array([part.measured for _, part in parts for _ in part.boxes])
            found = given.observe(
                self._commitments, scene_of(body), measured, separation, self._now()
            )
            self._commitments, self._seen = found, body
            with suppress(Exception):
                assert found.body is not None
                self._reporter.body_observed(found.body)

    def check_clock(self) -> None:
        """Stop the arm where the node's clock has stepped; called before a message is read."""
        self._run_fail_safe(self._check_clock)

    def _check_clock(self) -> None:
        before = time.monotonic()
        now = self._node.get_clock().now().nanoseconds * 1e-9
        after = time.monotonic()
        if after - before > AT_ONCE:
            return
        is_simulated = self._node.get_parameter('use_sim_time').value
        steady = 0.5 * (before + after)
        self._clocks, found = watch_clock(self._clocks, now, steady, is_simulated)
        if found is not None:
            self._take_step(found)

    def _take_step(self, found: ClockStep) -> None:
        """
        Stop the arm because the node's clock has stepped or is paused; the lock is held.

        All times that are known are taken by the new clock: where the arm is, and how old things
        are, does not change by a step.
        """
        self._inputs.shift(found.step)
        self._tracked = shifted(self._tracked, found.step)
        self._commitments = given.shift(self._commitments, found.step)
        if self._in_the_way_since is not None:
            self._in_the_way_since += found.step
        self._withheld_stop = self._withheld_stop and self._withheld_stop.shifted(found.step)
        self._settled, self._unsettled_by = time.monotonic() + SETTLING, found.sentence
        # Nor is what is planned meanwhile published.
        self.stop_reason, self.n_stops = found.sentence, self.n_stops + 1
        with suppress(Exception):
            self._node.get_logger().error(found.sentence)
        running, now = self.running, self._now()
        self._is_unstamped = True
        if running is not None and self._state is MonitorState.STOPPING and self.is_active(now):
            # A controller by the same clock has jumped along its stop.
            phase = self._phase_or_elapsed(running, now)
            if phase is not None and phase < running.trajectory.duration:
                stop = self._stop_of(running, phase, now)
                self._publishers.publish_motion(stop.trajectory, self._parameters, 0.0)
                self._tracked = track_stop_again(self._tracked, stop)
        self.fail(found.sentence)

    def hold(self, until: float) -> ExecutingMotion | None:
        """
        Return what the arm is commanded, which does not change until a time [s].

        A handover is planned from it; also the last motion after its end, since the controller
        holds that. Without separation it is the whole motion anyway. None: it is not known.
        """
        with self._lock:
            self._commitments = given.hold(self._commitments, until)
            return self._tracked.command

    @property
    def goal(self) -> PointingGoal | None:
        """The goal of the last commanded motion."""
        return self._goal

    @property
    def executes_whole(self) -> bool:
        """Whether the arm executes a motion that was published as a whole, or the stop of one."""
        return self.running is not None and self._parameters.separation is None

    @property
    def is_monitoring(self) -> bool:
        """Whether a motion is monitored that is not being stopped."""
        return self._state is MonitorState.MONITORING

    def is_active(self, now: float) -> bool:
        """Return whether the arm is to execute a motion or a stop at a time [s]."""
        running = self.running
        return running is not None and (
            self.is_monitoring or now < running.start_time + running.trajectory.duration
        )

    def has_stopped(self, goal: PointingGoal) -> bool:
        """Return whether a stop of a motion to this goal is to be taken, and planned after."""
        with self._lock:
            return any(stop.goal is goal and stop.is_replanned for stop in self._stops)

    def brake(self, why: str) -> None:
        """Stop the arm, if it moves, because it is no longer wanted to arrive."""
        with self._lock:
            self._stop_unless_over(why, is_replanned=False, is_fault=False)

    def take_stops(self) -> list[Stop]:
        """Return the stops published since the last call."""
        with self._lock:
            stops = list(self._stops)
            self._stops.clear()
        return stops

    def fail(self, why: str, is_replanned: bool = True) -> None:
        """
        Stop the arm, if it moves, because of a failure.

        Parameters
        ----------
        is_replanned : bool
            Whether to plan again once the arm is at rest: not after an error, which would recur.

        """
        with self._lock:
            self._stop_unless_over(why, is_replanned, is_fault=not is_replanned)

    def _stop_unless_over(self, why: str, is_replanned: bool, is_fault: bool) -> None:
        """Stop the arm, if it executes a motion; the lock is held."""
        self.n_faults += is_fault and self.running is not None
        if self.running is not None and self._state is MonitorState.MONITORING:
            # What is not to be planned again does not become so by what fails later.
            self._is_replanned = is_replanned and (self._is_replanned or not self.pending_stop)
            self.pending_stop = why
            self._pending_since = time.perf_counter()
            # To brake is no failure.
            level = DiagnosticStatus.WARN if is_replanned else DiagnosticStatus.OK
            self._stop_level = DiagnosticStatus.ERROR if is_fault else level
            self._stop_for_failure()
            with suppress(Exception):
                self._fail_commitments(why, is_fault)
        elif self.running is not None and is_fault:
            # The arm stops already; what is planned for after that does not begin.
            self.stop_reason, self.n_stops = why, self.n_stops + 1
            with suppress(Exception):
                self._set_state(self._state, why, DiagnosticStatus.ERROR)
            if not self._stops or self._stops[-1].is_replanned:
                with suppress(Exception):
                    self._record_stop(self.running.trajectory, None, is_replanned=False)
            with suppress(Exception):
                self._fail_commitments(why, is_fault)

    def _fail_commitments(self, why: str, is_fault: bool) -> None:
        """Report that the arm stops because of a failure; a fault lasts until `reset`."""
        rules = self._commitments.rules
        if rules is None or rules.separation is None:
            return
        if is_fault:
            self._commitments = given.fail(self._commitments, why)
        state = SeparationState.FAULT if is_fault else SeparationState.PROTECTIVE_STOP
        # An error in the report must not keep the arm from being stopped.
        with suppress(Exception):
            self._reporter.separation_status(SeparationStatus(state, why, 0.0))

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

    def _check_remaining_motion(self, body: WearerBody, arrived: int) -> None:
        """Stop the arm unless its remaining motion is proven free; the lock is held."""
        begin = time.perf_counter()
        if self.running is None:
            return
        now = self._now()
        self._check_withheld_stop(now)
        phase = self._monitored_phase(now)
        if phase is None:
            return
        self._reporter.body_used(self._inputs.body.age(now))
        scene, expected = scene_of(body.at(now)), self._inputs.expected_scene()
        planned, planned_phase = self._remaining(phase, now)
        is_free = self._holds(is_remaining_free, planned, planned_phase, scene) and (
            planned_phase < planned.escape_time or self._is_arm_free(scene)
        )
        # An escape leaves where he is.
        is_soon_free = planned_phase < planned.escape_time or self._holds(
            is_expected_free, self.running, phase, expected
        )
        if is_free and is_soon_free:
            self._reporter.remaining_motion_checked(time.perf_counter() - begin)
            self._in_the_way_since = None
            if planned_phase < planned.escape_time:
                self._extend(now, begin)
            else:
                # So far the arm keeps clear of where he will be; so must what it is given next.
                self._extend(now, begin, partial(self._is_soon_clear, expected))
            self._commitments = given.check_news(self._commitments, self._now())
            if self._commitments.has_lost_proof:
                self._stop(phase, now, scene, arrived, NOT_SEPARATE)
        else:
            if self._in_the_way_since is None:
                self._in_the_way_since = now
            may_go_on = self._may_go_on(phase, now, scene)
            if may_go_on:
                self._extend(now, begin, partial(self._is_clear, scene, expected))
            # The whole rest of the motion has no stop ahead of him.
            if not may_go_on or self._commitments.is_whole:
                why = IN_THE_WAY if is_soon_free else SOON_IN_THE_WAY
                self._stop(phase, now, scene, arrived, why)
        waited = self._elapsed(arrived)
        # The ages of parts count where motions are proven separate.
        if waited > LONGEST_WAIT and not self._commitments.is_active:
            self.fail(
                f'a body was checked {waited:.3f} s after its arrival, expected at most '
                f'{LONGEST_WAIT:g} s'
            )

    def _may_go_on(self, phase: float, now: float, scene: Scene) -> bool:
        """
        Return whether the arm may go on although the wearer is in the way further on.

        With separation it has been given nothing but a stretch that ends in a stop. Where that is
        free of him, a further stretch that is free as well may follow, while he moves on. So it
        may after the whole rest of the motion, which is replaced.
        """
        running, since = self.running, self._in_the_way_since
        assert running is not None and since is not None
        planned, planned_phase = self._remaining(phase, now)
        return (
            self._commitments.is_active
            and now - since < PATIENCE
            and planned_phase >= planned.escape_time
            and self._holds(is_remaining_free, running, phase, scene)
        )

    def _is_arm_free(self, scene: Scene) -> bool:
        """Return whether the arm is clear of the wearer where it is, maybe off its motion."""
        reading, parameters = self._inputs.joints.value, self._parameters
        return reading is None or is_place_free(
            reading.positions,
            parameters.arm,
            scene,
            MARGIN_LEFT * parameters.margin,
            parameters.ray_guard_length,
        )

    def _is_clear(self, scene: Scene, expected: Scene, curve: Trajectory) -> bool:
        """Return whether a stretch and its stop are free of the wearer, now and soon."""
        assert self.running is not None
        motion = replace(self.running, trajectory=curve, escape_time=0.0)
        is_free = self._holds(is_remaining_free, motion, 0.0, scene)
        return is_free and self._is_soon_clear(expected, curve)

    def _is_soon_clear(self, expected: Scene, curve: Trajectory) -> bool:
        """Return whether a stretch and all its stop are free of where the wearer will be soon."""
        assert self.running is not None
        motion = replace(self.running, trajectory=curve, target_distance=0.0, escape_time=0.0)
        return not expected.boxes or self._holds(is_remaining_free, motion, 0.0, expected)

    def _remaining(self, phase: float, now: float) -> tuple[ExecutingMotion, float]:
        """Return the motion that the arm is to execute, and the time within it [s]."""
        assert self.running is not None
        planned = self._commitments.planned
        return (
            (self.running, phase)
            if planned is None
            else (planned, given.phase_at(self._commitments, now))
        )

    def _extend(
        self,
        now: float,
        begin: float,
        is_clear: Callable[[Trajectory], bool] = lambda curve: True,
    ) -> None:
        """
        Have the commitment of the running motion replaced by one that leads further.

        begin: now [s] by `time.perf_counter`.
        """
        if self._commitments.is_active and not self.pending_stop:
            planned = self._commitments.planned
            motion = self._extend_commitments(now, begin, is_clear)
            if motion is not None:
                self._tracked = track_next(self._tracked, motion)
            if self._commitments.planned is not planned:
                self._report_switch(False)

    def _extend_commitments(
        self, now: float, begin: float, is_clear: Callable[[Trajectory], bool]
    ) -> ExecutingMotion | None:
        """Publish the commitment that replaces the newest one; return it if it changed."""
        found = given.extend(self._commitments, now, self._inputs.joints.value, is_clear)
        before = self._commitments = found.commitments
        unchanged = before.sent.motion if found.has_changed and before.sent else None
        if found.next is None:
            if found.status is not None:
                self._reporter.separation_status(found.status)
            return unchanged
        took = time.perf_counter() - begin
        if took > before.within:
            # The arm is on its way to rest by then: from there the next one goes on.
            self._commitments = given.note_took(before, took)
            return unchanged
        assert found.next.sent is not None
        message = found.next.sent.motion
        self._publishers.publish_motion(message.trajectory, self._parameters, message.start_time)
        self._commitments = given.note_took(found.next, took)
        # An error in the report must not hide what was published.
        with suppress(Exception):
            self._reporter.commitment_published(time.perf_counter() - begin)
            assert found.status is not None
            self._reporter.separation_status(found.status)
        return message

    def _holds(
        self, check: Callable[..., bool], running: ExecutingMotion, phase: float, scene: Scene
    ) -> bool:
        """Return the verdict of a check of a motion from a phase on [s]."""
        parameters = self._parameters
        return check(
            running,
            phase,
            parameters.arm,
            scene,
            margin=parameters.margin,
            ray_guard_length=parameters.ray_guard_length,
        )

    def _on_timer(self) -> None:
        """Run the periodic checks, and assert liveliness."""
        self._run_fail_safe(self._check_periodically)

    def _check_periodically(self) -> None:
        self._check_clock()
        reading = self._inputs.joints.value
        self._tracked = check_command(self._tracked, reading, self._now(), time.monotonic())
        if self._state is not MonitorState.IDLE:
            self._check_inputs()
        if self.pending_stop:
            self._stop_for_failure()
        if not self.pending_stop:
            self._publishers.assert_liveliness()
        if self._reporter.parameters.separates != NEVER:
            self._publishers.publish_ray_clear(self._is_ray_clear())

    def _is_ray_clear(self) -> bool:
        """Return whether the pointing ray is known to be clear of the wearer."""
        parameters, now = self._reporter.parameters, self._now()
        if parameters.separation is None:
            # Where a wearer is who was described once is not known either.
            return False
        try:
            # Where a part is that was lost is not known.
            body = self._inputs.body_at(now, parameters)
            q = self._inputs.joints_at(now, parameters.joint_timeout).positions
        except RequestError:
            return False
        length = parameters.ray_guard_length
        return is_ray_clear(q, parameters.arm, scene_of(body), parameters.margin, length)

    def _check_inputs(self) -> None:
        """Stop the arm where an input is stale or the last stop is not executed."""
        now = self._now()
        self._repeat_stop(now)
        self._check_previous_motion()
        self._check_ignored_motion()
        self._monitored_phase(now)

    def _monitored_phase(self, now: float) -> float | None:
        """Return the time within a monitored motion [s]; stop the arm where an input is stale."""
        phase = self._phase(now)
        if self._state is not MonitorState.MONITORING:
            return None
        # Also of an arm that is off its motion.
        parameters = self._reporter.parameters
        if self._parameters.stands_still and not parameters.stands_still:
            self.fail(STREAM_BEGAN)
            return None
        try:
            self._inputs.require_fresh(now, parameters)
        except RequestError as problem:
            self.fail(str(problem))
            return None
        return phase

    def _repeat_stop(self, now: float) -> None:
        """Publish the stop again where the arm does not execute it."""
        before = self._tracked.stopped
        self._tracked, phase = missed_stop(self._tracked, self._inputs.joints.value, now)
        if before is None or phase is None:
            return
        stop = self._stop_of(before, phase, now)
        if self._is_withheld(stop, before, now):
            return
        self._publishers.publish_motion(stop.trajectory, self._parameters, stop.start_time)
        self._tracked = track_stop_again(self._tracked, stop)
        self._node.get_logger().error(
            'arm did not follow the commanded stop: stop published again'
        )
        self._doubt(DiagnosticStatus.ERROR, 'arm did not follow the commanded stop')

    def _check_previous_motion(self) -> None:
        """Monitor the previous motion where the arm follows that: its controller rejected one."""
        if (
            self._state in (MonitorState.MONITORING, MonitorState.STOPPING)
            and not self._commitments.is_active
        ):
            before = self._tracked
            self._tracked = track_previous(before, self._inputs.joints.value)
            if self._tracked is before:
                return
            self._report_switch(self._tracked.is_latest)
            self._check_remaining_motion(self._inputs.body.value, time.time_ns())

    def _report_switch(self, is_latest: bool) -> None:
        """Report that the arm follows the motion before the last one, or the last one again."""
        self._node.get_logger().error(SWITCHED[is_latest])
        level = DiagnosticStatus.OK if is_latest else DiagnosticStatus.WARN
        self._set_state(MonitorState.MONITORING, SWITCHED[is_latest], level)
        if not is_latest:
            self._note_ignored('arm ignored the last commanded motion')
        self._is_ignored = not is_latest

    def _require_listener(self) -> None:
        """Report where nobody receives motions at all."""
        if not self._is_doubted and not self._publishers.has_listener():
            topic = self._publishers.motion_topic
            self._doubt(DiagnosticStatus.WARN, f'nobody is subscribed to {topic}')

    def _note_ignored(self, why: str, has_moved: bool = False) -> None:
        """Count a motion that the arm ignores, and report that it does."""
        # An arm that ignores one motion after the other, as with its drives off, holds.
        self._n_ignored = 0 if has_moved else self._n_ignored + 1
        self._is_ignored, n = True, self._n_ignored
        level = DiagnosticStatus.ERROR if n >= MOST_IGNORED else DiagnosticStatus.WARN
        self._doubt(level, f'{why} ({n} motions one after the other)' if n > 1 else why)

    def _doubt(self, level: bytes, why: str) -> None:
        """Report, until the arm follows a motion, that it may not be given what it needs."""
        self._is_doubted = True
        topic = self._publishers.motion_topic
        self._reporter.unfollowed(level, f'{why}: expected a controller that executes {topic}')

    def _check_followed_motion(self, reading: JointReading | None) -> None:
        """Withdraw what was reported of an arm that follows its motion now."""
        running = self.running
        # With separation one that it has ignored is not followed any more.
        is_other = not self._tracked.is_latest or (
            self._commitments.is_active and self._is_ignored
        )
        if (
            self._is_doubted
            and running is not None
            and not is_other
            and given.has_moved(
                self._commitments, reading, running, self._parameters.rest_speed, FOLLOWED
            )
            and tracked_phase(self._tracked, reading, self._now()) is not None
        ):
            self._n_ignored, self._is_ignored, self._is_doubted = 0, False, False
            self._reporter.unfollowed(DiagnosticStatus.OK, '')

    def _check_ignored_motion(self) -> None:
        """Give up a motion that the arm ignores, wherever it rests, also far from it."""
        reading, running = self._inputs.joints.value, self.running
        if self._state is not MonitorState.MONITORING or running is None:
            return
        rest_speed = self._parameters.rest_speed
        self._commitments, is_ignored = given.note_rest(
            self._commitments, reading, running, self._parameters.execution
        )
        if not is_ignored:
            self._check_followed_motion(reading)
        elif not self._commitments.is_active:
            # It was given all of it, and may be late: it is monitored as long as that takes.
            if not self._is_ignored:
                has_moved = given.has_moved(self._commitments, reading, running, rest_speed)
                self._note_ignored(NOT_FOLLOWED, has_moved)
        else:
            now = self._now()
            if self._commitments.is_whole:
                # One that is only late would execute all of it.
                stop = self._stop_of(running, 0.0, now)
                self._publishers.publish_motion(stop.trajectory, self._parameters, stop.start_time)
                self._tracked = track_stop(self._tracked, stop)
            has_moved = given.has_moved(self._commitments, reading, running, rest_speed)
            self._note_ignored(NOT_FOLLOWED, has_moved)
            self._give_up_motion(NOT_FOLLOWED, self._n_ignored < MOST_IGNORED)
            self._end_motion()
            self._tracked = forget_command(self._tracked)

    def _phase(self, now: float) -> float | None:
        """Return the time within the running motion; None where it is over or unknown [s]."""
        is_waiting = self._state is MonitorState.MONITORING and (
            given.waits_for_reset(self._commitments, now)
        )
        reading = self._inputs.joints.value
        if is_over(self._tracked, reading, now, self._parameters.rest_speed) and not is_waiting:
            if self._state is MonitorState.MONITORING and not given.is_arrived(
                self._commitments, now
            ):
                self._give_up_motion(TOO_NEAR)
            elif self._state is MonitorState.MONITORING and self._is_ignored_to_its_end():
                is_replanned = self._commitments.is_active and self._n_ignored < MOST_IGNORED
                self._give_up_motion(NOT_FOLLOWED, is_replanned)
            self._end_motion()
            return None
        phase = tracked_phase(self._tracked, reading, now)
        if phase is not None:
            self._tracked = find(self._tracked, now)
        if phase is not None and self._reporter.monitor_state[1] == OFF_TRAJECTORY:
            is_stopping = self._state is MonitorState.STOPPING
            self._set_state(self._state, self.stop_reason if is_stopping else '')
        has_lost = phase is None and is_lost(self._tracked, now)
        if has_lost and self._reporter.monitor_state[1] != OFF_TRAJECTORY:
            self._node.get_logger().error(OFF_TRAJECTORY)
            self._set_state(self._state, OFF_TRAJECTORY)
        return phase

    def _is_ignored_to_its_end(self) -> bool:
        """Return whether the arm has not followed the last motion, which is over."""
        reading, running = self._inputs.joints.value, self.running
        if reading is None or running is None or self._is_ignored:
            return self._is_ignored
        gap = np.abs(reading.positions - running.trajectory.positions[-1]).max()
        # An older reading says nothing of that.
        is_new = reading.taken > running.start_time + running.trajectory.duration
        if is_new and gap > MAX_DEVIATION and not self._commitments.is_active:
            self._note_ignored(NOT_FOLLOWED, has_moved=True)
        return self._is_ignored

    def _stop(self, phase: float, then: float, scene: Scene, arrived: int, why: str) -> None:
        """Stop the arm for a body, from its phase at a time `then` [s]; the lock is held."""
        # The check since then took time.
        now = self._now()
        phase += now - then
        running = self.running
        if running is None or phase >= running.trajectory.duration:
            return
        stopped = self._stop_of(running, phase, now)
        is_safe = self._holds(is_remaining_free, stopped, 0.0, scene)
        if not is_safe and self._holds(escapes_by_continuing, *self._remaining(phase, now), scene):
            self._extend(now, time.perf_counter())
            sentence = f'{why}, but the arm escapes, which a stop would prevent: motion continues'
            if self._reporter.monitor_state[1] != sentence:
                self._node.get_logger().error(sentence)
            self._set_state(MonitorState.MONITORING, sentence)
            return
        stopped = self._publish_stop(stopped, why)
        took = self._elapsed(arrived)
        warning = '' if is_safe else self._clearance_warning(stopped.trajectory, scene)
        self._reporter.stop_published(took)
        self._stop_level = DiagnosticStatus.WARN
        self._report_stop(stopped, warning, f'; published after {1e3 * took:.2f} ms')
        self._record_stop(stopped.trajectory, None if warning else scene)
        self._fail_commitments(why, is_fault=False)

    def _stop_for_failure(self) -> None:
        """Publish the pending stop with as little code as possible; the lock is held."""
        running = self.running
        if running is None:
            self.pending_stop = ''
            return
        try:
            now = self._now()
            phase = self._phase_or_elapsed(running, now)
            if phase is None:
                if not self._commitments.is_active:
                    return
                phase = now - running.start_time
            if phase >= running.trajectory.duration:
                # The motion has ended.
                self.pending_stop = ''
                return
            stopped = self._publish_stop(self._stop_of(running, phase, now), self.pending_stop)
        except Exception:
            # It is tried again at the next check; until then liveliness is not asserted.
            with suppress(Exception):
                self._node.get_logger().error(traceback.format_exc())
            return
        took = time.perf_counter() - self._pending_since
        # An error in the report must not undo the stop.
        with suppress(Exception):
            self._reporter.stop_published(took)
            self._report_stop(stopped)
            self._record_stop(stopped.trajectory, None, self._is_replanned)

    def _record_stop(
        self, stopped: Trajectory, scene: Scene | None, is_replanned: bool = True
    ) -> None:
        """Keep a stop for `take_stops`, with the wearer that it is proven free of."""
        is_replanned = is_replanned and self._reporter.parameters.replan
        stop = Stop(stopped, self._goal, self._parameters, scene, is_replanned, self.n_motions)
        is_manual = self._commitments.is_active and self._parameters.resume == MANUAL
        self._waiting = replace(stop, scene=None) if is_manual and is_replanned else None
        if is_manual:
            # It goes on after `~/reset`, or a request.
            stop = replace(stop, is_replanned=False)
        self._is_held = not stop.is_replanned
        self._stops.append(stop)

    def _phase_or_elapsed(self, running: ExecutingMotion, now: float) -> float | None:
        """Return the time within a motion, even after an error; None where the arm is off it."""
        try:
            return tracked_phase(self._tracked, self._inputs.joints.value, now)
        except Exception:
            # The joint states may be what is wrong: then the commanded state counts.
            return now - running.start_time

    def _publish_stop(self, stop: ExecutingMotion, why: str) -> ExecutingMotion:
        """
        Publish a stop, and track the arm on it; return what leads the arm to rest.

        With separation a stop that is not proven separate is not published, as long as the
        commitment that the arm executes is, and comes to rest.
        """
        now, running = self._now(), self.running
        if running is not None and self._is_withheld(stop, running, now):
            self._withheld_stop = running
            rest = max(0.0, now - running.start_time)
            if rest < running.trajectory.duration:
                left = part_of(running.trajectory, rest, running.trajectory.duration)
                stop = replace(running, trajectory=left, start_time=now)
        else:
            before = self._tracked
            self._tracked = track_stop(self._tracked, stop)
            try:
                begin = 0.0 if self._is_unstamped else stop.start_time
                self._publishers.publish_motion(stop.trajectory, self._parameters, begin)
            except Exception:
                self._tracked = before
                raise
            self._is_unstamped = False
        # From here on nothing may raise: the same stop would be published again.
        self._state, self.stop_reason, self.pending_stop = MonitorState.STOPPING, why, ''
        self.n_stops += 1
        return stop

    def _is_withheld(self, stop: ExecutingMotion, running: ExecutingMotion, now: float) -> bool:
        """Return whether to leave the arm on its commitment, which is proven and a stop is not."""
        return (
            self._commitments.is_active
            and not self._is_separate(stop, now)
            and self._is_separate(running, now)
        )

    def _check_withheld_stop(self, now: float) -> None:
        """Publish a stop after all where that is proven now, or the commitment not any more."""
        motion = self._withheld_stop
        if motion is None or self._state is not MonitorState.STOPPING:
            return
        if now >= motion.start_time + motion.trajectory.duration:
            self._withheld_stop = None
            return
        stop = self._stop_of(motion, 0.0, now)
        # Other commitments end in a stop of their own.
        is_proven = self._commitments.is_whole and self._is_separate(stop, now)
        if is_proven or not self._is_separate(motion, now):
            # An error here leaves it to the next body.
            self._publishers.publish_motion(stop.trajectory, self._parameters, stop.start_time)
            self._tracked = track_stop(self._tracked, stop)
            self._withheld_stop = None

    def _is_separate(self, motion: ExecutingMotion, now: float) -> bool:
        """Return whether the rest of a motion is proven separate; not after an error."""
        try:
            return given.is_separate(self._commitments, motion, now)
        except Exception:
            with suppress(Exception):
                self._node.get_logger().error(traceback.format_exc())
            return False

    def _give_up_motion(self, why: str, is_replanned: bool = True) -> None:
        """Have a motion planned again that came to rest on its way, and could not go on."""
        running = self.running
        assert running is not None
        self.stop_reason, self.n_stops = why, self.n_stops + 1
        sentence = f'{why}: motion given up'
        self._set_state(MonitorState.STOPPING if is_replanned else MonitorState.HOLDING, sentence)
        self._node.get_logger().warning(sentence)
        self._fail_commitments(why, is_fault=False)
        self._record_stop(running.trajectory, None, is_replanned)

    def _end_motion(self) -> None:
        """Monitor a motion no longer that has ended, or was given up."""
        self._tracked = track_nothing(self._tracked)
        self._commitments = given.end(self._commitments)
        self.pending_stop = ''
        if self._state is MonitorState.MONITORING:
            self._n_ignored, self._is_doubted, self.has_arrived = 0, False, True
            self._reporter.unfollowed(DiagnosticStatus.OK, '')
        if self._state is MonitorState.STOPPING and self._is_held:
            self._set_state(
                MonitorState.HOLDING, self._reporter.monitor_state[1], self._stop_level
            )
        elif self._state is not MonitorState.HOLDING:
            self._set_state(MonitorState.IDLE, '')

    def _report_stop(self, stop: ExecutingMotion, warning: str = '', note: str = '') -> None:
        """Report in log and diagnostics why the arm stops."""
        left = max(0.0, stop.start_time + stop.trajectory.duration - self._now())
        sentence = f'{self.stop_reason}: fail-safe stop, at rest in {left:.2f} s{warning}'
        self._set_state(MonitorState.STOPPING, sentence, self._stop_level)
        # Two calls: rclpy raises where one line of code logs at changing severities.
        if warning:
            self._node.get_logger().error(f'{sentence}{note}')
        else:
            self._node.get_logger().warning(f'{sentence}{note}')

    def _clearance_warning(self, stop: Trajectory, scene: Scene) -> str:
        """Return the clearance of a stop that is not proven free, as a sentence."""
        parameters = self._parameters
        world = arm_world(parameters.arm, scene, 0.0, parameters.ray_guard_length)
        clearance = least_clearance(stop, world)
        return f'; the stop is not proven free either, least clearance {clearance:.4f} m'

    def reset(self) -> str:
        """
        Allow motions again after a fault, with separation; return what it was.

        A motion that waits for that goes on: also one that was stopped and is planned anew.
        """
        with self._lock:
            if self._waiting is not None and self._waiting.n_motions == self.n_motions:
                self._stops.append(self._waiting)
                self._is_held = False
            self._waiting = None
            fault = self._commitments.fault
            self._commitments = given.reset(self._commitments)
            if fault:
                self._reporter.separation_status(SeparationStatus())
            return fault

    def report_hold(self, why: str) -> None:
        """Report that the arm stays where it came to rest."""
        with self._lock:
            if self._state is MonitorState.MONITORING:
                # Another motion was commanded meanwhile.
                return
            sentence = f'arm holds its position: {why}'
            self._set_state(MonitorState.HOLDING, sentence)
            self._node.get_logger().warning(sentence)

    def _set_state(
        self, state: MonitorState, sentence: str, level: bytes = DiagnosticStatus.WARN
    ) -> None:
        self._state = state
        self._reporter.monitor_state = (state.value, sentence)
        self._reporter.monitor_level = level if sentence else DiagnosticStatus.OK
        self._reporter.publish_soon()

    def _elapsed(self, arrived: int) -> float:
        """Return the time since the arrival of a body [ns -> s]."""
        return 1e-9 * (time.time_ns() - arrived)

    def _now(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9


def _named(problem: Exception) -> str:
    return one_line(f'{type(problem).__name__}: {problem}')
