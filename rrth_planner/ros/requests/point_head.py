# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The action point_head: a goal is a request, and ends once the arm has arrived or rests."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
import time
from typing import Any

from rclpy.action import CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.io.settings import LOWEST_LIMIT
from rrth_planner.model.arm import pointing_angle
from rrth_planner.model.errors import MessageError
from rrth_planner.model.goal import PacedGoal, PointingGoal
from rrth_planner.model.status import ErrorCode
from rrth_planner.requests.outcome import Outcome
from rrth_planner.requests.request_queue import PlanQueue
from rrth_planner.ros.interface.inputs import Inputs
from rrth_planner.ros.interface.reporter import Reporter
from rrth_planner.ros.interface.scene_monitor import SceneMonitor
from rrth_planner.ros.messages.error_codes import code_of_rejection
from rrth_planner.ros.messages.paced_goal import paced_goal
from rrth_planner.ros.messages.point_head import PointHead
from rrth_planner.ros.middleware.answers import Answers
from rrth_planner.ros.middleware.paced_action_server import PacedActionServer
from rrth_planner.ros.middleware.qos import SERVICE
from rrth_planner.ros.monitor.execution_monitor import ExecutionMonitor

# Period of the feedback [s].
PERIOD = 0.05
# An arm that rests has arrived where its ray misses the target by no greater angle [rad].
ARRIVED = 2e-3
# Not before this time after its motion was published, which begins a little later [s].
EARLIEST = 0.3
# Results are kept for clients that ask late for so long [s].
KEPT = 60
CANCELLED = 'the goal of point_head was cancelled'
REPLACED = 'another motion has replaced the one to the goal of point_head'


@dataclass(slots=True, eq=False)
class _Pursuit:
    """A goal that the arm is to reach; its future gets how it ended."""

    handle: ServerGoalHandle
    goal: PacedGoal
    # By the monotonic clock; None: no motion to it is published yet [s].
    commanded: float | None = None
    ended: Future = field(default_factory=Future)


class PointHeadServer:
    """
    Serves control_msgs/action/PointHead by the queue of requests; a newer goal replaces an older.

    All of it runs in the node's own thread, and waits for nothing there.
    """

    def __init__(
        self,
        node: Node,
        scene_monitor: SceneMonitor,
        inputs: Inputs,
        reporter: Reporter,
        monitor: ExecutionMonitor,
        queue: PlanQueue,
        respond: Callable[[PointingGoal], Awaitable[Outcome]],
        answers: Answers,
    ) -> None:
        """Offer the action."""
        self._node, self._scene_monitor, self._inputs = node, scene_monitor, inputs
        self._reporter, self._monitor, self._queue = reporter, monitor, queue
        self._respond = respond
        self._pursuits: list[_Pursuit] = []
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD, self._follow_all, clock=steady)
        self._timer.cancel()
        self._server = PacedActionServer(
            answers,
            node,
            PointHead,
            '~/point_head',
            self._execute,
            callback_group=ReentrantCallbackGroup(),
            cancel_callback=self._cancel,
            goal_service_qos_profile=SERVICE,
            result_service_qos_profile=SERVICE,
            cancel_service_qos_profile=SERVICE,
            result_timeout=KEPT,
        )

    def close(self) -> None:
        """Abort the goals that have not ended."""
        for pursuit in self._pursuits:
            if pursuit.handle.is_active and not pursuit.ended.done():
                pursuit.handle.abort()

    async def _execute(self, handle: ServerGoalHandle) -> Any:
        """Pursue a goal until it has ended; return its result, which is empty."""
        try:
            target = self._scene_monitor.goal(handle.request.target)
            goal = paced_goal(handle.request, target, LOWEST_LIMIT)
        except MessageError as problem:
            code = code_of_rejection(problem, ErrorCode.INVALID_GOAL_CONSTRAINTS)
            self._reporter.reject(code, f'goal of point_head: {problem}')
            handle.abort()
            return PointHead.Result()
        for other in self._pursuits:
            # One that is executed ends once a motion to this one is published.
            self._queue.withdraw(other.goal)
        pursuit = _Pursuit(handle, goal)
        self._pursuits.append(pursuit)
        self._timer.reset()
        try:
            if handle.is_cancel_requested:
                self._reporter.reject(ErrorCode.PREEMPTED, CANCELLED)
                handle.canceled()
                return PointHead.Result()
            outcome = await self._respond(goal)
            if outcome.trajectory is not None:
                pursuit.commanded = time.monotonic()
                code, sentence = await pursuit.ended
                self._reporter.revise(code, sentence)
            else:
                code = outcome.code
            if code is ErrorCode.SUCCESS:
                handle.succeed()
            elif handle.is_cancel_requested:
                handle.canceled()
            else:
                handle.abort()
        finally:
            self._pursuits.remove(pursuit)
        return PointHead.Result()

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        """Cancel a goal; an arm that executes its motion is stopped."""
        for pursuit in self._pursuits:
            if pursuit.handle == handle:
                self._stop(pursuit)
        return CancelResponse.ACCEPT

    def _stop(self, pursuit: _Pursuit) -> None:
        """Plan no more for a goal, and stop an arm that executes its motion."""
        if self._monitor.watch.goal is pursuit.goal and self._monitor.watch.is_monitoring:
            self._monitor.brake(CANCELLED)
        self._queue.withdraw(pursuit.goal)

    def _follow_all(self) -> None:
        """Publish feedback, and note which goals have ended."""
        if not self._pursuits:
            self._timer.cancel()
        reading = self._inputs.joints.value
        for pursuit in self._pursuits:
            if pursuit.ended.done():
                continue
            angle = None
            if reading is not None:
                arm = self._reporter.parameters.arm
                angle = pointing_angle(arm, reading.positions, pursuit.goal.target)
                pursuit.handle.publish_feedback(PointHead.Feedback(pointing_angle_error=angle))
            if pursuit.handle.is_cancel_requested:
                # Also one whose motion was published meanwhile.
                self._stop(pursuit)
            end = self._end_of(pursuit, reading, angle)
            if end is not None:
                pursuit.ended.set_result(end)

    def _end_of(
        self, pursuit: _Pursuit, reading: JointReading | None, angle: float | None
    ) -> tuple[ErrorCode, str] | None:
        """Return how a goal with a motion has ended; None: it has not."""
        goal, monitor = pursuit.goal, self._monitor
        if pursuit.commanded is None or self._queue.pursues(goal):
            return None
        is_cancelled = pursuit.handle.is_cancel_requested
        if monitor.watch.goal is not goal:
            return ErrorCode.PREEMPTED, CANCELLED if is_cancelled else REPLACED
        now = self._node.get_clock().now().nanoseconds * 1e-9
        if reading is not None and reading.is_moving(now):
            return None
        if reading is not None:
            # At rest the mean counts: encoders are noisy.
            arm = self._reporter.parameters.arm
            angle = pointing_angle(arm, reading.mean_positions(), goal.target)
        if monitor.watch.is_active(now):
            is_early = time.monotonic() - pursuit.commanded < EARLIEST
            if is_early or is_cancelled or not monitor.watch.is_monitoring:
                return None
            return _arrival(angle)
        if is_cancelled:
            return ErrorCode.PREEMPTED, f'{CANCELLED}, and the arm rests'
        return self._outcome_at_rest(goal, angle)

    def _outcome_at_rest(self, goal: PacedGoal, angle: float | None) -> tuple[ErrorCode, str]:
        """Return how a goal has ended for which nothing is planned or executed any more."""
        arrival = _arrival(angle)
        if arrival is not None:
            return arrival
        why = self._queue.why_given_up(goal)
        if why is not None:
            return why
        reason = self._reporter.monitor_state[1]
        error = 'unknown' if angle is None else f'{angle:.4f}'
        return ErrorCode.FAILURE, (
            f'the arm rests before it has arrived, pointing error {error}, expected at most '
            f'{ARRIVED:g} [rad]{reason and f": {reason}"}'
        )


def _arrival(angle: float | None) -> tuple[ErrorCode, str] | None:
    """Return the end of a goal by its pointing error [rad]; None: it is too great, or unknown."""
    if angle is None or not angle <= ARRIVED:
        return None
    return ErrorCode.SUCCESS, f'the arm has arrived, pointing error {angle:.6f} rad'
