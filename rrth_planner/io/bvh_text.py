# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""BVH files as their writers spell them, put into the spelling that the reader library takes."""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
import re

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import one_line, RecordError

# Position channels of a joint are those of its offset where they differ by no more, in the units
# of the file: writers round to a few digits.
SAME_OFFSET = 1e-3
AXES = 'XYZ'
_TOKENS = re.compile(r'[{}]|[^{}]+')


@dataclass(frozen=True, slots=True, eq=False)
class BvhText:
    """
    A BVH file that pybvh 0.9 reads.

    Parameters
    ----------
    text : str
        With names of its own, and with six channels of the root and three of each other joint.
    names : tuple of str
        Of the joints, as they are in the file, in its order.

    """

    text: str
    names: tuple[str, ...]


@dataclass(slots=True, eq=False)
class _Node:
    """A joint, or the end of a chain, while it is read."""

    kind: str
    name: str
    line: int
    offset: list[float] = field(default_factory=list)
    channels: list[str] | None = None
    children: 'list[_Node]' = field(default_factory=list)


def read_bvh_text(data: bytes) -> BvhText:
    """
    Return a BVH file in one spelling: keywords, names and channels as the library has them.

    Names may have blanks. Joints may have positions, where these are their offsets, and fewer
    than three rotations.

    Raises
    ------
    RecordError
        What is wrong, and in which line.

    """
    lines = [
        (number, part.strip())
        for number, line in enumerate(data.decode('utf-8-sig', 'replace').splitlines(), 1)
        for part in _TOKENS.findall(line)
        if part.strip()
    ]
    words = [(number, part, part.split()[0].upper().rstrip(':')) for number, part in lines]
    motion = next((k for k, (_, _, word) in enumerate(words) if word == 'MOTION'), len(words))
    nodes = _read_hierarchy(words[:motion])
    if motion == len(words):
        raise RecordError('no MOTION after the hierarchy, expected one: the file is cut off')
    joints = [node for node in nodes if node.kind != 'END']
    columns = [len(joint.channels or ()) for joint in joints]
    n_frames, period, values = _read_motion(lines[motion + 1 :], sum(columns))
    blocks = np.split(values, np.cumsum(columns)[:-1], axis=1)
    blocks = [_canonical(*pair) for pair in zip(joints, blocks, strict=True)]
    written: list[str] = ['HIERARCHY']
    _write(nodes[0], written, {id(joint): k for k, joint in enumerate(joints)})
    written += ['MOTION', f'Frames: {n_frames}', f'Frame Time: {period!r}']
    rows = np.concatenate(blocks, axis=1)
    written += [' '.join(map(repr, row)) for row in rows.tolist()]
    names = tuple(joint.name for joint in joints)
    return BvhText('\n'.join(written) + '\n', names)


def _read_hierarchy(words: Sequence[tuple[int, str, str]]) -> list[_Node]:
    """Return the nodes of a hierarchy, depth first."""
    nodes: list[_Node] = []
    opened: list[_Node] = []
    waiting: _Node | None = None
    for number, part, word in words:
        rest = part.split(maxsplit=1)[1:]
        if word in ('ROOT', 'JOINT', 'END', 'ENDSITE'):
            kind = 'END' if word == 'ENDSITE' else word
            if waiting is not None:
                raise RecordError(f'line {number}: {_quoted(part)}, expected "{{" first')
            if (kind == 'ROOT') != (not nodes) or (kind != 'ROOT' and not opened):
                raise RecordError(
                    f'line {number}: {_quoted(part)}, expected one ROOT and all else in it'
                )
            if kind != 'END' and not rest:
                raise RecordError(f'line {number}: {_quoted(part)}, expected a name')
            waiting = _Node(kind, '' if kind == 'END' else rest[0].strip(), number)
            if opened:
                opened[-1].children.append(waiting)
            nodes.append(waiting)
        elif word == '{':
            if waiting is None:
                raise RecordError(f'line {number}: "{{" without a joint before it')
            opened.append(waiting)
            waiting = None
        elif word == '}':
            if not opened:
                raise RecordError(f'line {number}: "}}" without a "{{" before it')
            _check(opened.pop())
        elif word == 'OFFSET' and opened:
            offset = [_number(text, number) for text in part.split()[1:]]
            if len(offset) != 3:
                raise RecordError(f'line {number}: {_quoted(part)}, expected three numbers')
            opened[-1].offset = offset
        elif word == 'CHANNELS' and opened:
            opened[-1].channels = _channels(part, number)
        elif word != 'HIERARCHY':
            raise RecordError(
                f'line {number}: {_quoted(part)}, expected ROOT, JOINT, End Site, OFFSET, '
                'CHANNELS, a brace or MOTION'
            )
    if not nodes:
        raise RecordError('no ROOT, expected a hierarchy')
    if opened or waiting is not None:
        node = opened[-1] if opened else nodes[-1]
        raise RecordError(
            f'line {node.line}: {node.kind} {_quoted(node.name)} is not closed by a "}}": the '
            'hierarchy is cut off'
        )
    return nodes


def _check(node: _Node) -> None:
    if len(node.offset) != 3:
        what = 'an End Site' if node.kind == 'END' else f'{node.kind} {_quoted(node.name)}'
        raise RecordError(f'line {node.line}: {what} without OFFSET, expected one')


def _channels(part: str, number: int) -> list[str]:
    """Return the channels of a joint: P or R, and the axis."""
    given = part.split()[1:]
    found = []
    for text in given[1:]:
        kind = text[1:].lower()
        if text[:1].upper() not in AXES or kind not in ('position', 'rotation'):
            raise RecordError(
                f'line {number}: channel {_quoted(text)}, expected Xposition to Zrotation'
            )
        found.append(kind[0].upper() + text[0].upper())
    if not given or given[0] != str(len(found)) or len(set(found)) != len(found):
        raise RecordError(
            f'line {number}: {_quoted(part)}, expected the number of channels, and each once'
        )
    return found


def _read_motion(lines: Sequence[tuple[int, str]], n_columns: int) -> tuple[int, float, Array]:
    """Return the number of frames, their period [s] and the values, (n_frames, n_columns)."""
    n_frames, period, begin = None, None, 0
    for k, (number, part) in enumerate(lines):
        name, colon, text = (piece.strip() for piece in part.partition(':'))
        if not colon:
            break
        begin = k + 1
        if name.lower() == 'frames':
            n_frames = _number(text, number)
        elif ' '.join(name.lower().split()) == 'frame time':
            period = _number(text, number)
        else:
            raise RecordError(
                f'line {number}: {_quoted(part)}, expected "Frames:" and "Frame Time:"'
            )
    if n_frames is None or n_frames < 1 or n_frames != int(n_frames):
        raise RecordError(f'Frames: {_given(n_frames)}, expected a number of frames')
    if period is None or not 0.0 < period < math.inf:
        raise RecordError(f'Frame Time: {_given(period)}, expected a time > 0 [s]')
    try:
        values = np.array(' '.join(part for _, part in lines[begin:]).split(), dtype=np.float64)
    except ValueError:
        bad = ((n, text) for n, part in lines[begin:] for text in part.split())
        for number, text in bad:
            _number(text, number)
        raise
    n, rest = divmod(len(values), n_columns)
    if rest or n != int(n_frames):
        raise RecordError(
            f'{len(values)} values for {int(n_frames)} frames of {n_columns} channels, expected '
            f'{int(n_frames) * n_columns}'
        )
    return n, period, values.reshape(n, n_columns)


def _canonical(joint: _Node, values: Array) -> Array:
    """Return the columns of a joint as they are written: Z, X and Y where it has no order."""
    channels = joint.channels or []
    turns = [k for k, channel in enumerate(channels) if channel[0] == 'R']
    places = {channel[1]: k for k, channel in enumerate(channels) if channel[0] == 'P'}
    still = np.zeros(len(values))
    columns = [values[:, k] for k in turns]
    # What does not turn about an axis may turn about it last, by nothing.
    columns += [still] * (3 - len(turns))
    joint.channels = [channels[k] for k in turns]
    joint.channels += [f'R{axis}' for axis in 'ZXY' if f'R{axis}' not in joint.channels]
    offset = dict(zip(AXES, joint.offset, strict=True))
    if joint.kind == 'ROOT':
        columns[:0] = [
            values[:, places[axis]] if axis in places else still + offset[axis] for axis in AXES
        ]
        return np.stack(columns, axis=1)
    for axis, k in places.items():
        away = float(np.abs(values[:, k] - offset[axis]).max())
        if not away <= SAME_OFFSET:
            raise RecordError(
                f'JOINT {_quoted(joint.name)}: its {axis}position differs from its OFFSET by up '
                f'to {away:g}, expected bones of fixed length: export the file without positions '
                'of joints'
            )
    return np.stack(columns, axis=1)


def _write(node: _Node, written: list[str], numbers: dict[int, int]) -> None:
    """Append the lines of a node and of those in it."""
    # Not by recursion: a file may nest more joints than the interpreter does calls.
    left: list[_Node | None] = [node]
    while left:
        item = left.pop()
        if item is None:
            written.append('}')
            continue
        name = 'End Site' if item.kind == 'END' else f'{item.kind} j{numbers[id(item)]}'
        written += [name, '{', f'OFFSET {" ".join(map(repr, item.offset))}']
        if item.kind != 'END':
            kinds = ['Xposition', 'Yposition', 'Zposition'] if item.kind == 'ROOT' else []
            kinds += [f'{channel[1]}rotation' for channel in item.channels or ()]
            written.append(f'CHANNELS {len(kinds)} {" ".join(kinds)}')
        left += [None, *reversed(item.children)]


def _number(text: str, line: int) -> float:
    try:
        return float(text)
    except ValueError:
        raise RecordError(f'line {line}: {_quoted(text)}, expected a number') from None


def _given(value: float | None) -> str:
    return 'missing' if value is None else f'{value:g}'


def _quoted(text: str) -> str:
    return f'"{one_line(text)}"'
