# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `record`."""

import argparse
import math
from pathlib import Path

from rrth_planner.cli.numbers import number
from rrth_planner.cli.program import command_parser

# What `record` records: all topics of a planner and an arm, with their types.
TOPICS = {
    'body_boxes': 'visualization_msgs/msg/MarkerArray',
    'target': 'geometry_msgs/msg/PointStamped',
    'joint_states': 'sensor_msgs/msg/JointState',
    'joint_trajectory': 'trajectory_msgs/msg/JointTrajectory',
    'rrth_planner/tool_path': 'nav_msgs/msg/Path',
    'rrth_planner/markers': 'visualization_msgs/msg/MarkerArray',
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    'arm_playback/tool_pose': 'geometry_msgs/msg/PoseStamped',
}
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
    command = command_parser('record', DESCRIPTION, EPILOG.format('\n  '.join(TOPICS)))
    add = command.add_argument
    add('-o', '--output', type=Path, metavar='FILE', help='new file to write (run-DATE-TIME.mcap)')
    add(
        '--duration',
        type=number('s', above=0.0),
        default=math.inf,
        metavar='S',
        help='stop after this time [s]',
    )
    add(
        '--topics',
        nargs='+',
        metavar='NAME',
        help='record these topics instead, of any installed type',
    )
    return command
