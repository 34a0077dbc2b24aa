# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `read_urdf`."""

import argparse
from pathlib import Path

from rrth_planner.cli.numbers import number
from rrth_planner.cli.program import add_files, add_mount, BODY_HELP, command_parser

DESCRIPTION = """\
Read the joints between two links of a URDF and write them as an arm of the planner, laid out as
config/arm.yaml: modified Denavit-Hartenberg rows, limits, mount and tool, and the shape of the
links. The collision geometry of each link, meshes included, is enclosed in a few slim capsules.
Where there is none at all, or with --geometry bars, every link is a bar from joint to joint, with
the radius given here.
"""
EPILOG = """\
The conversion is exact for any chain of revolute, continuous, prismatic and fixed joints. The
result is compared with the URDF at many configurations, and the difference is printed. Continuous
joints turn without a stop, as often as --max-turns allows. Links beside the chain belong to the
arm where they are fixed to it; those that joints beside it move, such as fingers, are left out
and named, or enclosed in all their positions. Every triangle of a mesh is proven to lie in the
capsules. Parts that collide in the middle of the joint ranges and nearly everywhere are written as
pairs that may meet.

exit codes: 0  the file has been written
            2  wrong usage, or a URDF without such a chain (the reason is printed)
          130  interrupted

example:    %(prog)s config/examples/chest_arm.urdf --ray +x --radius 0.025 \\
                --output my_arm.yaml --check 0 -0.5 1 0 0.3 0
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = command_parser('read_urdf', DESCRIPTION, EPILOG)
    add = command.add_argument
    add('file', type=Path, metavar='FILE', help='the URDF file')
    add('--base', metavar='LINK', help='first link of the chain (the root)')
    add('--tool', metavar='LINK', help='last link (the one that ends the chain)')
    add('--jaw', action='store_true', help='the tool may be what looks like the jaw of a gripper')
    add(
        '--ray',
        default='+z',
        metavar='AXIS',
        help='axis of the tool link that is the pointing ray: +x -x +y -y +z -z (%(default)s)',
    )
    add_mount(command, "pose of the first link in the wearer's base frame [m] (the same frame)")
    add(
        '--geometry',
        choices=('collision', 'visual', 'bars'),
        default='collision',
        help='shape of the links: their collision geometry, what is seen of them where that is '
        'given, or bars (%(default)s; bars where there is none)',
    )
    radius = 'radius of links that are bars [m] (%(default)s)'
    add('--radius', type=number('m'), default=0.03, metavar='M', help=radius)
    radius = 'radius of the pointing ray [m] (0; that of the links where these are bars)'
    add('--ray-radius', type=number('m'), metavar='M', help=radius)
    turns = (
        'how often continuous joints may turn, either way from 0, for their cables [turns] '
        '(%(default)g)'
    )
    add('--max-turns', type=number('turns'), default=3.0, metavar='N', help=turns)
    add(
        '--include-branches',
        action='store_true',
        help='enclose links moved by joints beside the chain, such as fingers, in all positions',
    )
    srdf = 'SRDF whose disable_collisions name pairs of links that may meet'
    add('--srdf', type=Path, metavar='FILE', help=srdf)
    add('--output', type=Path, required=True, metavar='FILE', help='arm file to write')
    add_files(command, body='where free configurations are looked for: ' + BODY_HELP)
    check = 'print the tool pose at these joint positions [rad or m]'
    add('--check', type=number('rad or m'), nargs='+', metavar='Q', help=check)
    return command
