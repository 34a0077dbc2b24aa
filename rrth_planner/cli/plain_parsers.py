# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Parsers of the commands that need no ROS; with the standard library alone they print --help."""

import argparse
from pathlib import Path

from rrth_planner.cli.numbers import integer, number, number_of_runs, number_of_workers
from rrth_planner.cli.program import add_files, add_size, add_target, command_parser, program

PLAN = """\
Plan one motion after which the arm's pointing ray meets a target, and which keeps the margin from
the wearer throughout. Reads files and needs no ROS; the motion is planned and checked as by the
node: certificate and second checker.
Lengths in metres, angles in radians, in the wearer's base frame: x forward, y left, z up.
"""
PLAN_EPILOG = """\
exit codes: 0  solved: figures on standard output, the motion in the file of --output
            1  rejected: the reason, in one sentence on standard error
            2  wrong usage or input: the error on standard error
          130  interrupted

`ray from` is the origin of the pointing ray, that of the arm's `tool` row; the tool itself may be
further out on the same line (`read_urdf` reports where).

A motion is a list of points: time [s], and position, velocity and acceleration of each joint.
Between two points each joint follows the quintic polynomial that fits both. A .csv file has a
header and one line per point; a .yaml file holds the same data. Without --period the file has the
fewest points that define the motion exactly.

example:    %(prog)s --target 1.5 0.8 0.6 --output motion.csv --period 0.01
            %(prog)s --arm config/examples/chest_arm.yaml \\
                --body config/examples/seated_body.yaml --target 1 0.5 0 --json
"""
CAMPAIGN = """\
Plan a motion for each row of one or more files of queries, on all cores of this machine or on a
dask cluster, and write one Parquet file with a row for each. Plans are those of `plan`: the same
query and seed have the same result, whoever plans it. Needs no ROS.
"""
CAMPAIGN_EPILOG = """\
Queries are .csv or .parquet files; all of a campaign have the same columns:
  target_x target_y target_z   target of the pointing ray in the base frame [m]
  start_1 ... start_n          start configuration [rad or m] (as of `plan`)
  arm, body                    files of the arm and the wearer, from the folder of the queries
                               (--arm, --body)
  seed                         random seed (--seed; without, the number of the row, from 0)
Only the target is required; where a value is missing the default in parentheses counts. Other
columns are kept as they are.

The output has the columns of the queries, the seed that was used, digests of the files of arm and
wearer, and the figures of the plan, named as by `plan --json`; end: the joint positions there
[rad or m]. status is `solved`, the reason why there is no motion, `invalid query`, or `error`;
sentence says more. An interrupted campaign, started again, continues.

exit codes: 0  all queries are planned, with or without a motion
            2  wrong usage or input, or a cluster that ended: the error on standard error
          130  interrupted; what was planned is kept

example:    %(prog)s queries.parquet --output plans.parquet
            %(prog)s first.csv second.csv --output plans.parquet --scheduler tcp://10.0.0.1:8786
"""
PLOT_EXAMPLES = """\
examples:   %(prog)s plan --target 0.3 1.4 0.4 -o plan.png
            %(prog)s recording run.mcap -o run.svg --begin 20 --end 30
"""
READ_URDF = """\
Read the joints between two links of a URDF and write them as an arm of the planner, laid out as
config/arm.yaml: modified Denavit-Hartenberg rows, limits, mount and tool, and the shape of the
links. The collision geometry of each link, meshes included, is enclosed in a few slim capsules.
Where there is none at all, or with --geometry bars, every link is a bar from joint to joint, with
the radius given here.
"""
READ_URDF_EPILOG = """\
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
WRITE_URDF = """\
Write an arm as a URDF, from the DH rows that the planner uses: a link for each frame,
joints with their limits, bars and capsules as cylinders and spheres, and a link "tool" whose +z
axis is the pointing ray. Capsules are collision geometry, too. It needs no ROS.
"""
WRITE_URDF_EPILOG = """\
The velocities are max_velocity of the settings. URDF also requires an effort, which neither file
gives: it is written as 0, and must be filled in to simulate forces.

exit codes: 0  written
            2  not written (the reason is printed)

example:    %(prog)s --arm my_arm.yaml --output my_arm.urdf
"""
REPLAY = """\
Replay an incident of the planner: a certified motion in which the second checker found a clearance
violation, or an unexpected error. Neither is ever published; the node answers FAILURE and names
the file that this command reads. The command plans again from the same inputs with the same seed,
reports whether the motion is identical to the bit, and checks each piece of the recorded motion
by three collision checkers: the certificate, the second checker (python-fcl or coal), and the
reference checker, which is plain numpy and shares nothing with the others. It needs no ROS.
"""
REPLAY_EPILOG = """\
exit codes: 0  reproduced as recorded
            1  not reproduced (the difference is printed)
            2  the file is not an incident (the reason is printed)

A plan that reached a time limit (time_limit, improve_time) may differ on another machine, and
other versions of the libraries may round differently; differing versions are printed.

example:    %(prog)s ~/.ros/log/rrth_planner/incident-20261121T213655123456-1f0c2a.yaml
"""
REPRODUCE = (
    'The reproduction: every figure and number of the paper, measured again by one command.'
)
WEARER = 'the wearer, laid out as config/body.yaml, the default, or as msg_examples/body.yaml'
VIEWER_PORT = 8081


def _add_mount(parser: argparse.ArgumentParser, text: str) -> None:
    """Add the option that says where an arm is worn, with its help."""
    pose = ('X', 'Y', 'Z', 'QX', 'QY', 'QZ', 'QW')
    parser.add_argument('--mount', type=number('m'), nargs=7, metavar=pose, help=text)


def plan() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    parser = command_parser('plan', PLAN, PLAN_EPILOG)
    add_target(parser, 'target of the pointing ray [m]')
    add_files(parser, arm='the arm (config/arm.yaml)', body=WEARER)
    add = parser.add_argument
    _add_mount(
        parser,
        "pose of the arm's mount in the wearer's base frame [m]; of an arm from a URDF, that of "
        'its first link (as in the file of the arm)',
    )
    add_start = parser.add_mutually_exclusive_group().add_argument
    start = 'start configuration, one value per joint [rad or m] (folded; with --arm, all 0)'
    add_start('--from', dest='q_from', type=number('rad or m'), nargs='+', metavar='Q', help=start)
    add_start('--start', choices=('auto',), help='start from a free configuration that is found')
    add_files(parser, settings='parameters of the node; defaults are those of config/planner.yaml')
    add('--margin', type=number('m'), metavar='M', help='clearance demanded from every box [m]')
    add('--seed', type=integer, metavar='N', help='random seed; -1: a new one each time')
    add_files(parser, output='file of the motion, .yaml or .csv')
    add('--period', type=number('s'), metavar='S', help='time between two points in that file [s]')
    add('--json', action='store_true', help='print the figures as JSON')
    return parser


def campaign() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    parser = command_parser('campaign', CAMPAIGN, CAMPAIGN_EPILOG)
    add = parser.add_argument
    add('queries', type=Path, nargs='+', metavar='QUERIES', help='.csv or .parquet')
    output = 'Parquet file of the plans; an existing one is continued'
    add('--output', type=Path, required=True, metavar='FILE', help=output)
    add_files(
        parser,
        arm='the arm of queries that name none (config/arm.yaml)',
        body=WEARER,
        settings='parameters of the node; defaults are those of config/planner.yaml',
    )
    add('--margin', type=number('m'), metavar='M', help='clearance demanded from every box [m]')
    seed = 'random seed of queries that have none; -1: the number of the row'
    add('--seed', type=integer, metavar='N', help=seed)
    add_where = parser.add_mutually_exclusive_group().add_argument
    add_where(
        '--workers',
        type=number_of_workers,
        metavar='N',
        help='processes on this machine (its cores)',
    )
    add_where('--scheduler', metavar='tcp://HOST:PORT', help='address of a dask scheduler')
    return parser


def plot() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    parser = command_parser(
        'plot',
        'Draw a plan or a recorded run as PNG, SVG or PDF, chosen by the file name.',
        PLOT_EXAMPLES,
    )
    commands = parser.add_subparsers(dest='what', required=True, metavar='plan | recording')
    plan = commands.add_parser('plan', help='plan a motion and draw it; needs no ROS')
    add_target(plan, 'target of the pointing ray, in the base frame [m]')
    add_files(plan, body=WEARER)
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
    for command in (plan, recording):
        command.add_argument(
            '-o', '--output', type=Path, required=True, metavar='FILE', help='.png, .svg or .pdf'
        )
        add_files(
            command,
            arm='the arm (config/arm.yaml)',
            settings="the planner's parameters (config/planner.yaml)",
        )
    return parser


def viewer() -> argparse.ArgumentParser:
    """Return the parser of all arguments but those of ROS."""
    parser = argparse.ArgumentParser(
        prog=program('viewer'),
        description='Show the planner in the browser; it replans when the target is dragged. '
        'Ctrl-C ends it.',
        epilog='With --live, arguments after --ros-args are passed to ROS: remaps, parameters.',
    )
    add_files(
        parser,
        arm='the arm, as config/arm.yaml',
        body=WEARER,
        settings='parameters, laid out as config/planner.yaml',
    )
    add_target(parser, 'target at the start [m] (1.5 0.1 0.3)', required=False)
    add = parser.add_argument
    add(
        '--set',
        action='append',
        default=[],
        metavar='NAME=VALUE',
        help='a parameter of config/planner.yaml, e.g. seed=3; may be repeated',
    )
    add('--host', default='127.0.0.1', help='address to listen on (%(default)s)')
    port = 'port to listen on; 0: any free one (%(default)s)'
    add('--port', type=integer, default=VIEWER_PORT, help=port)
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
    add_size(parser)
    add(
        '--urdf',
        type=Path,
        metavar='FILE',
        help='the URDF that the arm was read from: its meshes are shown beside the capsules',
    )
    add('--live', action='store_true', help='show the running nodes instead of planning')
    add_files(parser, screenshot='save a picture of the page with the arm at the goal, and exit')
    return parser


def read_urdf() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    parser = command_parser('read_urdf', READ_URDF, READ_URDF_EPILOG)
    add = parser.add_argument
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
    _add_mount(parser, "pose of the first link in the wearer's base frame [m] (the same frame)")
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
    add_files(parser, body='where free configurations are looked for: ' + WEARER)
    check = 'print the tool pose at these joint positions [rad or m]'
    add('--check', type=number('rad or m'), nargs='+', metavar='Q', help=check)
    return parser


def write_urdf() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    parser = command_parser('write_urdf', WRITE_URDF, WRITE_URDF_EPILOG)
    add_files(
        parser,
        arm='the arm, as config/arm.yaml (default: that one)',
        settings='parameters of the node, as config/planner.yaml (default: those)',
        output='file to write (default: standard output)',
    )
    radius = 'radius of bars that have none of their own [m] (default: %(default)s)'
    parser.add_argument('--radius', type=number('m'), default=0.015, metavar='M', help=radius)
    frame = 'link that the arm is mounted on, as base_frame of the node (default: %(default)s)'
    parser.add_argument('--base-frame', default='torso', metavar='NAME', help=frame)
    return parser


def replay() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    parser = command_parser('replay', REPLAY, REPLAY_EPILOG)
    parser.add_argument('file', type=Path, metavar='FILE', help='YAML file of the incident')
    return parser


def reproduce() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    parser = command_parser('reproduce', REPRODUCE)
    add = parser.add_argument
    add('--quick', action='store_true', help='few runs: a minute or two')
    output = 'folder of reproduction.md and its pictures (docs; --quick: build/reproduction)'
    add('--output', type=Path, help=output)
    data = 'Parquet file of the runs (reproduction.parquet in the output)'
    add('--data', type=Path, help=data)
    runs = 'timed runs per planner and map; the fewest and most are reported (10 100)'
    add('--runs', type=number_of_runs, nargs='+', metavar='N', help=runs)
    seeds = 'runs for each share and number of draws (1000)'
    add('--seeds', type=number_of_runs, metavar='N', help=seeds)
    add('--maps', nargs='+', metavar='NAME', help='only these maps')
    add('--targets', nargs='+', metavar='NAME', help='only these targets of the arm')
    add_where = parser.add_mutually_exclusive_group().add_argument
    add_where(
        '--scheduler',
        metavar='tcp://HOST:PORT',
        help='address of a dask scheduler (default: a local cluster)',
    )
    add_where('--serial', action='store_true', help='run all in this process, one by one')
    return parser
