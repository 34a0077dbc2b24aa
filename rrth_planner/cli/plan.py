# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plan from files to a file, without ROS."""

import argparse
from collections.abc import Sequence
import json
from pathlib import Path
import sys
from typing import Any, TYPE_CHECKING

import numpy as np
from rrth_planner.cli.file_question import folded, new_seed, plan_of, question_of, settings_of
from rrth_planner.cli.program import add_files, add_target, command_parser, joint_values, run, say
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.motion_file import check_suffix, motion_of, sampled, write_motion
from rrth_planner.io.wearer_file import load_body, WEARER_HELP
from rrth_planner.model.arm import ArmModel, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.status import PlanStatus

if TYPE_CHECKING:
    from rrth_planner.pipeline.motion_plan import MotionPlan

SOLVED, REJECTED, WRONG = 0, 1, 2
SEEDS = 2**31
DESCRIPTION = """\
Plan one motion after which the arm's pointing ray meets a target, and which keeps the margin from
the wearer throughout. Reads files and needs no ROS; the motion is planned and checked as by the
node: certificate and second checker.
Lengths in metres, angles in radians, in the wearer's base frame: x forward, y left, z up.
"""
EPILOG = """\
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Plan a motion, print its figures, write it, and return the exit code."""
    options = _parser().parse_args(arguments)
    return run('plan', lambda: _plan(options), WRONG)


def _plan(options: argparse.Namespace) -> int:
    if options.output is not None:
        check_suffix(options.output)
    elif options.period is not None:
        raise OptionsError(
            '--period: given without --output, expected a file to write the points to'
        )
    arm, scene = load_arm(options.arm), load_body(options.body)
    settings = settings_of(arm, options.settings, margin=options.margin, seed=options.seed)
    if not -1 <= settings.seed < SEEDS:
        raise OptionsError(f'seed: {settings.seed}, expected -1 to {SEEDS - 1} [-]')
    q_start, seed = _start(options, arm), new_seed(settings.seed)
    question = question_of(arm, scene, q_start, options.target, settings, seed)
    plan = plan_of(question, 'plan')
    figures = _figures(arm, q_start, plan)
    if plan.trajectory is not None and options.output is not None:
        motion = motion_of(arm, plan.trajectory)
        if options.period is not None:
            motion = sampled(motion, options.period)
        said = f'Target {_listed(question.goal.target)} m: {plan.sentence}.'
        write_motion(motion, options.output, [said])
    if options.json:
        print(json.dumps(figures, indent=2))
    elif plan.status is PlanStatus.SOLVED:
        print('\n'.join(_lines(figures, options.output)))
    if plan.status is PlanStatus.SOLVED:
        return SOLVED
    say('plan', f'{plan.status.value}: {plan.sentence}')
    return REJECTED


def _start(options: argparse.Namespace, arm: ArmModel) -> Array:
    """Return the start configuration, (dof,) [rad or m]."""
    if options.q_from is not None:
        return joint_values(options.q_from, '--from', arm.joint_names)
    if options.arm is None:
        return np.array(folded())
    return np.asarray(np.clip(np.zeros(arm.dof), *arm.bounds))


def _figures(arm: ArmModel, q_start: Array, plan: 'MotionPlan') -> dict[str, Any]:
    """Return the figures of a plan; the names end with their units."""
    figures: dict[str, Any] = {
        'status': plan.status.value,
        'sentence': plan.sentence,
        'start': _ray(arm, q_start),
    }
    if plan.path is not None and plan.trajectory is not None:
        figures |= {
            'waypoints': len(plan.path.waypoints),
            'duration_s': plan.trajectory.duration,
            'length_rad': plan.path.length,
            'clearance_m': plan.clearance,
            'reach_m': plan.target_distance,
            'escape_time_s': plan.escape_time,
            'end': _ray(arm, plan.trajectory.positions[-1]),
        }
    return figures | {'planning_time_s': plan.planning_time, 'seed': plan.seed}


def _ray(arm: ArmModel, q: Array) -> dict[str, list[float]]:
    """Return a configuration, and origin and direction of the pointing ray there."""
    T = tool_pose(arm, q)
    return {'q': q.tolist(), 'ray_from_m': T[:3, 3].tolist(), 'ray': T[:3, 2].tolist()}


def _lines(figures: dict[str, Any], output: Path | None) -> list[str]:
    lines = [
        f'waypoints      {figures["waypoints"]}',
        f'duration       {figures["duration_s"]:.3f} s',
        f'length         {figures["length_rad"]:.4f} rad',
        f'clearance      {figures["clearance_m"]:.4f} m',
        f'planning time  {1e3 * figures["planning_time_s"]:.2f} ms',
        f'seed           {figures["seed"]}',
    ]
    for label in ('start', 'end'):
        found = figures[label]
        lines += [
            f'{label:15}{_listed(found["q"])}',
            f'  ray from     {_listed(found["ray_from_m"])} m along {_listed(found["ray"])}',
        ]
    if figures['escape_time_s'] > 0.0:
        lines.append(f'escape         until {figures["escape_time_s"]:.3f} s')
    return lines if output is None else [*lines, f'written        {output}']


def _listed(numbers: Any) -> str:
    return ' '.join(f'{number:.4f}' for number in np.round(numbers, 4) + 0.0)


def _parser() -> argparse.ArgumentParser:
    parser = command_parser('plan', DESCRIPTION, EPILOG)
    add_target(parser, 'target of the pointing ray [m]')
    add_files(parser, arm='the arm (config/arm.yaml)', body=WEARER_HELP)
    add = parser.add_argument
    start = 'start configuration, one value per joint [rad or m] (folded; with --arm, all 0)'
    add('--from', dest='q_from', type=float, nargs='+', metavar='Q', help=start)
    add_files(parser, settings='parameters of the node; defaults are those of config/planner.yaml')
    add('--margin', type=float, metavar='M', help='clearance demanded from every box [m]')
    add('--seed', type=int, metavar='N', help='random seed; -1: a new one each time')
    add_files(parser, output='file of the motion, .yaml or .csv')
    add('--period', type=float, metavar='S', help='time between two points in that file [s]')
    add('--json', action='store_true', help='print the figures as JSON')
    return parser


if __name__ == '__main__':
    sys.exit(main())
