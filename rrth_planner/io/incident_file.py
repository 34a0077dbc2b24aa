# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Incidents as YAML files, every number to the bit; a folder keeps the last hundred."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin
import uuid

import numpy as np
from rrth_planner.io.entries import mapping, number, sequence, text, whole
from rrth_planner.io.incident import Incident, IncidentKind
from rrth_planner.io.replaced_file import replace_file
from rrth_planner.io.settings import LENGTHS
from rrth_planner.io.text_file import load_yaml, naming_file, to_yaml
from rrth_planner.model.arrays import frozen_array
from rrth_planner.model.errors import one_line, RecordError, shown
from rrth_planner.model.trajectory import MotionState
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.options import ALGORITHMS, TreeOptions

# Version of the record's layout; others are rejected.
FORMAT = 6
MOST_FILES = 100
# Of the numbers of a record, by the names of their fields.
UNITS = {
    **dict.fromkeys((*LENGTHS, 'distance', 'radius', 'body_error'), 'm'),
    **dict.fromkeys(('time', 'escape_time', 'body_age', 'controller_delay'), 's'),
    **dict.fromkeys(('contact_speed', 'body_speeds'), 'm/s'),
    'body_reach': 'm, m/s',
}
HEADER = '# An incident of rrth_planner. To replay it: ./run exec replay FILE\n'


def incident_to_yaml(incident: Incident) -> str:
    """Return the text of an incident's file; PyYAML writes numbers by repr, so to the bit."""
    return HEADER + to_yaml({'format': FORMAT, **plain(incident)})


def write_incident(incident: Incident, folder: Path) -> Path:
    """
    Write an incident to a new file of a folder, and remove the oldest beyond a hundred.

    Creates the folder if needed, and writes the file atomically; raises OSError where it cannot.
    """
    content = incident_to_yaml(incident).encode()
    return write_record(content, folder, 'incident', incident.time, '.yaml')


def write_record(
    content: bytes, folder: Path, kind: str, time: str, suffix: str, most: int = MOST_FILES
) -> Path:
    """
    Write a new file of a kind to a folder, and remove the oldest of that kind beyond `most`.

    time: as ISO 8601 has it. Creates the folder if needed, and writes the file atomically; raises
    OSError where it cannot.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stamp = ''.join(c for c in time[:26] if c.isalnum())
    path = folder / f'{kind}-{stamp}-{uuid.uuid4().hex[:6]}{suffix}'
    replace_file(path, lambda fresh: fresh.write_bytes(content))
    with suppress(OSError):
        _remove_oldest(folder, path, f'{kind}-*{suffix}', most)
    return path


def read_incident(path: Path) -> Incident:
    """Return the incident of a file, or raise RrthError."""
    data = load_yaml(path)
    with naming_file(path, RecordError):
        return incident_from_mapping(data)


def _remove_oldest(folder: Path, newest: Path, pattern: str, most: int) -> None:
    """Remove the oldest files; the newest stays, whatever its time stamp."""
    others = [file for file in folder.glob(pattern) if file != newest]
    others.sort(key=lambda file: (file.stat().st_mtime_ns, file.name), reverse=True)
    for file in others[most - 1 :]:
        file.unlink(missing_ok=True)


def incident_from_mapping(data: Any) -> Incident:
    """
    Return the incident of a mapping.

    Raises
    ------
    RrthError
        An entry that is missing, unknown or out of its range.

    """
    if isinstance(data, Mapping):
        if data.get('format') != FORMAT:
            raise RecordError(f'format: {shown(data.get("format"))}, expected {FORMAT}')
        data = {key: value for key, value in data.items() if key != 'format'}
    incident: Incident = _value(Incident, data, 'incident')
    return incident


def plain(value: Any) -> Any:
    """
    Return a value in the types of YAML; a dataclass as a mapping of its fields.

    Raise RecordError for options of no algorithm of `ALGORITHMS`.
    """
    if isinstance(value, TreeOptions):
        names = {kind: name for name, kind in ALGORITHMS.items()}
        if type(value) not in names:
            raise RecordError(
                f'options: {type(value).__name__}, expected those of {", ".join(ALGORITHMS)}'
            )
        return {'algorithm': names[type(value)], **_plain_fields(value)}
    if is_dataclass(value):
        return _plain_fields(value)
    if isinstance(value, Mapping):
        return {plain(key): plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, str):
        # Lone surrogates cannot be encoded.
        return value.encode('utf-8', 'replace').decode('utf-8')
    return value


def _plain_fields(value: Any) -> dict[str, Any]:
    return {field.name: plain(getattr(value, field.name)) for field in fields(value) if field.init}


def _value(kind: Any, data: Any, label: str) -> Any:
    """Return the value of a type that `plain` wrote, or raise RrthError; label: for sentences."""
    if isinstance(kind, UnionType):
        return None if data is None else _value(get_args(kind)[0], data, label)
    if kind is TreeOptions:
        return _options(data)
    if kind is MotionState:
        return _motion_state(data, label)
    if isinstance(kind, type) and is_dataclass(kind):
        types = {field.name: field.type for field in fields(kind) if field.init}
        given = mapping(data, label, types, RecordError)
        # The entries of a record and of its question are called by their names alone.
        owner = '' if kind in (Incident, PlanQuestion) else f'{label}: '
        return kind(**{name: _value(types[name], given[name], owner + name) for name in types})
    if get_origin(kind) is tuple:
        items, kinds = sequence(data, label, RecordError), get_args(kind)
        kinds = kinds[:1] * len(items) if kinds[-1] is Ellipsis else kinds
        if len(items) != len(kinds):
            raise RecordError(f'{label}: {shown(items)}, expected {len(kinds)} values')
        pairs = enumerate(zip(kinds, items, strict=True))
        return tuple(_value(one, item, f'{label}[{k}]') for k, (one, item) in pairs)
    if get_origin(kind) is Mapping:
        if not isinstance(data, Mapping):
            raise RecordError(f'{label}: {shown(data)}, expected a mapping')
        return {_value(str, k, label): _value(str, v, f'{label}: {k}') for k, v in data.items()}
    return _scalar(kind, data, label)


def _scalar(kind: Any, data: Any, label: str) -> Any:
    """Return a text, a number or a word; of an array what was given: its owner checks it."""
    if kind is IncidentKind:
        kinds = [one.value for one in IncidentKind]
        if data not in kinds:
            raise RecordError(f'{label}: {shown(data)}, expected {" or ".join(kinds)}')
        return IncidentKind(data)
    if kind is str:
        value = text(data, label, RecordError)
        # All others are printed in a line.
        return value if label == 'traceback' else one_line(value)
    if kind is bool and not isinstance(data, bool):
        raise RecordError(f'{label}: {shown(data)}, expected true or false')
    if kind is int:
        return whole(data, label, RecordError)
    if kind is float:
        name = label.rpartition(': ')[2].partition('[')[0]
        return number(data, label, UNITS[name], RecordError)
    return data


def _motion_state(data: Any, label: str) -> MotionState:
    names = [field.name for field in fields(MotionState)]
    given, arrays = mapping(data, label, names, RecordError), {}
    dof: int | None = None
    for name in names:
        arrays[name] = frozen_array(given[name], (dof,), f'{label}: {name}', 'rad, s', RecordError)
        dof = len(arrays[name])
    return MotionState(**arrays)


def _options(data: Any) -> TreeOptions:
    algorithm = data.get('algorithm') if isinstance(data, Mapping) else None
    if not isinstance(algorithm, str) or algorithm not in ALGORITHMS:
        raise RecordError(
            f'options: algorithm {shown(algorithm)}, expected one of {", ".join(ALGORITHMS)}'
        )
    kind = ALGORITHMS[algorithm]
    wanted = ('algorithm', *(field.name for field in fields(kind)))
    given = mapping(data, 'options', wanted, RecordError)
    del given['algorithm']
    return kind(**given)
