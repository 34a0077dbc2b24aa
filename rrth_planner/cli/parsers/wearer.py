# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `wearer`."""

import argparse
from pathlib import Path

from rrth_planner.cli.numbers import integer, number
from rrth_planner.cli.program import add_size, command_parser

# What a person is published as, and the drivers of trackers that he is published by.
FORMS = ('boxes', 'markers', 'poses')
DRIVERS = (
    *('kinect', 'femto', 'zed', 'zed_body_18', 'zed_body_34', 'zed_body_38', 'zed_body_70'),
    *('coco', 'halpe', 'natnet', 'vrpn', 'mocap4r2'),
)
DESCRIPTION = """\
Publish a recorded person as the wearer until Ctrl-C, as a tracker would: boxes on body_boxes, or
what trackers publish. The recording is played forwards and backwards; without FILE it is the
packaged one, of construction work. Names are relative; namespaces and remaps go after --ros-args.
"""
EPILOG = """\
examples:
  %(prog)s                                  construction work, at 60 Hz
  %(prog)s --rate 0.5 --latency 0.05        half as fast, every body 50 ms late
  %(prog)s walk.bvh --begin 0.1 --skeleton cmu_bvh
  %(prog)s --as markers --drop 0.1 --noise 0.01
  %(prog)s --as zed                         as the driver of a ZED camera
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments but those of ROS."""
    command = command_parser('wearer', DESCRIPTION, EPILOG)
    add = command.add_argument
    add('file', type=Path, nargs='?', metavar='FILE', help='a recording: .bvh, .c3d or .csv')
    add(
        '--as',
        dest='form',
        choices=(*FORMS, *DRIVERS),
        default='boxes',
        metavar='WHAT',
        help='boxes on body_boxes (default), markers or poses of the recorded points; or what the '
        f'driver of a tracker publishes: {", ".join(DRIVERS)}, by its types, topics and frames',
    )
    for name, text, unit, default in (
        ('rate', 'speed of the motion; 1: as recorded, 0: standing still', '-', 1.0),
        ('latency', 'from a measurement until it is published, with the old stamp', 's', 0.0),
        ('drop', 'share of the measurements that are lost, 0 to below 1', '-', 0.0),
        ('noise', 'standard deviation of each coordinate of the points', 'm', 0.0),
        ('begin', 'start of what is played; 0.1 leaves out a T-pose at the start', 's', 0.0),
    ):
        add(
            f'--{name}',
            type=number(unit),
            default=default,
            metavar='X',
            help=f'{text} [{unit}] (%(default)g)',
        )
    add(
        '--fps',
        type=number('1/s'),
        metavar='X',
        help='measurements per second [1/s] (60; that of the driver with its --as)',
    )
    add('--end', type=number('s'), metavar='X', help='end of what is played [s]')
    add('--seed', type=integer, default=0, help='random seed of noise and losses (%(default)s)')
    add(
        '--skeleton',
        default='cmu_bvh',
        metavar='NAME',
        help='what makes boxes of the points: one of config/skeletons, or a file (%(default)s)',
    )
    add_size(command)
    return command
