# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Motion files: YAML, or CSV with one line per point; both are exact to the bit."""

from collections.abc import Sequence
import csv
from dataclasses import dataclass, replace
import io
from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.io.entries import mapping, sequence
from rrth_planner.io.text_file import MOST_VALUES, naming_file, parse_yaml, read_text, to_yaml
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import printable, RecordError, shown
from rrth_planner.model.trajectory import sample, Trajectory

SERIES = ('positions', 'velocities', 'accelerations')
# Units of these, by that of the joint.
UNITS = ('{}', '{}/s', '{}/s^2')
COLUMNS = ('position', 'velocity', 'acceleration')
SUFFIXES = ('.yaml', '.yml', '.csv')
HEADER = """\
# Points in time; between two of them each joint follows the quintic that fits position, velocity
# and acceleration at both. Times in s; positions in the units given for each joint, velocities in
# these per second, accelerations per second squared.
"""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointMotion:
    """
    A trajectory with the names and units, rad or m, of its joints.

    Raises
    ------
    RecordError
        Numbers of names, units and joints that differ, a name that is not printable, or another
        unit.

    """

    joint_names: tuple[str, ...]
    units: tuple[str, ...]
    trajectory: Trajectory

    def __post_init__(self) -> None:
        """Validate."""
        dof = self.trajectory.positions.shape[1]
        for i, name in enumerate(self.joint_names):
            printable(name, f'joint_names[{i}]', RecordError)
        if not len(self.joint_names) == len(set(self.joint_names)) == len(self.units) == dof:
            raise RecordError(
                f'joints: {list(self.joint_names)} in {list(self.units)}, expected {dof} '
                'different names and as many units'
            )
        if not all(unit in ('rad', 'm') for unit in self.units):
            raise RecordError(f'units: {list(self.units)}, expected rad or m for each joint')


def motion_of(arm: ArmModel, trajectory: Trajectory) -> JointMotion:
    """Return the motion of an arm along a trajectory."""
    units = tuple('m' if slides else 'rad' for slides in arm.is_prismatic)
    return JointMotion(joint_names=arm.joint_names, units=units, trajectory=trajectory)


def sampled(motion: JointMotion, period: float) -> JointMotion:
    """Return a motion sampled at a period > 0 [s], and at its end."""
    if not 1e-5 <= period < np.inf:
        raise RecordError(f'period: {period}, expected at least 1e-05 [s]')
    end = motion.trajectory.duration
    # No sample that would coincide with the end.
    times = np.arange(0.0, end - 1e-3 * period, period)
    times = np.append(times, end) if end > 0.0 else np.zeros(1)
    return replace(motion, trajectory=Trajectory(times, *sample(motion.trajectory, times)))


def check_suffix(path: Path) -> None:
    """Raise RecordError if the suffix of a file is not supported."""
    if path.suffix.lower() not in SUFFIXES:
        raise RecordError(f'file {path}: expected a name that ends in .yaml or .csv')


def write_motion(motion: JointMotion, path: Path, comments: Sequence[str] = ()) -> None:
    """
    Write a motion as .yaml, comments at its head, or as .csv without, by the suffix of the file.

    Raise RecordError where it has another one, OSError where it cannot be written.
    """
    check_suffix(path)
    is_table = path.suffix.lower() == '.csv'
    text = _to_csv(motion) if is_table else _to_yaml(motion, comments)
    path.write_text(text, encoding='utf-8', newline='')


def read_motion(path: str | Path) -> JointMotion:
    """Return the motion of a file by `write_motion`; raise RrthError where it holds none."""
    file = Path(path)
    check_suffix(file)
    text = read_text(file)
    is_table = file.suffix.lower() == '.csv'
    data = None if is_table else parse_yaml(text, f'file {file}')
    with naming_file(file, RecordError):
        return _from_csv(text) if is_table else _from_mapping(data)


def _to_yaml(motion: JointMotion, comments: Sequence[str]) -> str:
    trajectory = motion.trajectory
    columns = [column.tolist() for column in (trajectory.times, *trajectory.states)]
    data = {
        'joint_names': list(motion.joint_names),
        'units': list(motion.units),
        'points': [
            dict(zip(('time', *SERIES), point, strict=True))
            for point in zip(*columns, strict=True)
        ],
    }
    said = ''.join(f'# {" ".join(line.split())}\n' for line in comments)
    return f'{said}{HEADER}{to_yaml(data, width=10**6)}'


def _from_mapping(data: Any) -> JointMotion:
    given = mapping(data, 'motion', ('joint_names', 'units', 'points'), RecordError)
    points = [
        mapping(point, f'points[{i}]', ('time', *SERIES), RecordError)
        for i, point in enumerate(sequence(given['points'], 'points', RecordError))
    ]
    return JointMotion(
        joint_names=tuple(sequence(given['joint_names'], 'joint_names', RecordError)),
        units=tuple(sequence(given['units'], 'units', RecordError)),
        trajectory=Trajectory(
            _column(points, 'time', (None,)),
            *(_column(points, name, (None, None)) for name in SERIES),
        ),
    )


def _column(points: list[dict[str, Any]], name: str, shape: tuple[None, ...]) -> Array:
    unit = 's' if name == 'time' else 'units of the joints'
    return frozen_array([point[name] for point in points], shape, name, unit, RecordError)


def _header(names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Return the names of a table's columns."""
    return ['time [s]'] + [
        f'{name} {column} [{form.format(unit)}]'
        for name, unit in zip(names, units, strict=True)
        for column, form in zip(COLUMNS, UNITS, strict=True)
    ]


def _to_csv(motion: JointMotion) -> str:
    trajectory = motion.trajectory
    # A joint's position, velocity and acceleration beside each other.
    values = np.stack(trajectory.states, axis=2)
    rows = np.column_stack([trajectory.times, values.reshape(len(values), -1)])
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(_header(motion.joint_names, motion.units))
    writer.writerows(rows.tolist())
    return text.getvalue()


def _from_csv(text: str) -> JointMotion:
    if text.count(',') > MOST_VALUES:
        raise RecordError(f'{text.count(",")} commas, expected at most {MOST_VALUES} values')
    try:
        rows = [row for row in csv.reader(io.StringIO(text, newline=''), strict=True) if row]
    except csv.Error as problem:
        raise RecordError(f'{problem}; expected a readable file') from problem
    header = rows[0] if rows else []
    columns = [column.rpartition(' position [') for column in header[1::3]]
    names, units = [name for name, _, _ in columns], [unit[:-1] for _, _, unit in columns]
    if not header or header != _header(names, units):
        raise RecordError(f'columns {shown(header)}, expected {shown(_header(names, units))}')
    if any(len(row) != len(header) for row in rows):
        raise RecordError(f'lines of other lengths, expected {len(header)} numbers in each')
    try:
        numbers = np.array(rows[1:], dtype=np.float64).reshape(-1, len(header))
    except ValueError as problem:
        raise RecordError(f'{problem}, expected numbers') from problem
    values = numbers[:, 1:].reshape(len(numbers), len(names), 3)
    return JointMotion(
        joint_names=tuple(names),
        units=tuple(units),
        trajectory=Trajectory(numbers[:, 0], *np.moveaxis(values, 2, 0)),
    )
