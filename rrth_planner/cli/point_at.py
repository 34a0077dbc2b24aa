# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The command point_at: request a motion to a target, and wait until the arm has arrived."""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass, field
import json
import math
from pathlib import Path
import sys

from geometry_msgs.msg import PointStamped
import rclpy
from rclpy.exceptions import InvalidNamespaceException, ROSInterruptException
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rrth_planner.cli.parsers.point_at import parser
from rrth_planner.cli.program import interrupt_on_signals, INTERRUPTED, say
from rrth_planner.io.extras import require
from rrth_planner.model.arm import pointing_error
from rrth_planner.model.errors import MessageError, OptionsError, RrthError
from rrth_planner.model.status import ErrorCode
from rrth_planner.requests.answer import Answer
from rrth_planner.ros.client.planner_client import (
    NotInTimeError,
    parameters_of_planner,
    PlannerClient,
)
from rrth_planner.ros.interface.parameters import PlannerParameters
from rrth_planner.ros.messages.body_writer import body_from_file
from rrth_planner.ros.messages.frames import Frames
from rrth_planner.ros.messages.goal import goal_from_msg
from visualization_msgs.msg import MarkerArray

DONE, REJECTED, USAGE, NOT_HEARD, NOT_ARRIVED = 0, 1, 2, 3, 4
# Time for the planner to process the messages just published [s].
PATIENCE = 2.0


@dataclass
class Report:
    """Result of a run, as printed by --json."""

    exit_code: int = DONE
    code: int | None = None
    name: str | None = None
    sentence: str = ''
    figures: dict[str, float] = field(default_factory=dict)
    arrived: bool | None = False
    pointing_error: float | None = None

    def take(self, answer: Answer) -> None:
        """Store the response of the planner."""
        self.code, self.name = int(answer.code), answer.code.name
        self.sentence, self.figures = answer.sentence, dict(answer.figures)
        if answer.number:
            self.figures['request'] = answer.number
        if answer.code is not ErrorCode.SUCCESS:
            self.exit_code = REJECTED

    def end(self, exit_code: int, sentence: str) -> None:
        """Store why the run ended early."""
        self.exit_code, self.sentence = exit_code, sentence


def main(arguments: Sequence[str] | None = None) -> int:
    """Point the arm and return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    interrupt_on_signals()
    try:
        options = parser().parse_args(remove_ros_args(['point_at', *given])[1:])
    except RuntimeError as problem:
        say('point_at', _of_ros_args(problem))
        return USAGE
    report = Report(arrived=None if options.no_move else False)
    try:
        with ExitStack() as stack:
            _run(options, given, report, stack)
    except NotInTimeError as problem:
        report.end(NOT_HEARD, str(problem))
    except RrthError as problem:
        # E.g. the planner's arm file, which may not exist on this machine.
        report.end(USAGE, str(problem))
    except (KeyboardInterrupt, ROSInterruptException):
        report.end(INTERRUPTED, 'interrupted')
    if options.json:
        print(json.dumps(asdict(report)))
    else:
        _print(report)
    return report.exit_code


def _run(options: argparse.Namespace, given: list[str], report: Report, stack: ExitStack) -> None:
    require('tools', 'tqdm')
    # Report a bad file before waiting for anything.
    if options.body is not None:
        _body(options.body, '')
    try:
        rclpy.init(args=given, signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        client = PlannerClient('point_at', options.timeout)
    except (RuntimeError, ValueError, InvalidNamespaceException) as problem:
        raise OptionsError(_of_ros_args(problem)) from problem
    stack.callback(client.destroy_node)
    parameters = parameters_of_planner(client)
    client.wait_for_planner()
    client.wait_for_state(parameters.arm.joint_names)
    body = None if options.body is None else _accepted(options.body, parameters.base_frame)
    target = PointStamped()
    target.header.frame_id = options.frame or parameters.base_frame
    target.point.x, target.point.y, target.point.z = options.x, options.y, options.z
    if options.no_move:
        # Loads the planner itself, which takes seconds.
        from rrth_planner.ros.client.dry_run import plan_without_moving

        answer, report.pointing_error = plan_without_moving(client, parameters, target, body)
        report.take(answer)
        return
    _move(client, parameters, target, body, options.tolerance, report)


def _move(
    client: PlannerClient,
    parameters: PlannerParameters,
    target: PointStamped,
    body: MarkerArray | None,
    tolerance: float,
    report: Report,
) -> None:
    """Move the arm to a target, and wait until it has arrived."""
    # Imported here: needs tqdm, which `require` has checked.
    from rrth_planner.ros.client.follow_motion import follow

    arm, frames = parameters.arm, Frames(client, parameters.base_frame)
    if body is not None:
        # With separation an old body is none.
        (client.publish if parameters.execution.separation is None else client.stand)(body)
    client.publish(target)
    answer = client.ask(PATIENCE)
    report.take(answer)
    if report.exit_code != DONE:
        return
    motion = client.motion_of(answer)
    point = None
    with suppress(MessageError):
        # The planner may know a frame that is unknown here.
        point = goal_from_msg(target, parameters.base_frame, frames.lookup).target
    try:
        follow(client, arm, motion, point, tolerance, answer)
        report.arrived = True
    except NotInTimeError as problem:
        report.end(NOT_ARRIVED, str(problem))
    if point is not None:
        report.pointing_error = pointing_error(arm, client.positions(), point)


def _of_ros_args(problem: Exception) -> str:
    return f'--ros-args: {" ".join(str(problem).split())}'


def _body(path: Path, frame: str) -> MarkerArray:
    try:
        return body_from_file(path, frame)
    except RrthError as problem:
        raise OptionsError(f'--body: {problem}') from problem


def _accepted(path: Path, frame: str) -> MarkerArray:
    """Return a body that the planner accepts; it would keep its previous one otherwise."""
    # Imported here: loads kernels, which takes seconds and is only needed with --body.
    from rrth_planner.ros.messages.body import WearerBody

    body = _body(path, frame)
    try:
        # Whenever it was measured.
        taken = WearerBody().apply(body, math.inf, frame)
    except MessageError as problem:
        raise OptionsError(f'--body: file {path}: {problem}') from problem
    if taken.n_boxes == 0:
        raise OptionsError(f'--body: file {path}: no box, expected at least one')
    return body


def _print(report: Report) -> None:
    if report.name is None or report.exit_code in (NOT_HEARD, NOT_ARRIVED, INTERRUPTED):
        say('point_at', report.sentence)
        return
    stream = sys.stdout if report.exit_code == DONE else sys.stderr
    print(f'{report.name} ({report.code}): {report.sentence}', file=stream)
    if report.pointing_error is not None:
        verb = 'misses' if report.arrived else 'would miss'
        print(f'the ray {verb} the target by {1e3 * report.pointing_error:.2f} mm')


if __name__ == '__main__':
    sys.exit(main())
