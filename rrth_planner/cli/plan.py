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
from rrth_planner.cli import plain_parsers
from rrth_planner.cli.file_question import folded, new_seed, plan_of, question_of, settings_of
from rrth_planner.cli.joint_values import joint_values
from rrth_planner.cli.program import run, say
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.motion_file import check_suffix, motion_of, sampled, write_motion
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import ArmModel, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.status import PlanStatus

if TYPE_CHECKING:
    from rrth_planner.pipeline.motion_plan import MotionPlan

SOLVED, REJECTED, WRONG = 0, 1, 2
SEEDS = 2**31


def main(arguments: Sequence[str] | None = None) -> int:
    """Plan a motion, print its figures, write it, and return the exit code."""
    options = plain_parsers.plan().parse_args(arguments)
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


if __name__ == '__main__':
    sys.exit(main())
