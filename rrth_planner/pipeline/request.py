# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""All inputs of a plan in one value: the same question has the same answer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from operator import attrgetter
from typing import Any

import numpy as np
from rrth_planner.collision.distance_library import LIBRARIES
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array, FARTHEST, float_number, frozen_array
from rrth_planner.model.errors import check_type, OptionsError, shown
from rrth_planner.model.frozen import Frozen
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Scene
from rrth_planner.model.separation import SeparationRules
from rrth_planner.model.trajectory import MotionLimits, StartState
from rrth_planner.planning.options import TreeOptions

_KINDS: dict[str, type[Any]] = {
    'arm': ArmModel,
    'scene': Scene,
    'goal': PointingGoal,
    'limits': MotionLimits,
    'options': TreeOptions,
}
_OPTIONAL: dict[str, type[Any]] = {
    'moving': StartState,
    'rules': SeparationRules,
    'stop_limits': MotionLimits,
}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanQuestion(Frozen):
    """
    The arguments of `pipeline.plan_motion` that determine its result, by name.

    Parameters
    ----------
    q_start : array_like, shape (dof,)
        [rad].
    margin, ray_guard_length : float
        From 0 to 1e4 [m].
    seed : int
        >= 0.
    escape_depth, reserve : float
        From 0 to 1e4 [m].
    second_checker : str
        One of `distance_library.LIBRARIES`.
    rules : SeparationRules or None
        Of several goals the arm aims at the one where these allow it to be soonest.
    stop_limits : MotionLimits or None
        Of stops of such a motion; None: `limits`.
    body_age : float
        Of the scene, while such a motion is executed, from 0 to 1e4 [s].

    Raises
    ------
    OptionsError
        A number out of its range, an argument of another type, or values of another number of
        joints than the arm's.

    """

    arm: ArmModel
    scene: Scene
    q_start: Array
    goal: PointingGoal
    limits: MotionLimits
    options: TreeOptions
    margin: float
    ray_guard_length: float
    seed: int
    moving: StartState | None = None
    escape_depth: float = 0.05
    reserve: float = 0.0
    second_checker: str = 'fcl'
    rules: SeparationRules | None = None
    stop_limits: MotionLimits | None = None
    body_age: float = 0.0

    @property
    def required(self) -> RequiredClearance:
        """What stays clear of the wearer."""
        return RequiredClearance(self.arm, self.margin, self.ray_guard_length, self.second_checker)

    def __post_init__(self) -> None:
        """Validate and freeze."""
        for name, kind in _KINDS.items():
            check_type(getattr(self, name), kind, name, OptionsError)
        for name, kind in _OPTIONAL.items():
            if getattr(self, name) is not None:
                check_type(getattr(self, name), kind, name, OptionsError)
        dof = self.arm.dof
        q_start = frozen_array(self.q_start, (dof,), 'q_start', 'rad', OptionsError)
        object.__setattr__(self, 'q_start', q_start)
        widths = {'limits': self.limits.velocity.shape[-1]}
        if self.stop_limits is not None:
            widths['stop_limits'] = self.stop_limits.velocity.shape[-1]
        if self.moving is not None:
            widths['moving'] = self.moving.state.positions.shape[-1]
            if self.moving.running is not None:
                widths['running'] = self.moving.running.positions.shape[-1]
        for name, width in widths.items():
            if width != dof:
                raise OptionsError(f'{name}: of {width} joints, expected those of the arm, {dof}')
        for name in ('margin', 'ray_guard_length', 'escape_depth', 'reserve'):
            value = float_number(getattr(self, name), name, 'm', 0.0, FARTHEST, OptionsError)
            object.__setattr__(self, name, value)
        age = float_number(self.body_age, 'body_age', 's', 0.0, FARTHEST, OptionsError)
        object.__setattr__(self, 'body_age', age)
        if self.second_checker not in tuple(LIBRARIES):
            raise OptionsError(
                f'second_checker: {shown(self.second_checker)}, expected {" or ".join(LIBRARIES)}'
            )
        is_whole = isinstance(self.seed, int | np.integer) and not isinstance(self.seed, bool)
        if not is_whole or self.seed < 0:
            raise OptionsError(f'seed: {shown(self.seed)}, expected a whole number >= 0')


_NAMES = tuple(field.name for field in fields(PlanQuestion))
# The parts of a question, as `asked` takes them.
parts_of: Callable[[PlanQuestion], tuple[Any, ...]] = attrgetter(*_NAMES)


def asked(parts: Sequence[Any]) -> PlanQuestion:
    """Return the question with these parts, which are those of one: it is not checked again."""
    question: PlanQuestion = object.__new__(PlanQuestion)
    for name, part in zip(_NAMES, parts, strict=True):
        object.__setattr__(question, name, part)
    return question
