# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node of the demo: what a program that uses planner and playback has to do."""

from collections.abc import Callable
import re
import time
from typing import Any

from geometry_msgs.msg import PointStamped
import numpy as np
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rrth_planner.arm import ArmModel
from rrth_planner.arrays import Array
from rrth_planner.errors import RrthError
from rrth_planner.ros.messages import configuration_from_msg, joint_trajectory_from_msg
from rrth_planner.trajectory import Trajectory
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
ARRIVED = 1e-3
STILL = 1e-6
NO_INPUT_YET = 'UNABLE_TO_AQUIRE_SENSOR_DATA'
# Between two requests of a planner that has not heard everything yet [s].
PAUSE = 0.3


class DemoError(RrthError):
    """Something that ends the demo."""


class DemoClient(Node):
    """
    Tells the planner body and target, asks for motions, and follows the arm.

    Parameters
    ----------
    arm : ArmModel
    timeout : float
        Longest wait for anything [s].
    check : callable
        Raises when going on waiting makes no sense.

    """

    def __init__(self, arm: ArmModel, timeout: float, check: Callable[[], None]) -> None:
        """Create publishers, subscriptions and the client of the planner."""
        super().__init__('rrth_demo')
        self._arm, self._timeout, self._check = arm, timeout, check
        self._state: JointState | None = None
        self._motion: JointTrajectory | None = None
        # All that the arm was told, and where it was, since `watch` was called.
        self._told: list[JointTrajectory] = []
        self._seen: list[JointState] = []
        self._body = self.create_publisher(MarkerArray, 'body_boxes', LATCHED)
        self._target = self.create_publisher(PointStamped, 'target', LATCHED)
        self.create_subscription(JointState, 'joint_states', self._on_state, 10)
        self.create_subscription(JointTrajectory, 'joint_trajectory', self._on_motion, LATCHED)
        self._plan = self.create_client(Trigger, 'rrth_planner/plan')
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)

    def wait_for(self, condition: Callable[[], bool], what: str, timeout: float) -> None:
        """Take messages until a condition holds, or raise DemoError after a time [s]."""
        end = time.monotonic() + timeout
        while not condition():
            self._spinner.spin_once(timeout_sec=0.05)
            self._check()
            if time.monotonic() > end:
                raise DemoError(f'{what}: nothing for {timeout:g} s')

    def wait_for_nodes(self) -> None:
        """Wait until the planner can be asked, and the arm can be seen and listens."""
        self.wait_for(lambda: self._state is not None, 'joint_states', self._timeout)
        self.wait_for(self._plan.service_is_ready, 'service rrth_planner/plan', self._timeout)
        for publisher in (self._body, self._target):
            self._wait_for_listener(publisher)
        self.wait_for(
            lambda: self.count_subscribers('joint_trajectory') > 1,
            'a subscription of joint_trajectory by the arm',
            self._timeout,
        )

    def tell_body(self, body: MarkerArray) -> None:
        """Publish the wearer's body."""
        self._tell(self._body, body)

    def tell_target(self, target: PointStamped) -> None:
        """Publish a target."""
        self._tell(self._target, target)

    def positions(self) -> Array:
        """Return the latest joint positions, (dof,) [rad]."""
        if self._state is None:
            raise DemoError('joint_states: none yet')
        return configuration_from_msg(self._state, self._arm.joint_names)

    def ask_for_motion(self) -> tuple[Trajectory, float]:
        """Return the motion that the planner publishes, and its planning time [ms]."""
        self._motion = None
        end = time.monotonic() + self._timeout
        answer = self._call()
        while answer.message.startswith(NO_INPUT_YET) and time.monotonic() < end:
            self._pause()
            answer = self._call()
        if not answer.success:
            raise DemoError(f'the planner refused: {answer.message}')
        self.wait_for(lambda: self._motion is not None, 'joint_trajectory', self._timeout)
        planning_time = re.search(r'planning time ([0-9.]+) ms', answer.message)
        if planning_time is None:
            raise DemoError(f'no planning time in the answer "{answer.message}"')
        trajectory = joint_trajectory_from_msg(self._motion, self._arm.joint_names)
        return trajectory, float(planning_time.group(1))

    def wait_for_arrival(self, trajectory: Trajectory) -> None:
        """Wait until the arm stands still at the end of a motion."""
        self.wait_for(
            lambda: self._is_still_at(trajectory.positions[-1]),
            f'the arm at the end of its motion of {trajectory.duration:.2f} s',
            trajectory.duration + self._timeout,
        )

    def watch(self) -> None:
        """Begin to write down what the arm is told and where it is."""
        self._told, self._seen = [], []

    def raise_arm(self, body: MarkerArray, q_start: Array, after: float) -> Array:
        """
        Publish another body so long after the arm set off [s]; return where the arm was from then.

        Waits until the arm has left where it starts, (dof,) [rad], and then until it has been
        stopped, has been told how to go on, and has arrived there.
        """
        self.wait_for(
            lambda: np.abs(self.positions() - q_start).max() > ARRIVED,
            'the arm on its way',
            self._timeout,
        )
        end = time.monotonic() + after
        while time.monotonic() < end:
            self._spinner.spin_once(timeout_sec=0.005)
        n = len(self._told)
        self._seen = []
        self.tell_body(body)
        # The stop begins in motion, what comes after it at rest.
        self.wait_for(
            lambda: len(self._told) > n + 1 and not any(self._told[-1].points[0].velocities),
            'a stop and a way round',
            self._timeout,
        )
        self.wait_for_arrival(joint_trajectory_from_msg(self._told[-1], self._arm.joint_names))
        return np.array([configuration_from_msg(m, self._arm.joint_names) for m in self._seen])

    def _wait_for_listener(self, publisher: Any) -> None:
        self.wait_for(
            lambda: publisher.get_subscription_count() > 0,
            f'a subscription of {publisher.topic}',
            self._timeout,
        )

    def _pause(self) -> None:
        """Let a while pass, taking messages."""
        end = time.monotonic() + PAUSE
        while time.monotonic() < end:
            self._spinner.spin_once(timeout_sec=0.05)

    def _is_still_at(self, q: Array) -> bool:
        velocities = np.abs(self._state.velocity) if self._state else np.array([np.inf])
        return bool(velocities.max() < STILL and np.abs(self.positions() - q).max() < ARRIVED)

    def _tell(self, publisher: Any, message: Any) -> None:
        publisher.publish(message)
        # The request that follows takes another way, and must not overtake the message.
        if not publisher.wait_for_all_acked(Duration(seconds=self._timeout)):
            raise DemoError(f'{publisher.topic}: not taken within {self._timeout:g} s')

    def _call(self) -> Trigger.Response:
        future = self._plan.call_async(Trigger.Request())
        self.wait_for(future.done, 'an answer of rrth_planner/plan', self._timeout)
        return future.result()

    def _on_state(self, msg: JointState) -> None:
        self._state = msg
        self._seen.append(msg)

    def _on_motion(self, msg: JointTrajectory) -> None:
        self._motion = msg
        self._told.append(msg)
