# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node of the viewer: it shows the running nodes and requests plans."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack, suppress
from pathlib import Path
from threading import Lock, Thread
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PointStamped
import numpy as np
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rrth_planner.execution.separation_status import SeparationStatus
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import MessageError, one_line, OptionsError
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.ros.interface.inputs import Inputs
from rrth_planner.ros.interface.parameters import declare_parameters
from rrth_planner.ros.interface.scene_monitor import SceneMonitor
from rrth_planner.ros.interface.separation_status import separation_from_msg
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg
from rrth_planner.ros.middleware.open_subscription import Arrival, OpenSubscription
from rrth_planner.ros.middleware.qos import LATCHED
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

NAME, PLANNER = 'rrth_viewer', 'rrth_planner'
SERVICE = f'{PLANNER}/plan'
# Longest wait for the acknowledgement of a target [s].
LONGEST_WAY = 1.0
# From an answer to the next request: by then the arm is in motion; period of the timer [s].
REQUEST_PAUSE, TIMER_PERIOD = 0.3, 0.02


class ViewerFeed(Node):
    """
    Subscribes to body, target, joints and motions; publishes targets and requests plans.

    Its parameters are those of the planner: arm, base frame, margin and `ray_guard_length` are
    taken from them.
    """

    def __init__(self, **kwargs: Any) -> None:
        """Subscribe; a rejected parameter raises RrthError or ParameterException."""
        super().__init__(NAME, **kwargs)
        parameters = declare_parameters(self)
        self.arm, self.margin = parameters.arm, parameters.margin
        self.ray_guard_length = parameters.ray_guard_length
        separation = parameters.execution.separation
        # What is assumed of a wearer who moves; None: motions are not separated from him.
        self.rules = None if separation is None else separation.rules
        self._frame = parameters.base_frame
        self._inputs = Inputs(
            *(self.resolve_topic_name(name) for name in ('body_boxes', 'target', 'joint_states'))
        )
        self._scene_monitor = SceneMonitor(self, parameters, self._inputs)
        self._motions = [
            OpenSubscription(self, JointTrajectory, topic, take, self._reject)
            for topic, take in (
                ('joint_trajectory', self._on_motion),
                (f'{PLANNER}/planned_trajectory', self._on_planned_motion),
            )
        ]
        self._states = self.create_subscription(
            DiagnosticStatus, f'{PLANNER}/state', self._on_state, LATCHED
        )
        # Whether motions come as stretches, and how they are executed then; None: not known.
        self._is_separated = False
        self.separation: SeparationStatus | None = None
        self._targets = self.create_publisher(PointStamped, 'target', LATCHED)
        self._client = self.create_client(Trigger, SERVICE)
        # The last motion that was published; when the arm was given it, or a stretch of it, by a
        # clock that never steps [s], and that.
        self.trajectory: Trajectory | None = None
        self.given: tuple[float, Trajectory] | None = None
        self._shown: tuple[WearerBody | None, Scene] = (None, Scene(()))
        # Of requests: written by the page's threads, read by the executor's.
        self._lock = Lock()
        self._is_asking, self._is_wanted = False, False
        self._newest: Array | None = None
        self._asked: Future | None = None
        self._answer, self._answered = '', -REQUEST_PAUSE
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self.create_timer(TIMER_PERIOD, self._on_timer, clock=steady)

    @property
    def scene(self) -> Scene:
        """The wearer in the base frame."""
        now = self.get_clock().now().nanoseconds * 1e-9
        body = self._inputs.body.value.at(now)
        if body is not self._shown[0]:
            self._shown = (body, scene_of(body))
        return self._shown[1]

    @property
    def target(self) -> Array | None:
        """In the base frame, (3,) [m]."""
        goal = self._inputs.target.value
        return None if goal is None else goal.target

    @property
    def positions(self) -> Array | None:
        """Of the joints, (dof,) [rad]."""
        reading = self._inputs.joints.value
        return None if reading is None else reading.positions

    @property
    def said(self) -> str:
        """The last answer of the planner, or what is still missing."""
        missing = [topic.topic for topic in self._inputs.all.values() if not topic.n_good]
        if not self._client.service_is_ready():
            missing.append(f'service {self._client.srv_name}')
        waiting = f'waiting for {", ".join(missing)}' if missing else ''
        status, state = self.separation, ''
        if status is not None:
            cause = f': {one_line(status.cause)}' if status.cause else ''
            state = f'{status.state.name}{cause}, at {status.rate:.0%} of its speed'
        said = '; '.join(filter(None, (state, self._answer, waiting)))
        return said or 'drag the target, or press Plan'

    def ask(self, target: Array | None = None) -> None:
        """Publish a target, (3,) in the base frame [m], and ask for a plan; the newest counts."""
        # Not published at once: a request would overtake queued targets.
        newest = None if target is None else np.array(target, dtype=np.float64)
        with self._lock:
            self._newest = self._newest if newest is None else newest
            self._is_wanted = True

    def _on_timer(self) -> None:
        """Request the wanted plan, one at a time, and not while the arm is about to set off."""
        is_ready = self._client.service_is_ready()
        if self._asked is not None and not is_ready:
            # No answer comes from a planner that has ended.
            self._client.remove_pending_request(self._asked)
            self._conclude('the planner has ended without an answer')
        is_soon = time.monotonic() < self._answered + REQUEST_PAUSE
        with self._lock:
            if not self._is_wanted or self._is_asking or is_soon or not is_ready:
                return
            self._is_asking, self._is_wanted = True, False
            target, self._newest = self._newest, None
        if target is not None:
            msg = PointStamped()
            msg.header.frame_id = self._frame
            msg.header.stamp = self.get_clock().now().to_msg()
            msg.point.x, msg.point.y, msg.point.z = target.tolist()
            self._targets.publish(msg)
        # The request must not overtake the target.
        self._targets.wait_for_all_acked(Duration(seconds=LONGEST_WAY))
        self._asked = self._client.call_async(Trigger.Request())
        self._asked.add_done_callback(self._on_answer)

    def _on_answer(self, future: Future) -> None:
        problem = future.exception()
        if problem is None:
            self._conclude(one_line(str(future.result().message)))
        else:
            self._conclude(f'no answer of the planner: {one_line(str(problem))}')

    def _conclude(self, answer: str) -> None:
        """Keep the answer of a request; the next one may follow."""
        self._answer, self._answered, self._asked = answer, time.monotonic(), None
        with self._lock:
            self._is_asking = False

    def _on_state(self, msg: DiagnosticStatus) -> None:
        try:
            self.separation = separation_from_msg(msg)
        except MessageError as problem:
            self.get_logger().warning(f'{self._states.topic_name} rejected: {problem}')

    def _on_planned_motion(self, msg: JointTrajectory, _: Arrival) -> None:
        if (motion := self._motion_of(msg)) is not None:
            self.trajectory, self._is_separated = motion, True

    def _on_motion(self, msg: JointTrajectory, _: Arrival) -> None:
        if (motion := self._motion_of(msg)) is None:
            return
        self.given = time.monotonic(), motion
        if not self._is_separated:
            # Else it is a stretch of the planned motion, which is shown.
            self.trajectory = motion

    def _motion_of(self, msg: JointTrajectory) -> Trajectory | None:
        """Return the motion of a message; None, with a warning: it is none."""
        try:
            return joint_trajectory_from_msg(msg, self.arm.joint_names)
        except MessageError as problem:
            self._reject(problem)
            return None

    def _reject(self, problem: MessageError) -> None:
        self.get_logger().warning(f'joint_trajectory rejected: {problem}')


@contextmanager
def following(
    arm: Path | None, settings: Path | None, ros_args: Sequence[str] = ()
) -> Iterator[ViewerFeed]:
    """
    Give a feed that spins in a thread of its own while the block runs.

    The files are laid out as `config/arm.yaml` and `config/planner.yaml`; without one for the arm
    it is as the settings or `ros_args` (remaps and parameters, from `--ros-args` on) say. Raises
    RrthError for a rejected argument or parameter.
    """
    own = ['--ros-args', '--params-file', str(settings), '--'] if settings else []
    overrides = [Parameter('arm', value=str(arm))] if arm else []
    with ExitStack() as stack:
        stack.callback(rclpy.try_shutdown)
        try:
            rclpy.init(args=[*own, *ros_args], signal_handler_options=SignalHandlerOptions.NO)
            node = ViewerFeed(parameter_overrides=overrides)
        except (ParameterException, RuntimeError) as problem:
            raise OptionsError(f'--live: {problem}') from problem
        stack.callback(node.destroy_node)
        executor = SingleThreadedExecutor()
        executor.add_node(node)

        def spin() -> None:
            with suppress(ExternalShutdownException):
                executor.spin()

        thread = Thread(target=spin, name='viewer feed', daemon=True)
        thread.start()
        stack.callback(thread.join)
        stack.callback(executor.shutdown)
        yield node
