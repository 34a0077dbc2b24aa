# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The command `simulate`: planner, an arm with masses, a person and a moving target, at once."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial
import math
import os
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
import numpy as np
import rclpy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from rrth_planner.cli.parsers.simulate import parser
from rrth_planner.cli.program import interrupt_on_signals, run
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.extras import require
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.arm import ArmModel, pointing_error
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import REST_SPEED
from rrth_planner.ros.client.planner_client import DemoClient, DemoError
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.fields import seconds_of
from rrth_planner.ros.messages.joint_state import configuration_from_msg
from rrth_planner.ros.middleware.child_process import ChildProcess
from rrth_planner.simulation.tool_speed import top_tool_speed
from visualization_msgs.msg import MarkerArray

# The ray misses a target that was reached by no more [m].
REACHED = 5e-3
# The target circles slowly before the wearer: where, how far to the sides and up [m], and how long
# a round of each takes [s].
CENTER, SWING, ROUNDS = np.array([1.4, 0.0, 0.1]), np.array([0.0, 0.8, 0.3]), (1.0, 23.0, 17.0)
# After so long without reaching a target the next one counts, and so long nodes may take to start.
LONGEST_MISS, LONGEST_START = 10.0, 300.0
# A step of the servos, and what comes late to them [s].
SERVO_DELAY = 0.009
FPS = 12.5
SIMULATION = 'arm_simulation'
# What the viewer says once it serves its page, among its first lines.
SERVED, FIRST_LINES = 'The viewer is at', 100
# Of a recording that comes along: at other times he bends so fast that an arm which stands still
# would be in his way.
EXCERPT = (1.2, 5.2)


class _RunOver(Exception):  # noqa: N818
    """The time of a run is over."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until the time is over or a signal; return the exit code."""
    command = parser()
    options = command.parse_args(arguments)
    if options.video and options.seconds == math.inf:
        command.error('--video: given without --seconds, expected both')
    if options.viewer is None:
        options.viewer = not options.video
    interrupt_on_signals()
    return run('simulate', lambda: _run(options), 1)


def _run(options: argparse.Namespace) -> None:
    require('ros,simulation', 'mujoco')
    if options.video:
        # Read when MuJoCo is imported, which what checks films does.
        os.environ.setdefault('MUJOCO_GL', 'egl')
        from rrth_planner.simulation.film import check_film

        check_film(options.video)
    elif options.viewer:
        require('tools', 'viser')
    # Isolated from other robots and other runs.
    os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    planner_file = resource_path('config/planner.yaml')
    parameters = load_yaml(planner_file)['/**']['ros__parameters']
    arm, frame = load_arm(parameters.get('arm')), parameters['base_frame']
    speed = top_tool_speed(arm, load_settings(arm.dof, planner_file).limits.velocity)
    delay = options.lag / speed + SERVO_DELAY
    planner = ['--ros-args', '--params-file', str(planner_file)]
    planner += ['-p', f'seed:={options.seed}', '-p', f'controller_delay:={delay:.4f}']
    print(f'Starting planner and simulation (ROS_DOMAIN_ID {os.environ["ROS_DOMAIN_ID"]}).')
    print('The first start compiles the planner, which may take a minute or two.', flush=True)
    children: list[ChildProcess] = []
    end = math.inf

    def check() -> None:
        for child in children:
            child.check()
        if time.monotonic() > end:
            raise _RunOver

    with ExitStack() as stack:
        for name, module, words in (
            ('physics', 'ros.simulation_node', _simulation_words(options)),
            ('planner', 'ros.planner_node', planner),
            *([('viewer', 'cli.viewer', _viewer_words(options))] if options.viewer else []),
        ):
            lines: list[str] = []
            child = ChildProcess(f'rrth_planner.{module}', words, partial(_show, name, lines))
            children.append(stack.enter_context(child))
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        client = DemoClient(arm, LONGEST_START, check, REST_SPEED)
        stack.callback(client.destroy_node)
        report = _Report(client)
        client.wait_for_nodes()
        if options.viewer:
            # The last child. While it loads the machine may have no time for the physics.
            client.wait_for(lambda: any(SERVED in line for line in lines), 'the viewer')
        client.timeout = LONGEST_MISS
        targets: list[tuple[float, Array]] = []
        end = time.monotonic() + options.seconds
        # A run without an end would fill the memory with what is seen.
        if options.video:
            client.see_separation()
        try:
            _point(client, frame, report, targets, keeps=bool(options.video))
        except _RunOver:
            # The report of the last second.
            end = math.inf
            report.wait(client)
        except KeyboardInterrupt:
            # Its nodes may have got the signal, too.
            if options.video:
                raise
    print(report.sentence(), flush=True)
    if options.video:
        _film(options, client, frame, targets)
        print(f'Video: {options.video}')


class _Report:
    """What became of the targets, and what the physics reports."""

    def __init__(self, client: DemoClient) -> None:
        """Listen to the diagnostics of the simulation."""
        self.n_reached, self.n_missed, self.n_reports = 0, 0, 0
        self._values: dict[str, str] = {}
        client.create_subscription(DiagnosticArray, '/diagnostics', self._keep, 10)

    def _keep(self, msg: DiagnosticArray) -> None:
        for status in msg.status:
            if status.name.endswith(f'{SIMULATION}: physics'):
                self._values = {pair.key: pair.value for pair in status.values}
                self.n_reports += 1

    def wait(self, client: DemoClient) -> None:
        """Wait for another report."""
        wanted = self.n_reports + 1
        client.wait_for(lambda: self.n_reports >= wanted, 'a report of the physics')

    def sentence(self) -> str:
        """Return all of it."""
        physics = '; '.join(f'{key}: {value}' for key, value in self._values.items())
        return f'Targets reached: {self.n_reached}, missed: {self.n_missed}; {physics}.'


def _point(
    client: DemoClient,
    frame: str,
    report: _Report,
    targets: list[tuple[float, Array]],
    keeps: bool,
) -> None:
    """Point at where the target is, again and again, until an exception ends it."""
    begin = time.monotonic()
    while True:
        target = target_at(time.monotonic() - begin)
        msg = PointStamped()
        msg.header.frame_id = frame
        msg.point.x, msg.point.y, msg.point.z = target.tolist()
        client.publish(msg)
        targets.append((client.get_clock().now().nanoseconds * 1e-9, target))
        try:
            client.point(partial(_aims, client.arm, target))
            report.n_reached += 1
        except DemoError as problem:
            report.n_missed += 1
            print(f'  target   | {problem}', flush=True)
        if not keeps:
            client.observed, client.commanded = [], []
            del targets[:-1]


def target_at(elapsed: float) -> Array:
    """Return where the target is after a time [s], in the base frame, (3,) [m]."""
    phases = 2.0 * np.pi * elapsed / np.array(ROUNDS)
    place: Array = CENTER + SWING * np.sin(phases)
    return place


def _aims(arm: ArmModel, target: Array, q: Array) -> bool:
    return pointing_error(arm, q, target) <= REACHED


def _simulation_words(options: argparse.Namespace) -> list[str]:
    begin, end = (options.begin, options.end) if options.file else EXCERPT
    given = {
        'wearer': options.wearer,
        'wearer_file': f"'{options.file or ''}'",
        'skeleton': options.skeleton,
        'stature': [float(stature) for stature in options.stature],
        'hand_size': float(options.hand_size),
        'wearer_unit': f"'{options.unit or ''}'",
        'lag': options.lag,
        'payload': options.payload,
    }
    if options.wearer == 'recorded':
        given |= {'wearer_begin': float(begin), 'wearer_end': float(end)}
    words = ['--ros-args', '--params-file', str(resource_path('config/simulation.yaml'))]
    for name, value in given.items():
        words += ['-p', f'{name}:={value}']
    return words


def _viewer_words(options: argparse.Namespace) -> list[str]:
    opens = {None: [], True: ['--open'], False: ['--no-open']}[options.open]
    return ['--live', '--port', str(options.port), *opens]


def _film(
    options: argparse.Namespace,
    client: DemoClient,
    frame: str,
    targets: Sequence[tuple[float, Array]],
) -> None:
    """Render what was seen."""
    from rrth_planner.simulation.film import Frame, write_film

    begin = targets[0][0]
    frames: list[Frame] = []
    bodies = _bodies(client, frame)
    measured, scene = next(bodies)
    upcoming = next(bodies, None)
    due = max(begin, measured)
    for state in client.observed:
        now = seconds_of(state.header.stamp)
        while upcoming is not None and upcoming[0] <= now:
            (measured, scene), upcoming = upcoming, next(bodies, None)
        if now >= due:
            target = [place for at, place in targets if at <= now]
            q = configuration_from_msg(state, client.joint_names)
            frames.append(Frame(q, scene, target[-1] if target else None))
            due += 1.0 / FPS
    print(f'Rendering {len(frames)} pictures.', flush=True)
    write_film(options.video, client.arm, frames, FPS)


def _bodies(client: DemoClient, frame: str) -> Iterator[tuple[float, Scene]]:
    """Give the bodies that were published, and when they were measured [s]."""
    for data in client.bodies:
        msg = deserialize_message(data, MarkerArray)
        yield (
            seconds_of(msg.markers[0].header.stamp),
            scene_of(WearerBody().apply(msg, math.inf, frame)),
        )


def _show(name: str, lines: list[str], line: str) -> None:
    # The first ones say that it has begun.
    if len(lines) < FIRST_LINES:
        lines.append(line)
    print(f'  {name:9}| {line}', flush=True)


if __name__ == '__main__':
    sys.exit(main())
