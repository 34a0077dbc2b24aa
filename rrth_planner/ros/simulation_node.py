# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node `arm_simulation`: an arm with masses and servos, and a wearer it may run into."""

from array import array
from contextlib import suppress
import os
import sys
from threading import Event, Lock, Thread
import traceback
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.time import Time
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.errors import MessageError, SceneError
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.ros.interface.simulation_parameters import (
    declare_simulation_parameters,
    simulated_arm,
    simulated_wearer,
)
from rrth_planner.ros.messages.contacts import contacts_to_msg
from rrth_planner.ros.messages.controller_points import controller_points_from_msg
from rrth_planner.ros.messages.diagnostics import status_to_msg
from rrth_planner.ros.messages.fields import seconds_of
from rrth_planner.ros.messages.part_markers import PartMarkers
from rrth_planner.ros.messages.tracked_person import LIFETIME
from rrth_planner.ros.middleware.node_process import run_node
from rrth_planner.ros.middleware.open_subscription import decoded
from rrth_planner.ros.middleware.qos import COMMITTED
from rrth_planner.simulation.physics_model import RATE
from rrth_planner.simulation.simulated_arm import STEP_PERIOD
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

NAME = 'arm_simulation'
# Longer trajectories are not decoded.
MOST_BYTES = 2 * 1024 * 1024
# Motions are reported at most this often [s].
REPORT_PERIOD = 0.5
# A simulation that is further behind its clock leaves out the time between [s].
MOST_BEHIND = 0.5
# Contacts are published when they begin and end, and meanwhile so often; and where there are none,
# so that they are known to be none [s].
CONTACT_PERIOD, QUIET_PERIOD = 0.1, 1.0
DIAGNOSTICS_PERIOD = 1.0
# Of the thread of the physics, by SCHED_RR: below a controller manager's 50.
PRIORITY = 10


class SimulationNode(Node):
    """Runs the simulation in a thread of its own, and publishes what sensors would."""

    def __init__(self, **options: Any) -> None:
        """Declare parameters and interfaces, and begin; bad values raise, naming the parameter."""
        super().__init__(NAME, **options)
        self._thread: Thread | None = None
        self._arm = declare_simulation_parameters(self)
        value = {name: self.get_parameter(name).value for name in ('rate', 'body_rate')}
        self._base_frame: str = self.get_parameter('base_frame').value
        self._wearer = simulated_wearer(self)
        # As of the playback: a step of the system's time must not move the arm.
        is_simulated = self.get_parameter('use_sim_time').value
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._motion_clock: Clock = self.get_clock() if is_simulated else steady
        self._begin = self._now()[0]
        self._simulation = simulated_arm(self, self._arm, self._wearer, self._begin)
        # Time that was left out [s].
        self._left_out = 0.0
        self._every = max(1, round(RATE / value['rate']))
        self._n_steps = 0
        self._lock, self._is_over = Lock(), Event()
        self._states = self.create_publisher(JointState, 'joint_states', 10)
        self._contacts = self.create_publisher(DiagnosticArray, '~/contacts', 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_subscription(
            JointTrajectory, 'joint_trajectory', self._on_raw_trajectory, COMMITTED, raw=True
        )
        self._bodies, self._body_period = None, np.inf
        if self._wearer is not None and value['body_rate'] > 0.0:
            # A reader that wants latched bodies as well has a second subscription for these.
            quietly = PublisherEventCallbacks(use_default_callbacks=False)
            self._bodies = self.create_publisher(
                MarkerArray, 'body_boxes', QoSProfile(depth=1), event_callbacks=quietly
            )
            self._body_period = 1.0 / value['body_rate']
            names = {box.name for box in self._wearer.scene_at(0.0).boxes}
            self._parts = PartMarkers([*self._wearer.body.names, *names], LIFETIME)
        self._next_body = self._next_contacts = self._begin
        self._n_contacts, self._n_reported = 0, 0
        self._greatest_force, self._greatest_error = 0.0, 0.0
        self._since = (self._begin, self._begin)
        self.create_timer(DIAGNOSTICS_PERIOD, self._report, clock=steady)
        self._thread = Thread(target=self._run, name='physics')
        self._thread.start()

    def destroy_node(self) -> None:
        """End the simulation, then the node."""
        if self._thread is not None:
            self._is_over.set()
            self._thread.join()
        super().destroy_node()

    def _now(self) -> tuple[float, float]:
        """Return the present on the clock of the motion, and on the node's clock [s]."""
        now = self._motion_clock.now().nanoseconds
        clock = self.get_clock()
        if self._motion_clock is clock:
            return now / NANOSECONDS, now / NANOSECONDS
        return now / NANOSECONDS, clock.now().nanoseconds / NANOSECONDS

    def _run(self) -> None:
        """Step until the end, and publish what is due."""
        # It stands in for hardware, which shares its processor with nobody; where that is allowed.
        with suppress(AttributeError, OSError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(PRIORITY))
        try:
            while not self._is_over.is_set():
                self._catch_up()
                due = self._simulation.time + STEP_PERIOD + self._left_out
                left = due - self._now()[0]
                self._is_over.wait(min(max(left, 0.0), STEP_PERIOD))
        except Exception:
            # A signal may have ended the context between two statements.
            if rclpy.ok(context=self.context):
                self.get_logger().fatal(traceback.format_exc())
                rclpy.try_shutdown(context=self.context)

    def _catch_up(self) -> None:
        """Take the steps that are due."""
        now, ros_now = self._now()
        behind = now - self._left_out - self._simulation.time
        if abs(behind) > MOST_BEHIND:
            # Or a simulated clock was set back.
            self._left_out += behind
            self.get_logger().warning(
                f'{behind:.3f} s behind the clock: time left out',
                throttle_duration_sec=REPORT_PERIOD,
            )
        while not self._is_over.is_set():
            with self._lock:
                # Of no state that lies in the future.
                if self._simulation.time + STEP_PERIOD + self._left_out > now:
                    return
                given_up = self._simulation.step()
                time = self._simulation.time
                self._n_steps += 1
                is_due = self._n_steps % self._every == 0
                reading = self._simulation.reading if is_due else None
                going = list(self._simulation.events)
                ended, self._simulation.ended = self._simulation.ended, []
            if given_up:
                self.get_logger().warning(f'motion given up, arm holds its position: {given_up}')
            # Of the state after the step.
            stamp = ros_now + (time + self._left_out - now)
            if reading is not None:
                self._publish_state(reading, stamp)
            if time >= self._next_body:
                self._publish_body(time, stamp)
            self._publish_contacts(going, ended, time, stamp)

    def _publish_state(self, reading: Any, stamp: float) -> None:
        both = np.array([reading.wanted.positions, reading.true_positions])
        wanted, true = tool_pose(self._arm, both)[:, :3, 3]
        gap = float(np.linalg.norm(wanted - true))
        self._greatest_error = max(self._greatest_error, gap)
        msg = JointState(name=list(self._arm.joint_names))
        msg.header.stamp = _to_msg(stamp)
        msg.position, msg.velocity = (
            array('d', row) for row in (reading.positions, reading.velocities)
        )
        msg.effort = array('d', reading.efforts)
        self._states.publish(msg)

    def _publish_body(self, time: float, stamp: float) -> None:
        self._next_body = max(self._next_body + self._body_period, time)
        if self._bodies is None or self._wearer is None:
            return
        try:
            scene = self._wearer.scene_at(time - self._begin)
        except SceneError:
            # His base is lost: a tracker has no boxes of him.
            return
        self._bodies.publish(self._parts.message(scene, self._base_frame, _to_msg(stamp)))

    def _publish_contacts(
        self, going: list[Any], ended: list[Any], time: float, stamp: float
    ) -> None:
        is_new = len(going) + len(ended) > self._n_reported
        if not is_new and not ended and time < self._next_contacts:
            return
        self._n_contacts += max(0, len(going) + len(ended) - self._n_reported)
        self._n_reported = len(going)
        for event in (*going, *ended):
            self._greatest_force = max(self._greatest_force, event.greatest_force)
        self._next_contacts = time + (CONTACT_PERIOD if going else QUIET_PERIOD)
        self._contacts.publish(contacts_to_msg(going, ended, _to_msg(stamp)))

    def _on_raw_trajectory(self, data: bytes) -> None:
        try:
            self._on_trajectory(decoded(data, JointTrajectory, MOST_BYTES))
        except MessageError as problem:
            self.get_logger().warning(f'joint_trajectory rejected, arm goes on: {problem}')
        except Exception:
            # After any error the arm continues as before.
            self.get_logger().error(traceback.format_exc())

    def _on_trajectory(self, msg: JointTrajectory) -> None:
        now, ros_now = self._now()
        points = controller_points_from_msg(msg, self._arm.joint_names, ros_now)
        stamp = seconds_of(msg.header.stamp)
        with self._lock:
            start = 0.0 if stamp == 0.0 else now - self._left_out + stamp - ros_now
            self._simulation.execute(points, start)
            left = (start or self._simulation.time) + points.times[-1] - self._simulation.time
        self.get_logger().info(
            f'executing a motion: {len(points.times)} points, at its end in {left:.2f} s',
            throttle_duration_sec=REPORT_PERIOD,
        )

    def _report(self) -> None:
        """Publish how the simulation keeps up, and what became of the arm."""
        now, simulated = self._now()[0], self._simulation.time
        passed, done = now - self._since[0], simulated - self._since[1]
        self._since = (now, simulated)
        factor = done / passed if passed > 0.0 else 0.0
        values: dict[str, object] = {
            'real-time factor': f'{factor:.3f}',
            'time left out [s]': f'{self._left_out:.3f}',
            'greatest distance of the tool from its motion [m]': f'{self._greatest_error:.5f}',
            'steps with a motor at its limit': self._simulation.n_at_limit,
            'contacts': self._n_contacts,
            'greatest force of a contact [N]': f'{self._greatest_force:.2f}',
        }
        is_slow = self._left_out > 0.0 and factor < 0.95
        level = DiagnosticStatus.WARN if is_slow else DiagnosticStatus.OK
        message = f'{factor:.2f} of real time' if is_slow else 'in real time'
        name = f'{self.get_fully_qualified_name().lstrip("/")}: physics'
        msg = DiagnosticArray(status=[status_to_msg(name, level, message, values)])
        msg.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(msg)


def _to_msg(stamp: float) -> Any:
    return Time(nanoseconds=round(stamp * NANOSECONDS)).to_msg()


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal; return the exit code."""
    return run_node(NAME, SimulationNode, rclpy.spin, args)


if __name__ == '__main__':
    sys.exit(main())
