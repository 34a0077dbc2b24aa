# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Command-line arguments of record."""

import argparse
import math
from pathlib import Path

from rrth_planner.cli.program import program

# All topics of a planner and an arm.
TOPICS = (
    'body_boxes',
    'target',
    'joint_states',
    'joint_trajectory',
    'rrth_planner/tool_path',
    'rrth_planner/markers',
    '/diagnostics',
    'arm_playback/tool_pose',
)
DESCRIPTION = """\
Record a run of the nodes in an MCAP file until Ctrl-C: every message once, serialized as received,
from reliable, best-effort and latched publishers. Foxglove opens the file, `plot recording` draws
it. Names are relative; namespaces and remaps go after --ros-args.
"""
EPILOG = """\
default topics:
  {}

example:    %(prog)s -o run.mcap --duration 30 --ros-args -r __ns:=/left
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments but those of ROS."""
    command = argparse.ArgumentParser(
        prog=program('record'),
        description=DESCRIPTION,
        epilog=EPILOG.format('\n  '.join(TOPICS)),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument(
        '-o',
        '--output',
        type=Path,
        metavar='FILE',
        help='new file to write (run-DATE-TIME.mcap)',
    )
    command.add_argument(
        '--duration',
        type=_seconds,
        default=math.inf,
        metavar='S',
        help='stop after this time [s]',
    )
    command.add_argument(
        '--topics',
        nargs='+',
        metavar='NAME',
        help='record these topics instead, of any installed type',
    )
    return command


def _seconds(text: str) -> float:
    value = float(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f'{text}, expected a time > 0 [s]')
    return value
