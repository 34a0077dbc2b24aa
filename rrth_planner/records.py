# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Values of this package as plain numbers, lists and mappings, and back, to the bit."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np
from rrth_planner.arm import ArmModel
from rrth_planner.arrays import frozen_array
from rrth_planner.errors import RecordError
from rrth_planner.goal import PointingGoal
from rrth_planner.options import ALGORITHMS, TreeOptions
from rrth_planner.question import PlanQuestion
from rrth_planner.scene import Box, Scene
from rrth_planner.takeover import MotionState, Takeover
from rrth_planner.touch import Touch
from rrth_planner.trajectory import MotionLimits, Trajectory


def plain(value: Any) -> Any:
    """Return a value as what YAML knows; of a dataclass a mapping of its fields."""
    if isinstance(value, TreeOptions):
        names = {kind: name for name, kind in ALGORITHMS.items()}
        if type(value) not in names:
            raise RecordError(
                f'options: {type(value).__name__}, expected those of {", ".join(ALGORITHMS)}'
            )
        return {'algorithm': names[type(value)], **_fields_of(value)}
    if is_dataclass(value):
        return _fields_of(value)
    if isinstance(value, Mapping):
        return {plain(key): plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, str):
        # Half a character, which no file can hold.
        return value.encode('utf-8', 'replace').decode('utf-8')
    return value


def _fields_of(value: Any) -> dict[str, Any]:
    return {field.name: plain(getattr(value, field.name)) for field in fields(value) if field.init}


def question_from_mapping(data: Any) -> PlanQuestion:
    """Return the question that `plain` wrote, or raise RrthError."""
    given = entries(data, PlanQuestion, 'question')
    arm = arm_from_mapping(given['arm'])
    return PlanQuestion(
        arm=arm,
        scene=scene_from_mapping(given['scene'], 'scene'),
        q_start=given['q_start'],
        goal=PointingGoal(**entries(given['goal'], PointingGoal, 'goal')),
        limits=MotionLimits(**entries(given['limits'], MotionLimits, 'limits')),
        options=_options(given['options']),
        margin=number(given['margin'], 'margin', 'm'),
        ray_guard_length=number(given['ray_guard_length'], 'ray_guard_length', 'm'),
        seed=_whole(given['seed'], 'seed'),
        moving=None if given['moving'] is None else _takeover(given['moving'], arm.dof),
        escape_depth=number(given['escape_depth'], 'escape_depth', 'm'),
    )


def arm_from_mapping(data: Any) -> ArmModel:
    """Return the arm that `plain` wrote; `arm.arm_from_mapping` reads what people write."""
    given = entries(data, ArmModel, 'arm')
    for name, kind in (('joint_names', str), ('is_prismatic', bool)):
        values = given[name]
        if not isinstance(values, list) or not all(isinstance(v, kind) for v in values):
            raise RecordError(f'arm: {name} {values!r}, expected a list of {kind.__name__}')
    return ArmModel(**given)


def scene_from_mapping(data: Any, name: str) -> Scene:
    """Return the scene that `plain` wrote, or raise RrthError."""
    boxes = entries(data, Scene, name)['boxes']
    if not isinstance(boxes, list):
        raise RecordError(f'{name}: boxes {boxes!r}, expected a list of boxes')
    result = []
    for i, box in enumerate(boxes):
        given = entries(box, Box, f'{name}: box {i}')
        text(given['name'], f'{name}: name of box {i}')
        result.append(Box(**given))
    return Scene(tuple(result))


def trajectory_from_mapping(data: Any, name: str) -> Trajectory:
    """Return the trajectory that `plain` wrote, or raise RrthError."""
    return Trajectory(**entries(data, Trajectory, name))


def touch_from_mapping(data: Any) -> Touch:
    """Return the touch that `plain` wrote, or raise RrthError."""
    given = entries(data, Touch, 'touch')
    return Touch(
        time=number(given['time'], 'touch: time', 's'),
        distance=number(given['distance'], 'touch: distance', 'm'),
        bar=text(given['bar'], 'touch: bar'),
        box=text(given['box'], 'touch: box'),
    )


def entries(data: Any, kind: Any, name: str, more: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the entries of a mapping that has those of a dataclass, and more, and no others."""
    if not isinstance(data, Mapping):
        raise RecordError(f'{name}: {_short(data)}, expected a mapping')
    wanted = [*(field.name for field in fields(kind) if field.init), *more]
    missing = [key for key in wanted if key not in data]
    if missing:
        raise RecordError(f'{name}: no {", ".join(missing)}, expected {", ".join(wanted)}')
    unknown = [str(key) for key in data if key not in wanted]
    if unknown:
        raise RecordError(f'{name}: {", ".join(unknown)}, expected only {", ".join(wanted)}')
    return dict(data)


def number(value: Any, name: str, unit: str) -> float:
    """Return a number, or raise RecordError."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RecordError(f'{name}: {_short(value)}, expected a number [{unit}]')
    return float(value)


def text(value: Any, name: str) -> str:
    """Return a text, or raise RecordError."""
    if not isinstance(value, str):
        raise RecordError(f'{name}: {_short(value)}, expected a text')
    return value


def _whole(value: Any, name: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise RecordError(f'{name}: {_short(value)}, expected a whole number')
    return value


def _options(data: Any) -> TreeOptions:
    algorithm = data.get('algorithm') if isinstance(data, Mapping) else None
    if not isinstance(algorithm, str) or algorithm not in ALGORITHMS:
        raise RecordError(
            f'options: algorithm {_short(algorithm)}, expected one of {", ".join(ALGORITHMS)}'
        )
    kind = ALGORITHMS[algorithm]
    given = entries(data, kind, 'options', ('algorithm',))
    del given['algorithm']
    return kind(**given)


def _takeover(data: Any, dof: int) -> Takeover:
    given = entries(data, Takeover, 'moving')
    state = entries(given['state'], MotionState, 'moving: state')
    running = given['running']
    return Takeover(
        state=MotionState(
            **{
                name: frozen_array(value, (dof,), f'moving: {name}', 'rad, s', RecordError)
                for name, value in state.items()
            }
        ),
        running=None if running is None else trajectory_from_mapping(running, 'moving: running'),
        time=number(given['time'], 'moving: time', 's'),
    )


def _short(value: Any) -> str:
    shown = repr(value)
    return shown if len(shown) <= 80 else f'{shown[:77]}...'
