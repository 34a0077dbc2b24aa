# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the arm is asked to do: point its tool at a point, perhaps at a pace of the request."""

from dataclasses import dataclass
import math

from rrth_planner.model.arrays import Array, FARTHEST, float_number, frozen_array
from rrth_planner.model.errors import OptionsError, SceneError
from rrth_planner.model.frozen import Frozen

# Of a motion, as a request may ask for it [s].
LONGEST_DURATION = 60.0


@dataclass(frozen=True, slots=True, eq=False)
class PointingGoal(Frozen):
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


@dataclass(frozen=True, slots=True, eq=False)
class PacedGoal(PointingGoal):
    """
    A goal whose motion is slower than the planner's parameters allow.

    Parameters
    ----------
    max_velocity : float
        Greatest velocity of each joint, > 0 [rad/s]; inf: that of the parameters.
    min_duration : float
        Least duration of the motion, from 0 to `LONGEST_DURATION` [s].

    Raises
    ------
    SceneError
        A coordinate that is no finite number, or beyond 1e4 m.
    OptionsError
        A velocity or a duration out of its range.

    """

    max_velocity: float = math.inf
    min_duration: float = 0.0

    def __post_init__(self) -> None:
        """Validate and freeze."""
        # Not super(): a class with slots is made anew, and that names the one before.
        PointingGoal.__post_init__(self)
        for name, unit in (('max_velocity', 'rad/s'), ('min_duration', 's')):
            value = float_number(getattr(self, name), name, unit, error=OptionsError)
            object.__setattr__(self, name, value)
        if not self.max_velocity > 0.0:
            raise OptionsError(
                f'max_velocity: {self.max_velocity:g}, expected a velocity > 0 [rad/s]'
            )
        if not 0.0 <= self.min_duration <= LONGEST_DURATION:
            raise OptionsError(
                f'min_duration: {self.min_duration:g}, expected a time from 0 to '
                f'{LONGEST_DURATION:g} [s]'
            )
