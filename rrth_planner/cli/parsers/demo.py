# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `demo`."""

import argparse
from pathlib import Path

from rrth_planner.cli.numbers import integer, number
from rrth_planner.cli.program import command_parser


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = command_parser(
        'demo', 'Plan and play motions around a wearer and a recorded person; check and draw them.'
    )
    add = command.add_argument
    add('--output', type=Path, default=Path('demo.png'), help='picture file (%(default)s)')
    add('--seed', type=integer, default=1, help='random seed of the planner; -1: a new one')
    add(
        '--timeout',
        type=number('s', above=0.0),
        default=180.0,
        help='timeout of every wait [s] (%(default)s)',
    )
    add('--body', default='body', metavar='NAME', help='msg_examples/NAME.yaml (%(default)s)')
    add(
        '--targets',
        nargs='+',
        default=['front', 'left', 'high'],
        metavar='NAME',
        help='msg_examples/target_NAME.yaml each (front left high)',
    )
    add(
        '--physics',
        action='store_true',
        help='the arm has masses and servos, and the person may run into it: simulation_node in '
        'place of playback_node',
    )
    return command
