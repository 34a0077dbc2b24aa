# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a planner is asked: a world, where to start, and where it may end."""

from collections.abc import Callable
from dataclasses import dataclass

from rrth_planner.arrays import Array, frozen_array
from rrth_planner.errors import RrthError
from rrth_planner.world import World


def _stay(path: Array, n_waypoints: int, finest: float) -> float:
    """Leave the goal where it is."""
    return 0.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanningProblem:
    """
    Find a path from q_start to any of the goals.

    Parameters
    ----------
    world : World
    q_start : array_like, shape (dof,)
        A valid configuration [rad].
    q_goals : array_like, shape (n, dof)
        Valid configurations, nearest to q_start first [rad].
    slide_goal : callable
        (path buffer, number of waypoints, finest step [rad]) -> gain [rad]: moves the last
        waypoint along the goal manifold in place, by edges that the world allows. Default: the
        goals are points.

    """

    world: World
    q_start: Array
    q_goals: Array
    slide_goal: Callable[[Array, int, float], float] = _stay

    def __post_init__(self) -> None:
        """Validate and freeze."""
        dof = self.world.bounds.shape[1]
        for name, shape in (('q_start', (dof,)), ('q_goals', (None, dof))):
            value = frozen_array(getattr(self, name), shape, name, 'rad', RrthError)
            object.__setattr__(self, name, value)
        if len(self.q_goals) == 0:
            raise RrthError('q_goals: none, expected at least one configuration [rad]')
