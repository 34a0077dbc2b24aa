# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Options of the planners: one class per algorithm, which selects it."""

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from rrth_planner.model.errors import OptionsError, shown

NUMBERS = (int, float, np.integer, np.floating)


def option(default: Any, low: float, high: float, unit: str, text: str) -> Any:
    """Return a dataclass field with its range, unit and description."""
    return field(
        default=default, metadata={'low': low, 'high': high, 'unit': unit, 'description': text}
    )


def _other_default(kind: Any, name: str, default: Any) -> Any:
    """Return a field as that of another class of options, but for its default."""
    return field(default=default, metadata=kind.__dataclass_fields__[name].metadata)


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """
    Options of a planner; each field has range, unit and meaning as metadata.

    Raises
    ------
    OptionsError
        A value outside its range.

    """

    def __post_init__(self) -> None:
        """Validate each field against its own metadata."""
        for f in fields(self):
            value, meta = getattr(self, f.name), f.metadata
            if f.type is bool:
                if not isinstance(value, bool):
                    raise OptionsError(f'{f.name}: {shown(value)}, expected true or false [-]')
                continue
            is_count = f.type is int
            is_number = isinstance(value, (int, np.integer) if is_count else NUMBERS)
            if (
                isinstance(value, bool)
                or not is_number
                or not meta['low'] <= value <= meta['high']
            ):
                kind = 'a whole number from ' if is_count else ''
                raise OptionsError(
                    f'{f.name}: {shown(value)}, expected {kind}{meta["low"]:g} to '
                    f'{meta["high"]:g} [{meta["unit"]}]'
                )


@dataclass(frozen=True, slots=True, kw_only=True)
class TreeOptions(Options):
    """What all planners have in common."""

    step_size: float = option(1.5, 0.01, 1000.0, 'rad', 'longest extension of a tree')
    clearance_gain: float = option(
        0.0, 0.0, 1000.0, '-', 'step size as a multiple of the free radius; 0: always step_size'
    )
    goal_bias: float = option(0.05, 0.0, 1.0, '-', 'probability of sampling a goal configuration')
    is_bidirectional: bool = option(True, 0, 1, '-', 'also grow a tree from the goals')
    max_samples: int = option(20000, 1, 10**7, '-', 'samples after which a growth fails')
    time_limit: float = option(4.0, 1e-3, 3600.0, 's', 'planning fails after this time')


@dataclass(frozen=True, slots=True, kw_only=True)
class GrowthOptions(TreeOptions):
    """What RRT and RRT-H have in common: growth to a first path."""

    near_bias: float = option(
        0.9, 0.0, 1.0, '-', 'initial probability of sampling near the start or a goal'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RRTOptions(GrowthOptions):
    """RRT (LaValle 1998), or RRT-Connect (Kuffner and LaValle 2000): the first path."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RRTStarOptions(TreeOptions):
    """RRT* (Karaman and Frazzoli 2011): the best path after `max_samples` draws."""

    improve_time: float = option(
        0.5, 0.0, 3600.0, 's', 'longest time spent on improving a path; 0: return the first path'
    )
    rewire_factor: float = option(
        1.1, 0.01, 100.0, '-', 'rewiring radius over the least one of optimality'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class InformedRRTStarOptions(RRTStarOptions):
    """Informed RRT* (Gammell et al. 2014)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RRTStarSmartOptions(RRTStarOptions):
    """RRT*-Smart (Nasir et al. 2013)."""

    biasing_ratio: int = option(2, 1, 10**6, '-', 'one in this many samples is near a beacon')


@dataclass(frozen=True, slots=True, kw_only=True)
class RRTHOptions(GrowthOptions):
    """RRT-H (Zou et al. 2024): grow to a path and shortcut it, then avoid it and repeat."""

    corner_spacing: float = option(
        0.1, 1e-4, 100.0, 'rad', 'k of the paper: shortest corner cut that is tried'
    )
    corner_moves: int = option(
        10, 0, 10**4, '-', 'most elastic band iterations, which move corners along contacts'
    )
    improve_time: float = option(
        0.5, 0.0, 3600.0, 's', 'longest time spent on improving a path; 0: return the first path'
    )
    club_attempts: int = option(
        3, 0, 10**4, '-', 'further growths that avoid the path club, after the first path'
    )
    club_radius: float = option(0.5, 0.0, 1000.0, 'rad', 'radius within which club points count')
    club_count: int = option(2, 0, 10**6, '-', 'a sample with more club points near is rejected')
    club_probability: float = option(0.9, 0.0, 1.0, '-', 'probability of that rejection')
    club_budget: int = option(100, 1, 10**7, '-', 'samples of one growth avoiding the path club')


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedRRTHOptions(RRTHOptions):
    """
    RRT-H with the three steps as printed, to reproduce the paper; its paths may collide.

    By default it grows as printed too: one tree, uniform draws. P_T and P_C are the points of
    section 2: along the segment, and along the lines to it.
    """

    goal_bias: float = _other_default(RRTHOptions, 'goal_bias', 0.0)
    is_bidirectional: bool = _other_default(RRTHOptions, 'is_bidirectional', False)
    near_bias: float = _other_default(RRTHOptions, 'near_bias', 0.0)
    corner_moves: int = option(0, 0, 0, '-', '0: only the three steps')
    target_spacing: float = option(0.05, 1e-4, 100.0, 'rad', 'distance between points P_T')
    check_spacing: float = option(0.05, 1e-4, 100.0, 'rad', 'distance between points P_C')


# Names of the algorithms in files and parameters.
ALGORITHMS: dict[str, type[TreeOptions]] = {
    'rrt_h': RRTHOptions,
    'rrt': RRTOptions,
    'rrt_star': RRTStarOptions,
    'informed_rrt_star': InformedRRTStarOptions,
    'rrt_star_smart': RRTStarSmartOptions,
}
