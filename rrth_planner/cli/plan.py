# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plan from files to a file, without ROS."""

import argparse
from collections.abc import Sequence
import json
from pathlib import Path
import sys
from typing import Any

import numpy as np
from rrth_planner.cli.file_question import (
    figures_of,
    free_start_of,
    new_seed,
    plan_of,
    question_of,
    SEEDS,
    settings_of,
    start_of,
)
from rrth_planner.cli.mount_pose import mount_pose
from rrth_planner.cli.parsers.plan import parser
from rrth_planner.cli.program import run, say
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.motion_file import check_suffix, sampled, write_motion
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.status import PlanStatus

SOLVED, REJECTED, WRONG = 0, 1, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Plan a motion, print its figures, write it, and return the exit code."""
    options = parser().parse_args(arguments)
    return run('plan', lambda: _plan(options), WRONG)


def _plan(options: argparse.Namespace) -> int:
    if options.output is not None:
        check_suffix(options.output)
    elif options.period is not None:
        raise OptionsError(
            '--period: given without --output, expected a file to write the points to'
        )
    T_base_link = None if options.mount is None else mount_pose(options.mount)
    arm, scene = load_arm(options.arm, T_base_link), load_body(options.body)
    settings = settings_of(arm, options.settings, margin=options.margin, seed=options.seed)
    if not -1 <= settings.seed < SEEDS:
        raise OptionsError(f'seed: {settings.seed}, expected -1 to {SEEDS - 1} [-]')
    if options.start == 'auto':
        q_start = free_start_of(arm, scene, settings, lambda T: load_arm(options.arm, T))
    else:
        q_start = start_of(options.q_from, '--from', arm, is_packaged=options.arm is None)
    seed = new_seed(settings.seed)
    question = question_of(arm, scene, q_start, options.target, settings, seed)
    plan = plan_of(question, 'plan')
    figures = figures_of(arm, q_start, plan)
    if plan.trajectory is not None and options.output is not None:
        motion = plan.trajectory
        if options.period is not None:
            motion = sampled(motion, options.period)
        said = f'Target {_listed(question.goal.target)} m: {plan.sentence}.'
        write_motion(arm, motion, options.output, [said])
    if options.json:
        print(json.dumps(figures, indent=2))
    elif plan.status is PlanStatus.SOLVED:
        print('\n'.join(_lines(figures, options.output)))
    if plan.status is PlanStatus.SOLVED:
        return SOLVED
    say('plan', f'{plan.status.value}: {plan.sentence}')
    return REJECTED


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
