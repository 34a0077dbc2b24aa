# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion of values to plain numbers, lists and mappings, and back, to the bit."""

from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np
from rrth_planner.collision.violation import Violation
from rrth_planner.io.entries import mapping, number, sequence, whole
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import frozen_array
from rrth_planner.model.errors import printable, RecordError, shown
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import MotionLimits, MotionState, StartState, Trajectory
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.options import ALGORITHMS, TreeOptions


def plain(value: Any) -> Any:
    """Return a value in the types of YAML; a dataclass as a mapping of its fields."""
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


def question_from_mapping(data: Any) -> PlanQuestion:
    """Return the request that `plain` wrote, or raise RrthError."""
    given = fields_of(data, PlanQuestion, 'question')
    arm = arm_from_mapping(given['arm'])
    lengths = {
        name: number(given[name], name, 'm', RecordError)
        for name in ('margin', 'ray_guard_length', 'escape_depth')
    }
    return PlanQuestion(
        arm=arm,
        scene=scene_from_mapping(given['scene'], 'scene'),
        q_start=given['q_start'],
        goal=PointingGoal(**fields_of(given['goal'], PointingGoal, 'goal')),
        limits=MotionLimits(**fields_of(given['limits'], MotionLimits, 'limits')),
        options=_options(given['options']),
        seed=whole(given['seed'], 'seed', RecordError),
        moving=None if given['moving'] is None else _start_state(given['moving'], arm.dof),
        **lengths,
    )


def arm_from_mapping(data: Any) -> ArmModel:
    """Return the arm that `plain` wrote; `arm_file.arm_from_mapping` reads arm files."""
    given = fields_of(data, ArmModel, 'arm')
    for name, kind in (('joint_names', str), ('is_prismatic', bool)):
        values = given[name]
        if not isinstance(values, list) or not all(isinstance(v, kind) for v in values):
            raise RecordError(f'arm: {name} {shown(values)}, expected a list of {kind.__name__}')
    return ArmModel(**given)


def scene_from_mapping(data: Any, name: str) -> Scene:
    """Return the scene that `plain` wrote, or raise RrthError."""
    boxes = sequence(fields_of(data, Scene, name)['boxes'], f'{name}: boxes', RecordError)
    return Scene(
        tuple(Box(**fields_of(box, Box, f'{name}: box {i}')) for i, box in enumerate(boxes))
    )


def trajectory_from_mapping(data: Any, name: str) -> Trajectory | None:
    """Return the trajectory that `plain` wrote, None of nothing, or raise RrthError."""
    return None if data is None else Trajectory(**fields_of(data, Trajectory, name))


def violation_from_mapping(data: Any) -> Violation:
    """Return the violation that `plain` wrote, or raise RrthError."""
    given = fields_of(data, Violation, 'violation')
    return Violation(
        time=number(given['time'], 'violation: time', 's', RecordError),
        distance=number(given['distance'], 'violation: distance', 'm', RecordError),
        bar=printable(given['bar'], 'violation: bar', RecordError),
        box=printable(given['box'], 'violation: box', RecordError),
    )


def fields_of(data: Any, kind: Any, name: str, more: Collection[str] = ()) -> dict[str, Any]:
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
    given = fields_of(data, kind, 'options', ('algorithm',))
    del given['algorithm']
    return kind(**given)


def _start_state(data: Any, dof: int) -> StartState:
    given = fields_of(data, StartState, 'moving')
    state = fields_of(given['state'], MotionState, 'moving: state')
    return StartState(
        state=MotionState(
            **{
                name: frozen_array(value, (dof,), f'moving: {name}', 'rad, s', RecordError)
                for name, value in state.items()
            }
        ),
        running=trajectory_from_mapping(given['running'], 'moving: running'),
        time=number(given['time'], 'moving: time', 's', RecordError),
    )
