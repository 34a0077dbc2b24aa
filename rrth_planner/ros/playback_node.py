# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node `arm_playback`: a kinematic arm that executes motions exactly."""

from array import array
from collections import deque
import gc
from importlib import import_module
import math
import os
import sys
from threading import Thread
import traceback
from typing import Any

from geometry_msgs.msg import PoseStamped
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.time import Time
from rrth_planner.execution.playback import accept, Playback, standing, stop
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import MessageError, RrthError
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.ros.interface.playback_parameters import (
    declare_playback_parameters,
    initial_positions,
    playback_rules,
)
from rrth_planner.ros.messages.fields import seconds_of
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg, pose_to_msg
from rrth_planner.ros.middleware.node_process import run_node
from rrth_planner.ros.middleware.open_subscription import decoded
from rrth_planner.ros.middleware.qos import COMMITTED, SERVICE, SUPERVISED
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

NAME = 'arm_playback'
# Longer trajectories are not decoded, which would delay the joint states.
MOST_BYTES = 2 * 1024 * 1024
# Motions are reported at most this often [s].
REPORT_PERIOD = 0.5
# Two clocks are read at once where that takes no longer [ns]; else again, so many times.
AT_ONCE, READINGS = 20_000, 5


class PlaybackNode(Node):
    """Executes the trajectories that it receives, and publishes the joint states."""

    def __init__(self, **options: Any) -> None:
        """Declare parameters and interfaces; bad values raise, naming the parameter."""
        super().__init__(NAME, **options)
        self._arm = declare_playback_parameters(self)
        self._base_frame: str = self.get_parameter('base_frame').value
        self._playback = standing(initial_positions(self, self._arm))
        self._lag: float = self.get_parameter('lag').value
        # What was executed lately, and since when [s]: the arm lags behind it.
        self._lately = deque([(-math.inf, self._playback)])
        # A step of the system's time must not move the arm.
        is_simulated = self.get_parameter('use_sim_time').value
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._motion_clock: Clock = self.get_clock() if is_simulated else steady
        self._latest, _ = self._now()
        self._state = JointState(name=list(self._arm.joint_names))
        self._pose = PoseStamped()
        # Since when the messages above hold the final state of the arm [s].
        self._rest_published = float('inf')
        self._joint_states = self.create_publisher(JointState, 'joint_states', 10)
        self._tool_pose = self.create_publisher(PoseStamped, '~/tool_pose', 10)
        # Volatile: an old latched motion must not start by itself.
        self.create_subscription(
            JointTrajectory, 'joint_trajectory', self._on_raw_trajectory, COMMITTED, raw=True
        )
        # Only for the liveliness of the planner: messages come by the subscription above.
        self.create_subscription(
            JointTrajectory,
            'joint_trajectory',
            lambda _: None,
            SUPERVISED,
            event_callbacks=SubscriptionEventCallbacks(
                liveliness=self._on_liveliness, use_default_callbacks=False
            ),
            raw=True,
        )
        self.create_service(Trigger, '~/stop', self._on_stop, qos_profile=SERVICE)
        period = 1.0 / self.get_parameter('rate').value
        self.create_timer(period, self._publish, clock=self._motion_clock)

    def _now(self) -> tuple[float, int]:
        """Return the present on the clock of the motion [s], and on the node's clock [ns]."""
        clock = self.get_clock()
        if self._motion_clock is clock:
            now = clock.now().nanoseconds
            return now / NANOSECONDS, now
        for _ in range(READINGS):
            before = self._motion_clock.now().nanoseconds
            now = clock.now().nanoseconds
            after = self._motion_clock.now().nanoseconds
            if after - before <= AT_ONCE:
                break
        return 0.5 * (before + after) / NANOSECONDS, now

    def _advance(self) -> tuple[float, int]:
        """Return `_now`; a simulated clock that was set back leaves the arm in place."""
        now, stamp = self._now()
        if now < self._latest:
            self._follow(standing(self._measured_at(self._latest)[0]))
            self._lately = deque([(-math.inf, self._playback)])
        self._latest = now
        return now, stamp

    def _follow(self, playback: Playback) -> None:
        self._playback, self._rest_published = playback, float('inf')
        self._lately.append((self._latest, playback))

    def _measured_at(self, time: float) -> tuple[Array, Array]:
        """Return positions and velocities of the arm [rad, rad/s]: the command of `lag` before."""
        then = time - self._lag
        while len(self._lately) > 1 and self._lately[1][0] <= then:
            self._lately.popleft()
        q, v, _ = self._lately[0][1].state_at(then)
        return q, v

    def _publish(self) -> None:
        """Publish the state of the arm at the time of the stamps."""
        time, nanoseconds = self._advance()
        # While it stands still only the stamps change.
        if not time >= self._rest_published:
            q, v = self._measured_at(time)
            self._state.position, self._state.velocity = array('d', q), array('d', v)
            self._pose = pose_to_msg(tool_pose(self._arm, q), self._base_frame)
            is_at_rest = time - self._lag >= max(self._playback.end_time, self._lately[-1][0])
            self._rest_published = time if is_at_rest else float('inf')
        stamp = Time(nanoseconds=nanoseconds).to_msg()
        self._state.header.stamp = self._pose.header.stamp = stamp
        self._joint_states.publish(self._state)
        self._tool_pose.publish(self._pose)

    def _on_raw_trajectory(self, data: bytes) -> None:
        try:
            self._on_trajectory(decoded(data, JointTrajectory, MOST_BYTES))
        except MessageError as problem:
            self.get_logger().warning(f'joint_trajectory rejected: {problem}')
        except Exception:
            # After any error the arm continues as before.
            self.get_logger().error(traceback.format_exc())

    def _on_trajectory(self, msg: JointTrajectory) -> None:
        time, nanoseconds = self._advance()
        ros_time = nanoseconds / NANOSECONDS
        stamp = seconds_of(msg.header.stamp)
        try:
            trajectory = joint_trajectory_from_msg(msg, self._arm.joint_names, ros_time)
            self._follow(
                accept(
                    self._playback,
                    trajectory,
                    self._arm,
                    playback_rules(self, self._arm),
                    start_time=time if stamp == 0.0 else time + stamp - ros_time,
                    time=time,
                )
            )
        except RrthError as problem:
            is_moving = time < self._playback.end_time
            stays = 'continues its motion' if is_moving else 'holds its position'
            self.get_logger().warning(f'joint_trajectory rejected, arm {stays}: {problem}')
            return
        # Motions may come with every body of a tracker.
        self.get_logger().info(
            f'executing a motion: {len(trajectory.times)} points, at rest in '
            f'{self._playback.end_time - time:.2f} s',
            throttle_duration_sec=REPORT_PERIOD,
        )

    def _on_liveliness(self, status: Any) -> None:
        if status.not_alive_count_change > 0 and self._advance()[0] < self._playback.end_time:
            self.get_logger().error(
                f'planner liveliness lost, the motion is not monitored: stop along the path, at '
                f'rest in {self._stop():.2f} s'
            )

    def _stop(self) -> float:
        """Stop along the path; return how long that takes, <= 0.0 at rest [s]."""
        time, _ = self._advance()
        self._follow(stop(self._playback, playback_rules(self, self._arm).limits, time))
        return self._playback.end_time - time

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        left = self._stop()
        what = f'stop along the path, at rest in {left:.2f} s' if left > 0.0 else 'already at rest'
        response.success, response.message = True, f'SUCCESS (1): {what}'
        self.get_logger().info(f'stop: {response.message}')
        return response


def _load_stops() -> None:
    """Load what a stop needs, while the node runs already."""
    import_module('rrth_planner.timing.fast_stop')
    # The collector must not pause a motion for objects that live as long as the node.
    gc.collect()
    gc.freeze()


def _run(node: PlaybackNode) -> None:
    Thread(target=_load_stops, name='stops').start()
    rclpy.spin(node)


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal; return the exit code."""
    # Kernels are plain Python here: a stop is found in some 20 ms, and nothing is compiled.
    os.environ['NUMBA_DISABLE_JIT'] = '1'
    return run_node(NAME, PlaybackNode, _run, args)


if __name__ == '__main__':
    sys.exit(main())
