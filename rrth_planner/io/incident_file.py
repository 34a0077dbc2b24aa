# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Incidents as YAML files, every number to the bit; a folder keeps the last hundred."""

from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
import os
from pathlib import Path
from typing import Any
import uuid

import numpy as np
from rrth_planner.collision.violation import Violation
from rrth_planner.io.arm_file import allowed_from
from rrth_planner.io.entries import mapping, number, sequence, text, whole
from rrth_planner.io.incident import Incident, IncidentKind
from rrth_planner.io.settings import LENGTHS
from rrth_planner.io.text_file import load_yaml, naming_file, to_yaml
from rrth_planner.model.arm import ArmModel, Capsule
from rrth_planner.model.arrays import frozen_array
from rrth_planner.model.errors import one_line, printable, RecordError, shown
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import SeparationRules
from rrth_planner.model.trajectory import MotionLimits, MotionState, StartState, Trajectory
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.options import ALGORITHMS, TreeOptions

# Version of the record's layout; others are rejected.
FORMAT = 5
MOST_FILES = 100
PATTERN = 'incident-*.yaml'
HEADER = '# An incident of rrth_planner. To replay it: ./run exec replay FILE\n'


def incident_to_yaml(incident: Incident) -> str:
    """Return the text of an incident's file; PyYAML writes numbers by repr, so to the bit."""
    return HEADER + to_yaml({'format': FORMAT, **plain(incident)})


def write_incident(incident: Incident, folder: Path) -> Path:
    """
    Write an incident to a new file of a folder, and remove the oldest beyond a hundred.

    Creates the folder if needed, and writes the file atomically; raises OSError where it cannot.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stamp = ''.join(c for c in incident.time[:26] if c.isalnum())
    path = folder / f'incident-{stamp}-{uuid.uuid4().hex[:6]}.yaml'
    fresh = path.with_suffix('.part')
    try:
        fresh.write_text(incident_to_yaml(incident), encoding='utf-8')
        os.replace(fresh, path)
    finally:
        fresh.unlink(missing_ok=True)
    with suppress(OSError):
        _remove_oldest(folder, path)
    return path


def read_incident(path: Path) -> Incident:
    """Return the incident of a file, or raise RrthError."""
    data = load_yaml(path)
    with naming_file(path, RecordError):
        return incident_from_mapping(data)


def _remove_oldest(folder: Path, newest: Path) -> None:
    """Remove the oldest files; the newest stays, whatever its time stamp."""
    others = [file for file in folder.glob(PATTERN) if file != newest]
    others.sort(key=lambda file: (file.stat().st_mtime_ns, file.name), reverse=True)
    for file in others[MOST_FILES - 1 :]:
        file.unlink(missing_ok=True)


def incident_from_mapping(data: Any) -> Incident:
    """
    Return the incident of a mapping.

    Raises
    ------
    RrthError
        An entry that is missing, unknown or out of its range.

    """
    if isinstance(data, Mapping) and data.get('format') != FORMAT:
        raise RecordError(f'format: {shown(data.get("format"))}, expected {FORMAT}')
    given = _fields_of(data, Incident, 'incident', ('format',))
    kinds = [kind.value for kind in IncidentKind]
    if given['kind'] not in kinds:
        raise RecordError(f'kind: {shown(given["kind"])}, expected {" or ".join(kinds)}')
    if not isinstance(given['versions'], Mapping):
        raise RecordError(f'versions: {shown(given["versions"])}, expected a mapping')
    present, violation = given['present'], given['violation']
    return Incident(
        kind=IncidentKind(given['kind']),
        question=_question(given['question']),
        trajectory=_trajectory(given['trajectory'], 'trajectory'),
        violation=None if violation is None else _violation(violation),
        present=None if present is None else _scene(present, 'present'),
        escape_time=number(given['escape_time'], 'escape_time', 's', RecordError),
        traceback=text(given['traceback'], 'traceback', RecordError),
        versions={
            _line(key, 'versions'): _line(value, f'versions: {key}')
            for key, value in given['versions'].items()
        },
        **{name: _line(given[name], name) for name in ('sentence', 'time', 'error')},
    )


def _line(value: Any, name: str) -> str:
    """Return a text as a line that may be printed, or raise RecordError."""
    return one_line(text(value, name, RecordError))


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


def _question(data: Any) -> PlanQuestion:
    """Return the question that `plain` wrote, or raise RrthError."""
    given = _fields_of(data, PlanQuestion, 'question')
    arm = _arm(given['arm'])
    lengths = {name: number(given[name], name, 'm', RecordError) for name in LENGTHS}
    return PlanQuestion(
        arm=arm,
        scene=_scene(given['scene'], 'scene'),
        q_start=given['q_start'],
        goal=PointingGoal(**_fields_of(given['goal'], PointingGoal, 'goal')),
        limits=_limits(given['limits'], 'limits'),
        options=_options(given['options']),
        seed=whole(given['seed'], 'seed', RecordError),
        second_checker=text(given['second_checker'], 'second_checker', RecordError),
        moving=None if given['moving'] is None else _start_state(given['moving'], arm.dof),
        rules=None if given['rules'] is None else _rules(given['rules']),
        stop_limits=(
            None if given['stop_limits'] is None else _limits(given['stop_limits'], 'stop_limits')
        ),
        body_age=number(given['body_age'], 'body_age', 's', RecordError),
        **lengths,
    )


def _limits(data: Any, name: str) -> MotionLimits:
    """Return the limits that `plain` wrote, or raise RrthError."""
    return MotionLimits(**_fields_of(data, MotionLimits, name))


def _rules(data: Any) -> SeparationRules:
    """Return the rules that `plain` wrote, or raise RrthError."""
    given = _fields_of(data, SeparationRules, 'rules')
    speeds = sequence(given['body_speeds'], 'rules: body_speeds', RecordError)
    if not all(isinstance(item, list) and len(item) == 2 for item in speeds):
        raise RecordError(
            f'rules: body_speeds {shown(speeds)}, expected pairs of words and a speed [m/s]'
        )
    return SeparationRules(
        body_speeds=tuple(
            (
                text(words, 'rules: body_speeds', RecordError),
                number(speed, 'rules: body_speeds', 'm/s', RecordError),
            )
            for words, speed in speeds
        ),
        **{
            name: number(given[name], f'rules: {name}', unit, RecordError)
            for name, unit in (
                ('contact_speed', 'm/s'),
                ('body_error', 'm'),
                ('controller_delay', 's'),
            )
        },
    )


def _arm(data: Any) -> ArmModel:
    """Return the arm that `plain` wrote; `arm_file.arm_from_mapping` reads arm files."""
    given = _fields_of(data, ArmModel, 'arm')
    for name, kind in (('joint_names', str), ('is_prismatic', bool)):
        values = given[name]
        if not isinstance(values, list) or not all(isinstance(v, kind) for v in values):
            raise RecordError(f'arm: {name} {shown(values)}, expected a list of {kind.__name__}')
    capsules = sequence(given['capsules'], 'arm: capsules', RecordError)
    given['capsules'] = tuple(
        _capsule(item, f'arm: capsule {i}') for i, item in enumerate(capsules)
    )
    given['allowed'] = allowed_from(given['allowed'], 'arm: allowed')
    return ArmModel(**given)


def _capsule(data: Any, name: str) -> Capsule:
    """Return the capsule that `plain` wrote, or raise RrthError."""
    given = _fields_of(data, Capsule, name)
    return Capsule(
        name=text(given['name'], f'{name}: name', RecordError),
        link=whole(given['link'], f'{name}: link', RecordError),
        ends=given['ends'],
        radius=number(given['radius'], f'{name}: radius', 'm', RecordError),
    )


def _scene(data: Any, name: str) -> Scene:
    """Return the scene that `plain` wrote, or raise RrthError."""
    boxes = sequence(_fields_of(data, Scene, name)['boxes'], f'{name}: boxes', RecordError)
    return Scene(
        tuple(Box(**_fields_of(box, Box, f'{name}: box {i}')) for i, box in enumerate(boxes))
    )


def _trajectory(data: Any, name: str) -> Trajectory | None:
    """Return the trajectory that `plain` wrote, None for None, or raise RrthError."""
    return None if data is None else Trajectory(**_fields_of(data, Trajectory, name))


def _violation(data: Any) -> Violation:
    """Return the violation that `plain` wrote, or raise RrthError."""
    given = _fields_of(data, Violation, 'violation')
    if not isinstance(given['is_of_arm'], bool):
        raise RecordError(
            f'violation: is_of_arm {shown(given["is_of_arm"])}, expected true or false'
        )
    return Violation(
        time=number(given['time'], 'violation: time', 's', RecordError),
        distance=number(given['distance'], 'violation: distance', 'm', RecordError),
        bar=printable(given['bar'], 'violation: bar', RecordError),
        box=printable(given['box'], 'violation: box', RecordError),
        is_of_arm=given['is_of_arm'],
    )


def _fields_of(data: Any, kind: Any, name: str, more: Collection[str] = ()) -> dict[str, Any]:
    """Return the entries of a mapping with exactly the fields of a dataclass, and `more`."""
    wanted = [*(field.name for field in fields(kind) if field.init), *more]
    return mapping(data, name, wanted, RecordError)


def _options(data: Any) -> TreeOptions:
    algorithm = data.get('algorithm') if isinstance(data, Mapping) else None
    if not isinstance(algorithm, str) or algorithm not in ALGORITHMS:
        raise RecordError(
            f'options: algorithm {shown(algorithm)}, expected one of {", ".join(ALGORITHMS)}'
        )
    kind = ALGORITHMS[algorithm]
    given = _fields_of(data, kind, 'options', ('algorithm',))
    del given['algorithm']
    return kind(**given)


def _start_state(data: Any, dof: int) -> StartState:
    given = _fields_of(data, StartState, 'moving')
    state = {
        name: frozen_array(value, (dof,), f'moving: {name}', 'rad, s', RecordError)
        for name, value in _fields_of(given['state'], MotionState, 'moving: state').items()
    }
    return StartState(
        state=MotionState(**state),
        running=_trajectory(given['running'], 'moving: running'),
        time=number(given['time'], 'moving: time', 's', RecordError),
    )
