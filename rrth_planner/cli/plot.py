# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The command `plot`: pictures of plans and of recorded runs."""

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
import sys
from typing import TYPE_CHECKING

import numpy as np
from rrth_planner.cli.program import program, say
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.extras import require, ROS
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings, PlanSettings
from rrth_planner.io.text_file import load_yaml
from rrth_planner.io.wearer_file import load_body, WEARER_HELP
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import one_line, OptionsError, RrthError
from rrth_planner.model.goal import PointingGoal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 110
KINDS = ('.png', '.svg', '.pdf')
TOOLS = (ROS, 'mcap', 'mcap_ros2')
EXAMPLES = """\
examples:   %(prog)s plan --target 0.3 1.4 0.4 -o plan.png
            %(prog)s recording run.mcap -o run.svg --begin 20 --end 30
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw a picture and return the exit code."""
    options = _parser().parse_args(arguments)
    try:
        _check_output(options.output)
        require('tools', 'matplotlib')
        figure = options.draw(options)
        try:
            figure.savefig(options.output, dpi=DOTS_PER_INCH)
        except OSError as problem:
            raise OptionsError(
                f'{options.output}: {problem.strerror}, expected a writable file'
            ) from problem
    except (RrthError, OSError) as problem:
        say('plot', one_line(' '.join(str(problem).split())))
        return 1
    except KeyboardInterrupt:
        say('plot', 'interrupted')
        return 130
    print(options.output)
    return 0


def _check_output(output: Path) -> None:
    # Before anything that takes time.
    if output.suffix.lower() not in KINDS:
        raise OptionsError(f'-o {output}, expected a name that ends in {", ".join(KINDS)}')
    if not output.absolute().parent.is_dir():
        raise OptionsError(f'-o {output}: its folder does not exist, expected one that does')


def _draw_plan(options: argparse.Namespace) -> 'Figure':
    arm, settings = _arm_and_settings(options)
    scene, goal = load_body(options.body), PointingGoal(options.target)
    q_start = _start(arm, options.start)
    # Not for --help: loading the planner takes seconds, and compiling it, once, minutes.
    from rrth_planner.kernels.precompile import prepare_kernels

    prepare_kernels(partial(say, 'plot'))
    from rrth_planner.pipeline.plan_motion import plan_motion, warm_up
    from rrth_planner.visualization.motion_figure import Motion, motion_figure

    warm_up(arm, settings.options)
    plan = plan_motion(
        arm,
        scene,
        q_start,
        goal,
        settings.limits,
        settings.options,
        margin=settings.margin,
        ray_guard_length=settings.ray_guard_length,
        seed=_seed(settings.seed),
        escape_depth=settings.escape_depth,
    )
    if plan.trajectory is None or plan.path is None:
        raise RrthError(f'no plan: {plan.sentence}')
    print(plan.sentence)
    motion = Motion(
        label='{:g}, {:g}, {:g}'.format(*goal.target),
        trajectory=plan.trajectory,
        target=goal.target,
        caption=f'{plan.path.length:.2f} rad in {plan.trajectory.duration:.2f} s, '
        f'{1e3 * plan.clearance:.0f} mm clearance, seed {plan.seed}',
    )
    return motion_figure(arm, scene, [motion], settings.limits, settings.ray_guard_length)


def _draw_recording(options: argparse.Namespace) -> 'Figure':
    require('ros,tools', *TOOLS)
    # Not before it is known that they are there; plans are drawn without.
    from rrth_planner.execution.recording import section
    from rrth_planner.ros.client.recording_reader import RecordingReader
    from rrth_planner.visualization.recording_figure import recording_figure

    arm, settings = _arm_and_settings(options)
    reader = RecordingReader(options.file, arm, options.base_frame, options.namespace)
    recording = reader.recording()
    for topic, sentence in reader.rejected.items():
        say('plot', one_line(f'{topic}: malformed messages skipped: {sentence}'))
    if options.begin is not None or options.end is not None:
        last = float(recording.times[-1])
        begin, end = _time(options.begin, -np.inf, last), _time(options.end, np.inf, last)
        recording = section(recording, begin, end)
    return recording_figure(recording, arm, settings, options.file.name)


def _time(given: float | None, default: float, last: float) -> float:
    """Return a time of a recording [s]: below 0 it is given from the last one backwards."""
    if given is None:
        return default
    return given + last if given < 0.0 else given


def _arm_and_settings(options: argparse.Namespace) -> tuple[ArmModel, PlanSettings]:
    arm = load_arm(options.arm)
    changes = {} if getattr(options, 'seed', None) is None else {'seed': options.seed}
    return arm, load_settings(arm.dof, options.settings, **changes)


def _start(arm: ArmModel, given: Sequence[float] | None) -> Array:
    """Return the start configuration, (dof,) [rad]: the given one, or that of the playback."""
    if given is not None:
        return frozen_array(given, (arm.dof,), '--from', 'rad', OptionsError)
    data = load_yaml(resource_path('config/playback.yaml'))
    q = data['/**']['ros__parameters']['initial_positions']
    if len(q) != arm.dof:
        raise OptionsError(
            f'no --from, expected {arm.dof} positions, one for each of '
            f'{", ".join(arm.joint_names)} [rad]'
        )
    return np.array(q, dtype=np.float64)


def _seed(given: int) -> int:
    if given < -1 or given >= 2**31:
        raise OptionsError(f'seed: {given}, expected 0 to 2147483647, or -1 for a new one')
    return int(np.random.default_rng().integers(2**31)) if given == -1 else given


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program('plot'),
        description='Draw a plan or a recorded run as PNG, SVG or PDF, chosen by the file name.',
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(required=True, metavar='plan | recording')
    plan = commands.add_parser('plan', help='plan a motion and draw it; needs no ROS')
    plan.set_defaults(draw=_draw_plan)
    plan.add_argument(
        '--target',
        type=float,
        nargs=3,
        required=True,
        metavar=('X', 'Y', 'Z'),
        help='target of the pointing ray, in the base frame [m]',
    )
    plan.add_argument('--body', metavar='FILE', help=WEARER_HELP)
    plan.add_argument(
        '--from',
        dest='start',
        type=float,
        nargs='+',
        metavar='Q',
        help='joint positions at the start [rad] (as in config/playback.yaml)',
    )
    plan.add_argument('--seed', type=int, help='random seed; -1: a new one (as in the settings)')
    recording = commands.add_parser('recording', help='draw a run recorded by `record`')
    recording.set_defaults(draw=_draw_recording)
    recording.add_argument('file', type=Path, metavar='FILE', help='MCAP')
    for name in ('begin', 'end'):
        recording.add_argument(
            f'--{name}',
            type=float,
            metavar='S',
            help=f'{name} of the drawn interval [s]; < 0: relative to the end of the run',
        )
    recording.add_argument('--namespace', metavar='NAME', help='namespace, if there are several')
    recording.add_argument(
        '--base-frame',
        default='torso',
        metavar='NAME',
        help='base frame of the planner (%(default)s)',
    )
    for command in (plan, recording):
        command.add_argument(
            '-o', '--output', type=Path, required=True, metavar='FILE', help='.png, .svg or .pdf'
        )
        command.add_argument('--arm', metavar='FILE', help='the arm (config/arm.yaml)')
        command.add_argument(
            '--settings', metavar='FILE', help="the planner's parameters (config/planner.yaml)"
        )
    return parser


if __name__ == '__main__':
    sys.exit(main())
