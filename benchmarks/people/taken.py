# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Goals that the wearer takes: no posture aims at them for long enough, whatever plans it."""

from itertools import compress

import numpy as np
from rrth_planner.collision.world import arm_world
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.settings import load_settings
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import scene_of_rows
from rrth_planner.planning.pointing_goals import FEW_DRAWS, goal_configurations, MANY_DRAWS
from rrth_planner.rehearsal.rehearsal import FOLDED
from rrth_planner.rehearsal.world import Wearer

# A goal is looked at so often, and is taken where it is never free for so long in a row [s].
LOOKS, LONG_ENOUGH = 0.2, 2.0


class Goals:
    """
    The goals of the packaged arm beside somebody as he really is, by his boxes as they are.

    Neither a margin nor what he might do counts: where all postures are taken, it is by himself.
    """

    def __init__(self, wearer: Wearer) -> None:
        """Look at somebody."""
        self._wearer, self._arm = wearer, load_arm()
        self._ray = load_settings(self._arm.dof).ray_guard_length

    def is_free(self, target: Array, time: float) -> bool:
        """Return whether a posture that aims at a target meets nobody at a time, (3,) [m], [s]."""
        rows = self._wearer.rows_at(time)
        known = np.isfinite(rows.sum(axis=1))
        scene = scene_of_rows(tuple(compress(self._wearer.names, known)), rows[known])
        world, goal = arm_world(self._arm, scene, 0.0, self._ray), PointingGoal(target)
        # Many draws before all are taken to be in collision.
        return any(
            len(goal_configurations(self._arm, goal, world, FOLDED, n).q_goals)
            for n in (FEW_DRAWS, MANY_DRAWS)
        )

    def is_taken(self, target: Array, begin: float, end: float) -> bool:
        """Return whether a target (3,) [m] is taken from one time to another [s]."""
        n_free, enough = 0, round(LONG_ENOUGH / LOOKS)
        for time in np.arange(begin, end, LOOKS):
            n_free = n_free + 1 if self.is_free(target, float(time)) else 0
            if n_free == enough:
                return False
        return True
