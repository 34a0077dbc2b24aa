# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Write the URDF of an arm, for RViz, robot_state_publisher and controllers."""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys

from rrth_planner.cli.parsers.write_urdf import parser
from rrth_planner.cli.program import run
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings
from rrth_planner.io.text_file import load_yaml
from rrth_planner.io.urdf.export import arm_to_urdf
from rrth_planner.model.errors import ModelError


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the URDF and return the exit code."""
    options = parser().parse_args(arguments)
    return run('write_urdf', lambda: _export(options), 2)


def _export(options: argparse.Namespace) -> None:
    text = urdf_of_file(options.arm, options.settings, options.radius, options.base_frame)
    path: Path | None = options.output
    if path is None:
        print(text, end='')
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding='utf-8')
    except OSError as problem:
        raise ModelError(
            f'file {path}: {problem.strerror}, expected a file that can be written'
        ) from problem


def urdf_of_file(
    arm_file: Path | None = None,
    settings_file: Path | None = None,
    radius: float = 0.015,
    base_frame: str = 'torso',
) -> str:
    """
    Return the URDF of an arm's file, named as there; without files, those of the package.

    Bars that have no radius get the given one [m]. Raise RrthError where a file cannot be read, or
    describes no arm or no settings.
    """
    arm = load_arm(arm_file)
    name = load_yaml(arm_file or resource_path('config/arm.yaml')).get('name', 'arm')
    speeds = load_settings(arm.dof, settings_file).limits.velocity
    return arm_to_urdf(arm, speeds, radius, base_frame, name)


if __name__ == '__main__':
    sys.exit(main())
