# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Motion files: YAML, or CSV with one line per point; both are exact to the bit."""

from collections.abc import Sequence
import csv
import io
from pathlib import Path

import numpy as np
from rrth_planner.io.text_file import to_yaml
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.errors import RecordError
from rrth_planner.model.trajectory import sample, Trajectory

SERIES = ('positions', 'velocities', 'accelerations')
# What a table has of each joint, and its unit by that of the joint.
COLUMNS = (('position', '{}'), ('velocity', '{}/s'), ('acceleration', '{}/s^2'))
SUFFIXES = ('.yaml', '.yml', '.csv')
HEADER = """\
# Points in time; between two of them each joint follows the quintic that fits position, velocity
# and acceleration at both. Times in s; positions in the units given for each joint, velocities in
# these per second, accelerations per second squared.
"""


def sampled(trajectory: Trajectory, period: float) -> Trajectory:
    """Return a trajectory sampled at a period > 0 [s], and at its end."""
    if not 1e-5 <= period < np.inf:
        raise RecordError(f'period: {period}, expected at least 1e-05 [s]')
    end = trajectory.duration
    # No sample that would coincide with the end.
    times = np.arange(0.0, end - 1e-3 * period, period)
    times = np.append(times, end) if end > 0.0 else np.zeros(1)
    return Trajectory(times, *sample(trajectory, times))


def check_suffix(path: Path) -> None:
    """Raise RecordError if the suffix of a file is not supported."""
    if path.suffix.lower() not in SUFFIXES:
        raise RecordError(f'file {path}: expected a name that ends in .yaml or .csv')


def write_motion(
    arm: ArmModel, trajectory: Trajectory, path: Path, comments: Sequence[str] = ()
) -> None:
    """
    Write an arm's motion as .yaml, comments at its head, or as .csv without, by the file's suffix.

    Raise RecordError where it has another one, OSError where it cannot be written.
    """
    check_suffix(path)
    units = arm.units
    if path.suffix.lower() == '.csv':
        text = _to_csv(arm.joint_names, units, trajectory)
    else:
        said = ''.join(f'# {" ".join(line.split())}\n' for line in comments)
        text = f'{said}{HEADER}{_to_yaml(arm.joint_names, units, trajectory)}'
    path.write_text(text, encoding='utf-8', newline='')


def _to_yaml(names: Sequence[str], units: Sequence[str], trajectory: Trajectory) -> str:
    columns = [column.tolist() for column in (trajectory.times, *trajectory.states)]
    points = [
        dict(zip(('time', *SERIES), point, strict=True)) for point in zip(*columns, strict=True)
    ]
    data = {'joint_names': list(names), 'units': list(units), 'points': points}
    return to_yaml(data, width=10**6)


def _to_csv(names: Sequence[str], units: Sequence[str], trajectory: Trajectory) -> str:
    header = ['time [s]'] + [
        f'{name} {column} [{form.format(unit)}]'
        for name, unit in zip(names, units, strict=True)
        for column, form in COLUMNS
    ]
    # A joint's position, velocity and acceleration beside each other.
    values = np.stack(trajectory.states, axis=2)
    rows = np.column_stack([trajectory.times, values.reshape(len(values), -1)])
    text = io.StringIO()
    csv.writer(text, lineterminator='\n').writerows([header, *rows.tolist()])
    return text.getvalue()
