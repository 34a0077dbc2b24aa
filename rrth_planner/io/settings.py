# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Planning settings from a file: the parameters of the node that determine a plan."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.collision.distance_library import LIBRARIES
from rrth_planner.io.entries import number, text, whole
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml, naming_file
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import OptionsError, shown
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.planning.options import ALGORITHMS, TreeOptions

LIMIT_UNITS = {'max_velocity': 'rad/s', 'max_acceleration': 'rad/s^2', 'max_jerk': 'rad/s^3'}
LENGTHS = ('margin', 'ray_guard_length', 'escape_depth', 'reserve')
LOWEST_LIMIT, HIGHEST_LIMIT = 1e-3, 1e6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanSettings:
    """Settings of a plan: a seed, -1 for a new one each time, lengths [m], limits and options."""

    seed: int
    margin: float
    ray_guard_length: float
    escape_depth: float
    reserve: float
    second_checker: str
    limits: MotionLimits
    options: TreeOptions


# Of the same parameters it is asked with each body.
@lru_cache(maxsize=8)
def required_clearance(arm: ArmModel, settings: PlanSettings) -> RequiredClearance:
    """Return what stays clear of the wearer by settings for an arm."""
    return RequiredClearance(
        arm, settings.margin, settings.ray_guard_length, settings.second_checker
    )


def settings_from_values(values: Mapping[str, Any], dof: int) -> PlanSettings:
    """
    Return the settings that values by name describe, as in `config/planner.yaml`.

    Raise OptionsError for the first invalid value: its name, what was given, what was expected,
    the unit.
    """
    if values['algorithm'] not in ALGORITHMS:
        raise OptionsError(
            f'algorithm: "{values["algorithm"]}", expected one that is available: '
            f'{", ".join(ALGORITHMS)}'
        )
    algorithm = ALGORITHMS[values['algorithm']]
    if values['second_checker'] not in LIBRARIES:
        raise OptionsError(
            f'second_checker: "{values["second_checker"]}", expected {" or ".join(LIBRARIES)}'
        )
    return PlanSettings(
        **{name: values[name] for name in ('seed', *LENGTHS, 'second_checker')},
        limits=MotionLimits(*(_of_each_joint(name, values, dof) for name in LIMIT_UNITS)),
        options=algorithm(**{f.name: values[f.name] for f in fields(algorithm)}),
    )


def load_settings(dof: int, path: str | Path | None = None, /, **changes: Any) -> PlanSettings:
    """
    Return the settings of a parameter file of the node, for an arm with `dof` joints.

    Parameters
    ----------
    path : str or Path, optional
        Missing parameters are taken from `config/planner.yaml`.
    **changes
        Values that override those of the files.

    Raises
    ------
    OptionsError
        An invalid value, or an unknown name.

    """
    return checked_settings(load_values(dof, path), changes, dof)


def load_values(dof: int, path: str | Path | None = None) -> dict[str, Any]:
    """Return what `load_settings` makes settings of: all values of the files, by name."""
    packaged = _parameters(resource_path('config/planner.yaml'))
    # Limits of the packaged arm are equal for all joints.
    values = {**packaged, **{name: packaged[name][:1] for name in LIMIT_UNITS}}
    if path is not None:
        given = _parameters(path)
        with naming_file(path, OptionsError):
            checked_settings(values, given, dof)
        values |= given
    return values


def checked_settings(
    values: Mapping[str, Any], changes: Mapping[str, Any], dof: int
) -> PlanSettings:
    """Return the settings of values with some changes, of any type, or raise OptionsError."""
    for name in changes:
        if name not in values:
            raise OptionsError(f'{name}: unknown parameter, expected one of {", ".join(values)}')
    changed = {**values, **changes}
    for name in ('algorithm', 'second_checker'):
        text(changed[name], name, OptionsError)
    whole(changed['seed'], 'seed', OptionsError)
    lengths = {name: number(changed[name], name, 'm', OptionsError) for name in LENGTHS}
    return settings_from_values({**changed, **lengths}, dof)


def _parameters(path: str | Path) -> dict[str, Any]:
    data = load_yaml(path)
    nodes = list(data.values()) if isinstance(data, dict) else []
    if len(nodes) == 1 and isinstance(nodes[0], dict):
        given = nodes[0].get('ros__parameters')
        if isinstance(given, dict):
            return given
    raise OptionsError(
        f'file {path}: {shown(data)}, expected a parameter file, '
        '/**: {ros__parameters: {name: value}}'
    )


def _of_each_joint(name: str, values: Mapping[str, Any], dof: int) -> Array:
    """Return a limit for each joint, (dof,)."""
    unit = LIMIT_UNITS[name]
    given = frozen_array(values[name], (None,), name, unit, OptionsError)
    is_within = ((given >= LOWEST_LIMIT) & (given <= HIGHEST_LIMIT)).all()
    if len(given) not in (1, dof) or not is_within:
        raise OptionsError(
            f'{name}: {given.tolist()}, expected {dof} values, or one for all joints, from '
            f'{LOWEST_LIMIT:g} to {HIGHEST_LIMIT:g} [{unit}]'
        )
    return np.array(np.broadcast_to(given, (dof,)))
