# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The options of the planners, one class an algorithm."""

from dataclasses import dataclass, field, fields
from typing import Any

from rrth_planner.errors import OptionsError


def _option(default: Any, low: float, high: float, unit: str, text: str) -> Any:
    """Return a dataclass field with its range, unit and description."""
    return field(
        default=default, metadata={'low': low, 'high': high, 'unit': unit, 'description': text}
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RRTHOptions:
    """
    RRT-H (Zou et al. 2024): grow to a first path, then pull it taut; again round other ways.

    Every field carries its range, unit and meaning in its metadata.

    Raises
    ------
    OptionsError
        A value outside its range.

    """

    step_size: float = _option(1.5, 0.01, 10.0, 'rad', 'longest extension of a tree')
    goal_bias: float = _option(0.05, 0.0, 1.0, '-', 'chance that a draw is a goal posture')
    corner_spacing: float = _option(
        0.01, 1e-4, 1.0, 'rad', 'k of the paper: shortest cut of a corner that is still tried'
    )
    max_samples: int = _option(20000, 1, 10**7, '-', 'draws of one growth before it gives up')
    time_limit: float = _option(2.0, 1e-3, 3600.0, 's', 'planning fails after this time')
    improve_time: float = _option(
        0.5, 0.0, 3600.0, 's', 'at most so long a found path is improved; 0: the first path'
    )
    club_attempts: int = _option(
        6, 0, 10**4, '-', 'further growths with the path club after the first path'
    )
    club_radius: float = _option(0.5, 0.0, 100.0, 'rad', 'range in which club points count')
    club_count: int = _option(2, 0, 10**6, '-', 'a new point with more club points is rejected')
    club_probability: float = _option(0.9, 0.0, 1.0, '-', 'chance of that rejection')
    club_budget: int = _option(400, 1, 10**7, '-', 'draws of one growth with the path club')

    def __post_init__(self) -> None:
        """Validate each field against its own metadata."""
        for f in fields(self):
            value, meta = getattr(self, f.name), f.metadata
            if not meta['low'] <= value <= meta['high']:
                raise OptionsError(
                    f'{f.name}: {value}, expected {meta["low"]:g} to {meta["high"]:g} '
                    f'[{meta["unit"]}]'
                )
