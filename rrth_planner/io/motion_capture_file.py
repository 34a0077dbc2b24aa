# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded people from motion capture: BVH (joint angles), C3D (points), and tables of ours."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
import warnings

import numpy as np
from rrth_planner.io.extras import require
from rrth_planner.io.person_file import read_person
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import naming_file, read_bytes
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RecordError, RrthError
from rrth_planner.wearer.recorded_person import RecordedPerson

PERSON = 'config/people/construction_work.csv'
UNITS = {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3}
# What is read, and by which library.
LIBRARIES = {'.bvh': 'pybvh', '.c3d': 'c3d', '.csv': ''}
# Of one person, or of his upper body alone: the longest side of a box round him [m]. So far apart
# that no skeleton may be of two units.
SMALLEST, LARGEST = 0.4, 3.0
# A file may hold so many joints, and so many points in all frames.
MOST_JOINTS, MOST_POINTS = 1000, 1_000_000


def load_person(
    path: str | Path | None = None,
    *,
    unit: str | None = None,
    say: Callable[[str], None] = lambda sentence: None,
) -> RecordedPerson:
    """
    Return the person of a .bvh, .c3d or .csv file; by default of one that comes along.

    Parameters
    ----------
    path : str or Path, optional
        By default `config/people/construction_work.csv`, a person at work.
    unit : str, optional
        Of the lengths of the file: m, cm or mm. By default what a C3D says; a BVH says nothing,
        so that it is guessed from the size of the skeleton. Tables are in metres.
    say : callable, optional
        Called with a sentence where the unit was guessed.

    Raises
    ------
    RrthError
        The file cannot be read, or is no recording of a person; its library is not installed;
        another unit.

    """
    if unit not in (None, *UNITS):
        raise RecordError(f'unit: {unit}, expected {", ".join(UNITS)}')
    file = resource_path(PERSON) if path is None else Path(path)
    suffix = file.suffix.lower()
    if suffix not in LIBRARIES:
        raise RecordError(f'file {file}: expected a name that ends in {", ".join(LIBRARIES)}')
    if suffix == '.csv':
        if unit not in (None, 'm'):
            raise RecordError(f'unit: {unit}, expected m for a table')
        return read_person(file)
    require('tools', LIBRARIES[suffix])
    # What cannot be opened, or is too long, is rejected before a library reads it.
    data = read_bytes(file)
    with naming_file(file, RecordError), _rejecting(suffix):
        if suffix == '.bvh':
            return _from_bvh(file, data, unit, say)
        return _from_c3d(file, unit)


@contextmanager
def _rejecting(suffix: str) -> Iterator[None]:
    """Raise RecordError whatever a library raises; its warnings are not shown."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            yield
    except RrthError:
        raise
    except Exception as problem:
        # The file may hold anything. What follows a semicolon is advice to programmers.
        reason = str(problem).partition(';')[0] or type(problem).__name__
        raise RecordError(f'{reason}; expected a readable {suffix} file') from problem


def _from_bvh(
    file: Path, data: bytes, unit: str | None, say: Callable[[str], None]
) -> RecordedPerson:
    # Imported here: `require` has checked that it is installed.
    import pybvh

    n_nodes = data.count(b'JOINT') + data.count(b'End')
    if n_nodes > 2 * MOST_JOINTS:
        raise RecordError(f'{n_nodes} joints and ends, expected at most {MOST_JOINTS} joints')
    # Which way is up is not asked, and not guessed.
    motion = pybvh.read_bvh_file(file, world_up='+y')
    names = tuple(motion.joint_names)
    _check_size(motion.frame_count, len(names))
    root, turns = motion.to_rotmat()
    tree = motion.fk_topology
    # Ends of chains, number -1, have no axes of their own.
    joints = np.flatnonzero(np.asarray(tree.joint_idx) >= 0)
    numbers = {int(node): k for k, node in enumerate(joints)}
    parents = [numbers.get(int(tree.parent_idx[node]), -1) for node in joints]
    offsets = np.asarray(tree.offsets, dtype=np.float64)[joints]
    positions, rotations = forward_kinematics(parents, offsets, np.asarray(root), turns)
    if not np.isfinite(positions).all():
        raise RecordError('numbers that are not finite, expected positions and angles')
    if unit is None:
        unit = _guessed_unit(positions)
        say(f'file {file}: lengths taken as {unit} by the size of the skeleton')
    return RecordedPerson(
        names=names,
        rate=1.0 / motion.frame_time,
        positions=UNITS[unit] * positions,
        rotations=rotations,
    )


def forward_kinematics(
    parents: list[int], offsets: Array, root: Array, turns: Array
) -> tuple[Array, Array]:
    """
    Return where the joints of a tree are, and how they are turned, in all frames at once.

    Parameters
    ----------
    parents : list of int, length n
        The joint before each, with a lower number; -1 for the first one.
    offsets : ndarray, shape (n, 3)
        From the joint before, in its axes.
    root : ndarray, shape (n_frames, 3)
        Position of the first joint.
    turns : ndarray, shape (n_frames, n, 3, 3)
        Rotation of each joint in the axes of the one before.

    Returns
    -------
    positions, rotations : ndarray, shapes (n_frames, n, 3) and (n_frames, n, 3, 3)
        In the units of the offsets, and in the frame of the root's position.

    """
    rotations = np.array(turns, dtype=np.float64)
    positions = np.empty((*rotations.shape[:2], 3))
    for k, parent in enumerate(parents):
        if parent < 0:
            positions[:, k] = root
            continue
        positions[:, k] = positions[:, parent] + rotations[:, parent] @ offsets[k]
        rotations[:, k] = rotations[:, parent] @ rotations[:, k]
    return positions, rotations


def _guessed_unit(positions: Array) -> str:
    """Return the unit in which a skeleton, (n_frames, n, 3), is as large as a person."""
    size = float(np.median(np.ptp(positions, axis=1).max(axis=1)))
    for unit, scale in UNITS.items():
        if SMALLEST <= scale * size <= LARGEST:
            return unit
    raise RecordError(
        f'the skeleton measures {size:.3g} from end to end, expected the size of a person in m, '
        'cm or mm, or a unit'
    )


def _from_c3d(file: Path, unit: str | None) -> RecordedPerson:
    import c3d

    with file.open('rb') as handle:
        reader = c3d.Reader(handle)
        labels = [str(label).strip() for label in reader.point_labels]
        n_frames = reader.last_frame - reader.first_frame + 1
        _check_size(n_frames, reader.point_used)
        if len(labels) > reader.point_used:
            raise RecordError(f'{len(labels)} names of {reader.point_used} points')
        frames = [points for _, points, _ in reader.read_frames()]
        given = unit or _text(reader.get('POINT:UNITS')).lower()
        rate = float(reader.point_rate)
    if len(frames) != n_frames:
        raise RecordError(f'{len(frames)} frames, expected {n_frames}: the file is cut off')
    if given not in UNITS:
        raise RecordError(f'lengths in "{given}", expected {", ".join(UNITS)}')
    # Columns of a point: its position, the residual, and the cameras; without a name it is noise.
    values = np.array(frames, dtype=np.float64)
    kept = [k for k, label in enumerate(labels) if label]
    positions = UNITS[given] * values[:, kept, :3]
    positions[values[:, kept, 3] < 0.0] = np.nan
    return RecordedPerson(names=tuple(labels[k] for k in kept), rate=rate, positions=positions)


def _text(parameter: Any) -> str:
    return '' if parameter is None else str(parameter.string_value).strip()


def _check_size(n_frames: int, n: int) -> None:
    if n_frames * n > MOST_POINTS:
        raise RecordError(
            f'{n_frames} frames of {n} points, expected at most {MOST_POINTS} in all'
        )
