# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Command-line arguments of the demo."""

import argparse
from pathlib import Path

from rrth_planner.cli.program import program


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = argparse.ArgumentParser(
        prog=program('demo'),
        description='Plan and play motions around a wearer, check and draw them.',
    )
    command.add_argument(
        '--output', type=Path, default=Path('demo.png'), help='picture file (%(default)s)'
    )
    command.add_argument(
        '--seed', type=int, default=1, help='random seed of the planner; -1: a new one'
    )
    command.add_argument(
        '--timeout', type=float, default=180.0, help='timeout of every wait [s] (%(default)s)'
    )
    command.add_argument(
        '--body', default='body', metavar='NAME', help='msg_examples/NAME.yaml (%(default)s)'
    )
    command.add_argument(
        '--targets',
        nargs='+',
        default=['front', 'left', 'high'],
        metavar='NAME',
        help='msg_examples/target_NAME.yaml each (front left high)',
    )
    return command
