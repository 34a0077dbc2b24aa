# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `viewer`."""

import argparse
from pathlib import Path

from rrth_planner.cli.numbers import integer
from rrth_planner.cli.program import add_files, add_size, add_target, BODY_HELP, program


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments but those of ROS."""
    command = argparse.ArgumentParser(
        prog=program('viewer'),
        description='Show the planner in the browser; it replans when the target is dragged. '
        'Ctrl-C ends it.',
        epilog='With --live, arguments after --ros-args are passed to ROS: remaps, parameters.',
    )
    add_files(
        command,
        arm='the arm, as config/arm.yaml',
        body=BODY_HELP,
        settings='parameters, laid out as config/planner.yaml',
    )
    add_target(command, 'target at the start [m] (1.5 0.1 0.3)', required=False)
    add = command.add_argument
    add(
        '--set',
        action='append',
        default=[],
        metavar='NAME=VALUE',
        help='a parameter of config/planner.yaml, e.g. seed=3; may be repeated',
    )
    add('--host', default='127.0.0.1', help='address to listen on (%(default)s)')
    port = 'port to listen on; 0: any free one (%(default)s)'
    add('--port', type=integer, default=8081, help=port)
    add(
        '--open',
        action=argparse.BooleanOptionalAction,
        default=None,
        help='open the page in the browser (default: if there is a display)',
    )
    add(
        '--person',
        nargs='?',
        const='',
        metavar='FILE',
        help='the wearer moves as a recorded person (.bvh, .c3d, .csv), and the arm plans round '
        'them; without FILE the packaged recording',
    )
    add(
        '--skeleton',
        default='cmu_bvh',
        metavar='NAME',
        help='what makes boxes of that recording (%(default)s)',
    )
    add_size(command)
    add(
        '--urdf',
        type=Path,
        metavar='FILE',
        help='the URDF that the arm was read from: its meshes are shown beside the capsules',
    )
    add('--live', action='store_true', help='show the running nodes instead of planning')
    add_files(command, screenshot='save a picture of the page with the arm at the goal, and exit')
    return command
