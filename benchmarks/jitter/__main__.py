# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How steadily the playback says where the arm is: `./run exec python -m benchmarks.jitter`."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import gc
import os
from pathlib import Path
import sys
import time

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rrth_planner.io.replaced_file import replace_file
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.ros.messages.fields import nanoseconds_of
from rrth_planner.ros.messages.trajectory import joint_trajectory_to_msg
from rrth_planner.ros.middleware.child_process import ChildProcess
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from benchmarks.jitter import report

NODE = 'rrth_planner.ros.playback_node'
RATES = (100.0, 500.0)
# Time of one swing, and what the first joint swings through.
SWING, REACH = 2.0, 1.2
# What a node may take to start, and messages that do not count after a change [s].
START, SETTLE = 30.0, 0.5
# Where a motion is fast enough to derive the time from the position [rad/s].
FAST = 0.3


class Watcher(Node):
    """Writes down when joint states come, what they are stamped with, and the first joint."""

    def __init__(self) -> None:
        """Listen to the playback."""
        super().__init__('rrth_jitter')
        # Reception [ns], stamp [ns], position [rad].
        self.rows: list[tuple[int, int, float]] = []
        self.state = JointState()
        self.motions = self.create_publisher(JointTrajectory, 'joint_trajectory', 1)
        self.create_subscription(
            JointState, 'joint_states', self._on_state, QoSProfile(depth=1000)
        )
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)

    def watch(self, seconds: float, child: ChildProcess) -> Array:
        """Return what comes within a time [s], (n, 3): reception [s], stamp [s], position."""
        self.rows.clear()
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._spinner.spin_once(0.1)
        child.check()
        rows = np.array(self.rows, dtype=object).reshape(-1, 3)
        # Differences first: seconds since 1970 have no digits left for nanoseconds.
        return np.stack(
            [*((rows[:, k] - rows[0, k]).astype(float) * 1e-9 for k in (0, 1)), rows[:, 2]], axis=1
        ).astype(float)

    def wait_for_states(self, child: ChildProcess) -> None:
        """Return as soon as joint states come and the motions are listened to."""
        end = time.monotonic() + START
        while not (self.rows and self.motions.get_subscription_count()):
            self._spinner.spin_once(0.1)
            child.check()
            if time.monotonic() > end:
                raise RrthError(f'playback node: no joint states within {START:g} s')

    def _on_state(self, msg: JointState) -> None:
        now = time.monotonic_ns()
        self.rows.append((now, nanoseconds_of(msg.header.stamp), msg.position[0]))
        self.state = msg


def measure(rate: float, seconds: float) -> dict[str, dict[str, dict[str, float]]]:
    """
    Return how steady the joint states of a playback node are, at rest and in motion.

    Parameters
    ----------
    rate : float
        Of the joint states [Hz].
    seconds : float
        How long each of the two is watched [s].

    Returns
    -------
    dict
        By `idle` and `moving`, then `published` (by the stamps) and `received` (by a subscriber in
        another process): `p50`, `p99` and `max` of |interval - period| [ms], `missed` periods and
        `intervals`; of `moving` also `positions`: how far the time that a position was taken at is
        from its stamp, `p99` and `max` [ms]. By `no arm`, `bare loop`: the same of a loop that
        only waits, than which no program on this machine is steadier.

    """
    bare = _steadiness(_bare_loop(rate, seconds), rate)
    arguments = ['--ros-args', '-p', f'rate:={float(rate)}']
    with _watcher() as watcher, ChildProcess(NODE, arguments, lambda _: None) as child:
        watcher.wait_for_states(child)
        watcher.watch(2.0 + SETTLE, child)
        idle = watcher.watch(seconds, child)
        swings = _swings(np.array(watcher.state.position), seconds + 2.0 * SETTLE)
        names = list(watcher.state.name)
        watcher.motions.publish(joint_trajectory_to_msg(swings, names, 'torso'))
        watcher.watch(SETTLE, child)
        moving = watcher.watch(seconds, child)
    if not np.ptp(moving[:, 2]) > 0.5 * REACH:
        raise RrthError(f'playback node: moved {np.ptp(moving[:, 2]):.3g}, expected {REACH} [rad]')
    return {
        'no arm': {'bare loop': bare},
        'idle': _figures(idle, rate),
        'moving': {**_figures(moving, rate), 'positions': _time_errors(moving, swings)},
    }


def main(arguments: list[str] | None = None) -> int:
    """Write a page with the figures of each rate."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rates', type=float, nargs='+', default=list(RATES), help='[Hz]')
    parser.add_argument('--seconds', type=float, default=60.0, help='of each figure [s]')
    parser.add_argument('--output', default='docs/playback.md', help='where the page goes')
    options = parser.parse_args(arguments)
    measured = {rate: measure(rate, options.seconds) for rate in options.rates}
    page = report.page(measured, 'python -m benchmarks.jitter', options.seconds)
    replace_file(Path(options.output), lambda fresh: fresh.write_text(page, encoding='utf-8'))
    print(page)
    return 0


def _bare_loop(rate: float, seconds: float) -> Array:
    """Return when a loop that does nothing woke up for each period [s]."""
    begin = time.monotonic()
    times = []
    for k in range(1, int(seconds * rate) + 1):
        time.sleep(max(0.0, begin + k / rate - time.monotonic()))
        times.append(time.monotonic())
    return np.array(times)


def _figures(rows: Array, rate: float) -> dict[str, dict[str, float]]:
    return {by: _steadiness(rows[:, k], rate) for k, by in ((1, 'published'), (0, 'received'))}


def _steadiness(times: Array, rate: float) -> dict[str, float]:
    """Return by how much the intervals between times [s] differ from the period."""
    intervals = np.diff(times)
    off = 1e3 * np.abs(intervals - 1.0 / rate)
    p50, p99 = np.percentile(off, [50, 99])
    return {
        'p50': float(p50),
        'p99': float(p99),
        'max': float(off.max()),
        'missed': float(np.maximum(np.round(intervals * rate) - 1.0, 0.0).sum()),
        'intervals': float(len(intervals)),
    }


def _swings(q: Array, seconds: float) -> Trajectory:
    """Return a motion of the first joint back and forth, for so long at least [s]."""
    n = int(np.ceil(seconds / SWING)) + 2
    positions = np.tile(q, (n, 1))
    positions[1::2, 0] += REACH
    still = np.zeros_like(positions)
    return Trajectory(
        times=SWING * np.arange(n), positions=positions, velocities=still, accelerations=still
    )


def _time_errors(rows: Array, swings: Trajectory) -> dict[str, float]:
    """Return how far stamps are from the times that the positions belong to [ms]."""
    fine = np.linspace(0.0, SWING, 20001)
    q, v, _ = sample(swings, fine)
    is_fast = v[:, 0] > FAST
    low, high = q[is_fast, 0][[0, -1]]
    rising = np.append(np.diff(rows[:, 2]) > 0.0, False)
    chosen = rows[rising & (rows[:, 2] > low) & (rows[:, 2] < high)]
    begin = chosen[:, 1] - np.interp(chosen[:, 2], q[is_fast, 0], fine[is_fast])
    off = (begin - begin[0] + SWING) % (2.0 * SWING)
    off = 1e3 * np.abs(off - np.median(off))
    return {'p99': float(np.percentile(off, 99)), 'max': float(off.max())}


@contextmanager
def _watcher() -> Iterator[Watcher]:
    """Give a watcher in a ROS domain of its own, the collector held."""
    os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    gc.freeze()
    try:
        watcher = Watcher()
        yield watcher
        watcher.destroy_node()
    finally:
        gc.unfreeze()
        rclpy.try_shutdown()


if __name__ == '__main__':
    sys.exit(main())
