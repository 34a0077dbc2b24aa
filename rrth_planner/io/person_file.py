# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded people as tables: CSV with a line a frame, read without any further library."""

from collections.abc import Sequence
import csv
import io
from pathlib import Path

import numpy as np
from rrth_planner.io.text_file import MOST_VALUES, naming_file, read_text
from rrth_planner.model.arrays import Array, FARTHEST
from rrth_planner.model.errors import RecordError, shown
from rrth_planner.model.rotation import quaternion_xyzw, rotation_matrix
from rrth_planner.wearer.recorded_person import RecordedPerson

TIME = 'time [s]'
POSITION = ('x [m]', 'y [m]', 'z [m]')
ROTATION = ('qx', 'qy', 'qz', 'qw')
# Steps of time differ by no more than this part of one, the shortest of which is [s].
EVEN, SHORTEST = 1e-3, 1e-5


def write_person(person: RecordedPerson, path: Path, comments: Sequence[str] = ()) -> None:
    """
    Write a recording to 0.1 mm, with comments at the head; what was lost is left empty.

    The quaternion of a point (x, y, z, w) has columns where it is known in any frame. Raise
    OSError where the file cannot be written.
    """
    names, columns = [TIME], [np.arange(len(person.positions)) / person.rate]
    formats = ['%r']
    for k, name in enumerate(person.names):
        names += [f'{name} {axis}' for axis in POSITION]
        columns += list(person.positions[:, k].T)
        formats += ['%.4f'] * len(POSITION)
    for k, name in enumerate(person.names):
        rotations = None if person.rotations is None else person.rotations[:, k]
        if rotations is not None and not np.isnan(rotations).all():
            names += [f'{name} {part}' for part in ROTATION]
            columns += list(np.array([_quaternion(r) for r in rotations]).T)
            formats += ['%.4f'] * len(ROTATION)
    text = io.StringIO()
    text.writelines(f'# {" ".join(line.split())}\n' for line in comments)
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(names)
    for row in np.column_stack(columns).tolist():
        fields = zip(formats, row, strict=True)
        writer.writerow('' if np.isnan(value) else form % value for form, value in fields)
    path.write_text(text.getvalue(), encoding='utf-8', newline='')


def read_person(path: str | Path) -> RecordedPerson:
    """
    Return the recording of a table by `write_person`.

    Raise RecordError where it is none, ModelError where it cannot be read.
    """
    text = read_text(path)
    with naming_file(path, RecordError):
        return _from_csv(text)


def _quaternion(rotation: Array) -> Array:
    return np.full(4, np.nan) if np.isnan(rotation).any() else quaternion_xyzw(rotation)


def _from_csv(text: str) -> RecordedPerson:
    if text.count(',') > MOST_VALUES:
        raise RecordError(f'{text.count(",")} commas, expected at most {MOST_VALUES} values')
    lines = [line for line in text.splitlines() if not line.startswith('#')]
    try:
        header, *rows = [row for row in csv.reader(lines, strict=True) if row] or [[]]
    except csv.Error as problem:
        raise RecordError(f'{problem}; expected a readable file') from problem
    names, turned = _points_of(header)
    if any(len(row) != len(header) for row in rows):
        raise RecordError(f'lines of other lengths, expected {len(header)} fields in each')
    try:
        values = np.array([[float(field or 'nan') for field in row] for row in rows])
    except ValueError as problem:
        raise RecordError(f'{problem}, expected numbers, or nothing where one is lost') from None
    if len(values) < 2:
        raise RecordError(f'{len(values)} frames, expected at least 2')
    if (np.abs(values) > FARTHEST).any():
        raise RecordError(f'numbers beyond {FARTHEST:g}, expected smaller ones')
    rate = _rate_of(values[:, 0])
    n_frames, n = len(values), len(names)
    end = 1 + 3 * n
    rotations = np.full((n_frames, n, 3, 3), np.nan)
    for column, name in enumerate(turned):
        begin = end + 4 * column
        quaternions = values[:, begin : begin + 4]
        # One of no length is that of a point that its tracker had lost.
        is_lost = (quaternions == 0.0).all(axis=1)
        quaternions = np.where(is_lost[:, None], np.nan, quaternions)
        values[is_lost, 1 + 3 * names.index(name) : 4 + 3 * names.index(name)] = np.nan
        lengths = np.linalg.norm(quaternions, axis=1)
        # A quaternion in part is none, and none is lost.
        is_known = np.isfinite(lengths) & (np.abs(lengths - 1.0) < 0.01)
        if not (is_known | np.isnan(quaternions).all(axis=1)).all():
            raise RecordError(f'{name}: a quaternion of another length, expected 1 [-]')
        for frame in np.flatnonzero(is_known):
            rotations[frame, names.index(name)] = rotation_matrix(quaternions[frame])
    return RecordedPerson(
        names=names,
        rate=rate,
        positions=values[:, 1:end].reshape(n_frames, n, 3),
        rotations=rotations if turned else None,
    )


def _points_of(header: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the points of a table, and of those with a quaternion."""
    n = sum(column.endswith(f' {POSITION[0]}') for column in header)
    names, turned = (
        tuple(column.rpartition(f' {end}')[0] for column in columns)
        for columns, end in (
            (header[1 : 1 + 3 * n : 3], POSITION[0]),
            (header[1 + 3 * n :: 4], ROTATION[0]),
        )
    )
    wanted = [TIME]
    wanted += [f'{name} {axis}' for name in names for axis in POSITION]
    wanted += [f'{name} {part}' for name in turned for part in ROTATION]
    if list(header) != wanted or not n or not set(turned) <= set(names):
        raise RecordError(
            f'columns {shown(list(header))}, expected {TIME}, x, y and z [m] of each point, and '
            'then qx, qy, qz and qw of those that are turned'
        )
    return names, turned


def _rate_of(times: Array) -> float:
    """Return the rate of evenly spaced times [1/s], or raise RecordError."""
    steps = np.diff(times)
    period = (times[-1] - times[0]) / len(steps)
    if not period >= SHORTEST or not np.abs(steps - period).max() <= EVEN * period:
        raise RecordError(
            'times in uneven steps, expected the same step everywhere, at least 1e-05 [s]'
        )
    rate = 1.0 / period
    # What was written as k / rate comes back as that rate.
    return float(round(rate)) if abs(rate - round(rate)) < 1e-9 * rate else float(rate)
