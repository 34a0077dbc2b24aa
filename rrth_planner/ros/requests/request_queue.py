# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Requests one after the other, in a thread of their own, so that the node hears meanwhile."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
import time
import traceback
from typing import Any

from nav_msgs.msg import Path
from rclpy.node import Node
from rclpy.task import Future
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.ros.interface.diagnostics import PlanReport
from rrth_planner.ros.interface.inputs import Inputs, RequestError
from rrth_planner.ros.interface.parameters import PlannerParameters
from rrth_planner.ros.interface.publishers import PlanPublishers
from rrth_planner.ros.interface.reporter import Reporter
from rrth_planner.ros.messages.error_codes import answer, ErrorCode
from rrth_planner.ros.middleware.executor_barrier import CatchUp
from rrth_planner.ros.middleware.thread_priority import stand_back
from rrth_planner.ros.monitor.execution_monitor import ExecutionMonitor
from rrth_planner.ros.requests.incidents import incident_of, keep, sentence_of
from rrth_planner.ros.requests.revalidation import busy, require_news
from rrth_planner.ros.requests.stop_validation import incident_of_stop
from rrth_planner.ros.requests.wait_for_rest import Rest

# So often is a moment sought to tell a motion in.
MOST_TRIES = 20
CANCELLED = (ErrorCode.PREEMPTED, 'the request was cancelled')


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """
    What a request is answered.

    Parameters
    ----------
    is_solved : bool
        Whether a motion was published.
    text : str
    tool_path : callable
        Returns the tool's path; empty where no motion was published.
    conclude : callable
        What is left to do when it has been answered: to show and to report it.

    """

    is_solved: bool
    text: str
    tool_path: Callable[[], Path]
    conclude: Callable[[], None]


class _Ticket:
    """One plan, until its motion is published or it ends without one."""

    is_cancelled = False

    def __init__(self, is_asked: bool = True) -> None:
        """Begin a request, or what nobody asked for."""
        self.is_asked = is_asked


class PlanQueue:
    """
    Plan and publish for one request at a time; the others wait their turn.

    Parameters
    ----------
    node : Node
    heard : Inputs
    reporter : Reporter
        Its parameters, as they are when a request's turn begins, are those of the plan.
    plan_request : callable
        `plan_request.plan_request`, which is loaded late.
    catch_up : CatchUp
        Returns when the bodies that came are read.

    """

    def __init__(
        self,
        node: Node,
        heard: Inputs,
        reporter: Reporter,
        plan_request: Callable[..., Any],
        catch_up: CatchUp,
    ) -> None:
        """Start with nothing to do."""
        self._catch_up = catch_up
        self._node, self._heard, self._reporter = node, heard, reporter
        self._plan_request = plan_request
        self._publishers = PlanPublishers(node)
        self._worker = ThreadPoolExecutor(
            max_workers=1, thread_name_prefix='planner', initializer=stand_back
        )
        # Held while a motion is published, so that what was cancelled before never is.
        self._lock = heard.lock
        self.guard = ExecutionMonitor(node, heard, reporter, self._publishers, self._lock)
        self.guard.plan_again = self._plan_again
        self.guard.judge = self._judge
        self._open: set[_Ticket] = set()
        self._is_closed = False

    async def respond(self, goal: PointingGoal | None) -> Response:
        """Return the response to a request for a goal, or for the last target, after its turn."""
        future, ticket = Future(), _Ticket()
        begin = time.perf_counter()

        def work() -> None:
            try:
                future.set_result(self._work(goal, begin, ticket))
            except BaseException as problem:
                future.set_exception(problem)
            executor = self._node.executor
            if executor is not None:
                executor.wake()

        with self._lock:
            self._open.add(ticket)
        try:
            self._worker.submit(work)
            response: Response = await future
            executor = self._node.executor
            if executor is not None:
                # As a task of its own: the answer is sent before the executor comes to it.
                executor.create_task(self.prepare, response.conclude)
            return response
        finally:
            with self._lock:
                self._open.discard(ticket)

    def prepare(self, work: Callable[[], None]) -> None:
        """Have something done in the worker's thread before the requests that follow."""

        def prepared() -> None:
            try:
                work()
            except Exception:
                # The request that needs it will say what is wrong.
                self._node.get_logger().error(traceback.format_exc())

        with self._lock:
            if not self._is_closed:
                self._worker.submit(prepared)

    def cancel(self) -> int:
        """End the requests that have published no motion yet; return how many these are."""
        with self._lock:
            ended, self._open = self._open, set()
            for ticket in ended:
                ticket.is_cancelled = True
        return len(ended)

    def close(self) -> None:
        """End everything; nothing is published any more, and no request may follow."""
        with self._lock:
            self._is_closed = True
        self.cancel()
        self.guard.close()
        self._worker.shutdown(wait=True, cancel_futures=True)

    def _work(self, goal: PointingGoal | None, begin: float, ticket: _Ticket) -> Response:
        """Plan and publish; called in the worker's thread."""
        figures, shown, incident = PlanReport(), None, None
        parameters = self._reporter.parameters
        n_brakes, running = self.guard.n_brakes, self.guard.running
        try:
            outcome = self._plan_request(
                self._heard,
                parameters,
                self._now,
                lambda: self._should_stop(ticket),
                goal,
                running,
                self._catch_up,
                lambda outcome, fits: self._tell(ticket, outcome, fits, parameters, n_brakes),
            )
            code, sentence, plan = outcome.code, outcome.sentence, outcome.plan
            incident = outcome.incident
            if plan is not None:
                figures = replace(figures, seed=plan.seed, planning_time=plan.planning_time)
            if outcome.trajectory is not None:
                shown = outcome
                figures = replace(
                    figures,
                    response_time=time.perf_counter() - begin,
                    duration=plan.trajectory.duration,
                    length=plan.path.length,
                    clearance=plan.clearance,
                )
            elif self._is_cancelled(ticket) and code is not ErrorCode.PREEMPTED:
                code, sentence = CANCELLED
        except Exception as problem:
            # Whatever it is, the caller gets an answer, and the node lives on.
            self._node.get_logger().error(traceback.format_exc())
            with self._lock:
                self._open.discard(ticket)
            code, sentence, shown = ErrorCode.FAILURE, sentence_of(problem), None
            incident = incident_of(problem)
        if incident is not None:
            noted, file = keep(incident, parameters.incident_folder)
            sentence += noted
            self._reporter.incident(file)

        def tool_path() -> Path:
            return Path() if shown is None else self._tool_path(shown, parameters)

        def conclude() -> None:
            self._heard.way.give()
            self._reporter.conclude(code, sentence, figures)
            self._heard.way.give()
            if shown is not None:
                self._show(shown, parameters)

        is_solved = code is ErrorCode.SUCCESS and not self._is_closed
        return Response(is_solved, answer(code, sentence), tool_path, conclude)

    def _tell(
        self,
        ticket: _Ticket,
        outcome: Any,
        fits: Callable[[], bool],
        parameters: PlannerParameters,
        n_brakes: int,
    ) -> bool:
        """Publish a request's motion if it fits, and return that, or raise RequestError."""
        begin = 0.0 if outcome.start is None else outcome.start.time
        msg = self._publishers.motion(outcome.trajectory, parameters, begin)
        for _ in range(MOST_TRIES):
            # The last of all that may take its time.
            require_news(self._catch_up)
            with self._lock:
                self._require_use(ticket, n_brakes)
                if not fits():
                    return False
                # Where the machine stood still others have come, and wait for the lock.
                if self._catch_up.is_news():
                    self._open.discard(ticket)
                    self.guard.begin(
                        ExecutingMotion(
                            trajectory=outcome.trajectory,
                            start_time=begin or self._now(),
                            reach=outcome.plan.reach,
                            escape_time=outcome.plan.escape_time,
                        ),
                        outcome.inputs.goal,
                        parameters,
                        lambda: self._publishers.tell(msg),
                    )
                    return True
        raise busy()

    def _require_use(self, ticket: _Ticket, n_brakes: int) -> None:
        """Raise RequestError where a motion is of no use any more; the lock is held."""
        if ticket.is_cancelled or self._is_closed:
            raise RequestError(*CANCELLED)
        if n_brakes != self.guard.n_brakes:
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f'the arm was stopped while its motion was planned: {self.guard.cause}',
            )
        if self.guard.due:
            raise RequestError(
                ErrorCode.FAILURE, f'a stop of the arm could not be published: {self.guard.due}'
            )

    def _should_stop(self, ticket: _Ticket) -> bool:
        """Return whether a request was cancelled, once whoever hears the wearer is through."""
        self._heard.way.give()
        return ticket.is_cancelled

    def _is_cancelled(self, ticket: _Ticket) -> bool:
        """Return whether a request was cancelled before it ended, without a motion."""
        with self._lock:
            self._open.discard(ticket)
            return ticket.is_cancelled or self._is_closed

    def _plan_again(self, goal: PointingGoal, wait: float) -> None:
        """Plan for a goal once more as soon as the arm, which brakes, rests."""
        ticket, n_begun = _Ticket(is_asked=False), self.guard.n_begun
        rest = Rest(self._heard.joints, self._now, wait)

        def is_wanted() -> bool:
            # Whoever asked for a motion that has begun since then wants that one.
            return not ticket.is_cancelled and self.guard.n_begun == n_begun

        def work() -> None:
            # No request waits for the rest of the arm: this comes after it.
            if not rest.wait(lambda: self._is_asked() or not is_wanted()) and is_wanted():
                self.prepare(work)
                return
            response = None
            try:
                if is_wanted():
                    response = self._work(goal, time.perf_counter(), ticket)
            finally:
                with self._lock:
                    self._open.discard(ticket)
            if response is None:
                return
            response.conclude()
            if not response.is_solved:
                self.guard.hold(response.text)

        with self._lock:
            self._open.add(ticket)
        self.prepare(work)

    def _is_asked(self) -> bool:
        """Return whether a request waits for its turn."""
        with self._lock:
            return any(ticket.is_asked for ticket in self._open)

    def _judge(
        self, stop: Trajectory, scene: Scene, goal: PointingGoal, parameters: PlannerParameters
    ) -> None:
        """Have the second judge look at a stop that was published."""

        def work() -> None:
            incident = incident_of_stop(stop, scene, goal, parameters, self._heard.way.give)
            if incident is not None:
                noted, file = keep(incident, parameters.incident_folder)
                self._reporter.incident(file)
                self._node.get_logger().error(f'the arm brakes, but {incident.sentence}{noted}')

        self.prepare(work)

    def _tool_path(self, outcome: Any, parameters: PlannerParameters) -> Path:
        """Return the tool's path; a failure of this does not unsay the motion."""
        try:
            return self._publishers.tool_path(outcome.trajectory, parameters)
        except Exception:
            self._node.get_logger().error(traceback.format_exc())
            return Path()

    def _show(self, outcome: Any, parameters: PlannerParameters) -> None:
        """Publish what shows a motion."""
        self._publishers.publish_view(
            outcome.trajectory,
            parameters,
            outcome.inputs.scene,
            outcome.inputs.goal.target,
            self._heard.way.give,
        )

    def _now(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9
