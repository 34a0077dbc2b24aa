# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `point_at`."""

import argparse
from pathlib import Path

from rrth_planner.cli.numbers import number
from rrth_planner.cli.program import command_parser

DESCRIPTION = """\
Request a motion that points the arm at X Y Z [m], and wait until the arm has arrived. A planner
node and an arm (playback_node, or a controller) must run in the same ROS domain."""
EPILOG = """\
examples:
  %(prog)s 1.5 0.1 0.3                      in front of the chest (x forward, y left, z up)
  %(prog)s 0.2 1.4 -0.1                     to the left, a little down
  %(prog)s 1.5 0.1 0.3 --body config/body.yaml
                                            publish the wearer's body first
  %(prog)s 1.5 0.1 0.3 --no-move            plan only; the arm does not move
  %(prog)s 1.5 0.1 0.3 --json | jq .figures.duration
  %(prog)s 1.5 0.1 0.3 --timeout 5 || echo "not there: $?"
  %(prog)s 1.5 0.1 0.3 --ros-args -r __ns:=/left

exit codes:
  0    the arm has arrived; with --no-move: there is a motion
  1    rejected by the planner; its code and sentence say why
  2    wrong usage: an argument, a file, a name
  3    no planner, no response, no joint positions or no body within the timeout
  4    the arm did not arrive: it does not follow the motion, or was stopped
  130  interrupted; the arm continues its commanded motion

--json prints one object: exit_code, code and name (of the planner; null without a response),
sentence, figures (waypoints, duration [s], path_length [rad], least_clearance [m],
planning_time_ms, seed), arrived (null with --no-move) and pointing_error, the distance of
the ray from the target [m] (null if unknown).

--no-move publishes neither body nor target. It plans in its own process with the planner's
parameters, from the present joint positions, and with the body of --body or the one received on
body_boxes (whose publisher must be latched, or repeat it)."""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments but those of ROS."""
    command = command_parser('point_at', DESCRIPTION, EPILOG)
    add = command.add_argument
    for axis, direction in (('x', 'forward'), ('y', 'left'), ('z', 'up')):
        add(axis, type=number('m'), metavar=axis.upper(), help=f'{direction} [m]')
    add('--frame', metavar='NAME', help="frame of the target (the planner's base_frame: torso)")
    add(
        '--body',
        type=Path,
        metavar='FILE',
        help='the wearer: a YAML file of boxes (config/body.yaml) or markers '
        '(msg_examples/body.yaml), which replaces the body that the planner has',
    )
    add('--json', action='store_true', help='print one JSON object on standard output')
    add('--no-move', action='store_true', help='plan only, and publish nothing')
    add(
        '--timeout',
        type=number('s', above=0.0),
        default=30.0,
        metavar='S',
        help='timeout of every wait, and of the arrival after the end of the motion [s] '
        '(%(default)g)',
    )
    add(
        '--tolerance',
        type=number('rad', above=0.0),
        default=0.01,
        metavar='RAD',
        help='tolerance of each joint at the end of the motion [rad] (%(default)g)',
    )
    add(
        '--ros-args',
        action='store_true',
        help='everything after it is passed to ROS: namespace, remaps, parameters',
    )
    return command
