# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A client that asks all the time, and writes down all that the planner publishes."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
import re
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import psutil
from rclpy.qos import QoSProfile
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from benchmarks.common.client import Client, LATCHED

# A call that is not answered within this counts as unanswered [s].
PATIENCE = 10.0
DEPTH = 1000
# What the node logs of a brake: how long after the body came it was published [ms].
BRAKE = re.compile(r'fail-safe stop.*; published after ([\d.]+) ms')


@dataclass(frozen=True, slots=True)
class Published:
    """
    A motion as it came.

    Parameters
    ----------
    published, received : int
        By the planner's, and by the client's clock [ns].
    place, size : int
        Where its bytes are in the file.

    """

    published: int
    received: int
    place: int
    size: int


class SoakClient(Client):
    """
    Asks, and keeps what comes meanwhile.

    Parameters
    ----------
    folder : Path
        Where the motions are kept: they would not fit into the memory.

    """

    def __init__(self, folder: Path) -> None:
        """Connect to the planner, and to the playback where there is one."""
        super().__init__()
        self.motions: list[Published] = []
        # When joint states were sent [ns], and positions and velocities; for the playback.
        self.states: list[tuple[int, Any, Any]] = []
        self.figures: dict[str, str] = {}
        # Called with the figures of each message of diagnostics.
        self.on_figures: Callable[[dict[str, str]], None] = lambda _: None
        self._file = (folder / 'motions').open('w+b')
        latched = QoSProfile(depth=DEPTH, durability=LATCHED.durability)
        self.stream = self.create_publisher(MarkerArray, 'body_boxes', latched)
        self.create_subscription(
            JointTrajectory, 'joint_trajectory', self._on_motion, latched, raw=True
        )
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, DEPTH)

    def listen_to_states(self) -> None:
        """Keep the joint states from now on."""
        self.create_subscription(JointState, 'joint_states', self._on_state, DEPTH)

    def question(self) -> tuple[float, Trigger.Response | None]:
        """Return how long an answer took [s], and the answer; None: there was none."""
        begin = time.perf_counter()
        future = self._plan.call_async(Trigger.Request())
        while not future.done() and time.perf_counter() < begin + PATIENCE:
            self._spinner.spin_once(PATIENCE)
        if not future.done():
            self._plan.remove_pending_request(future)
        return time.perf_counter() - begin, future.result() if future.done() else None

    def hear(self, seconds: float, until: Callable[[], object] = lambda: False) -> bool:
        """Take messages for a time [s], or until a condition holds; return whether it did."""
        end = time.perf_counter() + seconds
        while not until():
            left = end - time.perf_counter()
            if left <= 0.0:
                return False
            self._spinner.spin_once(min(left, 0.05))
        return True

    def bytes_of(self, motion: Published) -> bytes:
        """Return a motion's message, serialized."""
        self._file.seek(motion.place)
        data = self._file.read(motion.size)
        self._file.seek(0, 2)
        return data

    def close(self) -> None:
        """Leave the file."""
        self._file.close()

    def publish_start(self, names: tuple[str, ...], q: Array, target: Array) -> None:
        """Publish where the arm is, at rest [rad], and where to point [m]."""
        self.publish_joints(names, q)
        self.publish_target(target)

    def _on_motion(self, data: bytes, info: dict[str, Any]) -> None:
        received = time.time_ns()
        place = self._file.tell()
        self._file.write(data)
        self.motions.append(Published(info['source_timestamp'], received, place, len(data)))

    def _on_state(self, msg: JointState) -> None:
        stamp = msg.header.stamp
        self.states.append(
            (stamp.sec * 10**9 + stamp.nanosec, msg.position.tolist(), msg.velocity.tolist())
        )

    def _on_diagnostics(self, msg: DiagnosticArray) -> None:
        self.figures = {pair.key: pair.value for pair in msg.status[0].values}
        self.on_figures(self.figures)


def brakes_in(line: str) -> list[tuple[int, float]]:
    """
    Return what a line of the log, read just now, says of a fail-safe stop; nothing of another one.

    That is when the body came, or a little later [ns], and how long after it came the trajectory
    was published [ms].
    """
    found = BRAKE.search(line)
    return [(time.time_ns() - round(1e6 * float(found[1])), float(found[1]))] if found else []


def process_of(module: str) -> psutil.Process:
    """Return the child process that runs a module."""
    for child in psutil.Process().children():
        if module in child.cmdline():
            return child
    raise RrthError(f'{module}: its process is gone')


def threads_of(module: str) -> list[int]:
    """Return the numbers of the threads of the child process that runs a module."""
    return [thread.id for thread in process_of(module).threads()]
