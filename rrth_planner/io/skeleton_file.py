# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How the points of a tracker become boxes, as a YAML file: docs/skeletons.md is its layout."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.io.entries import mapping, number, sequence, text
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml, naming_file
from rrth_planner.model.arrays import Array, float_array, frozen_array
from rrth_planner.model.errors import SceneError, shown
from rrth_planner.wearer.hands import with_hand_size
from rrth_planner.wearer.skeleton import (
    AXES,
    BASE,
    Bone,
    Direction,
    FrameBase,
    Joint,
    JointBase,
    Part,
    REST,
    Skeleton,
    STATURES,
)

# The parts and bones of an adult, which every skeleton begins with.
PARTS_FILE = 'config/human.yaml'
# What an entry `axes` of a skeleton may hold: where an axis of the wearer is in a frame.
LETTERS = {
    f'{sign}{letter}': (1.0 if not sign else -1.0) * np.eye(3)[k]
    for k, letter in enumerate('xyz')
    for sign in ('', '-')
}
# The entries of a limb, and those of a part that a box surrounds: its margins, lower and upper of
# each axis.
LIMB = ('bone', 'radius', 'ends')
SIDES = (('backward', 'forward'), ('right', 'left'), ('down', 'up'))
BLOCK = ('around', *(side for pair in SIDES for side in pair))
# The entries of a bone.
BONE = ('ends', 'share')


def load_skeleton(
    name_or_path: str | Path, stature: Sequence[float] = STATURES, hand_size: float = 0.0
) -> Skeleton:
    """
    Return a skeleton of `config/skeletons` by its name, or of a file whose name ends in `.yaml`.

    Parameters
    ----------
    stature : sequence of 1 or 2 floats
        Of the wearer, or of the smallest and of the largest one [m]; by default of any adult.
    hand_size : float
        Edge of the boxes of hands whose fingers the tracker does not see [m]; 0: as in the file.

    Raises
    ------
    ModelError, SceneError
        There is no such skeleton, the file cannot be read, or it describes none; a stature
        outside 0.5 to 2.8, none or more than two; a hand_size other than 0 or 0.05 to 1, or
        one for hands with fingers.

    """
    is_file = str(name_or_path).endswith('.yaml')
    packaged = f'config/skeletons/{name_or_path}.yaml'
    path = Path(name_or_path) if is_file else resource_path(packaged)
    parts_path = resource_path(PARTS_FILE)
    human = load_yaml(parts_path)
    with naming_file(parts_path, SceneError):
        adult = mapping(human, 'an adult', ('parts', 'bones'), SceneError)
    data = load_yaml(path)
    with naming_file(path, SceneError):
        skeleton = skeleton_from_mapping(data, adult['parts'], adult['bones'])
    given = float_array(stature, (None,), 'stature', 'm', SceneError)
    if len(given) not in (1, 2):
        raise SceneError(f'stature: {len(given)} values, expected one or two [m]')
    return with_hand_size(replace(skeleton, stature=given[[0, -1]]), hand_size)


def skeleton_from_mapping(
    data: Any, parts: Mapping[str, Any], bones: Mapping[str, Any] | None = None
) -> Skeleton:
    """
    Return the skeleton that a mapping describes, laid out as the files in `config/skeletons`.

    Parameters
    ----------
    parts : mapping
        The parts that it begins with, by name, as in `config/human.yaml`.
    bones : mapping, optional
        The bones that it begins with, of which those between its joints count; by default none.

    Raises
    ------
    SceneError
        Something is missing, has another name, or describes no skeleton.

    """
    optional = ('axes', 'parts', 'without', 'names_by_id', 'bones')
    given = mapping(data, 'skeleton', ('base', 'joints'), SceneError, optional)
    joints = _entries(given['joints'], 'joints')
    return Skeleton(
        joints=tuple(_joint(name, entry) for name, entry in joints.items()),
        parts=_parts(given, parts),
        base=_base(given['base']),
        axes=_axes(given.get('axes')),
        names_by_id=_names(given.get('names_by_id', []), 'names_by_id'),
        bones=_bones(given, bones or {}, {BASE, *joints}),
    )


def _joint(name: str, data: Any) -> Joint:
    """Return a joint: the name of a point, names of several, or a frame and an offset."""
    label = f'joint "{name}"'
    if isinstance(data, Mapping):
        given = mapping(data, label, ('frame', 'offset'), SceneError)
        return Joint(name, (text(given['frame'], f'{label}: frame', SceneError),), given['offset'])
    return Joint(name, _names(data if isinstance(data, list) else [data], label))


def _base(data: Any) -> FrameBase | JointBase | None:
    """Return the base: `none`, a frame, or an origin with two axes; and its offset."""
    if data == 'none':
        return None
    if isinstance(data, Mapping) and 'frame' in data:
        given = mapping(data, 'base', ('frame', 'offset'), SceneError)
        return FrameBase(text(given['frame'], 'base: frame', SceneError), given['offset'])
    given = mapping(data, 'base', ('origin', 'offset', 'axes'), SceneError)
    origin = text(given['origin'], 'base: origin', SceneError)
    return JointBase(origin, given['offset'], _directions(given['axes'], 'base'))


def _axes(data: Any) -> Array:
    """Return where forward, left and up are in the frames of a tracker, as columns."""
    if data is None:
        return np.eye(3)
    given = mapping(data, 'axes', AXES, SceneError)
    for axis, letter in given.items():
        if not isinstance(letter, str) or letter not in LETTERS:
            raise SceneError(f'axes: {axis} {shown(letter)}, expected one of {", ".join(LETTERS)}')
    return np.column_stack([LETTERS[given[axis]] for axis in AXES])


def _parts(given: Mapping[str, Any], human: Mapping[str, Any]) -> tuple[Part, ...]:
    """Return the parts of an adult without some of them, changed and added to."""
    changed = _entries(given.get('parts', {}), 'parts')
    without = _names(given.get('without', []), 'without')
    for name in without:
        if name not in human or name in changed:
            raise SceneError(
                f'without: "{name}", expected a part of {PARTS_FILE} that parts does not change'
            )
    merged = {name: entry for name, entry in human.items() if name not in without}
    for name, entry in changed.items():
        label = f'part "{name}"'
        # Not even a part that is new there may have unknown entries.
        entries = mapping(entry, label, (), SceneError, (*LIMB, *BLOCK, 'axes', 'rest'))
        # One that says what it is round is another part by the same name.
        is_new = 'bone' in entries or 'around' in entries
        merged[name] = entries if is_new else {**merged.get(name, {}), **entries}
    return tuple(_part(name, entry) for name, entry in merged.items())


def _part(name: str, data: Any) -> Part:
    """Return a limb, or a part that a box surrounds."""
    label = f'part "{name}"'
    if isinstance(data, Mapping) and 'bone' in data:
        entries = mapping(data, label, LIMB, SceneError, ('rest',))
        start, end = _pair(entries['bone'], f'{label}: bone')
        radius = number(entries['radius'], f'{label}: radius', 'm', SceneError)
        ends = frozen_array(entries['ends'], (2,), f'{label}: ends', 'm', SceneError)
        margins = np.array([[radius, radius], [radius, radius], ends])
        joints: tuple[str, ...] = (start, end)
        axes: tuple[Direction, ...] = (Direction('up', start, end),)
    else:
        entries = mapping(data, label, BLOCK, SceneError, ('axes', 'rest'))
        sides = [
            [number(entries[side], f'{label}: {side}', 'm', SceneError) for side in pair]
            for pair in SIDES
        ]
        joints, margins = _names(entries['around'], f'{label}: around'), np.array(sides)
        axes = _directions(entries['axes'], label) if 'axes' in entries else ()
    return Part(name, joints, margins, axes, entries.get('rest', REST))


def _bones(
    given: Mapping[str, Any], human: Mapping[str, Any], joints: set[str]
) -> tuple[Bone, ...]:
    """Return the bones of an adult between joints of a skeleton, changed and added to."""
    changed = _entries(given.get('bones', {}), 'bones')
    bones = []
    for name in dict.fromkeys([*human, *changed]):
        label = f'bone "{name}"'
        entry = mapping(changed.get(name, {}), label, (), SceneError, (*BONE, 'trunk'))
        entry = mapping({**human.get(name, {}), **entry}, label, BONE, SceneError, ('trunk',))
        start, end = _pair(entry['ends'], f'{label}: ends')
        # An adult has joints that the skeleton lacks.
        if {start, end} <= joints or name in changed:
            bones.append(Bone(name, start, end, entry['share'], entry.get('trunk') is True))
    return tuple(bones)


def _directions(data: Any, label: str) -> tuple[Direction, ...]:
    """Return axes, each with the two joints that it leads from and to, in their order."""
    given = mapping(data, f'{label}: axes', (), SceneError, AXES)
    return tuple(Direction(axis, *_pair(ends, f'{label}: {axis}')) for axis, ends in given.items())


def _pair(data: Any, label: str) -> tuple[str, str]:
    names = _names(data, label)
    if len(names) != 2:
        raise SceneError(f'{label}: {shown(data)}, expected two joints')
    return names[0], names[1]


def _names(data: Any, label: str) -> tuple[str, ...]:
    return tuple(text(name, label, SceneError) for name in sequence(data, label, SceneError))


def _entries(data: Any, label: str) -> dict[str, Any]:
    """Return a mapping with any names."""
    if not isinstance(data, Mapping):
        raise SceneError(f'{label}: {shown(data)}, expected a mapping by names')
    return dict(data)
