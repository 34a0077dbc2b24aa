# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Motions as files: YAML, or CSV with a line a point; both are read to the bit."""

from collections.abc import Sequence
import csv
from dataclasses import dataclass
import io
from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.arm import ArmModel
from rrth_planner.errors import RecordError, RrthError
from rrth_planner.resources import load_yaml
from rrth_planner.trajectory import sample, Trajectory
import yaml

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
_Dumper = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointMotion:
    """
    A trajectory and whose it is.

    Parameters
    ----------
    joint_names : tuple of str
    units : tuple of str
        rad or m, of each joint.
    trajectory : Trajectory

    Raises
    ------
    RecordError
        Another number of names or units than of joints, or a unit that is neither.

    """

    joint_names: tuple[str, ...]
    units: tuple[str, ...]
    trajectory: Trajectory

    def __post_init__(self) -> None:
        """Validate."""
        dof = self.trajectory.positions.shape[1]
        if not len(self.joint_names) == len(set(self.joint_names)) == len(self.units) == dof:
            raise RecordError(
                f'joints: {list(self.joint_names)} in {list(self.units)}, expected {dof} '
                'different names and as many units'
            )
        if not set(self.units) <= {'rad', 'm'}:
            raise RecordError(f'units: {list(self.units)}, expected rad or m for each joint')


def motion_of(arm: ArmModel, trajectory: Trajectory) -> JointMotion:
    """Return the motion that an arm makes of a trajectory."""
    units = tuple('m' if slides else 'rad' for slides in arm.is_prismatic)
    return JointMotion(joint_names=arm.joint_names, units=units, trajectory=trajectory)


def sampled(motion: JointMotion, period: float) -> JointMotion:
    """Return a motion with a point every so often, > 0 [s], and one at the end."""
    if not 1e-5 <= period < np.inf:
        raise RecordError(f'period: {period}, expected at least 1e-05 [s]')
    end = motion.trajectory.duration
    # No point so near to the end that the two would be one.
    times = np.arange(0.0, end - 1e-3 * period, period)
    times = np.append(times, end) if end > 0.0 else np.zeros(1)
    positions, velocities, accelerations = sample(motion.trajectory, times)
    return JointMotion(
        joint_names=motion.joint_names,
        units=motion.units,
        trajectory=Trajectory(
            times=times, positions=positions, velocities=velocities, accelerations=accelerations
        ),
    )


def check_suffix(path: Path) -> None:
    """Raise RecordError if the name of a file does not say how to write it."""
    if path.suffix.lower() not in SUFFIXES:
        raise RecordError(f'file {path}: expected a name that ends in .yaml or .csv')


def write_motion(motion: JointMotion, path: Path, comments: Sequence[str] = ()) -> None:
    """
    Write a motion as its name ends, .yaml or .csv.

    Comments stand at the head of a YAML file; a CSV file, which has none, goes without.

    Raises
    ------
    RecordError
        Another ending.
    OSError
        The file cannot be written.

    """
    check_suffix(path)
    is_table = path.suffix.lower() == '.csv'
    text = _to_csv(motion) if is_table else _to_yaml(motion, comments)
    path.write_text(text, encoding='utf-8', newline='')


def read_motion(path: str | Path) -> JointMotion:
    """
    Return the motion of a file that `write_motion` wrote.

    Raises
    ------
    RrthError
        The file cannot be read, or holds no motion.

    """
    file = Path(path)
    check_suffix(file)
    try:
        is_table = file.suffix.lower() == '.csv'
        return _from_csv(file) if is_table else _from_mapping(load_yaml(file))
    except (OSError, UnicodeDecodeError, csv.Error) as problem:
        raise RecordError(f'file {file}: {problem}; expected a readable file') from problem
    except RrthError as problem:
        if str(file) in str(problem):
            raise
        raise RecordError(f'file {file}: {problem}') from problem
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as problem:
        said = ' '.join(str(problem).split())
        raise RecordError(f'file {file}: {said}; expected a motion as `plan` writes it') from None


def _to_yaml(motion: JointMotion, comments: Sequence[str]) -> str:
    trajectory = motion.trajectory
    columns = [getattr(trajectory, name).tolist() for name in ('times', *SERIES)]
    data = {
        'joint_names': list(motion.joint_names),
        'units': list(motion.units),
        'points': [
            dict(zip(('time', *SERIES), point, strict=True))
            for point in zip(*columns, strict=True)
        ],
    }
    said = ''.join(f'# {" ".join(line.split())}\n' for line in comments)
    text = yaml.dump(data, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=10**6)
    return f'{said}{HEADER}{text}'


def _from_mapping(data: Any) -> JointMotion:
    points = data['points']
    positions, velocities, accelerations = (
        np.array([point[name] for point in points], dtype=np.float64) for name in SERIES
    )
    return JointMotion(
        joint_names=tuple(map(str, data['joint_names'])),
        units=tuple(map(str, data['units'])),
        trajectory=Trajectory(
            times=np.array([point['time'] for point in points], dtype=np.float64),
            positions=positions,
            velocities=velocities,
            accelerations=accelerations,
        ),
    )


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
    values = np.stack([getattr(trajectory, name) for name in SERIES], axis=2)
    rows = np.column_stack([trajectory.times, values.reshape(len(values), -1)])
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(_header(motion.joint_names, motion.units))
    writer.writerows(rows.tolist())
    return text.getvalue()


def _from_csv(file: Path) -> JointMotion:
    with file.open(encoding='utf-8', newline='') as stream:
        header, *rows = [row for row in csv.reader(stream, strict=True) if row]
    names, units = [], []
    for column in header[1::3]:
        name, unit = column.rsplit(' position [', 1)
        names.append(name)
        units.append(unit.removesuffix(']'))
    if header != _header(names, units):
        raise RecordError(f'columns {header}, expected {_header(names, units)}')
    numbers = np.array(rows, dtype=np.float64)
    values = numbers[:, 1:].reshape(len(numbers), len(names), 3)
    return JointMotion(
        joint_names=tuple(names),
        units=tuple(units),
        trajectory=Trajectory(
            times=numbers[:, 0], **{name: values[..., k] for k, name in enumerate(SERIES)}
        ),
    )
