# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the command point_at is told, and what it tells about itself."""

import argparse
import math
from pathlib import Path

from rrth_planner.cli.program import program

DESCRIPTION = """\
Have the planner turn the arm so that it points at X Y Z [m], and wait until it does. A planner
node and an arm (playback_node, or a controller) have to run in the same ROS domain."""
EPILOG = """\
examples:
  %(prog)s 1.5 0.1 0.3                      in front of the chest (x forward, y left, z up)
  %(prog)s 0.2 1.4 -0.1                     to the left, a little down
  %(prog)s 1.5 0.1 0.3 --body config/body.yaml
                                            tell the planner the wearer's body first
  %(prog)s 1.5 0.1 0.3 --no-move            say how the arm would move, and let it stand
  %(prog)s 1.5 0.1 0.3 --json | jq .figures.duration
  %(prog)s 1.5 0.1 0.3 --timeout 5 || echo "not there: $?"
  %(prog)s 1.5 0.1 0.3 --ros-args -r __ns:=/left

exit codes:
  0    the arm has arrived; with --no-move: there is a motion
  1    the planner refused: its code and its sentence say why
  2    wrong usage: an argument, a file, a name
  3    no planner, no answer, no joint positions or no body within the timeout
  4    the arm did not arrive: it does not follow, or was stopped on its way
  130  interrupted; the arm goes on with what it was told

--json prints one object: exit_code, code and name (of the planner; null without an answer),
sentence, figures (waypoints, duration [s], path_length [rad], least_clearance [m],
planning_time_ms, seed), arrived (null with --no-move) and pointing_error, by how much the ray
passes the target [m] (null where it is not known).

--no-move publishes nothing, neither body nor target: it plans by itself as the planner would, with
the planner's parameters, from the present joint positions, round the body of --body or the one
that is heard on body_boxes: a publisher that neither latches nor repeats it is not heard."""


def parser() -> argparse.ArgumentParser:
    """Return the parser of everything but the words for ROS."""
    command = argparse.ArgumentParser(
        prog=program('point_at'),
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    for axis, way in (('x', 'forward'), ('y', 'left'), ('z', 'up')):
        command.add_argument(axis, type=_coordinate, metavar=axis.upper(), help=f'{way} [m]')
    command.add_argument(
        '--frame', metavar='NAME', help="of the target (the planner's base_frame: torso)"
    )
    command.add_argument(
        '--body',
        type=Path,
        metavar='FILE',
        help='the wearer: a YAML file of boxes (config/body.yaml) or markers '
        '(msg_examples/body.yaml), which replaces the body that the planner has',
    )
    command.add_argument('--json', action='store_true', help='one JSON object on standard output')
    command.add_argument('--no-move', action='store_true', help='plan only, and publish nothing')
    command.add_argument(
        '--timeout',
        type=_positive,
        default=30.0,
        metavar='S',
        help='longest wait for anything, and for the arm after the end of its motion [s] '
        '(%(default)g)',
    )
    command.add_argument(
        '--tolerance',
        type=_positive,
        default=0.01,
        metavar='RAD',
        help='how close each joint has to come to the end of the motion [rad] (%(default)g)',
    )
    command.add_argument(
        '--ros-args',
        action='store_true',
        help='everything after it is for ROS, as for any node: namespace, remaps, parameters',
    )
    return command


def _coordinate(text: str) -> float:
    return _number(text, 'a coordinate, a finite number [m]')


def _positive(text: str) -> float:
    value = _number(text, 'a number > 0')
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f'{text}, expected a number > 0')
    return value


def _number(text: str, expected: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f'"{text}", expected {expected}')
    return value
