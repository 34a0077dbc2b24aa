# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The planner as a ROS 2 node: its services, start and shutdown."""

import signal
import time
from typing import Any, TYPE_CHECKING

from geometry_msgs.msg import PointStamped, Pose
from nav_msgs.srv import GetPlan
import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rrth_planner.model.errors import MessageError, RrthError
from rrth_planner.model.status import ErrorCode
from rrth_planner.pipeline.worker_process import WorkerProcess
from rrth_planner.requests.answer import answer
from rrth_planner.ros.interface.parameters import declare_parameters, PlannerParameters
from rrth_planner.ros.messages.error_codes import code_of_rejection
from rrth_planner.ros.middleware.answers import Answers
from rrth_planner.ros.middleware.executor import settle_interpreter, spin
from rrth_planner.ros.middleware.qos import SERVICE
from std_srvs.srv import Trigger

# What has to be compiled, or takes long to load, is imported once the node exists: discovery goes
# on meanwhile.
if TYPE_CHECKING:
    from rrth_planner.model.goal import PointingGoal
    from rrth_planner.pipeline.planning_process import Planner
    from rrth_planner.requests.outcome import Outcome
    from rrth_planner.ros.requests.point_head import PointHeadServer

NAME = 'rrth_planner'
BEGIN = time.monotonic()


class PlannerNode(Node):
    """Plan a motion that points the arm at a target, from the latest inputs, on request."""

    def __init__(
        self,
        planner: 'Planner | None' = None,
        worker: WorkerProcess | None = None,
        **kwargs: Any,
    ) -> None:
        """
        Subscribe, compile or load the planner, and only then offer the services.

        Parameters
        ----------
        planner : Planner, optional
            Without, a `PlanningProcess`, which ends with the node.
        worker : WorkerProcess, optional
            For that one, if it is started already.
        kwargs
            Of `rclpy.node.Node`.

        Raises
        ------
        RrthError
            A rejected parameter, an arm that cannot point, no library for the second checker.

        """
        super().__init__(NAME, **kwargs)
        self._point_head: PointHeadServer | None = None
        parameters = declare_parameters(self, self._on_parameters)
        self._compile()
        from rrth_planner.execution.warm_up import warm_up
        from rrth_planner.pipeline.planning_process import PlanningProcess

        # It loads in parallel to the node.
        self._planner: Planner = planner or PlanningProcess(
            parameters.arm,
            parameters.options,
            self.get_logger().error,
            worker,
            parameters.second_checker,
        )
        try:
            self._create_components(parameters)
            # In this process, while the other one loads.
            warm_up(parameters.required, parameters.stop_limits, parameters.execution.separation)
            self._planner.warm_up(parameters.arm, parameters.options, parameters.second_checker)
        except BaseException:
            self._planner.close()
            raise
        group = ReentrantCallbackGroup()
        for kind, name, callback in (
            (Trigger, '~/plan', self._on_plan),
            (GetPlan, '~/get_plan', self._on_get_plan),
            (Trigger, '~/cancel', self._on_cancel),
            (Trigger, '~/reset', self._on_reset),
            (Trigger, '~/save', self._on_save),
        ):
            self.create_service(kind, name, callback, qos_profile=SERVICE, callback_group=group)
        self._serve_action(Answers(self))
        self.get_logger().info(f'ready after {time.monotonic() - BEGIN:.1f} s')

    def _create_components(self, parameters: PlannerParameters) -> None:
        """Create inputs, monitor and queue."""
        from rrth_planner.requests.request_queue import PERIOD, PlanQueue
        from rrth_planner.ros.interface.inputs import Inputs
        from rrth_planner.ros.interface.publishers import PlanPublishers
        from rrth_planner.ros.interface.reporter import Reporter
        from rrth_planner.ros.interface.scene_monitor import SceneMonitor
        from rrth_planner.ros.monitor.execution_monitor import ExecutionMonitor
        from rrth_planner.ros.requests.node_host import NodeHost

        self._inputs = inputs = Inputs(
            *(self.resolve_topic_name(name) for name in ('body_boxes', 'target', 'joint_states'))
        )
        self._motions = publishers = PlanPublishers(
            self, parameters.separates, parameters.base_frame
        )
        self._reporter = Reporter(self, inputs, parameters)
        self._monitor = ExecutionMonitor(self, inputs, self._reporter, publishers)
        self._scene_monitor = SceneMonitor(
            self,
            parameters,
            inputs,
            self._on_change,
            self._monitor.on_body,
            self.fail,
            self._keep_removed,
            self._monitor.check_clock,
            lambda: self._reporter.parameters.rest_speed,
        )
        self.host = NodeHost(self, self._planner, self.fail)
        self._queue = PlanQueue(self.host, inputs, self._reporter, publishers, self._monitor)
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(PERIOD, self._queue.follow_up, clock=steady)

    def _serve_action(self, answers: Answers) -> None:
        """Offer the action point_head, where its type is installed."""
        from rrth_planner.ros.messages.point_head import PointHead

        if PointHead is not None:
            from rrth_planner.ros.requests.point_head import PointHeadServer

            self._point_head = PointHeadServer(
                self,
                self._scene_monitor,
                self._inputs,
                self._reporter,
                self._monitor,
                self._queue,
                self.respond,
                answers,
            )

    def close(self) -> None:
        """Stop an arm in motion; end the plan in progress, the queue, and the planning process."""
        # First of all; to end the rest takes time, or may fail.
        self._monitor.close()
        if self._point_head is not None:
            self._point_head.close()
        self._queue.close()

    def _keep_removed(self) -> float:
        """Return how long a part of the wearer that is removed now stays where it was [s]."""
        return 0.0 if self._monitor.watch.running is None else self._reporter.parameters.keep_lost

    def fail(self, what: str) -> None:
        """Stop an arm in motion after an unexpected error."""
        self._monitor.fail(what, is_replanned=False)

    def _on_change(self) -> None:
        """Take note of what comes in for the first time, or otherwise than before."""
        separation = self._reporter.parameters.execution.separation
        if self._inputs.source.is_stream and separation is not None:
            self._motions.separate()
        self._reporter.publish()

    def _compile(self) -> None:
        """Compile all kernels, in processes of their own where there is a cache."""
        from rrth_planner.kernels.precompile import prepare_kernels

        prepare_kernels(self.get_logger().info)

    def _on_parameters(self, now: PlannerParameters) -> None:
        before, self._reporter.parameters = self._reporter.parameters, now
        if (
            type(now.options) is not type(before.options)
            or now.second_checker != before.second_checker
        ):
            # Not within the time of the next plan; requests wait until it is done.
            self.host.begin(self.host.warm_up(now.arm, now.options, now.second_checker))

    async def respond(self, goal: 'PointingGoal | None') -> 'Outcome':
        """Return the outcome of a request for a goal, or for the last target."""
        outcome: Outcome = await self.host.future_of(self._queue.respond(goal))
        return outcome

    async def _on_plan(self, _: Any, response: Trigger.Response) -> Trigger.Response:
        outcome = await self.respond(None)
        response.success, response.message = outcome.trajectory is not None, outcome.text
        return response

    async def _on_get_plan(
        self, request: GetPlan.Request, response: GetPlan.Response
    ) -> GetPlan.Response:
        try:
            if request.start.header.frame_id:
                raise MessageError(
                    f'start: frame "{request.start.header.frame_id}", expected an empty start, '
                    'since a plan begins where the arm is'
                )
            if request.start.pose != Pose():
                raise MessageError(
                    'start: a pose, expected an empty start (position 0, orientation 0, 0, 0, 1), '
                    'since a plan begins where the arm is'
                )
            goal = self._scene_monitor.goal(
                PointStamped(header=request.goal.header, point=request.goal.pose.position)
            )
        except MessageError as problem:
            code = code_of_rejection(problem, ErrorCode.INVALID_GOAL_CONSTRAINTS)
            self._reporter.reject(code, f'request of get_plan: {problem}')
            return response
        outcome = await self.respond(goal)
        if outcome.trajectory is not None and outcome.parameters is not None:
            response.plan = self._motions.tool_path(outcome.trajectory, outcome.parameters)
        return response

    def _on_cancel(self, _: Any, response: Trigger.Response) -> Trigger.Response:
        response.success = True
        response.message = answer(ErrorCode.SUCCESS, f'requests cancelled: {self._queue.cancel()}')
        return response

    def _on_reset(self, _: Any, response: Trigger.Response) -> Trigger.Response:
        fault = self._monitor.reset()
        response.success = True
        response.message = answer(ErrorCode.SUCCESS, f'reset: {fault or "nothing"}')
        return response

    async def _on_save(self, _: Any, response: Trigger.Response) -> Trigger.Response:
        try:
            found = ErrorCode.SUCCESS, await self.host.future_of(self._queue.save())
        except RrthError as problem:
            found = ErrorCode.FAILURE, str(problem)
        response.success, response.message = found[0] is ErrorCode.SUCCESS, answer(*found)
        return response


def run(args: list[str] | None = None, worker: WorkerProcess | None = None) -> int:
    """
    Run the node until SIGINT or SIGTERM; return the exit code.

    worker: for its planning process, if it is started already.
    """
    node = None
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = PlannerNode(worker=worker)
        settle_interpreter()
        signals: list[int] = []
        # Not ROS's own handlers, which end the context: an arm in motion must still be stopped.
        for number in (signal.SIGINT, signal.SIGTERM):
            # Only stored: a lock, as of an Event, could be held by what a signal interrupts.
            signal.signal(number, lambda number, _: signals.append(number))
        # The timers of the node wake it up often enough to see the signal.
        spin(node, node.fail, lambda: bool(signals))
    except KeyboardInterrupt:
        pass
    except (RrthError, ParameterException, RuntimeError) as problem:
        if node is not None:
            raise
        get_logger(NAME).fatal(f'cannot start: {" ".join(str(problem).split())}')
        return 1
    finally:
        if node is not None:
            node.close()
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
