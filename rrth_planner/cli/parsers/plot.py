# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `plot`."""

import argparse
from pathlib import Path

from rrth_planner.cli.numbers import integer, number
from rrth_planner.cli.program import add_files, add_target, BODY_HELP, command_parser

EPILOG = """\
examples:   %(prog)s plan --target 0.3 1.4 0.4 -o plan.png
            %(prog)s recording run.mcap -o run.svg --begin 20 --end 30
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = command_parser(
        'plot',
        'Draw a plan or a recorded run as PNG, SVG or PDF, chosen by the file name.',
        EPILOG,
    )
    commands = command.add_subparsers(dest='what', required=True, metavar='plan | recording')
    plan = commands.add_parser('plan', help='plan a motion and draw it; needs no ROS')
    add_target(plan, 'target of the pointing ray, in the base frame [m]')
    add_files(plan, body=BODY_HELP)
    start = 'joint positions at the start [rad or m] (as in config/playback.yaml)'
    plan.add_argument(
        '--from', dest='q_from', type=number('rad or m'), nargs='+', metavar='Q', help=start
    )
    plan.add_argument(
        '--seed', type=integer, help='random seed; -1: a new one (as in the settings)'
    )
    recording = commands.add_parser('recording', help='draw a run recorded by `record`')
    add = recording.add_argument
    add('file', type=Path, metavar='FILE', help='MCAP file, or the folder of a `ros2 bag`')
    for name in ('begin', 'end'):
        what = f'{name} of the drawn interval [s]; < 0: relative to the end of the run'
        add(f'--{name}', type=number('s'), metavar='S', help=what)
    add('--namespace', metavar='NAME', help='namespace, if there are several')
    frame = 'base frame of the planner (%(default)s)'
    add('--base-frame', default='torso', metavar='NAME', help=frame)
    for drawing in (plan, recording):
        drawing.add_argument(
            '-o', '--output', type=Path, required=True, metavar='FILE', help='.png, .svg or .pdf'
        )
        add_files(
            drawing,
            arm='the arm (config/arm.yaml)',
            settings="the planner's parameters (config/planner.yaml)",
        )
    return command
