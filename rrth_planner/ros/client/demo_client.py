# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node of the demo: a client of planner and playback."""

from collections.abc import Callable

import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.ros.client.answer_parser import answer_from_text
from rrth_planner.ros.client.planner_client import PlannerClient
from rrth_planner.ros.messages.joint_state import configuration_from_msg
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg
from visualization_msgs.msg import MarkerArray

ARRIVED = 1e-3
STILL = 1e-6


class DemoError(RrthError):
    """An error that ends the demo."""


class DemoClient(PlannerClient):
    """
    Publishes body and target, requests motions, and follows the arm.

    See PlannerClient for `timeout` [s] and `check`.
    """

    def __init__(self, arm: ArmModel, timeout: float, check: Callable[[], None]) -> None:
        """Create publishers, subscriptions and the client of the planner."""
        super().__init__('rrth_demo', timeout, check)
        self.arm = arm

    def wait_for_nodes(self) -> None:
        """Wait for the planner, for joint states, and for a subscriber of the motions."""
        self.wait_for_state(self.arm.joint_names)
        self.wait_for_planner()
        self.wait_for(lambda: self.count_arms() > 0, 'a subscriber of joint_trajectory')

    def ask_for_motion(self) -> tuple[Trajectory, float]:
        """Return the motion that the planner publishes, and its planning time [ms]."""
        self.commanded, self.observed = [], []
        response = self.ask(self.timeout)
        if not response.success:
            raise DemoError(f'the planner rejected the request: {response.message}')
        self.wait_for(lambda: bool(self.commanded), 'joint_trajectory')
        figures = answer_from_text(response.message).figures
        if 'planning_time_ms' not in figures:
            raise DemoError(f'no planning time in the answer "{response.message}"')
        trajectory = joint_trajectory_from_msg(self.commanded[-1], self.joint_names)
        return trajectory, figures['planning_time_ms']

    def wait_for_arrival(self, trajectory: Trajectory) -> None:
        """Wait until the arm stands still at the end of a motion."""
        q_end = trajectory.positions[-1]
        self.wait_for(
            lambda: self.is_still_at(q_end, ARRIVED, STILL),
            f'the arm at the end of its motion of {trajectory.duration:.2f} s',
            trajectory.duration + self.timeout,
        )

    def raise_arm(self, body: MarkerArray, q_start: Array, after: float) -> Array:
        """
        Publish another body so long after the arm set off [s]; return its states from then on.

        Waits until the arm has left q_start, (dof,) [rad], and then until it was stopped, got a
        new motion, and has arrived at its end.
        """
        self.wait_for(
            lambda: np.abs(self.positions() - q_start).max() > ARRIVED, 'the arm in motion'
        )
        self.receive_for(after)
        n = len(self.commanded)
        self.observed = []
        self.publish(body)
        # The stop begins in motion, what comes after it at rest.
        self.wait_for(
            lambda: (
                len(self.commanded) > n + 1 and not any(self.commanded[-1].points[0].velocities)
            ),
            'a stop and a new motion',
        )
        self.wait_for_arrival(joint_trajectory_from_msg(self.commanded[-1], self.joint_names))
        return np.array([configuration_from_msg(m, self.joint_names) for m in self.observed])
