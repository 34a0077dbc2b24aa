# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The options of the planners, one class an algorithm: the class is the choice."""

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from rrth_planner.model.errors import OptionsError, shown

NUMBERS = (int, float, np.integer, np.floating)


def _option(default: Any, low: float, high: float, unit: str, text: str) -> Any:
    """Return a dataclass field with its range, unit and description."""
    return field(
        default=default, metadata={'low': low, 'high': high, 'unit': unit, 'description': text}
    )


def _other_default(kind: Any, name: str, default: Any) -> Any:
    """Return a field as that of another class of options, but for its default."""
    return field(default=default, metadata=kind.__dataclass_fields__[name].metadata)


@dataclass(frozen=True, slots=True, kw_only=True)
class TreeOptions:
    """
    What all planners have in common; every field carries range, unit and meaning as metadata.

    Raises
    ------
    OptionsError
        A value outside its range.

    """

    step_size: float = _option(1.5, 0.01, 1000.0, 'rad', 'longest extension of a tree')
    clearance_gain: float = _option(
        0.0, 0.0, 1000.0, '-', 'step as a multiple of the free radius; 0: always step_size'
    )
    goal_bias: float = _option(0.05, 0.0, 1.0, '-', 'chance that a draw is a goal posture')
    is_bidirectional: bool = _option(True, 0, 1, '-', 'grow a tree from the goals too')
    max_samples: int = _option(20000, 1, 10**7, '-', 'draws of one growth before it gives up')
    time_limit: float = _option(2.0, 1e-3, 3600.0, 's', 'planning fails after this time')

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
class GrowthOptions(TreeOptions):
    """What RRT and RRT-H have in common: growth to a first path."""

    near_bias: float = _option(
        0.9, 0.0, 1.0, '-', 'chance that a draw is near an end of the path, at first'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RRTOptions(GrowthOptions):
    """RRT (LaValle 1998), or RRT-Connect (Kuffner and LaValle 2000): the first path."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RRTStarOptions(TreeOptions):
    """RRT* (Karaman and Frazzoli 2011): the best path after `max_samples` draws."""

    improve_time: float = _option(
        0.5, 0.0, 3600.0, 's', 'at most so long a found path is improved; 0: the first path'
    )
    rewire_factor: float = _option(
        1.1, 0.01, 100.0, '-', 'radius of the neighbourhood over the least that is optimal'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class InformedRRTStarOptions(RRTStarOptions):
    """Informed RRT* (Gammell et al. 2014)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RRTStarSmartOptions(RRTStarOptions):
    """RRT*-Smart (Nasir et al. 2013)."""

    biasing_ratio: int = _option(2, 1, 10**6, '-', 'every so many draws one is near a beacon')


@dataclass(frozen=True, slots=True, kw_only=True)
class RRTHOptions(GrowthOptions):
    """RRT-H (Zou et al. 2024): grow to a first path, then pull it taut; again round other ways."""

    corner_spacing: float = _option(
        0.1, 1e-4, 100.0, 'rad', 'k of the paper: shortest cut of a corner that is still tried'
    )
    corner_moves: int = _option(
        10, 0, 10**4, '-', 'rounds at most in which corners move along what they lean on'
    )
    improve_time: float = _option(
        0.5, 0.0, 3600.0, 's', 'at most so long a found path is improved; 0: the first path'
    )
    club_attempts: int = _option(
        3, 0, 10**4, '-', 'further growths with the path club after the first path'
    )
    club_radius: float = _option(0.5, 0.0, 1000.0, 'rad', 'range in which club points count')
    club_count: int = _option(2, 0, 10**6, '-', 'a new point with more club points is rejected')
    club_probability: float = _option(0.9, 0.0, 1.0, '-', 'chance of that rejection')
    club_budget: int = _option(100, 1, 10**7, '-', 'draws of one growth with the path club')


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedRRTHOptions(RRTHOptions):
    """
    RRT-H with the three steps as printed, to check the paper by; its paths may touch.

    By default it grows as printed too: one tree, uniform draws. P_T and P_C are the points of
    section 2: along the segment, and along the lines to it.
    """

    goal_bias: float = _other_default(RRTHOptions, 'goal_bias', 0.0)
    is_bidirectional: bool = _other_default(RRTHOptions, 'is_bidirectional', False)
    near_bias: float = _other_default(RRTHOptions, 'near_bias', 0.0)
    corner_moves: int = _option(0, 0, 0, '-', 'none: the three steps are all there is')
    target_spacing: float = _option(0.05, 1e-4, 100.0, 'rad', 'distance between points P_T')
    check_spacing: float = _option(0.05, 1e-4, 100.0, 'rad', 'distance between points P_C')


# What files and parameters call the algorithms.
ALGORITHMS: dict[str, type[TreeOptions]] = {
    'rrt_h': RRTHOptions,
    'rrt': RRTOptions,
    'rrt_star': RRTStarOptions,
    'informed_rrt_star': InformedRRTStarOptions,
    'rrt_star_smart': RRTStarSmartOptions,
}
