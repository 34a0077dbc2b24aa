# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Requests one after the other, in a worker thread, while the node receives messages."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
import math
import time
import traceback
from typing import cast

from nav_msgs.msg import Path
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from rrth_planner.execution.command import ahead
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.remaining_motion import is_place_free
from rrth_planner.execution.watch import Stop
from rrth_planner.model.errors import RequestError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.status import ErrorCode
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.planning_process import Planner
from rrth_planner.ros.interface.inputs import Inputs
from rrth_planner.ros.interface.parameters import PlannerParameters
from rrth_planner.ros.interface.publishers import PlanPublishers
from rrth_planner.ros.interface.reporter import PlanReport, Reporter
from rrth_planner.ros.interface.separation_status import NO_PROMISE
from rrth_planner.ros.messages.body import scene_of
from rrth_planner.ros.messages.error_codes import answer, FINAL
from rrth_planner.ros.middleware.executor_barrier import ExecutorBarrier, NodeIsBusyError
from rrth_planner.ros.monitor.execution_monitor import ExecutionMonitor
from rrth_planner.ros.requests.incidents import incident_of, incident_of_stop, keep, sentence_of
from rrth_planner.ros.requests.plan_request import plan_request, PlanOutcome, require_not_cancelled
from rrth_planner.ros.requests.revalidation import Revalidation
from trajectory_msgs.msg import JointTrajectory

# Period of the work after a stop, and shortest time from one motion shown to the next [s].
PERIOD, SHORTEST_SHOW = 0.05, 0.2
# An arm may come to rest so much later than its commanded stop [s].
LONGEST_SETTLING = 1.0
# A request that the wearer was in the way of is planned again after this time [s].
AGAIN = 0.01
# A wearer whose hand is in the ray of an arm at rest has so long to take it out [s].
RAY_PATIENCE = 2.0
# After a stop the same goal is tried so often [s].
RESUME_PERIOD = 0.05
# It is waited for so long, each time, until it is known whether the body stands still [s].
LONGEST_UNKNOWN = 2.0
# More requests than these do not wait; that is logged at most this often [s].
MOST_WAITING, WARNING_PERIOD = 64, 5.0
CANCELLED = (ErrorCode.PREEMPTED, 'the request was cancelled')
OVERTAKEN = (ErrorCode.PREEMPTED, 'another request has come meanwhile')


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """
    The response to a request.

    Parameters
    ----------
    is_solved : bool
        Whether a motion was published.
    code, sentence
        Of the answer.
    tool_path : callable
        Returns the tool's path; empty where no motion was published.
    conclude : callable
        Called after the answer is sent: shows and reports the motion.

    """

    is_solved: bool
    code: ErrorCode
    sentence: str
    tool_path: Callable[[], Path]
    conclude: Callable[[], None]

    @property
    def text(self) -> str:
        """Code and sentence, as `error_codes.answer` writes them."""
        return answer(self.code, self.sentence)


class _Ticket:
    """One plan, until its motion is published or it ends without one."""

    def __init__(self, goal: PointingGoal | None, request: int) -> None:
        """Begin, with the number of its request; without a goal it is that of the last target."""
        self.goal, self.request, self.is_cancelled = goal, request, False


@dataclass(frozen=True, slots=True)
class _Resumption:
    """
    A plan for the goal of a motion that was stopped, to be made once the arm rests.

    It is tried at once where the stop is proven free of the wearer, as a handover from the stop.
    """

    ticket: _Ticket
    goal: PointingGoal
    # Numbers of motions and requests until then.
    n_motions: int
    n_requests: int
    # When the stop ends [s], and until when to wait for the rest by the monotonic clock, since a
    # simulated one may stand still; and until when to try again while the wearer is in the way.
    stopped: float
    latest: float
    end: float
    is_during_stop: bool
    is_first: bool = True

    def is_due(self, joints: JointReading | None, rest_speed: float) -> bool:
        """
        Return whether to try now: during the stop, or once a reading after it has the arm at rest.

        At rest it is no faster than a speed [rad/s]. Also once the time to wait for that is up.
        """
        if self.is_during_stop or time.monotonic() >= self.latest:
            return True
        return (
            joints is not None
            and joints.received >= self.stopped
            and not joints.is_moving(joints.taken, rest_speed)
        )


class PlanQueue:
    """
    Plan and publish for one request at a time; the others wait their turn.

    Parameters
    ----------
    reporter : Reporter
        Its parameters, as they are when a request's turn begins, are those of the plan.
    monitor : ExecutionMonitor
        Monitors each published motion; its stops are checked again here, and replanned.

    """

    def __init__(
        self,
        node: Node,
        inputs: Inputs,
        reporter: Reporter,
        publishers: PlanPublishers,
        monitor: ExecutionMonitor,
        planner: Planner,
    ) -> None:
        """Start with nothing to do."""
        self._node, self._inputs, self._reporter = node, inputs, reporter
        self._publishers, self._monitor, self._planner = publishers, monitor, planner
        self._barrier = ExecutorBarrier(node)
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix='planner')
        self._open: set[_Ticket] = set()
        self._resumption: _Resumption | None = None
        # The newest motion that is not shown yet, and when one was last shown [s].
        self._unseen: tuple[PlanOutcome, PlannerParameters] | None = None
        self._shown = -SHORTEST_SHOW
        self._is_closed = False
        # So far, and how many of them are not answered yet.
        self._n_requests, self._n_waiting = 0, 0
        # The number of the request whose goal the arm pursues; None: of none.
        self._pursued: int | None = None
        # The goal that was given up last after a stop, and why.
        self._given_up: tuple[PointingGoal | None, ErrorCode, str] = None, *CANCELLED
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD, self._follow_up, clock=steady)

    async def respond(self, goal: PointingGoal | None) -> Response:
        """Return the response to a request for a goal, or for the last target, after its turn."""
        begin = time.perf_counter()
        # What it finds is compared by the clock of its own time.
        self._monitor.check_clock()
        if self._n_waiting >= MOST_WAITING:
            sentence = f'{MOST_WAITING} requests wait for their answers already: ask again later'
            self._node.get_logger().warning(sentence, throttle_duration_sec=WARNING_PERIOD)
            return Response(False, ErrorCode.PREEMPTED, sentence, Path, lambda: None)
        self._n_requests += 1
        future, ticket = Future(), _Ticket(goal, self._n_requests)

        def work() -> None:
            try:
                self._work(goal, begin, ticket, future.set_result)
            except BaseException as problem:
                future.set_exception(problem)
            executor = self._node.executor
            if executor is not None:
                executor.wake()

        self._open.add(ticket)
        self._n_waiting += 1
        try:
            self._worker.submit(work)
            response: Response = await future
            executor = self._node.executor
            if executor is not None:
                # As a task of its own: the answer is sent before it runs.
                executor.create_task(self.prepare, response.conclude)
            return response
        finally:
            self._n_waiting -= 1
            self._open.discard(ticket)

    def prepare(self, work: Callable[[], None]) -> None:
        """Run something in the worker thread before the requests that follow."""

        def prepared() -> None:
            try:
                work()
            except Exception:
                # The request that needs it will report the error.
                self._node.get_logger().error(traceback.format_exc())

        if not self._is_closed:
            self._worker.submit(prepared)

    def cancel(self) -> int:
        """Cancel the requests that have published no motion yet; return their number."""
        ended, self._open, self._resumption = self._open, set(), None
        # A copy is made at one go, while the worker removes tickets.
        for ticket in ended.copy():
            ticket.is_cancelled = True
            if ticket.request == self._pursued:
                self._given_up = ticket.goal, *CANCELLED
        return len(ended)

    def withdraw(self, goal: PointingGoal) -> None:
        """Cancel what is planned for this goal, unless its motion is published already."""
        for ticket in self._open.copy():
            if ticket.goal is goal:
                ticket.is_cancelled = True
                self._open.discard(ticket)
        if self._resumption is not None and self._resumption.goal is goal:
            self._resumption = None

    def pursues(self, goal: PointingGoal) -> bool:
        """Return whether a motion to this goal is planned, or will be after a stop."""
        is_open = any(ticket.goal is goal for ticket in self._open.copy())
        return is_open or self._monitor.has_stopped(goal)

    def why_given_up(self, goal: PointingGoal) -> tuple[ErrorCode, str] | None:
        """Return how the last try after a stop ended, where this goal was given up then."""
        given_up, code, sentence = self._given_up
        return (code, sentence) if given_up is goal else None

    def close(self) -> None:
        """End all work; nothing is published afterwards, and no request may follow."""
        self._is_closed = True
        self.cancel()
        self._monitor.close()
        # Who waits hears of it, as far as that is possible.
        with suppress(Exception):
            self._note_end()
        self._worker.shutdown(wait=True, cancel_futures=True)
        self._planner.close()

    def _work(
        self,
        goal: PointingGoal | None,
        begin: float,
        ticket: _Ticket,
        settle: Callable[[Response], None],
        patience: float | None = None,
    ) -> bool:
        """
        Plan, publish and settle a request; called in the worker's thread.

        The request is settled as soon as its motion is published, in the node's own thread.
        patience: how long to plan again while the wearer moves [s]; None: `time_limit`. Return
        whether it may have a motion a moment later.
        """
        parameters = self._parameters_for(ticket)

        def settle_published(outcome: PlanOutcome, parameters: PlannerParameters) -> None:
            sentence = f'{outcome.sentence}; request {ticket.request}'
            if not self._publishers.has_listener():
                sentence += f'; nobody is subscribed to {self._publishers.motion_topic}'
            settle(self._response(replace(outcome, sentence=sentence), parameters, begin))

        try:
            outcome = self._plan(goal, ticket, parameters, settle_published, patience)
            if outcome.trajectory is not None:
                return False
            if ticket.is_cancelled and outcome.code is not ErrorCode.PREEMPTED:
                outcome = replace(outcome, code=CANCELLED[0], sentence=CANCELLED[1])
        except Exception as problem:
            # After any error the caller gets an answer, and the node continues.
            self._node.get_logger().error(traceback.format_exc())
            outcome = PlanOutcome(
                ErrorCode.FAILURE, sentence_of(problem), incident=incident_of(problem)
            )
        if outcome.incident is not None:
            noted, file = keep(outcome.incident, parameters.incident_folder)
            outcome = replace(outcome, sentence=outcome.sentence + noted)
            self._reporter.incident(file)
        settle(self._response(outcome, parameters, begin))
        return outcome.code not in FINAL

    def _plan(
        self,
        goal: PointingGoal | None,
        ticket: _Ticket,
        parameters: PlannerParameters,
        settle_published: Callable[[PlanOutcome, PlannerParameters], None],
        patience: float | None,
    ) -> PlanOutcome:
        """
        Return the outcome of a request, planned again while a wearer who moves is in its way.

        After a time [s], or `time_limit`, the last outcome stands.
        """
        longest = parameters.options.time_limit if patience is None else patience
        monitor, end = self._monitor, time.monotonic() + longest
        n_faults = monitor.n_faults
        self._await_clear_ray(parameters, ticket)
        while True:
            n_stops = monitor.n_stops

            def publish(
                outcome: PlanOutcome, revalidation: Revalidation, n_stops: int = n_stops
            ) -> bool:
                assert outcome.trajectory is not None
                parameters = revalidation.parameters
                start = 0.0 if outcome.handover is None else outcome.handover.time
                msg = self._publishers.motion(outcome.trajectory, parameters, start)

                def publish_now() -> bool:
                    if monitor.n_faults != n_faults:
                        raise RequestError(
                            ErrorCode.FAILURE,
                            f'an error while the motion was planned: {monitor.stop_reason}',
                        )
                    is_published = self._publish(ticket, outcome, revalidation, n_stops, msg)
                    if is_published:
                        settle_published(outcome, parameters)
                    return is_published

                try:
                    # In the node's own thread, once all received messages are processed.
                    return self._barrier.call(publish_now)
                except NodeIsBusyError:
                    require_not_cancelled(lambda: ticket.is_cancelled)
                    raise RequestError(
                        ErrorCode.SENSOR_INFO_STALE,
                        'the node is busy: bodies received while the motion was planned are not '
                        'processed yet',
                    ) from None

            outcome = plan_request(
                self._inputs,
                parameters,
                self._now,
                self._planner,
                lambda: ticket.is_cancelled,
                publish,
                goal,
                monitor.hold,
            )
            may_change = outcome.is_outdated or (
                outcome.is_in_the_way and self._inputs.is_wearer_moving()
            )
            if not may_change or ticket.is_cancelled or time.monotonic() >= end:
                return outcome
            time.sleep(AGAIN)
            parameters = self._parameters_for(ticket)

    def _parameters_for(self, ticket: _Ticket) -> PlannerParameters:
        """
        Return the parameters of a plan, once it is known whether the body stands still.

        Called in the worker's thread, which waits for that.
        """
        end = time.monotonic() + LONGEST_UNKNOWN
        while not ticket.is_cancelled and time.monotonic() < end:
            left = self._inputs.source.time_until_known(time.monotonic())
            if not self._reporter.parameters.stands_still or left <= 0.0:
                break
            time.sleep(min(left, AGAIN))
        return self._reporter.parameters

    def _require_same_source(self, parameters: PlannerParameters) -> None:
        """Raise RequestError where it is not known any more that the body stands still."""
        is_standing = self._reporter.parameters.stands_still
        left = self._inputs.source.time_until_known(time.monotonic())
        if is_standing != parameters.stands_still or (is_standing and left > 0.0):
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                'another body came while the motion was planned, expected the same one while it '
                'stands still, or a stream of them',
            )

    def _await_clear_ray(self, parameters: PlannerParameters, ticket: _Ticket) -> None:
        """
        Let a wearer who moves take a hand out of the pointing ray of an arm at rest.

        Whatever the arm did, its ray would sweep over the hand first.
        """
        end = time.monotonic() + min(RAY_PATIENCE, parameters.options.time_limit)
        while (
            self._inputs.is_wearer_moving()
            and self._is_ray_crossed(parameters)
            and time.monotonic() < end
            and not ticket.is_cancelled
        ):
            time.sleep(AGAIN)

    def _is_ray_crossed(self, parameters: PlannerParameters) -> bool:
        """Return whether the arm rests, clear of the wearer but for its pointing ray."""
        now, arm = self._now(), parameters.arm
        try:
            joints = self._inputs.joints_at(now, parameters.joint_timeout)
            scene = scene_of(self._inputs.body_at(now, parameters))
        except RequestError:
            return False
        if joints.is_moving(now, parameters.rest_speed):
            return False
        q = joints.mean_positions(parameters.rest_speed)
        margin, length = parameters.margin, parameters.ray_guard_length
        is_free = is_place_free(q, arm, scene, margin, length)
        return not is_free and is_place_free(q, arm, scene, margin, 0.0)

    def _response(
        self, outcome: PlanOutcome, parameters: PlannerParameters, begin: float
    ) -> Response:
        """Return the response to a request that began at a time, by `time.perf_counter`."""
        code, sentence, plan = outcome.code, outcome.sentence, outcome.plan
        trajectory, figures = outcome.trajectory, PlanReport()
        if trajectory is not None and parameters.stands_still:
            sentence = f'{sentence}; {NO_PROMISE}'
        if plan is not None:
            figures = replace(figures, seed=plan.seed, planning_time=plan.planning_time)
        if plan is not None and plan.path is not None and trajectory is not None:
            figures = replace(
                figures,
                response_time=time.perf_counter() - begin,
                duration=trajectory.duration,
                length=plan.path.length,
                clearance=plan.clearance,
            )

        def tool_path() -> Path:
            return Path() if trajectory is None else self._tool_path(trajectory, parameters)

        def conclude() -> None:
            self._reporter.conclude(code, sentence, figures)
            if trajectory is not None:
                self._unseen = outcome, parameters

        is_solved = trajectory is not None and not self._is_closed
        return Response(is_solved, code, sentence, tool_path, conclude)

    def _publish(
        self,
        ticket: _Ticket,
        outcome: PlanOutcome,
        revalidation: Revalidation,
        n_stops: int,
        msg: JointTrajectory,
    ) -> bool:
        """
        Publish the motion of a request, and have it monitored; called in the node's own thread.

        Return False where it is too late; raise RequestError where it is no longer valid.
        """
        monitor, parameters = self._monitor, revalidation.parameters
        require_not_cancelled(lambda: ticket.is_cancelled)
        self._require_same_source(parameters)
        if n_stops != monitor.n_stops:
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f'the arm was stopped while its motion was planned: {monitor.stop_reason}',
            )
        if monitor.pending_stop:
            raise RequestError(
                ErrorCode.FAILURE,
                f'a stop of the arm could not be published: {monitor.pending_stop}',
            )
        revalidation.require_fit()
        if revalidation.is_late():
            return False
        trajectory, plan, snapshot = outcome.trajectory, outcome.plan, outcome.snapshot
        assert trajectory is not None and plan is not None and snapshot is not None
        self._reporter.body_used(self._inputs.body.age(self._now()))
        # From here on the request cannot be cancelled.
        self._open.discard(ticket)
        handover, start = outcome.handover, self._now() + ahead(parameters.controller_delay)
        monitor.begin(
            ExecutingMotion(
                trajectory=trajectory,
                start_time=start if handover is None else handover.time,
                target_distance=plan.target_distance,
                escape_time=plan.escape_time,
            ),
            snapshot.goal,
            parameters,
            lambda: self._publishers.publish_planned(msg),
            math.inf if handover is None else handover.joins,
            None if handover is None else handover.before,
        )
        self._pursued, self._given_up = ticket.request, (None, *CANCELLED)
        self._reporter.pursued(ticket.request)
        return True

    def _follow_up(self) -> None:
        """Show the newest motion; after a stop, check it a second time and plan again."""
        self._show_newest()
        if not self._monitor.executes_whole:
            self._publishers.withdraw_whole()
        for stop in self._monitor.take_stops():
            self.prepare(partial(self._check_stop, stop))
            if stop.goal is not None and not stop.is_replanned:
                # Also what was to be tried again after an earlier stop.
                self.withdraw(stop.goal)
            if stop.is_replanned and stop.goal is not None and not self._is_closed:
                self._discard_resumption()
                duration = stop.trajectory.duration
                self._resumption = _Resumption(
                    _Ticket(stop.goal, self._pursued or 0),
                    stop.goal,
                    stop.n_motions,
                    self._n_requests,
                    self._now() + duration,
                    time.monotonic() + duration + LONGEST_SETTLING,
                    time.monotonic() + duration + self._reporter.parameters.patience,
                    is_during_stop=stop.scene is not None,
                )
                self._open.add(self._resumption.ticket)
        resumption = self._resumption
        if resumption is not None and self._is_overtaken(resumption):
            self._give_up(resumption, *OVERTAKEN)
            self._discard_resumption()
        elif resumption is not None and resumption.is_due(
            self._inputs.joints.value, self._reporter.parameters.rest_speed
        ):
            self._resumption = None
            self.prepare(partial(self._resume, resumption))
        self._note_end()

    def _give_up(self, resumption: _Resumption, code: ErrorCode, sentence: str) -> None:
        """Keep why the goal of a stopped motion is given up, unless another motion has begun."""
        if resumption.n_motions == self._monitor.n_motions:
            self._given_up = resumption.goal, code, sentence

    def _note_end(self) -> None:
        """Report a goal that is not pursued any more before the arm has arrived."""
        monitor, goal = self._monitor, self._monitor.goal
        if goal is None or monitor.is_monitoring or self.pursues(goal):
            return
        if self._pursued is not None:
            self._pursued = None
            if not monitor.has_arrived:
                why = self.why_given_up(goal)
                stopped = self._reporter.monitor_state[1] or monitor.stop_reason
                self._reporter.given_up(stopped if why is None else answer(*why))
        if monitor.running is None:
            self._reporter.nothing_runs()

    def _is_overtaken(self, resumption: _Resumption) -> bool:
        """Return whether one was commanded since its stop, or requested since its first try."""
        is_requested = resumption.n_requests != self._n_requests and not resumption.is_first
        return is_requested or resumption.n_motions != self._monitor.n_motions

    def _discard_resumption(self) -> None:
        if self._resumption is not None:
            self._open.discard(self._resumption.ticket)
            self._resumption = None

    def _resume(self, resumption: _Resumption) -> None:
        """Plan again for the goal of a motion that was stopped; called in the worker's thread."""
        ticket = resumption.ticket
        if ticket.is_cancelled or self._is_overtaken(resumption):
            self._give_up(resumption, *(CANCELLED if ticket.is_cancelled else OVERTAKEN))
            self._open.discard(ticket)
            return
        responses: list[Response] = []
        begin, present = time.perf_counter(), time.monotonic()
        n_requests = resumption.n_requests if not resumption.is_first else self._n_requests
        may_pass = self._work(resumption.goal, begin, ticket, responses.append, 0.0)
        response = responses[-1]
        if resumption.is_during_stop and not response.is_solved:
            self._resumption = replace(resumption, is_during_stop=False)
            return
        is_last = not may_pass or present >= resumption.end
        if response.is_solved or resumption.is_first:
            response.conclude()
        elif is_last:
            self._reporter.revise(response.code, response.sentence)
        if not response.is_solved and (resumption.is_first or is_last):
            self._monitor.report_hold(response.text)
        if not is_last:
            self._resumption = replace(
                resumption,
                n_requests=n_requests,
                stopped=math.inf,
                latest=present + RESUME_PERIOD,
                is_first=False,
            )
        else:
            if not response.is_solved:
                self._give_up(resumption, response.code, response.sentence)
            self._open.discard(ticket)

    def _check_stop(self, stop: Stop) -> None:
        """Have the second checker check a stop that was published as proven free."""
        incident = incident_of_stop(stop, self._planner)
        if incident is not None:
            noted, file = keep(incident, cast(PlannerParameters, stop.parameters).incident_folder)
            self._reporter.incident(file)
            self._node.get_logger().error(f'fail-safe stop: {incident.sentence}{noted}')

    def _tool_path(self, trajectory: Trajectory, parameters: PlannerParameters) -> Path:
        """Return the tool's path; empty after an error, since the motion is published already."""
        try:
            return self._publishers.tool_path(trajectory, parameters)
        except Exception:
            self._node.get_logger().error(traceback.format_exc())
            return Path()

    def _show_newest(self) -> None:
        """
        Have the newest motion shown, if there is a subscriber.

        That takes the interpreter for several milliseconds, which could delay a stop.
        """
        present, unseen = time.monotonic(), self._unseen
        if (
            unseen is not None
            and present - self._shown >= SHORTEST_SHOW
            and self._publishers.is_view_subscribed()
        ):
            self._unseen, self._shown = None, present
            self.prepare(partial(self._show, *unseen))

    def _show(self, outcome: PlanOutcome, parameters: PlannerParameters) -> None:
        """Publish what shows a motion."""
        assert outcome.trajectory is not None and outcome.snapshot is not None
        snapshot = outcome.snapshot
        self._publishers.publish_view(
            outcome.trajectory, parameters, snapshot.scene, snapshot.goal.target
        )

    def _now(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9
