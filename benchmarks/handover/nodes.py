# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Handovers of real nodes before an arm with servos that lag: print how continuous they are."""

import argparse
from collections.abc import Sequence
import sys
from threading import Event, Thread
import time

import numpy as np
from rclpy.qos import QoSProfile
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.settings import load_settings
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.ros.messages.body_writer import body_to_msg
from rrth_planner.ros.messages.fields import seconds_of
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg
from rrth_planner.ros.middleware.child_process import ChildProcess
from rrth_planner.simulation.tool_speed import top_tool_speed
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from benchmarks.common.client import Client, FRAME, ros_client
from benchmarks.common.random_draws import random_target

PLANNER, SIMULATION = (f'rrth_planner.ros.{name}_node' for name in ('planner', 'simulation'))
# Lags of the tool at its top speed [m], and the delay of transport and of a servo's cycle [s].
LAGS, TRANSPORT = (0.01, 0.03), 0.009
# Bodies a second; a moving arm is as fast as this [rad/s]; so long until it is asked again [s].
BODIES, MOVING, BETWEEN = 60.0, 0.2, (0.2, 0.5)
# Instants after the arrival of a message at which it is compared with the one before [s].
AFTER = np.linspace(0.0, 0.01, 6)
HANDOVERS, QUICK, DEPTH = 50, 10, 10_000


class Listener(Client):
    """Keeps the motions that come, and how fast the arm is."""

    def __init__(self) -> None:
        """Listen."""
        super().__init__()
        self.motions: list[tuple[float, float, Trajectory]] = []
        self.speed = 0.0
        self._names = load_arm().joint_names
        self.create_subscription(
            JointTrajectory, 'joint_trajectory', self._on_motion, QoSProfile(depth=DEPTH)
        )
        self.create_subscription(JointState, 'joint_states', self._on_state, 10)

    def hear(self, seconds: float) -> None:
        """Take messages for a time [s]."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._spinner.spin_once(left)

    def stream(self, scene: Scene, over: Event) -> None:
        """Publish a wearer who stands still as a tracker does, until an event."""
        while not over.wait(1.0 / BODIES):
            msg, stamp = body_to_msg(scene, FRAME), self.get_clock().now().to_msg()
            for marker in msg.markers:
                marker.header.stamp = stamp
            self._body.publish(msg)

    def _on_motion(self, msg: JointTrajectory) -> None:
        trajectory = joint_trajectory_from_msg(msg, self._names)
        self.motions.append((time.time(), seconds_of(msg.header.stamp), trajectory))

    def _on_state(self, msg: JointState) -> None:
        self.speed = float(np.abs(np.array(msg.velocity)).max(initial=0.0))


def gaps_of(motions: Sequence[tuple[float, float, Trajectory]]) -> Array:
    """Return how far each message commands from the one before when it comes, (n,) [rad]."""
    gaps = []
    for (_, begun, before), (came, begin, after) in zip(motions, motions[1:], strict=False):
        commanded = sample(before, came + AFTER - begun)[0], sample(after, came + AFTER - begin)[0]
        gaps.append(float(np.abs(commanded[0] - commanded[1]).max()))
    return np.array(gaps)


def run(lag: float, is_separated: bool, n: int) -> str:
    """Return a line of the table for an arm whose tool lags by so much [m]."""
    arm, rng = load_arm(), np.random.default_rng(1)
    delay = lag / top_tool_speed(arm, load_settings(arm.dof).limits.velocity) + TRANSPORT
    planner = ['--ros-args', '-p', f'controller_delay:={delay:.4f}', '-p', 'seed:=7']
    planner += ['-p', f'separation:={str(is_separated).lower()}']
    n_handovers = n_asked = 0
    with (
        ros_client(Listener) as client,
        ChildProcess(SIMULATION, ['--ros-args', '-p', f'lag:={lag}'], lambda _: None) as one,
        ChildProcess(PLANNER, planner, lambda _: None) as other,
    ):
        client.wait_for_service(other)
        over, scene = Event(), load_body()
        tracker = Thread(target=client.stream, args=(scene, over), daemon=True)
        tracker.start()
        try:
            client.hear(2.0)
            while n_handovers < n and n_asked < 20 * n:
                client.publish_target(random_target(rng))
                was_moving = client.speed > MOVING
                n_asked += 1
                _, answer = client.ask()
                n_handovers += bool(answer.success) and was_moving
                client.hear(float(rng.uniform(*BETWEEN)))
                one.check()
                other.check()
        finally:
            over.set()
            tracker.join()
        client.hear(1.0)
        gaps = gaps_of(client.motions)
    return (
        f'| {lag:g} | {1e3 * delay:.0f} | {"on" if is_separated else "off"} | {n_handovers} | '
        f'{len(gaps)} | {1e3 * np.median(gaps):.4f} | {1e3 * gaps.max(initial=0.0):.3f} |'
    )


def main() -> int:
    """Print the table; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--quick', action='store_true', help=f'{QUICK} handovers a line')
    n = QUICK if parser.parse_args().quick else HANDOVERS
    print(
        '| lag of the tool [m] | `controller_delay` [ms] | separation | handovers in motion | '
        'messages | off the one before, median [mrad] | at most [mrad] |\n'
        '| --- | --- | --- | --- | --- | --- | --- |'
    )
    for lag in LAGS:
        for is_separated in (False, True):
            print(run(lag, is_separated, n), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
