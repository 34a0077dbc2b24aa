# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `simulate`."""

import argparse
import math
from pathlib import Path

from rrth_planner.cli.numbers import integer, number
from rrth_planner.cli.program import add_size, command_parser

DESCRIPTION = """\
Run the planner with a simulated arm (masses, gravity, friction, servos), a person in the scene and
a target that moves, until Ctrl-C; shown in the browser, or rendered to a video. At the end it says
how many targets were reached, which contacts there were, and how far the tool lagged.
"""
EPILOG = """\
examples:
  %(prog)s                                  beside a person at work, in the browser
  %(prog)s --lag 0.03 --payload 1.0         with soft servos
  %(prog)s --seconds 10 --video run.mp4     rendered, without a browser
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = command_parser('simulate', DESCRIPTION, EPILOG)
    add = command.add_argument
    add(
        '--wearer',
        choices=('recorded', 'standing'),
        default='recorded',
        help='a person who moves, or boxes that do not (%(default)s)',
    )
    file = "the person's recording, or boxes of one who stands (the packaged ones)"
    add('--file', type=Path, metavar='FILE', help=file)
    begin = 'start of --file [s] (%(default)g)'
    add('--begin', type=number('s'), default=0.0, metavar='S', help=begin)
    add('--end', type=number('s'), default=0.0, metavar='S', help='end of --file [s]; 0: its end')
    add('--skeleton', default='cmu_bvh', metavar='NAME', help='skeleton of --file (%(default)s)')
    add_size(command)
    add(
        '--lag',
        type=number('m', above=0.0),
        default=0.01,
        metavar='M',
        help='lag of the tool behind its motion at top speed [m] (%(default)g)',
    )
    payload = 'mass at the tool [kg] (%(default)g)'
    add('--payload', type=number('kg'), default=0.2, metavar='KG', help=payload)
    add('--seed', type=integer, default=1, help='random seed of the planner; -1: a new one')
    seconds = 'duration [s] (until Ctrl-C)'
    add('--seconds', type=number('s', above=0.0), default=math.inf, metavar='S', help=seconds)
    add('--video', type=Path, metavar='FILE', help='render the run to a .gif or .mp4')
    add(
        '--viewer',
        action=argparse.BooleanOptionalAction,
        default=None,
        help='show it in the browser (unless there is --video)',
    )
    add('--port', type=integer, default=8081, help='port of the viewer (%(default)s)')
    add(
        '--open',
        action=argparse.BooleanOptionalAction,
        default=None,
        help='open the viewer in the browser (if there is a display)',
    )
    return command
