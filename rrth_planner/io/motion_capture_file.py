# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded people from motion capture: BVH (joint angles), C3D (points), and tables of ours."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import count
import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
import warnings

import numpy as np
from rrth_planner.io.bvh_text import read_bvh_text
from rrth_planner.io.extras import require
from rrth_planner.io.person_file import read_person
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import naming_file, read_bytes
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RecordError, RrthError
from rrth_planner.wearer.recorded_person import RecordedPerson

PERSON = 'config/people/construction_work.csv'
UNITS = {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3, 'inch': 0.0254, 'foot': 0.3048}
# A BVH says nothing of its unit: one of these is taken where it makes the skeleton as large as an
# adult. Not inches or feet: an upper body in centimetres may be as large as a person in inches.
GUESSED = ('m', 'cm', 'mm')
# What is read, and by which library.
LIBRARIES = {'.bvh': 'pybvh', '.c3d': 'c3d', '.csv': ''}
# The skeleton of an adult, or the span of his arms, measures so much from end to end [m].
SMALLEST, LARGEST = 1.2, 2.3
# A skeleton that is less tall is an upper body, or crouches [m].
TALL = 1.1
# A file may hold so many joints, and so many points in all frames.
MOST_JOINTS, MOST_POINTS = 1000, 1_000_000
# The last frame number that the header of a C3D can say.
FULL = 65535


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
        Of the lengths of the file: m, cm, mm, inch, foot, or a number, how long it is [m]. By
        default what a C3D says; a BVH says nothing, so that m, cm or mm is taken where the
        skeleton is as large as an adult in it. Tables are in metres.
    say : callable, optional
        Called with a sentence that says how large the skeleton of a BVH is, and in which unit.

    Raises
    ------
    RrthError
        The file cannot be read, or is no recording of a person; its library is not installed;
        another unit.

    """
    scale = None if unit is None else _scale_of(unit)
    file = resource_path(PERSON) if path is None else Path(path)
    suffix = file.suffix.lower()
    if suffix not in LIBRARIES:
        raise RecordError(f'file {file}: expected a name that ends in {", ".join(LIBRARIES)}')
    if suffix == '.csv':
        if scale not in (None, 1.0):
            raise RecordError(f'unit: {unit}, expected m for a table')
        return read_person(file)
    require('tools', LIBRARIES[suffix])
    # What cannot be opened, or is too long, is rejected before a library reads it.
    data = read_bytes(file)
    with naming_file(file, RecordError), _rejecting(suffix):
        if suffix == '.bvh':
            return _from_bvh(file, data, unit, say)
        return _from_c3d(file, len(data), unit)


def _scale_of(unit: str) -> float:
    """Return how long a unit is [m]."""
    if unit in UNITS:
        return UNITS[unit]
    with suppress(ValueError):
        if 0.0 < (scale := float(unit)) < math.inf:
            return scale
    raise RecordError(f'unit: {unit}, expected {", ".join(UNITS)} or how long it is [m]')


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

    n_nodes = sum(data.lower().count(word) for word in (b'joint', b'end'))
    if n_nodes > 2 * MOST_JOINTS:
        raise RecordError(f'{n_nodes} joints and ends, expected at most {MOST_JOINTS} joints')
    found = read_bvh_text(data)
    with TemporaryDirectory() as folder:
        copy = Path(folder, 'person.bvh')
        copy.write_text(found.text, encoding='utf-8')
        # Which way is up is not asked, and not guessed.
        motion = pybvh.read_bvh_file(copy, world_up='+y')
    names = found.names
    _check_size(motion.frame_count, len(names))
    root, turns = motion.to_rotmat()
    tree = motion.fk_topology
    # Ends of chains, number -1, have no axes of their own.
    joints = np.flatnonzero(np.asarray(tree.joint_idx) >= 0)
    numbers = {int(node): k for k, node in enumerate(joints)}
    parents = [numbers.get(int(tree.parent_idx[node]), -1) for node in joints]
    offsets = np.asarray(tree.offsets, dtype=np.float64)
    positions, rotations = forward_kinematics(parents, offsets[joints], np.asarray(root), turns)
    if not np.isfinite(positions).all():
        raise RecordError('numbers that are not finite, expected positions and angles')
    rest = np.zeros_like(offsets)
    for node, parent in enumerate(np.asarray(tree.parent_idx)):
        if parent >= 0:
            rest[node] = rest[parent] + offsets[node]
    size = _size_of(rest, positions)
    if unit is None:
        unit = _guessed_unit(size)
    scale = _scale_of(unit)
    named = f'{unit} m' if unit not in UNITS else unit
    say(f'file {file}: lengths taken as {named}: {_measures(rest, scale, scale * size)}')
    return RecordedPerson(
        names=names,
        rate=1.0 / motion.frame_time,
        positions=scale * positions,
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


def _size_of(rest: Array, positions: Array) -> float:
    """
    Return how much a skeleton measures from end to end, in the units of the file.

    rest, (n, 3): where joints and ends are without rotations; positions, (n_frames, n, 3).
    """
    moving = float(np.median(np.ptp(positions, axis=1).max(axis=1)))
    return max(float(np.ptp(rest, axis=0).max()), moving)


def _measures(rest: Array, scale: float, size: float) -> str:
    """Return how large a skeleton is, in words; scale: of its units, size: from end to end [m]."""
    extents = np.ptp(rest, axis=0)
    # Left and right mirror each other; of the other two axes the longer one is up.
    skew = [np.abs(np.sort(rest[:, k]) + np.sort(rest[:, k])[::-1]).max() for k in range(3)]
    lateral = int(np.argmin(np.where(extents > 0.0, skew, np.inf)))
    # A spine alone has no left and right.
    upright = [k for k in range(3) if k != lateral and extents[k] > 0.0] or [lateral]
    height = scale * float(extents[upright].max())
    tall = f'the skeleton is {height:.2f} m tall'
    return tall if height >= TALL else f'{tall}, and {size:.2f} m from end to end'


def _guessed_unit(size: float) -> str:
    """Return the unit in which a skeleton of that size from end to end is that of an adult."""
    for unit in GUESSED:
        if SMALLEST <= UNITS[unit] * size <= LARGEST:
            return unit
    would = ', '.join(f'{UNITS[unit] * size:.3g} m in {unit}' for unit in UNITS)
    raise RecordError(
        f'--unit is needed, {", ".join(UNITS)} or how long it is [m]: the skeleton measures '
        f'{size:.3g} from end to end ({would}), expected {SMALLEST:g} to {LARGEST:g} m '
        f'in {", ".join(GUESSED)}'
    )


def _from_c3d(file: Path, n_bytes: int, unit: str | None) -> RecordedPerson:
    import c3d

    class Frames(c3d.Reader):  # type: ignore[misc]
        """Reads so many frames from the first one on, whatever their numbers are."""

        def __init__(self, handle: Any, n_frames: int) -> None:
            self._n_frames = n_frames
            super().__init__(handle)

        @property
        def first_frame(self) -> int:
            return 0

        @property
        def last_frame(self) -> int:
            return self._n_frames - 1

    with file.open('rb') as handle:
        reader = c3d.Reader(handle)
        labels, n_frames = _labels(reader), _count_frames(reader, n_bytes)
        _check_size(n_frames, int(reader.point_used))
        if len(labels) > reader.point_used:
            raise RecordError(f'{len(labels)} names of {reader.point_used} points')
        frames = [points for _, points, _ in Frames(handle, n_frames).read_frames()]
        given = unit or _text(reader.get('POINT:UNITS')).lower()
        rate = float(reader.point_rate)
    if len(frames) != n_frames:
        raise RecordError(f'{len(frames)} frames, expected {n_frames}: the file is cut off')
    if unit is None and given not in UNITS:
        raise RecordError(f'lengths in "{given}", expected {", ".join(UNITS)}')
    # Columns of a point: its position, the residual, and the cameras; without a name it is noise.
    values = np.array(frames, dtype=np.float64)
    kept = [k for k, label in enumerate(labels) if label]
    positions = _scale_of(given) * values[:, kept, :3]
    # Some writers leave a gap as zeros: no marker is at the origin to the last bit.
    is_lost = (values[:, kept, 3] < 0.0) | ~values[:, kept, :3].any(axis=2)
    positions[is_lost] = np.nan
    names = without_subject([labels[k] for k in kept])
    return RecordedPerson(names=names, rate=rate, positions=positions)


def _labels(reader: Any) -> list[str]:
    """Return the names of all points: a parameter holds 255, the next ones are in LABELS2, ..."""
    labels: list[str] = []
    for number in count(1):
        parameter = reader.get(f'POINT:LABELS{number if number > 1 else ""}')
        if parameter is None:
            return labels[: reader.point_used] if number > 2 else labels
        labels += [str(label).strip() for label in parameter.string_array]
    return labels


def without_subject(labels: Sequence[str]) -> tuple[str, ...]:
    """Return names of points without the subject before a colon, where all have the same."""
    subjects = {label.partition(':')[0] for label in labels if ':' in label}
    if len(subjects) != 1 or not all(':' in label for label in labels):
        return tuple(labels)
    return tuple(label.partition(':')[2].strip() for label in labels)


def _count_frames(reader: Any, n_bytes: int) -> int:
    """
    Return the number of frames of a C3D: as its fields say, where they can, else by its size.

    c3d 0.6.0 counts the second word of a start field by 65535, and the header ends at 65535.
    """
    header = reader.header
    first = _field(reader, 'START', header.first_frame)
    # As the library: what ends before the header says so is not believed.
    last = max(_field(reader, 'END', 0), int(reader.last_frame))
    stated = last - first + 1
    # Data are in blocks of 512 bytes; a number is a float where the scale is negative.
    size = 4 if reader.point_scale < 0.0 else 2
    n_analog = int(reader.analog_used) * int(reader.analog_per_frame)
    one = size * (4 * int(reader.point_used) + n_analog)
    data = n_bytes - 512 * (int(header.data_block) - 1)
    there = data // one if one else 0
    # Without the field of two words nothing says of more frames than the header can.
    is_full = last == FULL and reader.get('TRIAL:ACTUAL_END_FIELD') is None
    if stated < 1 or (is_full and there > stated):
        return int(there)
    return int(stated)


def _field(reader: Any, name: str, default: int) -> int:
    """Return a frame number of two words, the lower one first."""
    parameter = reader.get(f'TRIAL:ACTUAL_{name}_FIELD')
    if parameter is None:
        return int(default)
    words = [int(word) for word in parameter.uint16_array]
    return words[0] + 65536 * (words[1] if len(words) > 1 else 0)


def _text(parameter: Any) -> str:
    return '' if parameter is None else str(parameter.string_value).strip()


def _check_size(n_frames: int, n: int) -> None:
    if n_frames * n > MOST_POINTS:
        raise RecordError(
            f'{n_frames} frames of {n} points, expected at most {MOST_POINTS} in all'
        )
