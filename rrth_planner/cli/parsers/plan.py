# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `plan`."""

import argparse

from rrth_planner.cli.numbers import integer, number
from rrth_planner.cli.program import add_files, add_mount, add_target, BODY_HELP, command_parser

DESCRIPTION = """\
Plan one motion after which the arm's pointing ray meets a target, and which keeps the margin from
the wearer throughout. Reads files and needs no ROS; the motion is planned and checked as by the
node: certificate and second checker.
Lengths in metres, angles in radians, in the wearer's base frame: x forward, y left, z up.
"""
EPILOG = """\
exit codes: 0  solved: figures on standard output, the motion in the file of --output
            1  rejected: the reason, in one sentence on standard error
            2  wrong usage or input: the error on standard error
          130  interrupted

`ray from` is the origin of the pointing ray, that of the arm's `tool` row; the tool itself may be
further out on the same line (`read_urdf` reports where).

A motion is a list of points: time [s], and position, velocity and acceleration of each joint.
Between two points each joint follows the quintic polynomial that fits both. A .csv file has a
header and one line per point; a .yaml file holds the same data. Without --period the file has the
fewest points that define the motion exactly.

example:    %(prog)s --target 1.5 0.8 0.6 --output motion.csv --period 0.01
            %(prog)s --arm config/examples/chest_arm.yaml \\
                --body config/examples/seated_body.yaml --target 1 0.5 0 --json
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = command_parser('plan', DESCRIPTION, EPILOG)
    add_target(command, 'target of the pointing ray [m]')
    add_files(command, arm='the arm (config/arm.yaml)', body=BODY_HELP)
    add = command.add_argument
    add_mount(
        command,
        "pose of the arm's mount in the wearer's base frame [m]; of an arm from a URDF, that of "
        'its first link (as in the file of the arm)',
    )
    add_start = command.add_mutually_exclusive_group().add_argument
    start = 'start configuration, one value per joint [rad or m] (folded; with --arm, all 0)'
    add_start('--from', dest='q_from', type=number('rad or m'), nargs='+', metavar='Q', help=start)
    add_start('--start', choices=('auto',), help='start from a free configuration that is found')
    add_files(
        command, settings='parameters of the node; defaults are those of config/planner.yaml'
    )
    add('--margin', type=number('m'), metavar='M', help='clearance demanded from every box [m]')
    add('--seed', type=integer, metavar='N', help='random seed; -1: a new one each time')
    add_files(command, output='file of the motion, .yaml or .csv')
    add('--period', type=number('s'), metavar='S', help='time between two points in that file [s]')
    add('--json', action='store_true', help='print the figures as JSON')
    return command
