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
# A motion: points in time, one a line. Between two of them each joint follows the quintic that fits
# position, velocity and acceleration at both. Times in s, units of the joints as given, per second
# for velocities, per second squared for accelerations.
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
    points = [
        {'time': time, **dict(zip(SERIES, values, strict=True))}
        for time, *values in zip(
            trajectory.times.tolist(),
            *(getattr(trajectory, name).tolist() for name in SERIES),
            strict=True,
        )
    ]
    head = {'joint_names': list(motion.joint_names), 'units': list(motion.units)}
    said = ''.join(f'# {" ".join(line.split())}\n' for line in comments)
    text = ''.join(
        yaml.dump(part, Dumper=_Dumper, sort_keys=False, default_flow_style=flow, width=10**6)
        for part, flow in ((head, None),)
    )
    # A point a line, which no style of the library gives for mappings with lists.
    lines = ''.join(
        f'- {yaml.dump(p, Dumper=_Dumper, sort_keys=False, default_flow_style=True, width=10**6)}'
        for p in points
    )
    return f'{said}{HEADER}{text}points:\n{lines}'


def _from_mapping(data: Any) -> JointMotion:
    points = data['points']
    series = {name: [point[name] for point in points] for name in SERIES}
    return JointMotion(
        joint_names=tuple(map(str, data['joint_names'])),
        units=tuple(map(str, data['units'])),
        trajectory=Trajectory(times=[point['time'] for point in points], **series),
    )


def _to_csv(motion: JointMotion) -> str:
    names = zip(motion.joint_names, motion.units, strict=True)
    header = ['time [s]']
    for name, unit in names:
        header += [
            f'{name} {column} [{form.format(unit)}]'
            for column, form in zip(COLUMNS, UNITS, strict=True)
        ]
    trajectory = motion.trajectory
    # A joint's position, velocity and acceleration beside each other.
    values = np.stack([getattr(trajectory, name) for name in SERIES], axis=2)
    rows = np.column_stack([trajectory.times, values.reshape(len(values), -1)])
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(header)
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
    numbers = np.array(rows, dtype=np.float64)
    values = numbers[:, 1:].reshape(len(numbers), len(names), 3)
    return JointMotion(
        joint_names=tuple(names),
        units=tuple(units),
        trajectory=Trajectory(
            times=numbers[:, 0], **{name: values[..., k] for k, name in enumerate(SERIES)}
        ),
    )
