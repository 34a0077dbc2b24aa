# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `write_urdf`."""

import argparse

from rrth_planner.cli.numbers import number
from rrth_planner.cli.program import add_files, command_parser

DESCRIPTION = """\
Write an arm as a URDF, from the DH rows that the planner uses: a link for each frame,
joints with their limits, bars and capsules as cylinders and spheres, and a link "tool" whose +z
axis is the pointing ray. Capsules are collision geometry, too. It needs no ROS.
"""
EPILOG = """\
The velocities are max_velocity of the settings. URDF also requires an effort, which neither file
gives: it is written as 0, and must be filled in to simulate forces.

exit codes: 0  written
            2  not written (the reason is printed)

example:    %(prog)s --arm my_arm.yaml --output my_arm.urdf
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = command_parser('write_urdf', DESCRIPTION, EPILOG)
    add_files(
        command,
        arm='the arm, as config/arm.yaml (default: that one)',
        settings='parameters of the node, as config/planner.yaml (default: those)',
        output='file to write (default: standard output)',
    )
    radius = 'radius of bars that have none of their own [m] (default: %(default)s)'
    command.add_argument('--radius', type=number('m'), default=0.015, metavar='M', help=radius)
    frame = 'link that the arm is mounted on, as base_frame of the node (default: %(default)s)'
    command.add_argument('--base-frame', default='torso', metavar='NAME', help=frame)
    return command
