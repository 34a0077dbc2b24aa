# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the arm is asked to do: point its tool at a point."""

from dataclasses import dataclass

from rrth_planner.model.arrays import Array, FARTHEST, frozen_array
from rrth_planner.model.errors import SceneError


@dataclass(frozen=True, slots=True, eq=False)
class PointingGoal:
    """
    A point of the base frame that the pointing ray has to meet, array_like of shape (3,) [m].

    Raises
    ------
    SceneError
        A coordinate that is no finite number, or beyond 1e4 m.

    """

    target: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        target = frozen_array(self.target, (3,), 'target', 'm', SceneError, FARTHEST)
        object.__setattr__(self, 'target', target)
