# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The command `plot`: pictures of plans and of recorded runs."""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
from typing import TYPE_CHECKING

import numpy as np
from rrth_planner.cli.file_question import folded, new_seed, plan_of, question_of, settings_of
from rrth_planner.cli.parsers.plot import parser
from rrth_planner.cli.program import run, say
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.extras import require, ROS
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import one_line, OptionsError, RrthError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 110
KINDS = ('.png', '.svg', '.pdf')
TOOLS = (ROS, 'mcap', 'mcap_ros2', 'rosbags', 'zstandard')


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw a picture and return the exit code."""
    options = parser().parse_args(arguments)
    return run('plot', lambda: _draw(options), 1)


def _draw(options: argparse.Namespace) -> None:
    # Before anything that takes time.
    output: Path = options.output
    if output.suffix.lower() not in KINDS:
        raise OptionsError(f'-o {output}, expected a name that ends in {", ".join(KINDS)}')
    if not output.absolute().parent.is_dir():
        raise OptionsError(f'-o {output}: its folder does not exist, expected one that does')
    require('tools', 'matplotlib')
    figure = _draw_plan(options) if options.what == 'plan' else _draw_recording(options)
    try:
        figure.savefig(output, dpi=DOTS_PER_INCH)
    except OSError as problem:
        raise OptionsError(f'{output}: {problem.strerror}, expected a writable file') from problem
    print(output)


def _draw_plan(options: argparse.Namespace) -> 'Figure':
    arm = load_arm(options.arm)
    settings = settings_of(arm, options.settings, seed=options.seed)
    if not -1 <= settings.seed < 2**31:
        raise OptionsError(f'seed: {settings.seed}, expected 0 to 2147483647, or -1 for a new one')
    scene, q_start = load_body(options.body), _start(arm, options.q_from)
    question = question_of(arm, scene, q_start, options.target, settings, new_seed(settings.seed))
    plan = plan_of(question, 'plot')
    if plan.trajectory is None or plan.path is None:
        raise RrthError(f'no plan: {plan.sentence}')
    print(plan.sentence)
    # Loads matplotlib, and must follow the compiling.
    from rrth_planner.visualization.motion_figure import Motion, motion_figure

    target = question.goal.target
    motion = Motion(
        label='{:g}, {:g}, {:g}'.format(*target),
        trajectory=plan.trajectory,
        target=target,
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

    arm = load_arm(options.arm)
    settings = settings_of(arm, options.settings)
    reader = RecordingReader(options.file, arm, options.base_frame, options.namespace)
    recording = reader.recording()
    for topic, sentence in reader.rejected.items():
        say('plot', one_line(f'{topic}: malformed messages skipped: {sentence}'))
    if options.begin is not None or options.end is not None:
        last = float(recording.times[-1])
        begin, end = _time(options.begin, -np.inf, last), _time(options.end, np.inf, last)
        recording = section(recording, begin, end)
    return recording_figure(recording, arm, settings, options.file.absolute().name)


def _time(given: float | None, default: float, last: float) -> float:
    """Return a time of a recording [s]: below 0 it is given from the last one backwards."""
    if given is None:
        return default
    return given + last if given < 0.0 else given


def _start(arm: ArmModel, given: Sequence[float] | None) -> Array:
    """Return the start configuration, (dof,) [rad]: the given one, or that of the playback."""
    if given is not None:
        return frozen_array(given, (arm.dof,), '--from', 'rad', OptionsError)
    q = folded()
    if len(q) != arm.dof:
        raise OptionsError(
            f'no --from, expected {arm.dof} positions, one for each of '
            f'{", ".join(arm.joint_names)} [rad]'
        )
    return np.array(q, dtype=np.float64)


if __name__ == '__main__':
    sys.exit(main())
