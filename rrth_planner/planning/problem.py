# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The planning problem: a world, a start configuration and goal configurations."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from rrth_planner.collision.world import World
from rrth_planner.kernels import jit
from rrth_planner.kernels.search import tree
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import check_type, RrthError
from rrth_planner.model.frozen import Frozen

NOWHERE = frozen_array(np.zeros(3), (3,), 'target', 'm', RrthError)
STAY = jit.first_class(tree.stay)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanningProblem(Frozen):
    """
    Find a path from q_start to any of the goals.

    Parameters
    ----------
    q_start : array_like, shape (dof,)
        A valid configuration [rad].
    q_goals : array_like, shape (n, dof)
        Valid configurations, nearest to q_start first [rad].
    n_bent : int
        Number of the first goals that are known to have no straight free edge.
    slide_goal : compiled function
        The seam `kernels.jit.SLIDE`: moves the last waypoint along the goal manifold in place, by
        edges that the world allows. Default: the goals are points.
    target : ndarray, shape (3,)
        What `slide_goal` keeps aiming at, in the arm's base frame [m].

    """

    world: World
    q_start: Array
    q_goals: Array
    n_bent: int = 0
    slide_goal: Callable[..., float] = STAY
    target: Array = field(default_factory=lambda: NOWHERE)

    def __post_init__(self) -> None:
        """Validate and freeze."""
        check_type(self.world, World, 'world')
        dof = self.world.bounds.shape[1]
        for name, shape, unit in (
            ('q_start', (dof,), 'rad'),
            ('q_goals', (None, dof), 'rad'),
            ('target', (3,), 'm'),
        ):
            value = frozen_array(getattr(self, name), shape, name, unit, RrthError)
            object.__setattr__(self, name, value)
        if len(self.q_goals) == 0:
            raise RrthError('q_goals: none, expected at least one configuration [rad]')
        if not 0 <= self.n_bent <= len(self.q_goals):
            raise RrthError(f'n_bent: {self.n_bent}, expected 0 to {len(self.q_goals)}')
