# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How a request for a motion ended."""

from dataclasses import dataclass

from rrth_planner.collision.violation import Disagreement
from rrth_planner.model.path import Path
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.planning.planner import PlanResult


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MotionPlan:
    """
    How a request ended.

    Parameters
    ----------
    sentence : str
        The result, with figures and units, for the caller.
    seed : int
        Seed that was used; the same seed and inputs give the same trajectory to the bit.
    planning_time : float
        From the call to the certified trajectory [s].
    path : Path or None
        The shortened path before timing; None unless solved.
    trajectory : Trajectory or None
        From rest to rest, certified; None unless solved.
    clearance : float
        Least one of the arm and of the ray up to `ray_guard_length` [m], after an escape; NaN
        unless solved.
    target_distance : float
        Distance from the tool to the target at the end [m]; NaN unless solved.
    disagreement : Disagreement or None
        The motion that the two checkers disagree about, where that is the reason.
    escape_time : float
        Until then the trajectory escapes from boxes [s]; 0: it starts in none.
    search : PlanResult or None
        How the path was found: the first path, the trees; None unless solved.

    """

    status: PlanStatus
    sentence: str
    seed: int
    planning_time: float
    path: Path | None = None
    trajectory: Trajectory | None = None
    clearance: float = float('nan')
    target_distance: float = float('nan')
    disagreement: Disagreement | None = None
    escape_time: float = 0.0
    search: PlanResult | None = None
