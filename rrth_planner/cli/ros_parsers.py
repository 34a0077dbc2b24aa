# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Parsers of the commands that need ROS; with the standard library alone they print --help."""

import argparse
import math
from pathlib import Path

from rrth_planner.cli.numbers import integer, number
from rrth_planner.cli.program import add_size, command_parser

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
# What a person is published as, and the drivers of trackers that he is published by.
FORMS = ('boxes', 'markers', 'poses')
DRIVERS = (
    *('kinect', 'femto', 'zed', 'zed_body_18', 'zed_body_34', 'zed_body_38', 'zed_body_70'),
    *('coco', 'halpe', 'natnet', 'vrpn', 'mocap4r2'),
)
POINT_AT = """\
Request a motion that points the arm at X Y Z [m], and wait until the arm has arrived. A planner
node and an arm (playback_node, or a controller) must run in the same ROS domain."""
POINT_AT_EPILOG = """\
examples:
  %(prog)s 1.5 0.1 0.3                      in front of the chest (x forward, y left, z up)
  %(prog)s 0.2 1.4 -0.1                     to the left, a little down
  %(prog)s 1.5 0.1 0.3 --body config/body.yaml
                                            publish the wearer's body first
  %(prog)s 1.5 0.1 0.3 --no-move            plan only; the arm does not move
  %(prog)s 1.5 0.1 0.3 --json | jq .figures.duration
  %(prog)s 1.5 0.1 0.3 --timeout 5 || echo "not there: $?"
  %(prog)s 1.5 0.1 0.3 --ros-args -r __ns:=/left

exit codes:
  0    the arm has arrived; with --no-move: there is a motion
  1    rejected by the planner; its code and sentence say why
  2    wrong usage: an argument, a file, a name
  3    no planner, no response, no joint positions or no body within the timeout
  4    the arm did not arrive: it does not follow the motion, or was stopped
  130  interrupted; the arm continues its commanded motion

--json prints one object: exit_code, code and name (of the planner; null without a response),
sentence, figures (waypoints, duration [s], path_length [rad], least_clearance [m],
planning_time_ms, seed), arrived (null with --no-move) and pointing_error, the distance of
the ray from the target [m] (null if unknown).

--no-move publishes neither body nor target. It plans in its own process with the planner's
parameters, from the present joint positions, and with the body of --body or the one received on
body_boxes (whose publisher must be latched, or repeat it)."""
WEARER = """\
Publish a recorded person as the wearer until Ctrl-C, as a tracker would: boxes on body_boxes, or
what trackers publish. The recording is played forwards and backwards; without FILE it is the
packaged one, of construction work. Names are relative; namespaces and remaps go after --ros-args.
"""
WEARER_EPILOG = """\
examples:
  %(prog)s                                  construction work, at 60 Hz
  %(prog)s --rate 0.5 --latency 0.05        half as fast, every body 50 ms late
  %(prog)s walk.bvh --begin 0.1 --skeleton cmu_bvh
  %(prog)s --as markers --drop 0.1 --noise 0.01
  %(prog)s --as zed                         as the driver of a ZED camera
"""
SIMULATE = """\
Run the planner with a simulated arm (masses, gravity, friction, servos), a person in the scene and
a target that moves, until Ctrl-C; shown in the browser, or rendered to a video. At the end it says
how many targets were reached, which contacts there were, and how far the tool lagged.
"""
SIMULATE_EPILOG = """\
examples:
  %(prog)s                                  beside a person at work, in the browser
  %(prog)s --lag 0.03 --payload 1.0         with soft servos
  %(prog)s --seconds 10 --video run.mp4     rendered, without a browser
"""
RECORD = """\
Record a run of the nodes in an MCAP file until Ctrl-C: every message once, serialized as received,
from reliable, best-effort and latched publishers. Foxglove opens the file, `plot recording` draws
it. Names are relative; namespaces and remaps go after --ros-args.
"""
RECORD_EPILOG = """\
default topics:
  {}

example:    %(prog)s -o run.mcap --duration 30 --ros-args -r __ns:=/left
"""


def point_at() -> argparse.ArgumentParser:
    """Return the parser of all arguments but those of ROS."""
    command = command_parser('point_at', POINT_AT, POINT_AT_EPILOG)
    add = command.add_argument
    for axis, direction in (('x', 'forward'), ('y', 'left'), ('z', 'up')):
        add(axis, type=number('m'), metavar=axis.upper(), help=f'{direction} [m]')
    add('--frame', metavar='NAME', help="frame of the target (the planner's base_frame: torso)")
    add(
        '--body',
        type=Path,
        metavar='FILE',
        help='the wearer: a YAML file of boxes (config/body.yaml) or markers '
        '(msg_examples/body.yaml), which replaces the body that the planner has',
    )
    add('--json', action='store_true', help='print one JSON object on standard output')
    add('--no-move', action='store_true', help='plan only, and publish nothing')
    add(
        '--timeout',
        type=number('s', above=0.0),
        default=30.0,
        metavar='S',
        help='timeout of every wait, and of the arrival after the end of the motion [s] '
        '(%(default)g)',
    )
    add(
        '--tolerance',
        type=number('rad', above=0.0),
        default=0.01,
        metavar='RAD',
        help='tolerance of each joint at the end of the motion [rad] (%(default)g)',
    )
    add(
        '--ros-args',
        action='store_true',
        help='everything after it is passed to ROS: namespace, remaps, parameters',
    )
    return command


def record() -> argparse.ArgumentParser:
    """Return the parser of all arguments but those of ROS."""
    command = command_parser('record', RECORD, RECORD_EPILOG.format('\n  '.join(TOPICS)))
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


def wearer() -> argparse.ArgumentParser:
    """Return the parser of all arguments but those of ROS."""
    command = command_parser('wearer', WEARER, WEARER_EPILOG)
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


def demo() -> argparse.ArgumentParser:
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


def simulate() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = command_parser('simulate', SIMULATE, SIMULATE_EPILOG)
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
